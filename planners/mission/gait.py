"""Gaits: RMS torques, speeds and powers of an activity over base speed and load, from tables or learned from logs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from scipy.interpolate import CubicSpline

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.errors import InputError, shown
from lptn.basics.places import matching
from lptn.logs.columns import ColumnSource
from lptn.logs.reading import read_log
from lptn.logs.resampling import reduce_blocks
from lptn.logs.run import Run
from lptn.model.model import Model

REST = "rest"
"""The gait with all drives off."""
_GRID = 25  # points in each direction at which a table is checked between its cells
_FORM = math.pi / (2 * math.sqrt(2))  # RMS over mean magnitude of a sine, for a speed of which only the mean is given
_MOST = 1e15  # SI; beyond it no quantity of a robot lies
_IDLE = ("torque", "current", "current_abs", "velocity", "velocity_rms", "mechanical_power", "powered")
_BELOW = -1e-6  # relative to its largest cell; further below zero a table swings between its cells
_FEWEST = 3.0  # windows that must lie around a cell, weighted by how near they are
_BEYOND = 0.1  # share of the range of the cells by which a window may lie outside


@dataclass(frozen=True)
class Gait:
    """The inputs of a model over base speed and load.

    Between the cells a natural cubic spline in each direction: smooth, as a solver needs it, and straight where there
    are two cells. [QuadrupedLPTN, eq. 15] logs torques as RMS over a second; heat goes with their square.

    Args:
        name: what the task file calls it.
        speeds: base speeds of the cells [m/s], rising; one where it has none to choose.
        loads: loads of the cells [kg], rising.
        cells: inputs in the model's order, SI, shape (loads, speeds, inputs).
    """

    name: str
    speeds: FloatArray
    loads: FloatArray
    cells: FloatArray

    def inputs(self, speed: Any, load: Any) -> Any:
        """The model's inputs as expressions of speed and load, shape (inputs,)."""
        by_speed, by_load = basis_at(speed, self.speeds), basis_at(load, self.loads)
        flat = self.cells.reshape(-1, self.cells.shape[2]).T
        return ca.mtimes(ca.DM(flat), ca.vec(ca.mtimes(by_speed, by_load.T)))

    def at(self, speed: float, load: float) -> FloatArray:
        """The model's inputs at one speed and load, shape (inputs,)."""
        weights = np.outer(weights_at(load, self.loads), weights_at(speed, self.speeds))
        inputs: FloatArray = np.einsum("ij,ijk->k", weights, self.cells)
        return inputs

    def least(self) -> FloatArray:
        """The least value of each input anywhere between the cells, shape (inputs,)."""
        speeds = np.linspace(self.speeds[0], self.speeds[-1], _GRID)
        loads = np.linspace(self.loads[0], self.loads[-1], _GRID)
        by_speed, by_load = weights_at(speeds, self.speeds), weights_at(loads, self.loads)
        return np.asarray(np.einsum("ai,bj,ijk->abk", by_load, by_speed, self.cells).min(axis=(0, 1)))


def weights_at(value: Any, knots: FloatArray) -> FloatArray:
    """How much each cell counts at a value, or at many; shape (…, knots)."""
    if knots.size == 1:
        return np.ones((*np.shape(value), 1))
    return np.asarray(_spline(knots)(value))


def basis_at(value: Any, knots: FloatArray) -> Any:
    """`weights_at` as an expression, shape (knots,)."""
    if knots.size == 1:
        return ca.SX.ones(1)
    pieces = np.asarray(_spline(knots).c)  # (order, piece, knot)
    basis = None
    for number in range(knots.size - 1):
        away = value - float(knots[number])
        here = ca.DM(pieces[0, number])
        for row in pieces[1:, number]:
            here = here * away + ca.DM(row)
        basis = here if basis is None else ca.if_else(away >= 0, here, basis)
    return basis


def _spline(knots: FloatArray) -> CubicSpline:
    return CubicSpline(knots, np.eye(knots.size), bc_type="natural")


# --- from tables ---------------------------------------------------------------------------------


