"""Sensor faults in logs, detected in two ways: by a threshold on the error, and by a filter's innovations.

Some need no filter: what the log's own quality pass says, missing readings, and noise that grew.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from math import inf

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.errors import InputError
from lptn.basics.processes import one_blas_thread
from lptn.logs.channels import STILL, spans
from lptn.logs.columns import INPUTS
from lptn.logs.plausible import COLDEST
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.online.calibration import Calibration, uncalibrated
from lptn.online.fault_bank import Alarm, Hypothesis, Kind, faults, suspects, undecided
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import simulate

THRESHOLD = 10.0
"""K; the threshold of [QuadrupedLPTN, application 2]."""
NOTICED = 0.5
"""K; the usual tolerance of thermistors and platinum sensors, below which an alarm is useless."""


def first_at_each_sensor(alarms: Iterable[Alarm]) -> tuple[Alarm, ...]:
    """The first alarm at each sensor, or input, in order of time."""
    first: dict[str, Alarm] = {}
    for alarm in sorted(alarms, key=lambda alarm: alarm.time):
        first.setdefault(alarm.channel or alarm.node, alarm)
    return tuple(first.values())


# --- The run: what was read, what the free-running model predicts, and which sensors are faulty ---

_HOTTEST = 250.0  # degC; insulation of the best class bears 240, and 255 is a code of drives


@dataclass(frozen=True, repr=False)
class MonitoredRun:
    """Readings and predictions of a run, and the alarms of both detectors, each in order of time.

    Args:
        run: the run.
        nodes: names of the nodes, in order.
        measured: readings [degC], NaN where missing or no temperature, shape (nodes, n).
        predicted: readings of the model that runs freely from the run's first readings [degC], shape (nodes, n).
        threshold_alarms: of the plain detector.
        statistical_alarms: of the statistical one.
    """

    run: Run
    nodes: tuple[str, ...]
    measured: FloatArray
    predicted: FloatArray
    threshold_alarms: tuple[Alarm, ...] = ()
    statistical_alarms: tuple[Alarm, ...] = ()

    def __repr__(self) -> str:
        counts = f"{len(self.statistical_alarms)} statistical, {len(self.threshold_alarms)} by the plain threshold"
        return f"<MonitoredRun {self.run.name}: alarms: {counts}>"

    @classmethod
    def of(cls, model: Model, run: Run) -> MonitoredRun:
        """Let the model run; no alarms yet.

        Raises:
            InputError: the run lacks an input, or no reading of the model's nodes is one.
        """
        bound = bind(model, run)
        measured = believable(bound.measured)
        if not np.isfinite(measured).any():
            expected = f"readings from {COLDEST:g} to {_HOTTEST:g} degC: is that their unit?"
            raise InputError(run.source, "temperature.*", "no reading that a robot's part can have", expected)
        return cls(run, tuple(model.nodes), measured, simulate(model, bound).readings)

    @property
    def error(self) -> FloatArray:
        """Predicted − measured [K], shape (nodes, n)."""
        return self.predicted - self.measured

    @property
    def largest_error(self) -> dict[str, float]:
        """Largest absolute error [K] at each node that is measured."""
        return {
            node: float(np.nanmax(np.abs(error)))
            for node, error in zip(self.nodes, self.error, strict=True)
            if np.isfinite(error).any()
        }


def believable(measured: FloatArray) -> FloatArray:
    """Readings with error codes such as -273 or 999 degC made missing."""
    with np.errstate(invalid="ignore"):
        return np.where((measured > COLDEST) & (measured < _HOTTEST), measured, np.nan)


# --- Dropouts -------------------------------------------------------------------------------------

_SILENT = 10.0  # s without a reading
_SILENT_STEPS = 5


def dropouts(watched: MonitoredRun) -> list[Alarm]:
    """The first time at each sensor that readings have been missing for 10 s, and for five steps.

    A node without any reading has no sensor. Readings that are left out for what the log's issues say are not missing.
    """
    alarms, time = [], watched.run.time.tolist()
    need = max(_SILENT_STEPS, round(_SILENT / watched.run.step))
    explained = silent_rows(watched.run, watched.nodes)
    for node, readings, left_out in zip(watched.nodes, watched.measured, explained, strict=True):
        silent = [begin for begin, end in spans(np.isnan(readings) & ~left_out) if end - begin >= need]
        if silent and np.isfinite(readings).any():
            alarms.append(Alarm(node, "dropout", time[silent[0] + need - 1], time[silent[0]]))
    return alarms


# --- What the log's own quality pass says ---------------------------------------------------------

_KINDS: dict[str, Kind] = {"frozen": "stuck", "clamped": "clamped", "dead": "dead", "code": "dead", "spike": "spikes",
                           "disconnected": "dropout", "wrap": "dropout", "interpolated": "dropout",
                           "duplicate": "duplicate"}  # fmt: skip


def known_faults(runs: Sequence[Run], nodes: Sequence[str]) -> list[list[Alarm]]:
    """For each run the alarms that its log's issues are, of sensors and of the inputs that drive a joint.

    Pieces of a log have their issues in common: one belongs to the piece in which, or behind which, it begins.
    """
    alarms: list[list[Alarm]] = [[] for _ in runs]
    for source in dict.fromkeys(run.source for run in runs):
        pieces = [number for number, run in enumerate(runs) if run.source == source]
        for issue in runs[pieces[0]].issues:
            quantity, _, place = issue.key.partition(".")
            is_input = quantity in INPUTS
            if issue.kind not in _KINDS or not (is_input or (quantity == "temperature" and place in nodes)):
                continue
            start, stop = issue.stretch or (float(runs[pieces[0]].time[0]), float(runs[pieces[-1]].time[-1]))
            piece = max((number for number in pieces if runs[number].time[0] <= start), default=pieces[0])
            time = min(start + STILL, stop)  # readings that are constant for so long count as frozen
            kind: Kind = "input" if is_input else _KINDS[issue.kind]
            alarms[piece].append(
                Alarm(place, kind, time, start, detail=issue.problem, channel=issue.key if is_input else "")
            )
    return alarms


def silent_rows(run: Run, nodes: Sequence[str]) -> BoolArray:
    """Where a log's issues say why a reading is missing, shape (nodes, n)."""
    rows = np.zeros((len(nodes), len(run)), dtype=bool)
    for issue in run.issues:
        node = issue.key.removeprefix("temperature.")
        if issue.key.startswith("temperature.") and node in nodes and issue.kind in _KINDS:
            start, stop = issue.stretch or (-np.inf, np.inf)
            rows[list(nodes).index(node)] |= (run.time >= start - run.step) & (run.time <= stop + run.step)
    return rows


