"""What `lptn.forecast` and `lptn.monitor` say of the rows so far, and a process that asks them."""

from __future__ import annotations

import os
import pickle
import subprocess
import sys
import time
from collections import deque
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from threading import Thread
from typing import IO

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.identify.noise import estimate_noise
from lptn.logs.columns import SAMPLES, ColumnSource
from lptn.logs.reading import read_log
from lptn.logs.run import Run
from lptn.logs.scatter import Scatter
from lptn.model.model import Model
from lptn.model.tables import FitTable
from lptn.online.calibration import Calibration
from lptn.online.fault_bank import Alarm
from lptn.online.forecasting import Forecast, forecast
from lptn.online.monitoring import monitor
from lptn.online.operating_point import GaitPeriod, find_gait
from lptn.online.present import ModelUncertainty
from lptn.simulate.bound_run import bind, needed_columns

_MEANS = "means after"


@dataclass(frozen=True)
class Question:
    """What is the same for all assessments of a robot.

    Args:
        model: the model.
        fit: what its file says of its fit.
        limits: degC, as `lptn.forecast` takes them; none: no forecast.
        coverage: of the intervals.
        threshold: of the plain detector of `lptn.monitor` [K].
        calibration: of the statistical one.
        source: for messages.
    """

    model: Model
    fit: FitTable
    limits: Mapping[str, float]
    coverage: float
    threshold: float
    calibration: Calibration | None
    source: str


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
    why_not: str = ""
    refused: InputError | None = None
    seconds: float = 0.0


Speeds = tuple[Sequence[FloatArray], float]
"""The joints' speeds at their own rate, (n,) each, and s between samples; none of rows that are samples themselves."""


def assess(
    question: Question, rows: Mapping[str, FloatArray], speeds: Speeds, step: float, *, averaged: bool
) -> Assessment:
    """Forecast and monitor the rows as if they were a finished log.

    Args:
        question: what is asked.
        rows: `time` [s] and quantities, (n,) each.
        speeds: of the joints in the last seconds.
        step: s, of the model.
        averaged: whether rows are means over a step, else samples.
    """
    began, end = time.process_time(), float(rows["time"][-1])
    try:
        gait = find_gait(*speeds) if speeds[0] else None
        found = _assessed(question, rows_as_runs(question, rows, step, averaged=averaged), gait, end)
    except InputError as error:
        found = Assessment(end, why_not=str(error))
    return replace(found, seconds=time.process_time() - began)


def rows_as_runs(question: Question, rows: Mapping[str, FloatArray], step: float, *, averaged: bool) -> list[Run]:
    """The rows as `read_log` reads a log.

    Raises:
        InputError: they are too few.
    """
    inputs, outputs = needed_columns(question.model)
    columns = {"time": ColumnSource(("time",), rows=_MEANS if averaged else SAMPLES)}
    frame = pd.DataFrame({key: values for key, values in rows.items() if np.isfinite(values).any()})
    return read_log(frame, columns, name=question.source, step=step, inputs=inputs, outputs=outputs, strict=False)


def _assessed(question: Question, runs: list[Run], gait: GaitPeriod | None, end: float) -> Assessment:
    model, run = question.model, runs[-1]
    for issue in run.issues:
        if issue.certain:
            return Assessment(end, refused=InputError(question.source, *issue.error))
    noise = estimate_noise([bind(model, run)], model.nodes)
    uncertainty = ModelUncertainty.of_table(model, question.fit, noise.floor)
    found = Assessment(end, uncertainty=uncertainty, resolution=run.resolution, scatter=run.scatter)
    try:
        watched = monitor(
            model, runs, threshold=question.threshold, calibration=question.calibration, rmse=question.fit.rmse
        )
        alarms = tuple(alarm for one in watched.runs for alarm in one.statistical_alarms)
        found = replace(found, alarms=alarms)
        if question.limits:
            ahead = forecast(model, run, question.limits, coverage=question.coverage, fit=uncertainty, gait=gait)
            found = replace(found, forecast=ahead)
    except InputError as error:
        found = replace(found, why_not=str(error))
    return found


# --- A process of its own, which the loop need not wait for -------------------------------------------

_NICENESS = 5  # by which the robot's own programs come first


class Worker:
    """A process that assesses: begun when it is first asked, and ended with this one."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._answers = deque[Assessment]()

    def ask(
        self, question: Question, rows: Mapping[str, FloatArray], speeds: Speeds, step: float, *, averaged: bool
    ) -> None:
        """Ask for an assessment, as of `assess`; one at a time."""
        if self._process is None:
            command = [sys.executable, "-c", "from lptn.live.assessment import work; work()"]
            # Of a group of its own: Ctrl-C is the loop's.
            self._process = subprocess.Popen(
                command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, start_new_session=True
            )
            Thread(target=self._listen, args=(self._process,), daemon=True).start()
        with suppress(BrokenPipeError):  # what reads then says that it ended
            assert self._process.stdin is not None
            pickle.dump((question, rows, speeds, step, averaged), self._process.stdin)
            self._process.stdin.flush()

    def answer(self) -> Assessment | None:
        """What it found, once."""
        return self._answers.popleft() if self._answers else None

    def close(self) -> None:
        """End it, whatever it does."""
        if self._process is not None:
            self._process.kill()
            self._process.wait()

    def _listen(self, process: subprocess.Popen[bytes]) -> None:
        assert process.stdin is not None
        assert process.stdout is not None
        with process.stdout as answers, process.stdin:
            while True:
                try:
                    self._answers.append(pickle.load(answers))
                except (EOFError, pickle.UnpicklingError):
                    self._process = None
                    self._answers.append(Assessment(-np.inf, why_not="the process that forecasts has ended"))
                    return


def work() -> None:
    """Answer what comes on standard input, until nothing more does."""
    answers: IO[bytes] = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what a library prints is no answer
    os.nice(_NICENESS)
    with suppress(EOFError, BrokenPipeError):
        while True:
            question, rows, speeds, step, averaged = pickle.load(sys.stdin.buffer)
            pickle.dump(assess(question, rows, speeds, step, averaged=averaged), answers)
            answers.flush()
