"""A run as it is watched for faults of its temperature sensors, and those faults that no filter is needed for.

They are what the log's own quality pass says, missing readings, noise that grew, and the shape of the error of a model
that runs freely. The size of a fault is what it adds to the reading, so a sensor 3 K too high has an offset of +3 K:
there error = predicted − measured is −3 K.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Literal

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.errors import InputError
from lptn.logs.columns import INPUTS
from lptn.logs.law import STILL
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import simulate

Kind = Literal[
    "drift",
    "offset",
    "stuck",
    "dropout",
    "dead",
    "clamped",
    "spikes",
    "duplicate",
    "noise",
    "lag",
    "disconnected",
    "swapped",
    "input",
    "undecided",
]
"""Disconnected: reads the air, or whatever else is prescribed. Input: not the sensor, but what the log says of the
joint's torque, current or speed, or of the air. Undecided: one or the other. Duplicate: the readings of another
column. The others are as people say."""


@dataclass(frozen=True)
class Alarm:
    """One sensor's fault as a detector sees it.

    Args:
        node: whose sensor.
        kind: named from the log up to some minutes behind the alarm.
        time: of the alarm [s, in the log's clock].
        onset: at which the fault seems to have begun [s].
        size: K for an offset, K/s for a drift, positive where the reading is too high, s for a lag; else `None`.
        detail: what more is known, in words.
        channel: the log's column, where it is not the node's temperature.
    """

    node: str
    kind: Kind
    time: float
    onset: float
    size: float | None = None
    detail: str = ""
    channel: str = ""

    def as_json(self) -> dict[str, object]:
        """The alarm as other tools read it."""
        return asdict(self) | {"channel": self.channel or f"temperature.{self.node}"}


def first_at_each_sensor(alarms: Iterable[Alarm]) -> tuple[Alarm, ...]:
    """The first alarm at each sensor, or input, in order of time."""
    first: dict[str, Alarm] = {}
    for alarm in sorted(alarms, key=lambda alarm: alarm.time):
        first.setdefault(alarm.channel or alarm.node, alarm)
    return tuple(first.values())


# --- The run: what was read, what the free-running model predicts, and which sensors are faulty ---

_COLDEST, _HOTTEST = -60.0, 250.0  # degC; what lies beyond is an error code, no temperature of a robot
_SAME = 1e-6  # K


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
            expected = f"readings from {_COLDEST:g} to {_HOTTEST:g} degC: is that their unit?"
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

    def index_at(self, time: float) -> int:
        """Index of the last reading not after a time [s]."""
        return max(0, int(np.searchsorted(self.run.time, time, side="right")) - 1)

    @property
    def steps(self) -> FloatArray:
        """Step of each sensor [K], 0 for a fine one, shape (nodes,)."""
        return np.array([self.run.resolution.get(f"temperature.{node}", 0.0) for node in self.nodes])

    def stands_since(self, row: int, at: int) -> int:
        """Index of the reading since which a sensor's reading has not changed; a missing one is no change."""
        readings = self.measured[row, : at + 1]
        finite = np.flatnonzero(np.isfinite(readings))
        changes = np.flatnonzero(np.abs(np.diff(readings[finite])) > _SAME)
        return int(finite[changes[-1] + 1]) if changes.size else 0


def believable(measured: FloatArray) -> FloatArray:
    """Readings with error codes such as -273 or 999 degC made missing."""
    with np.errstate(invalid="ignore"):
        return np.where((measured > _COLDEST) & (measured < _HOTTEST), measured, np.nan)


# --- Dropouts, and the kind of a fault, by the shape of the error ---------------------------------

_NAMING = 300.0  # s behind an alarm that help to name it
_SILENT = 10.0  # s without a reading
_SILENT_STEPS = 5
_ONSETS = 100  # tried for a step or a line: one in 1 % of the time until the alarm
_MOVED = 0.75  # K beyond the sensor's step that the model moves while a stuck reading stands: a model errs as much


def dropouts(watched: MonitoredRun, explained: BoolArray) -> list[Alarm]:
    """The first time at each sensor that readings have been missing for 10 s, and for five steps.

    A node without any reading has no sensor. Readings that are left out since something is known to be wrong with them,
    `explained`, shape (nodes, n), are not missing.
    """
    alarms = []
    need = max(_SILENT_STEPS, round(_SILENT / watched.run.step))
    for node, readings, left_out in zip(watched.nodes, watched.measured, explained, strict=True):
        missing = np.isnan(readings) & ~left_out
        count = np.arange(missing.size) - np.maximum.accumulate(np.where(missing, -1, np.arange(missing.size)))
        silent = np.flatnonzero(count >= need)
        if silent.size and np.isfinite(readings).any():
            begin = int(silent[0]) - need + 1
            alarms.append(Alarm(node, "dropout", float(watched.run.time[silent[0]]), float(watched.run.time[begin])))
    return alarms


def offset_or_drift(watched: MonitoredRun, row: int, at: int) -> Alarm:
    """An alarm named by the shape of the error: a step or a straight line that begins at a time of its own.

    Args:
        watched: the run.
        row: of the sensor.
        at: index of the alarm.
    """
    end = watched.index_at(watched.run.time[at] + _NAMING)
    time, added = watched.run.time[: end + 1], -watched.error[row, : end + 1]  # what the fault adds to the reading
    finite = np.isfinite(added)
    time, added = time[finite], added[finite]
    onsets = np.linspace(time[0], watched.run.time[at], _ONSETS)
    steps = [_least_squares((time >= onset).astype(float), added) for onset in onsets]
    lines = [_least_squares(np.maximum(time - onset, 0.0), added) for onset in onsets]
    step, line = (min(range(_ONSETS), key=lambda k: fits[k][0]) for fits in (steps, lines))
    when, node = float(watched.run.time[at]), watched.nodes[row]
    if steps[step][0] <= lines[line][0]:
        return Alarm(node, "offset", when, float(onsets[step]), steps[step][1])
    return Alarm(node, "drift", when, float(onsets[line]), lines[line][1])


def _least_squares(shape: FloatArray, added: FloatArray) -> tuple[float, float]:
    """Sum of squares that a constant and a multiple of a shape leave, and the multiple."""
    centred, level = shape - shape.mean(), added - added.mean()
    power = float(centred @ centred)
    size = float(centred @ level) / power if power > 0 else 0.0
    return float(level @ level) - size * float(centred @ level), size


def or_stuck(watched: MonitoredRun, alarm: Alarm) -> Alarm:
    """The same alarm, or one of a stuck sensor if its reading stands still for minutes while the model moves.

    A drift, too, can hold a reading for a while: against a temperature that moves the other way.
    """
    row, at = watched.nodes.index(alarm.node), watched.index_at(alarm.time)
    end = watched.index_at(watched.run.time[at] + _NAMING)
    begin = watched.stands_since(row, end)
    if begin > at or np.ptp(watched.predicted[row, begin : end + 1]) <= watched.steps[row] + _MOVED:
        return alarm
    return replace(alarm, kind="stuck", onset=float(watched.run.time[begin]), size=None)


# --- What the log's own quality pass says ---------------------------------------------------------

_KINDS: dict[str, Kind] = {
    "frozen": "stuck",
    "clamped": "clamped",
    "dead": "dead",
    "code": "dead",
    "disconnected": "dropout",
    "wrap": "dropout",
    "spike": "spikes",
    "duplicate": "duplicate",
}


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
            time = min(start + STILL, stop)  # what stands for so long is seen to stand
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

_BLOCK = 60.0  # s; enough readings for a scatter, short against a fault
_LOUD = 4.0  # times the usual scatter; of a coarse sensor more than its step, since noise of a fraction moves it by one
_BLOCKS = 3  # in turn
_FEWEST = 20  # readings in a block
_LEAST = 0.1  # K; of sensors that show none
_MAD_TO_SIGMA = 1.4826 / np.sqrt(6.0)  # of second differences


def noisy(watched: MonitoredRun) -> list[Alarm]:
    """The first time at each sensor at which its noise grew, and stayed so for minutes."""
    size, time = max(1, round(_BLOCK / watched.run.step)), watched.run.time
    alarms: list[Alarm] = []
    if size < _FEWEST:
        return alarms
    second = np.abs(np.diff(watched.measured, 2, axis=1))
    blocks = second[:, : second.shape[1] // size * size].reshape(len(second), -1, size)
    few = np.isfinite(blocks).sum(axis=2) < _FEWEST
    # Standard deviation of the noise in each block [K], NaN where too few readings are there.
    scatters = np.where(few, np.nan, _MAD_TO_SIGMA * np.nanmedian(np.where(few[..., None], 0.0, blocks), axis=2))
    for node, scatter, step in zip(watched.nodes, scatters, watched.steps, strict=True):
        if np.isfinite(scatter).sum() < 2 * _BLOCKS:
            continue
        loud = scatter > _LOUD * max(float(np.nanquantile(scatter, 0.25)), float(step) / _LOUD, _LEAST)
        begins = np.flatnonzero(np.convolve(loud, np.ones(_BLOCKS), "valid") == _BLOCKS)
        if begins.size:
            at, seen = begins[0] * size, min((begins[0] + _BLOCKS) * size, time.size - 1)
            detail = f"{np.nanmedian(scatter[loud]):.2g} K"
            alarms.append(Alarm(node, "noise", float(time[seen]), float(time[at]), detail=detail))
    return alarms