# --- Noise that grew ------------------------------------------------------------------------------

_BLOCK_OF_NOISE = 60.0  # s; enough readings for a scatter, short against a fault
_LOUD = 4.0  # times the usual scatter; of a coarse sensor more than its step, since noise of a fraction moves it by one
_LOUD_BLOCKS = 3  # in turn
_LEAST_READINGS = 20  # readings in a block
_LEAST_SCATTER = 0.1  # K; of sensors that show none
_MAD_TO_SIGMA = 1.4826 / np.sqrt(6.0)  # of second differences


def noisy(watched: MonitoredRun) -> list[Alarm]:
    """The first time at each sensor at which its noise grew, and stayed so for minutes."""
    size, time = max(1, round(_BLOCK_OF_NOISE / watched.run.step)), watched.run.time
    alarms: list[Alarm] = []
    if size < _LEAST_READINGS:
        return alarms
    second = np.abs(np.diff(watched.measured, 2, axis=1))
    blocks = second[:, : second.shape[1] // size * size].reshape(len(second), -1, size)
    few = np.isfinite(blocks).sum(axis=2) < _LEAST_READINGS
    # Standard deviation of the noise in each block [K], NaN where too few readings are there.
    scatters = np.where(few, np.nan, _MAD_TO_SIGMA * np.nanmedian(np.where(few[..., None], 0.0, blocks), axis=2))
    for node, scatter in zip(watched.nodes, scatters, strict=True):
        step = watched.run.resolution.get(f"temperature.{node}", 0.0)
        if np.isfinite(scatter).sum() < 2 * _LOUD_BLOCKS:
            continue
        loud = scatter > _LOUD * max(float(np.nanquantile(scatter, 0.25)), step / _LOUD, _LEAST_SCATTER)
        begins = np.flatnonzero(np.convolve(loud, np.ones(_LOUD_BLOCKS), "valid") == _LOUD_BLOCKS)
        if begins.size:
            at, seen = begins[0] * size, min((begins[0] + _LOUD_BLOCKS) * size, time.size - 1)
            detail = f"{np.nanmedian(scatter[loud]):.2g} K"
            alarms.append(Alarm(node, "noise", float(time[seen]), float(time[at]), detail=detail))
    return alarms


# --- Several runs ---------------------------------------------------------------------------------


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
                },
                "statistical": {"alarms": [alarm.as_json() for alarm in watched.statistical_alarms]},
            }
        return {"threshold": self.threshold, "calibration": self.calibration.model_dump(mode="json"), "runs": runs}


