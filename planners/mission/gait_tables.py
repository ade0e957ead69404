"""A gait from what a user supplies: tables over speed and load by joint, or logs of the robot walking."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError, shown
from lptn.basics.places import matching
from lptn.model.model import Model

from .activities import REST
from .gait import Gait, gait

_FORM = math.pi / (2 * math.sqrt(2))  # RMS over mean magnitude of a sine, for a speed of which only the mean is given
_MOST = 1e15  # SI; beyond it no quantity of a robot lies
_IDLE = ("torque", "current", "current_abs", "velocity", "velocity_rms", "mechanical_power", "powered")
_BELOW = -1e-6  # relative to its largest cell; further below zero a table swings between its cells


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
            found = matching(f"{quantity}.{pattern}", columns)
            if not found:
                known = ", ".join(c.partition(".")[2] for c in columns) or f"no {quantity} at all: the model has none"
                raise InputError(origin, where, "a pattern that matches no input of the model", f"some of {known}")
            tables |= dict.fromkeys(found, _table(values, shape, origin, where))
    return made(name, np.array(speeds, dtype=float), np.array(loads, dtype=float), tables, model, origin)


def made(
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
    found = gait(name, speeds, loads, columns)
    for column, least in zip(columns, found.least().tolist(), strict=True):
        if least < _BELOW * max(float(np.abs(columns[column]).max()), 1e-9):
            raise InputError(
                origin, f"gaits.{name}", f"{column} down to {least:.3g} between the cells",
                "cells so close that the curve through them stays above zero",
            )  # fmt: skip
    return found


def _of(column: str, tables: Mapping[str, FloatArray], name: str, origin: str) -> FloatArray:
    quantity, _, place = column.partition(".")
    if column in tables:
        return tables[column]
    if quantity == "temperature" or column == "speed.base":
        return np.zeros((1, 1))  # the planner's own business
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
