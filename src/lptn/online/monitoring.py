"""Sensor faults in logs, detected in two ways: by a threshold on the error, and by a filter's innovations."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from lptn.basics.processes import one_blas_thread
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.online.calibration import Calibration, uncalibrated
from lptn.online.fault_hypotheses import Suspicion, attributed, named, suspects, undecided
from lptn.online.fault_likelihood import KINDS, STEP, coarsely_bound
from lptn.online.sensor_faults import (
    Alarm,
    MonitoredRun,
    believable,
    dropouts,
    first_at_each_sensor,
    known_faults,
    noisy,
    offset_or_drift,
    or_stuck,
    silent_rows,
)

THRESHOLD = 10.0
"""K; the threshold of [QuadrupedLPTN, application 2]."""
NOTICED = 0.5
"""K; thermistors and platinum sensors are off by so much themselves, so nobody would act on less."""


@dataclass(frozen=True, repr=False)
class Monitoring:
    """What both detectors say of several runs.

    Args:
        threshold: of the plain detector [K].
        calibration: of the statistical one.
        runs: with their alarms.
    """

    threshold: float
    calibration: Calibration
    runs: tuple[MonitoredRun, ...]

    def __repr__(self) -> str:
        return f"<Monitoring: {'; '.join(map(repr, self.runs))}>"

    def as_json(self) -> dict[str, object]:
        """The alarms as other tools read them; times in s of each log's clock, errors without sign in K."""
        runs: dict[str, object] = {}
        for watched in self.runs:
            run = watched.run
            # Logs of one name from two folders must not hide each other.
            name = run.name if run.name not in runs else f"{run.name} ({run.source})"
            runs[name] = {
                "start": float(run.time[0]),
                "end": float(run.time[-1] + run.step),
                "threshold": {
                    "alarms": [alarm.as_json() for alarm in watched.threshold_alarms],
                    "largest_error": watched.largest_error,
                    "largest_residual": watched.largest_error,  # the former name, for programs that read it
                },
                "statistical": {"alarms": [alarm.as_json() for alarm in watched.statistical_alarms]},
            }
        nodes = self.runs[0].nodes
        return {"threshold": self.threshold, "calibration": self.calibration.as_json(nodes), "runs": runs}


@one_blas_thread
def monitor(
    model: Model,
    runs: Sequence[Run],
    *,
    threshold: float = THRESHOLD,
    calibration: Calibration | None = None,
    rmse: float | None = None,
    report: Callable[[str], None] = lambda _: None,
) -> Monitoring:
    """Look for faults of temperature sensors: drift, offset, stuck, dropout ([QuadrupedLPTN, application 2]).

    The plain detector sets the readings against the model, which runs freely from the log's first readings. The
    statistical one weighs the innovations of a Kalman filter on the same model against what each fault
    would do to them, with limits learnt from healthy logs.

    Args:
        model: a fitted model.
        runs: the runs to watch.
        threshold: of the plain detector [K].
        calibration: from `calibrate`; without it cautious guesses serve.
        rmse: of the model's fit [K], for those guesses.
        report: gets a line on what is being done.

    Raises:
        InputError: a run lacks an input, or measures none of the model's nodes.
        ValueError: a threshold that is not above 0.

    Example:
        >>> import lptn
        >>> loaded = lptn.load_model("examples/tclab/two_heaters.toml")
        >>> runs = loaded.runs(["examples/tclab/log.csv"])
        >>> watched = lptn.monitor(lptn.fit(loaded.model, runs).model, runs, threshold=10.0)
        >>> watched.runs[0].run.name
        'log'
    """
    if not threshold > 0:
        raise ValueError(f"threshold: found {threshold:g}; expected a number of kelvin above 0")
    calibration = calibration or uncalibrated(model, runs, rmse)
    watched = []
    faults = known_faults(runs, model.nodes)
    for number, run in enumerate(runs, start=1):
        report(f"watching log {number} of {len(runs)}")
        one, said = MonitoredRun.of(model, run), faults[number - 1]
        by_statistics = alarms_by_statistics(model, one, calibration, said)
        by_threshold = _unless_explained(model, alarms_by_threshold(one, threshold), by_statistics)
        watched.append(replace(one, threshold_alarms=by_threshold, statistical_alarms=by_statistics))
    return Monitoring(threshold, calibration, tuple(watched))


