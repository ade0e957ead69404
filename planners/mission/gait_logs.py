"""A gait learned from logs: RMS torques, mean speeds and powers in cells of base speed and load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.errors import InputError
from lptn.logs.columns import ColumnSource
from lptn.logs.reading import read_log
from lptn.logs.resampling import reduce_blocks
from lptn.logs.run import Run
from lptn.model.model import Model

from .gait import Gait, weights_at
from .gait_tables import made

_FEWEST = 3.0  # windows that must lie around a cell, each counted by how near it is
_BEYOND = 0.1  # share of the range of the cells by which a window may lie outside


@dataclass(frozen=True)
class LogPart:
    """A stretch of a log.

    Args:
        file: the log.
        load: on the robot's back [kg].
        start: since the log's beginning [s].
        end: since the log's beginning [s].
    """

    file: Path
    load: float
    start: float = 0.0
    end: float = np.inf


def gait_from_logs(
    name: str,
    speeds: Sequence[float],
    loads: Sequence[float],
    parts: Sequence[LogPart],
    model: Model,
    origin: str,
    *,
    window: float = 10.0,
    columns: Mapping[str, ColumnSource] | None = None,
) -> Gait:
    """Learn a gait's cells by least squares over windows of the logs.

    A window gives the RMS of torques and currents and the means of speeds and powers, so that no heat is lost, and the
    base's mean speed. The cells are those values whose curves pass nearest to all windows.

    Args:
        name: what the task file calls it.
        speeds: of the cells [m/s]; one for a gait that stays where it is.
        loads: of the cells [kg].
        parts: of logs.
        model: whose inputs are needed.
        origin: the task file, for messages.
        window: length of a window [s], some gait cycles.
        columns: other people's column names.

    Raises:
        InputError: a log can't be used, or no log comes near a cell.
    """
    knots = np.array(speeds, dtype=float), np.array(loads, dtype=float)
    needed = [c for c in model.inputs if c.partition(".")[0] not in ("temperature", "speed")]
    asked = [*needed, *(["speed.base"] if knots[0].size > 1 else [])]
    measured: list[FloatArray] = []
    for part in parts:
        runs = read_log(part.file, columns, inputs=asked)
        begin = float(runs[0].time[0])
        measured += [_windows(run, part, run.time - begin, asked, window) for run in runs]
    rows = np.vstack(measured)
    rows = rows[np.isfinite(rows).all(axis=1)]
    if knots[0].size > 1:
        rows = rows[_inside(rows[:, -2], knots[0])]
    rows = rows[_inside(rows[:, -1], knots[1])]
    v = rows[:, -2]  # of no account where there is one speed
    _refuse_empty(name, v, rows[:, -1], knots, origin)
    by_load, by_speed = weights_at(rows[:, -1], knots[1]), weights_at(v, knots[0])
    weights = (by_load[:, :, None] * by_speed[:, None, :]).reshape(len(rows), -1)
    cells, _, rank, _ = np.linalg.lstsq(weights, rows[:, : len(needed)])
    if rank < weights.shape[1]:
        expected = "speeds in the logs that differ enough to tell the cells apart, or fewer cells"
        raise InputError(origin, f"gaits.{name}.speeds", f"{weights.shape[1]} cells, {rank} of them known", expected)
    shape = knots[1].size, knots[0].size
    tables = {column: cells[:, k].reshape(shape).clip(min=0.0) for k, column in enumerate(needed)}
    return made(name, *knots, tables, model, origin)


def _windows(run: Run, part: LogPart, since: FloatArray, columns: Sequence[str], window: float) -> FloatArray:
    """Each window's values of the columns, the last of them the load; shape (windows, columns + 1)."""
    factor = max(1, round(window / run.step))
    keep = (since >= part.start) & (since < part.end)
    reduced = [reduce_blocks(column, run.columns[column][keep], factor) for column in columns]
    return np.column_stack([*reduced, np.full(reduced[0].size, part.load)])


def _inside(values: FloatArray, knots: FloatArray) -> BoolArray:
    reach = _BEYOND * float(np.ptp(knots)) + 1e-9
    return np.asarray((values >= knots[0] - reach) & (values <= knots[-1] + reach))


def _refuse_empty(
    name: str, speed: FloatArray, load: FloatArray, knots: tuple[FloatArray, FloatArray], origin: str
) -> None:
    """Every cell needs windows around it."""
    near = [np.stack([_hat(values, which, k) for k in range(which.size)]) for values, which in
            ((load, knots[1]), (speed, knots[0]))]  # fmt: skip
    count = near[0] @ near[1].T
    if (count < _FEWEST).any():
        row, column = np.unravel_index(int(count.argmin()), count.shape)
        at = f" at {knots[0][column]:g} m/s" if knots[0].size > 1 else ""
        found = f"{count[row, column]:.1f} windows near {knots[1][row]:g} kg{at}"
        raise InputError(origin, f"gaits.{name}.logs", found, f"{_FEWEST:g} or more around each cell, or other cells")


def _hat(values: FloatArray, knots: FloatArray, k: int) -> FloatArray:
    """1 at a knot, 0 at its neighbours."""
    if knots.size == 1:
        return np.ones(values.size)
    return np.asarray(np.interp(values, knots, np.eye(knots.size)[k]))
