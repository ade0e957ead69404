"""What `lptn.forecast` and `lptn.monitor` say of the rows so far: in a process of its own, or here."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace

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


def assess(question: Question, rows: Mapping[str, FloatArray], step: float, *, averaged: bool) -> Assessment:
    """Forecast and monitor the rows as if they were a finished log.

    Args:
        question: what is asked.
        rows: `time` [s] and quantities, (n,) each.
        step: s, of the model.
        averaged: whether rows are means over a step, else samples.
    """
    began, end = time.process_time(), float(rows["time"][-1])
    try:
        found = _assessed(question, rows_as_runs(question, rows, step, averaged=averaged), end)
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


def _assessed(question: Question, runs: list[Run], end: float) -> Assessment:
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
            ahead = forecast(model, run, question.limits, coverage=question.coverage, fit=uncertainty)
            found = replace(found, forecast=ahead)
    except InputError as error:
        found = replace(found, why_not=str(error))
    return found
