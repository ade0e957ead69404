"""What `lptn.forecast` and `lptn.monitor` say of the rows so far, and a process that asks them."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import inf, isfinite
from typing import IO

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.identify.data import optional_columns
from lptn.identify.noise import estimate_noise
from lptn.live.change import what_changed
from lptn.logs.columns import SAMPLES, ColumnSource
from lptn.logs.reading import read_log
from lptn.logs.run import Run
from lptn.logs.scatter import Scatter, scatter_of
from lptn.model.model import Model
from lptn.model.tables import FitTable
from lptn.online.calibration import Calibration
from lptn.online.fault_bank import Alarm
from lptn.online.forecasting import Forecast, forecast
from lptn.online.monitoring import monitor
from lptn.online.operating_point import find_gait
from lptn.online.present import ModelUncertainty
from lptn.simulate.bound_run import bind, needed_columns

_MEANS = "means after"


@dataclass(frozen=True)
class Question:
    """A robot, and what is known of it now.

    Args:
        model: the model.
        fit: what its file says of its fit.
        limits: degC, as `lptn.forecast` takes them; none: no forecast.
        coverage: of the intervals.
        threshold: of the plain detector of `lptn.monitor` [K].
        calibration: of the statistical one.
        source: for messages.
        rows: `time` [s] and quantities, (n,) each.
        readings: of the sensors one in each row of means, (n,) each: they show steps and noise, which means don't.
        step: s, of the model.
        averaged: whether rows are means over a step, else samples.
        speeds: of the joints in the last seconds at their own rate, (n,) each; none where rows are samples themselves.
        period: s between those.
        stands: sensors that repeat themselves, by s since when: what the filter has found explains first.
        why_since: s from which on the robot is not as its model, so that it is asked what is likely; infinite: it is.
    """

    model: Model
    fit: FitTable
    limits: Mapping[str, float]
    coverage: float
    threshold: float
    calibration: Calibration | None
    source: str
    rows: Mapping[str, FloatArray] = field(default_factory=dict)
    readings: Mapping[str, FloatArray] = field(default_factory=dict)
    step: float = 1.0
    averaged: bool = False
    speeds: Sequence[FloatArray] = ()
    period: float = 0.0
    stands: Mapping[str, float] = field(default_factory=dict)
    why_since: float = inf

    def runs(self, since: float = -inf) -> list[Run]:
        """The rows from a time on [s], as a log is read.

        Raises:
            InputError: they are none.
        """
        inputs, outputs = needed_columns(self.model)
        columns = {"time": ColumnSource(("time",), rows=_MEANS if self.averaged else SAMPLES)}
        # What is no reading shows in readings, not in means: one number again and again, a step of the sensor.
        values = {**self.rows, **self.readings}
        frame = pd.DataFrame({key: x for key, x in values.items() if np.isfinite(x).any()})
        frame = frame[frame["time"] >= since]
        runs = read_log(frame, columns, name=self.source, step=self.step, inputs=inputs, outputs=outputs,
                        optional=optional_columns(self.model), strict=False)  # fmt: skip
        return [self._with_means(run) for run in runs] if self.readings else runs

    def _with_means(self, run: Run) -> Run:
        """A run of readings with the means in their place, but where the reading before, or that of a row, is none."""
        time, means, scatter = self.rows["time"], dict(run.columns), dict[str, Scatter]()
        rows = np.searchsorted(time, run.time + self.step / 2) - 1
        for key, readings in self.readings.items():
            scatter[key] = scatter_of(time, readings, run.resolution.get(key, 0.0))
            if run.has(key):
                there = np.isfinite(readings[rows])
                last = np.maximum.accumulate(np.where(there, np.arange(rows.size), 0))
                means[key] = np.where((there & np.isnan(run.columns[key]))[last], np.nan, self.rows[key][rows])
        return replace(run, columns=means, scatter=scatter)


@dataclass(frozen=True)
class Assessment:
    """What the rows until a time say.

    Args:
        time: s, where they end.
        forecast: when limits are reached; `None` where nothing can be said, which `why_not` explains.
        alarms: faults of sensors and inputs, the statistical detector's.
        uncertainty: of the model; `None` where there is no run.
        resolution: of the sensors [K], by column.
        scatter: of the sensors.
        changed: what is likely where the robot is not as its model any more, in words; `None` where nobody asked.
        why_not: in words.
        refused: what can't be: a unit, a counter, exchanged columns.
        seconds: of a processor that it took.
    """

    time: float
    forecast: Forecast | None = None
    alarms: tuple[Alarm, ...] = ()
    uncertainty: ModelUncertainty | None = None
    resolution: Mapping[str, float] = field(default_factory=dict)
    scatter: Mapping[str, Scatter] = field(default_factory=dict)
    changed: tuple[str, ...] | None = None
    why_not: str = ""
    refused: InputError | None = None
    seconds: float = 0.0


def assess(question: Question) -> Assessment:
    """Forecast and monitor the rows as if they were a finished log."""
    began, end = time.process_time(), float(question.rows["time"][-1])
    try:
        found = _assessed(question, end)
    except InputError as error:
        found = Assessment(end, why_not=str(error))
    return replace(found, seconds=time.process_time() - began)


def _assessed(question: Question, end: float) -> Assessment:
    model, runs = question.model, question.runs()
    gait = find_gait(question.speeds, question.period) if question.speeds else None
    run = runs[-1]
    for issue in run.issues:
        if issue.certain:
            return Assessment(end, refused=InputError(question.source, *issue.error))
    noise = estimate_noise([bind(model, run)], model.nodes)
    uncertainty = ModelUncertainty.of_table(model, question.fit, noise.floor)
    found = Assessment(end, uncertainty=uncertainty, resolution=run.resolution, scatter=run.scatter)
    stuck = [Alarm(node, "stuck", end, since, detail="bit for bit") for node, since in question.stands.items()]
    try:
        watched = monitor(model, runs, threshold=question.threshold, calibration=question.calibration,
                          rmse=question.fit.rmse, found=stuck)  # fmt: skip
        found = replace(found, alarms=tuple(alarm for one in watched.runs for alarm in one.statistical_alarms))
        if question.limits:
            ahead = forecast(model, run, question.limits, coverage=question.coverage, fit=uncertainty, gait=gait)
            found = replace(found, forecast=ahead)
        if isfinite(question.why_since):
            changed = what_changed(model, question.fit, question.runs(question.why_since))
            found = replace(found, changed=tuple(changed))
    except InputError as error:
        found = replace(found, why_not=str(error))
    return found


# --- A process of its own, which the loop need not wait for -------------------------------------------

_NICENESS = 5  # by which the robot's own programs come first


class Worker:
    """A process that assesses: begun when it is first asked, and ended with this one."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._waiting = ThreadPoolExecutor(1)

    def ask(self, question: Question) -> Future[Assessment]:
        """Ask for an assessment, one at a time."""
        return self._waiting.submit(self._answer, question)

    def _answer(self, question: Question) -> Assessment:
        if self._process is None:
            command = [sys.executable, "-c", "from lptn.live.assessment import work; work()"]
            # Of a group of its own: Ctrl-C is the loop's.
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
            )
        try:
            assert self._process.stdin is not None
            assert self._process.stdout is not None
            pickle.dump(question, self._process.stdin)
            self._process.stdin.flush()
            answer: Assessment = pickle.load(self._process.stdout)
        except (BrokenPipeError, EOFError, pickle.UnpicklingError):
            self._end()
            return Assessment(-np.inf, why_not="the process that forecasts has ended")
        return answer

    def close(self) -> None:
        """End it, whatever it does."""
        if (process := self._process) is not None:
            process.kill()
        self._waiting.shutdown()
        self._end()

    def _end(self) -> None:
        process, self._process = self._process, None
        if process is not None:
            process.kill()
            with suppress(BrokenPipeError), process:  # which closes its pipes
                pass


def work() -> None:
    """Answer what comes on standard input, until nothing more does."""
    answers: IO[bytes] = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    os.nice(_NICENESS)
    with suppress(EOFError, BrokenPipeError):
        while True:
            pickle.dump(assess(pickle.load(sys.stdin.buffer)), answers)
            answers.flush()