def gait_from_tables(
    name: str, speeds: Sequence[float], loads: Sequence[float], given: Mapping[str, Any], model: Model, origin: str
) -> Gait:
    """A gait from its tables.

    Args:
        name: what the task file calls it.
        speeds: of the columns of each table [m/s].
        loads: of its rows [kg].
        given: for each quantity by pattern of places a number, a list over the speeds (over the loads where there is
            one speed), or a row of speeds for each load.
        model: whose inputs are needed.
        origin: the task file, for messages.

    Raises:
        InputError: a quantity is missing, a table has the wrong shape, a pattern matches no input of the model.
    """
    shape = len(loads), len(speeds)
    tables: dict[str, FloatArray] = {}
    for quantity, by_place in given.items():
        place = f"gaits.{name}.{quantity}"
        if not isinstance(by_place, Mapping):
            raise InputError(origin, place, shown(by_place), 'a table of places, such as { "*_calf" = … }')
        for pattern, values in by_place.items():
            where = f'{place}."{pattern}"'
            columns = [c for c in model.inputs if c.partition(".")[0] == quantity]
            matched = matching(f"{quantity}.{pattern}", columns)
            if not matched:
                places = ", ".join(c.partition(".")[2] for c in columns) or f"no {quantity} at all: the model has none"
                raise InputError(origin, where, "a pattern that matches no input of the model", f"some of {places}")
            tables |= dict.fromkeys(matched, _table(values, shape, origin, where))
    return _gait(name, np.array(speeds, dtype=float), np.array(loads, dtype=float), tables, model, origin)


def _gait(
    name: str,
    speeds: FloatArray,
    loads: FloatArray,
    tables: Mapping[str, FloatArray],
    model: Model,
    origin: str,
) -> Gait:
    """A gait from one table of shape (loads, speeds) by input column; what follows from others is filled in.

    Raises:
        InputError: an input of the model has no table, or a table swings below zero between its cells.
    """
    columns = {column: _of(column, tables, name, origin) for column in model.inputs}
    cells = np.stack([np.broadcast_to(table, (loads.size, speeds.size)) for table in columns.values()], axis=2)
    gait = Gait(name, speeds, loads, np.ascontiguousarray(cells, dtype=float))
    for column, least in zip(columns, gait.least().tolist(), strict=True):
        if least < _BELOW * max(float(np.abs(columns[column]).max()), 1e-9):
            raise InputError(
                origin, f"gaits.{name}", f"{column} down to {least:.3g} between the cells",
                "cells so close that the curve through them stays above zero",
            )  # fmt: skip
    return gait


def _of(column: str, tables: Mapping[str, FloatArray], name: str, origin: str) -> FloatArray:
    quantity, _, place = column.partition(".")
    if column in tables:
        return tables[column]
    if quantity == "temperature" or column == "speed.base":
        return np.zeros((1, 1))  # the planner sets it
    if name == REST and quantity in _IDLE:
        return np.zeros((1, 1))
    if quantity == "velocity_rms" and f"velocity.{place}" in tables:
        return _FORM * tables[f"velocity.{place}"]
    if quantity == "current_abs" and f"current.{place}" in tables:
        return tables[f"current.{place}"] / _FORM
    if quantity == "powered":
        return np.ones((1, 1))
    raise InputError(origin, f"gaits.{name}.{quantity}", f"nothing for {place}", f'"{place}" = …, for the model')


def _table(values: Any, shape: tuple[int, int], origin: str, where: str) -> FloatArray:
    """A number, one row over speeds (over loads where there is one speed), or rows; of shape (loads, speeds)."""
    expected = f"a number, or {shape[0]} rows (loads) of {shape[1]} numbers (speeds), none below 0"
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(origin, where, "something that is no table", expected) from error
    if array.ndim == 1:
        array = array[None, :] if shape[1] > 1 else array[:, None]
    if array.ndim > 2 or array.shape not in ((), shape, (shape[0], 1), (1, shape[1])):
        raise InputError(origin, where, f"a table of {' x '.join(map(str, array.shape))}", expected)
    wrong = array[~((array >= 0) & (array < _MOST))]
    if wrong.size:
        raise InputError(origin, where, f"{float(wrong[0]):g}", expected)
    return np.broadcast_to(array, shape)


# --- from logs -----------------------------------------------------------------------------------


@dataclass(frozen=True)
class LogPart:
    """Part of a log.

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
    v = rows[:, -2]  # unused where there is one speed
    _refuse_empty(name, v, rows[:, -1], knots, origin)
    by_load, by_speed = weights_at(rows[:, -1], knots[1]), weights_at(v, knots[0])
    weights = (by_load[:, :, None] * by_speed[:, None, :]).reshape(len(rows), -1)
    cells, _, rank, _ = np.linalg.lstsq(weights, rows[:, : len(needed)])
    if rank < weights.shape[1]:
        expected = "speeds in the logs that differ enough to tell the cells apart, or fewer cells"
        raise InputError(
            origin, f"gaits.{name}.speeds", f"{weights.shape[1]} cells, {rank} of them determined", expected
        )
    shape = knots[1].size, knots[0].size
    tables = {column: cells[:, k].reshape(shape).clip(min=0.0) for k, column in enumerate(needed)}
    return _gait(name, *knots, tables, model, origin)


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