# --- The plain detector: the free-running model's error, and a threshold --------------------------


def alarms_by_threshold(watched: MonitoredRun, threshold: float) -> tuple[Alarm, ...]:
    """The first time at each sensor that its absolute error is over a threshold [K], or that readings are missing.

    Source: [QuadrupedLPTN, application 2].
    """
    alarms = dropouts(watched, silent_rows(watched.run, watched.nodes))
    for row, error in enumerate(watched.error):
        over = np.flatnonzero(np.abs(np.nan_to_num(error)) > threshold)
        if over.size:
            alarms.append(or_stuck(watched, offset_or_drift(watched, row, int(over[0]))))
    return first_at_each_sensor(alarms)


def _unless_explained(model: Model, alarms: tuple[Alarm, ...], found: tuple[Alarm, ...]) -> tuple[Alarm, ...]:
    """Alarms of the plain detector but for those that others explain.

    It can't tell a sensor from an input, and a wrong one of either leads the free-running model astray at other nodes.
    """
    if found:
        nodes = {alarm.node for alarm in found if alarm.kind != "input"}
        return tuple(alarm for alarm in alarms if alarm.node in nodes)
    shapes = [alarm for alarm in alarms if alarm.kind in KINDS]
    others = [alarm for alarm in alarms if alarm.kind not in KINDS]
    first = [
        undecided(alarm, f"{', '.join([f'temperature.{alarm.node}', *suspects(model, alarm.node)])} or the model")
        for alarm in shapes[:1]
    ]
    return first_at_each_sensor([*others, *first])


# --- The statistical detector: what a fault of each kind would do to a filter's innovations -------


def alarms_by_statistics(
    model: Model, watched: MonitoredRun, calibration: Calibration, known: Sequence[Alarm] = ()
) -> tuple[Alarm, ...]:
    """The first alarm at each sensor.

    Once a sensor is called faulty, the filter does without it from the fault's onset on, and the search for others
    starts again: else its error would spread over its neighbours.

    Args:
        model: the model.
        watched: the run.
        calibration: from `calibrate`, or guesses.
        known: alarms that the log's own quality pass gives.
    """
    noise = noisy(watched)
    loud = {alarm.node for alarm in noise}  # whose single readings leap, too
    known = [alarm for alarm in known if alarm.kind != "spikes" or alarm.node not in loud]
    explained = silent_rows(watched.run, watched.nodes)
    alarms = [*known, *noise, *dropouts(watched, explained)]
    named_already = {alarm.node for alarm in alarms if alarm.kind != "input"}
    coarse = coarsely_bound(model, watched.run, STEP)
    measured = believable(coarse.measured)
    given = Suspicion(model, coarse, measured, calibration, calibration.error)
    for alarm in known:
        if alarm.channel in model.inputs and alarm.node in model.nodes:
            given = given.with_unknown_input(alarm.channel)
    for alarm in noise:
        given = given.without([model.nodes.index(alarm.node)], alarm.onset)
    faulty: list[Alarm] = []
    while (first := given.alarm) is not None:
        told, after = attributed(given, first)
        # A sensor can't be judged by a load that is wrong; and no channel is told twice.
        inputs = {alarm.channel: alarm.node for alarm in faulty if alarm.channel}
        called = {alarm.node for alarm in faulty}
        if first.node in called or any(alarm.channel in inputs for alarm in told):
            told, after = [], given.without([model.nodes.index(first.node)], -inf)  # what that leaves
        given = after
        faulty += [or_stuck(watched, alarm) if alarm is first else alarm for alarm in told]
    for alarm in faulty:
        if alarm.channel or alarm.node not in named_already:
            one = named(given, measured, alarm) if alarm.kind in KINDS else alarm
            alarms += [one] * (_largest(one, float(coarse.run.time[-1])) >= NOTICED)
    return first_at_each_sensor(alarms)


def _largest(alarm: Alarm, end: float) -> float:
    """What a fault adds to the reading at most until the end of the log [K]; infinite where nobody knows."""
    if alarm.size is None or alarm.kind == "lag":
        return inf
    return abs(alarm.size) * (end - alarm.onset if alarm.kind == "drift" else 1.0)
