"""Faults of a log's channels that need no model: what the log's own quality pass says, and noise that grew."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.logs.run import Run
from lptn.logs.silence import INPUTS, STILL
from lptn.online.sensor_faults import Alarm, Kind, MonitoredRun

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
    size = max(1, round(_BLOCK / watched.run.step))
    alarms: list[Alarm] = []
    if size < _FEWEST:
        return alarms
    for row, node in enumerate(watched.nodes):
        scatter = _scatter(watched.measured[row], size)
        if np.isfinite(scatter).sum() < 2 * _BLOCKS:
            continue
        usual = max(float(np.nanquantile(scatter, 0.25)), float(watched.steps[row]) / _LOUD, _LEAST)
        with np.errstate(invalid="ignore"):
            loud = scatter > _LOUD * usual
        for k in range(loud.size - _BLOCKS + 1):
            if loud[k : k + _BLOCKS].all():
                time, at = watched.time[min((k + _BLOCKS) * size, watched.time.size - 1)], watched.time[k * size]
                times = float(np.nanmedian(scatter[loud]))
                alarms.append(Alarm(node, "noise", float(time), float(at), detail=f"{times:.2g} K"))
                break
    return alarms


def _scatter(readings: FloatArray, size: int) -> FloatArray:
    """Standard deviation of the noise [K] in each block, NaN where too few readings are there."""
    second = np.abs(readings[2:] - 2 * readings[1:-1] + readings[:-2])
    blocks = [second[k : k + size] for k in range(0, second.size - size + 1, size)]
    return np.array(
        [
            _MAD_TO_SIGMA * float(np.nanmedian(block)) if np.isfinite(block).sum() >= _FEWEST else np.nan
            for block in blocks
        ]
    )
