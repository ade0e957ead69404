"""Gaits: RMS torques, speeds and powers over base speed, load and posture, from tables or learned from logs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import reduce
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from pydantic import Field
from scipy.interpolate import CubicSpline
from scipy.linalg import khatri_rao

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError, shown
from lptn.basics.places import matching
from lptn.basics.toml import Number, Strict
from lptn.logs.columns import ColumnSource
from lptn.logs.reading import read_log
from lptn.logs.resampling import reduce_blocks
from lptn.model.model import Model

from ..values import SINE, ExtraMass, NotNegative, Positive

REST = "rest"
"""The gait with all drives off."""
_IDLE = ("torque", "torque_abs", "current", "current_abs", "velocity", "velocity_rms", "mechanical_power", "powered")


@dataclass(frozen=True)
class Gait:
    """The inputs of a model over base speed and load, and over postures where it has some.

    A posture is whatever else can be chosen and moves the torques: the height of the base [m], how far the weight is
    shifted forward [m]. Between the cells a natural cubic spline in each direction: smooth, as a solver needs it, and
    straight where there are two cells. [QuadrupedLPTN, eq. 15] logs torques as RMS over a second; heat goes with their
    square.

    Args:
        name: what the task file calls it.
        speeds: base speeds of the cells [m/s], rising; one where it has none to choose.
        loads: loads of the cells [kg], rising.
        cells: inputs in the model's order, SI, shape (*postures, loads, speeds, inputs).
        postures: by name the values of the cells, rising.
    """

    name: str
    speeds: FloatArray
    loads: FloatArray
    cells: FloatArray
    postures: Mapping[str, FloatArray] = field(default_factory=dict)

    @property
    def axes(self) -> tuple[FloatArray, ...]:
        """Values of the cells along each axis of `cells` but the last."""
        return (*self.postures.values(), self.loads, self.speeds)

    def inputs(self, speed: Any, load: Any, posture: Sequence[Any] = ()) -> Any:
        """The model's inputs as expressions of speed, load and each posture, shape (inputs,)."""
        weights = ca.SX.ones(1)
        for value, knots in zip((*posture, load, speed), self.axes, strict=True):
            weights = ca.kron(weights, basis_at(value, knots))
        return ca.mtimes(ca.DM(self.cells.reshape(-1, self.cells.shape[-1]).T), weights)

    def at(self, speed: float, load: float, posture: Sequence[float] = ()) -> FloatArray:
        """The model's inputs at one speed, load and posture, shape (inputs,)."""
        inputs = self.cells
        for value, knots in zip((*posture, load, speed), self.axes, strict=True):
            inputs = np.tensordot(weights_at(value, knots), inputs, axes=1)
        return np.asarray(inputs)

    def least(self, points: int = 25) -> FloatArray:
        """The least value of each input between the cells, at so many points in each direction, shape (inputs,)."""
        inputs = self.cells
        for axis, knots in enumerate(self.axes):
            weights = weights_at(np.linspace(knots[0], knots[-1], points if knots.size > 2 else knots.size), knots)
            inputs = np.moveaxis(np.tensordot(weights, inputs, axes=(1, axis)), 0, axis)
        return np.asarray(inputs.reshape(-1, inputs.shape[-1]).min(axis=0))


def with_surroundings(inputs: Any, columns: Sequence[str], speed: Any, air: Any) -> Any:
    """Inputs of a model with what no gait says: the base's speed [m/s] and the temperature around [degC]."""
    for row, column in enumerate(columns):
        if column.startswith("temperature."):
            inputs[row] = air
        elif column == "speed.base":
            inputs[row] = speed
    return inputs


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
    name: str,
    speeds: Sequence[float],
    loads: Sequence[float],
    given: Mapping[str, Any],
    model: Model,
    origin: str,
    postures: Mapping[str, Sequence[float]] | None = None,
    *,
    place: str | None = None,
) -> Gait:
    """A gait from its tables.

    Args:
        name: what the task file calls it.
        speeds: of the columns of each table [m/s].
        loads: of its rows [kg].
        given: for each quantity by pattern of places a number, a list over the speeds (over the loads where there is
            one speed), a row of speeds for each load, or a list of such tables for each posture.
        model: whose inputs are needed.
        origin: the task file, for messages.
        postures: by name their values, one for each table.
        place: of its table in the task file, for messages; `gaits.` and its name where nothing is said.

    Raises:
        InputError: a quantity is missing, a table has the wrong shape, a pattern matches no input of the model.
    """
    place = place or f"gaits.{name}"
    bare = _bare(name, speeds, loads, postures)
    shape = tuple(knots.size for knots in bare.axes)
    tables: dict[str, FloatArray] = {}
    for quantity, by_place in given.items():
        if not isinstance(by_place, Mapping):
            expected = 'a table of places, such as { "*_calf" = … }'
            raise InputError(origin, f"{place}.{quantity}", shown(by_place), expected)
        for pattern, values in by_place.items():
            where = f'{place}.{quantity}."{pattern}"'
            columns = [c for c in model.inputs if c.partition(".")[0] == quantity]
            matched = matching(f"{quantity}.{pattern}", columns)
            if not matched:
                places = ", ".join(c.partition(".")[2] for c in columns) or f"no {quantity} at all: the model has none"
                raise InputError(origin, where, "a pattern that matches no input of the model", f"some of {places}")
            tables |= dict.fromkeys(matched, _table(values, shape, origin, where))
    return _filled(bare, tables, model, origin, place)