@one_blas_thread
def monitor(
    model: Model,
    runs: Sequence[Run],
    *,
    threshold: float = THRESHOLD,
    calibration: Calibration | None = None,
    rmse: float | None = None,
    found: Sequence[Alarm] = (),
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
        found: faults of sensors that something else has found in the last run: others are blamed only for what these
            leave unexplained.
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
    for number, (run, known) in enumerate(zip(runs, known_faults(runs, model.nodes), strict=True), start=1):
        report(f"watching log {number} of {len(runs)}")
        one = MonitoredRun.of(model, run)
        by_statistics = alarms_by_statistics(model, one, calibration, known, found if number == len(runs) else ())
        by_threshold = _explained(model, alarms_by_threshold(one, threshold), by_statistics)
        watched.append(replace(one, threshold_alarms=by_threshold, statistical_alarms=by_statistics))
    return Monitoring(threshold, calibration, tuple(watched))


# --- The plain detector: the free-running model's error, and a threshold --------------------------


def alarms_by_threshold(watched: MonitoredRun, threshold: float) -> tuple[Alarm, ...]:
    """The first time at each sensor that its absolute error is over a threshold [K], or that readings are missing.

    It can't tell a sensor from an input or the model.

    Source: [QuadrupedLPTN, application 2].
    """
    alarms = dropouts(watched)
    for node, error in zip(watched.nodes, watched.error, strict=True):
        over = np.flatnonzero(np.abs(np.nan_to_num(error)) > threshold)
        if over.size:
            time = float(watched.run.time[over[0]])
            alarms.append(Alarm(node, "undecided", time, time))
    return first_at_each_sensor(alarms)


def _explained(model: Model, alarms: tuple[Alarm, ...], found: tuple[Alarm, ...]) -> tuple[Alarm, ...]:
    """Alarms of the plain detector as the statistical one names them.

    A wrong sensor or input leads the free-running model astray at other nodes, too. So of what the statistical detector
    doesn't explain the first alarm counts, where it explains none.
    """
    by_node = {alarm.node: alarm for alarm in found if alarm.kind != "input"}
    kept = [replace(by_node[alarm.node], time=alarm.time) if alarm.kind == "undecided" else alarm
            for alarm in alarms if alarm.node in by_node]  # fmt: skip
    for alarm in alarms if not found else ():
        if alarm.kind != "undecided":
            kept.append(alarm)
        elif not any(other.kind == "undecided" for other in kept):
            channels = ", ".join([f"temperature.{alarm.node}", *suspects(model, alarm.node)])
            kept.append(undecided(alarm, f"{channels} or the model"))
    return first_at_each_sensor(kept)


# --- The statistical detector: the bank of hypotheses ---------------------------------------------


def alarms_by_statistics(
    model: Model,
    watched: MonitoredRun,
    calibration: Calibration,
    known: Sequence[Alarm],
    found: Sequence[Alarm] = (),
) -> tuple[Alarm, ...]:
    """The first alarm at each sensor; those that the log's own quality pass gives are `known`, others `found`."""
    noise = noisy(watched)
    loud = {alarm.node for alarm in noise}  # whose single readings leap, too
    known = [alarm for alarm in known if alarm.kind != "spikes" or alarm.node not in loud]
    alarms = [*known, *found, *noise, *dropouts(watched)]
    named_already = {alarm.node for alarm in alarms if alarm.kind != "input"}
    given = Hypothesis.of(model, watched.run, calibration.noise, calibration.model_error)
    given = replace(given, measured=believable(given.measured))
    inputs = set(model.inputs)  # that may yet be suspected
    for alarm in known:
        if alarm.channel in model.inputs and alarm.node in model.nodes:
            given, inputs = given.with_unknown_input(alarm.channel), inputs - {alarm.channel}
    for alarm in (*noise, *found):
        given = given.without(model.nodes.index(alarm.node), alarm.onset)
    for alarm in faults(given, calibration.limits, inputs, taught=calibration.healthy_hours > 0):
        size = inf if alarm.size is None or alarm.kind == "lag" else abs(alarm.size)
        if alarm.kind == "drift":
            size *= float(given.run.run.time[-1]) - alarm.onset
        if (alarm.channel or alarm.node not in named_already) and size >= NOTICED:
            alarms.append(alarm)
    return first_at_each_sensor(alarms)