def _bare(
    name: str,
    speeds: Sequence[float],
    loads: Sequence[float],
    postures: Mapping[str, Sequence[float]] | None,
) -> Gait:
    """A gait of which nothing is known but where its cells are."""
    axes = {key: np.array(values, dtype=float) for key, values in (postures or {}).items()}
    return Gait(name, np.array(speeds, dtype=float), np.array(loads, dtype=float), np.zeros(0), axes)


def _filled(bare: Gait, tables: Mapping[str, FloatArray], model: Model, origin: str, place: str) -> Gait:
    """A gait from one table of shape (*postures, loads, speeds) by input column; what follows from others is filled in.

    Raises:
        InputError: an input of the model has no table, or a table swings below zero between its cells.
    """
    columns = {column: _of(column, tables, bare.name, origin, place) for column in model.inputs}
    shape = tuple(knots.size for knots in bare.axes)
    cells = np.stack([np.broadcast_to(table, shape) for table in columns.values()], axis=-1)
    gait = replace(bare, cells=np.ascontiguousarray(cells, dtype=float))
    for column, least in zip(columns, gait.least().tolist(), strict=True):
        if least < -1e-6 * max(float(np.abs(columns[column]).max()), 1e-9):  # more than rounding
            raise InputError(
                origin, place, f"{column} down to {least:.3g} between the cells",
                "cells so close that the curve through them stays above zero",
            )  # fmt: skip
    return gait


def _of(column: str, tables: Mapping[str, FloatArray], name: str, origin: str, table: str) -> FloatArray:
    quantity, _, place = column.partition(".")
    if column in tables:
        return tables[column]
    if quantity == "temperature" or column == "speed.base":
        return np.zeros((1, 1))  # the planner sets it
    if name == REST and quantity in _IDLE:
        return np.zeros((1, 1))
    if quantity == "velocity_rms" and f"velocity.{place}" in tables:
        return SINE * tables[f"velocity.{place}"]
    if quantity in ("current_abs", "torque_abs") and (rms := f"{quantity[:-4]}.{place}") in tables:
        return tables[rms]  # a mean magnitude is no more
    if quantity == "mechanical_power" and f"torque.{place}" in tables:
        speed = _of(f"velocity_rms.{place}", tables, name, origin, table)
        return tables[f"torque.{place}"] * speed  # nor is the mean of a product more than that of their RMS values
    if quantity == "powered":
        return np.ones((1, 1))
    raise InputError(origin, f"{table}.{quantity}", f"nothing for {place}", f'"{place}" = …, for the model')


def _table(values: Any, shape: tuple[int, ...], origin: str, where: str) -> FloatArray:
    """A number, one row over speeds (over loads where there is one speed), rows, or rows for each posture."""
    expected = f"a number, or {shape[-2]} rows (loads) of {shape[-1]} numbers (speeds), none below 0"
    if shape[:-2]:
        expected += f", for all postures or for each: {' x '.join(map(str, shape))} numbers"
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(origin, where, "something that is no table", expected) from error
    if array.ndim == 1:
        array = array[None, :] if shape[-1] > 1 else array[:, None]
    admitted = [(), (shape[-2], shape[-1]), (shape[-2], 1), (1, shape[-1]), shape]
    if array.shape not in admitted:
        raise InputError(origin, where, f"a table of {' x '.join(map(str, array.shape))}", expected)
    wrong = array[~((array >= 0) & (array < 1e15))]  # SI; beyond it no quantity of a robot lies
    if wrong.size:
        raise InputError(origin, where, f"{float(wrong[0]):g}", expected)
    return np.broadcast_to(array, shape)


# --- from logs -----------------------------------------------------------------------------------


class LogPart(Strict):
    """Part of a log: a table `[[gaits.NAME.logs]]` of a task file."""

    file: Path  # as seen from the task file
    load: ExtraMass = 0.0  # on the robot's back [kg]
    start: NotNegative = 0.0  # since the log's beginning [s]
    end: Positive | None = None  # since the log's beginning [s]; none: all of it
    posture: dict[str, Number] = Field(default_factory=dict)  # by name


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
    postures: Mapping[str, Sequence[float]] | None = None,
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
        postures: by name the values of the cells; each part of a log says which it was.

    Raises:
        InputError: a log can't be used, or no log comes near a cell.
    """
    bare = _bare(name, speeds, loads, postures)
    axes, moves = bare.axes, bare.speeds.size > 1
    needed = [c for c in model.inputs if c.partition(".")[0] not in ("temperature", "speed")]
    asked = [*needed, *(["speed.base"] if moves else [])]
    measured: list[FloatArray] = []
    for part in parts:
        runs = read_log(part.file, columns, inputs=asked)
        still = [*(part.posture[key] for key in bare.postures), part.load]
        for run in runs:
            since = run.time - float(runs[0].time[0])
            keep = (since >= part.start) & (since < (part.end or np.inf))
            factor = max(1, round(window / run.step))
            reduced = [reduce_blocks(column, run.columns[column][keep], factor) for column in asked]
            measured.append(np.column_stack([*reduced, np.tile(still, (reduced[0].size, 1))]))
    rows = np.vstack(measured)
    rows = rows[np.isfinite(rows).all(axis=1)]
    constants = rows[:, len(asked) :]  # postures and load; the speed is measured
    at = np.column_stack([constants, rows[:, len(needed)] if moves else np.zeros(len(rows))])
    for k, knots in enumerate(axes if moves else axes[:-1]):
        reach = 0.1 * float(np.ptp(knots)) + 1e-9  # a tenth of the cells' range, in which a window still tells of them
        inside = (at[:, k] >= knots[0] - reach) & (at[:, k] <= knots[-1] + reach)
        rows, at = rows[inside], at[inside]
    _refuse_empty(bare, at, origin)
    weights = _over_cells([weights_at(values, knots) for values, knots in zip(at.T, axes, strict=True)])
    cells, _, rank, _ = np.linalg.lstsq(weights, rows[:, : len(needed)])
    if rank < weights.shape[1]:
        found = f"{weights.shape[1]} cells, {rank} of them determined"
        expected = "speeds in the logs that differ enough to tell the cells apart, or fewer cells"
        raise InputError(origin, f"gaits.{name}.speeds", found, expected)
    shape = [knots.size for knots in axes]
    tables = {column: cells[:, k].reshape(shape).clip(min=0.0) for k, column in enumerate(needed)}
    return _filled(bare, tables, model, origin, f"gaits.{name}")


def _over_cells(by_axis: Sequence[FloatArray]) -> FloatArray:
    """Weights of the cells, shape (windows, cells), from those along each axis, shape (windows, knots)."""
    return np.ascontiguousarray(reduce(khatri_rao, [along.T for along in by_axis]).T)


def _refuse_empty(bare: Gait, at: FloatArray, origin: str, least: float = 3.0) -> None:
    """Every cell needs windows around it, weighted by how near they are; `at` tells where each window lies, shape
    (windows, axes)."""
    # For each cell 1 at its knot, 0 at the neighbours.
    near = [
        np.stack([np.interp(values, knots, hat) for hat in np.eye(knots.size)], axis=1)
        for values, knots in zip(at.T, bare.axes, strict=True)
    ]
    windows = _over_cells(near).sum(axis=0).reshape([knots.size for knots in bare.axes])
    if (windows >= least).all():
        return
    cell = np.unravel_index(int(windows.argmin()), windows.shape)
    *postures, load, speed = (knots[k] for knots, k in zip(bare.axes, cell, strict=True))
    where = [f"{name} {value:g}" for name, value in zip(bare.postures, postures, strict=True)] + [f"{load:g} kg"]
    where += [f"{speed:g} m/s"] * (bare.speeds.size > 1)
    raise InputError(
        origin, f"gaits.{bare.name}.logs", f"{windows[cell]:.1f} windows near {' at '.join(where)}",
        f"{least:g} or more around each cell, or other cells",
    )  # fmt: skip
