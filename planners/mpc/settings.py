"""Settings of a thermal controller: limits, stages of the horizon, weights, margins; checked and spread over places."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Literal, NamedTuple, get_args

import casadi as ca
import numpy as np
from scipy.optimize import brentq

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.online.living_sensors import ERROR

from ..heating import Heating
from ..values import Each, checked_by_place, limits_of
from .c_code import surroundings, unsure

LostSensor = Literal["model", "derate", "stop"]
"""What a joint gets whose node has lost its sensor; the order is that of `c/lptn_mpc.h`."""

_ROOM = 25.0  # degC
_ABSOLUTE = 273.15 + _ROOM  # K
_AIR = 3.0 / _ABSOLUTE  # standard deviation of its told absolute temperature: a room may have 20 or 30 degC as well
SLACK_PRICES = 10.0, 10.0
"""Of slack, linear [1/K] and quadratic [1/K²] at one stage; admitting nothing at all costs 1."""
BAND = 10.0  # K above its limit at which a node, by default, is to cool as fast as it does without any load


class Settings:
    """Arguments of `TorqueMPC`, checked and spread over a model's places, and what follows from them.

    Args:
        heating: the model.
        limits: as for `TorqueMPC`, as are all others.

    Attributes:
        stages: lengths [s], shape (stages,).
        limits: degC by node; the margin is not taken off yet.
        weights, currents, rates, floors: of the joints, shape (joints,); infinite currents, rates of 0: no limits.
        recovery: of the limited nodes, shape (limited nodes,).
        units: values of the parameters that a robot has of its own, or standard errors of those that are 0; absolute
            temperatures of what surrounds it [K].
        errors: standard deviations of what sets a robot apart from its model, for the estimate and where sensors are
            tested: heat that each node lacks, as a rate [K/s], and logarithms of these parameters over their
            units; shape (2, errors).
        settles: time in which each node forgets how warm the whole robot began [s].
        power: limit of all joints together at the supply [W].

    Raises:
        InputError: an unknown place, or a number that can't be used.
        ValueError: period, horizon or number of stages can't be.
    """

    def __init__(
        self,
        heating: Heating,
        limits: Each,
        *,
        period: float,
        horizon: float,
        stages: int,
        level: float,
        model_error: float,
        weights: Each = 1.0,
        current_limits: Each = math.inf,
        rates: Each = 0.0,
        floors: Each = 0.0,
        priorities: Each = 0.0,
        recovery: float | None = None,
        smoothing: float = 0.0,
        margin: float = 0.0,
        noise: float = 0.1,
        resolution: float = 0.0,
        standard_errors: Mapping[str, float] | None = None,
        lost_sensor: LostSensor = "model",
        power_limit: float = math.inf,
    ) -> None:
        model, joints = heating.model, heating.joints
        self.limits = limits_of(limits, model)
        self.margin, self.smoothing, self.model_error = margin, smoothing, model_error
        self.noise, self.resolution, self.level = noise, resolution, level
        self.lost_sensor, self.power = lost_sensor, power_limit
        for place, value in (
            ("margin", margin), ("recovery", recovery or 0.0), ("smoothing", smoothing), ("noise", noise),
            ("resolution", resolution), ("model_error", model_error),
        ):  # fmt: skip
            if not (math.isfinite(value) and value >= 0.0):
                raise InputError(model.network.origin, place, f"{value:g}", "a number from 0 up")
        if lost_sensor not in get_args(LostSensor):
            expected = " or ".join(get_args(LostSensor))
            raise InputError(model.network.origin, "lost_sensor", f"{lost_sensor!r}", expected)
        if not power_limit > 0:
            raise InputError(model.network.origin, "power_limit", f"{power_limit:g} W", "a power above 0 W")
        if not 0.5 <= level < 1:
            raise InputError(model.network.origin, "level", f"{level:g}", "a probability from 0.5 up, less than 1")
        self.stages = growing_stages(period, horizon, stages)
        most = 2  # levels either way; a joint gives way by a hundredth of the share of one a level below
        levels = _by_joint(priorities, joints, "priorities", 0.0, least=-most)
        if np.any(levels > most):
            raise InputError(model.network.origin, "priorities", f"{levels.max():g}", f"at most {most}")
        self.weights = _by_joint(weights, joints, "weights", 1.0) * 100.0 ** (levels - levels.max())
        self.currents = _by_joint(current_limits, joints, "current_limits", math.inf, infinite=True)
        self.rates = _by_joint(rates, joints, "rates", 0.0, least=0.0)
        self.floors = _by_joint(floors, joints, "floors", 0.0, least=0.0)
        self.recovery = (
            _recovery(heating, self.limits) if recovery is None else np.full(len(self.limits), float(recovery))
        )
        self.units, self.errors = _errors(heating, self.limits, model_error, standard_errors or {})
        self.settles = _settles(heating, self.limits)

    @property
    def planned_limits(self) -> FloatArray:
        """Limits with the fixed margin off [degC], shape (limited nodes,)."""
        return np.array(list(self.limits.values())) - self.margin

    def limits_from(self, start: FloatArray) -> FloatArray:
        """Limits at the stages' ends [degC], shape (limited nodes, stages), with the recovery from a start [degC]."""
        ends, limits = np.cumsum(self.stages), self.planned_limits[:, None]
        slow = self.recovery[:, None] > 0
        left = np.where(slow, np.exp(-ends / np.where(slow, self.recovery[:, None], 1.0)), 0.0)
        return np.asarray(limits + left * np.maximum(start[:, None] - limits, 0.0))


def _recovery(heating: Heating, limits: dict[str, float]) -> FloatArray:
    """Time constants [s] with which limited nodes come down to their limits by default, shape (limited nodes,)."""
    rows = [heating.model.places.index(node) for node in limits]
    # What no current heats is as warm as the others make it, whatever its limit: a winding cools into its housing.
    driven = np.isin(rows, ca.jacobian(heating.rates, heating.amount).sparsity().row())
    among = {node: limit for (node, limit), heated in zip(limits.items(), driven, strict=True) if heated} or limits
    free = driven * np.abs(_at_limits(heating, among).rates[rows])
    return np.asarray(BAND / np.maximum(_cooling(heating, limits)[rows], free))


def _settles(heating: Heating, limits: dict[str, float]) -> FloatArray:
    """Mean time in which each node forgets how warm all began [s], at most a day: of one mass its time constant."""
    nodes, day = len(heating.model.nodes), 86400.0
    slope = _at_limits(heating, limits).slope[:nodes, :nodes]
    forgets = np.linalg.lstsq(-slope, np.ones(nodes))[0]
    forgets[np.abs(slope @ forgets + 1) > 1e-6] = day  # without air nothing is forgotten
    return np.where((forgets > 0) & (forgets < day), forgets, day)


class _Balance(NamedTuple):
    """States without load [degC], conditions of a room, rates there [K/s] and their slopes in the states [1/s]."""

    x: FloatArray
    room: FloatArray
    rates: FloatArray
    slope: FloatArray


def _at_limits(heating: Heating, limits: Mapping[str, float]) -> _Balance:
    """Limited nodes at their limits without load, the others in balance with them in a room; balance is that of the
    linearisation at the limits."""
    model = heating.model
    x = np.array([limits.get(node, max(limits.values())) for node in model.nodes])[np.array(model.owners)]
    room = np.array([_ROOM if name.startswith("temperature") else 0.0 for name in heating.conditions])

    def unloaded() -> tuple[FloatArray, FloatArray]:
        rates, slope, *_ = heating.function()(x, np.zeros(len(heating.joints)), room, model.values)
        return np.asarray(rates.full()).ravel(), np.asarray(slope.full()).T

    free = [row for row, owner in enumerate(model.owners) if model.nodes[owner] not in limits]
    rates, slope = unloaded()
    if free:
        x[free] -= np.linalg.lstsq(slope[np.ix_(free, free)], rates[free])[0]
        rates, slope = unloaded()
    return _Balance(x, room, rates, slope)


def _errors(
    heating: Heating, limits: dict[str, float], model_error: float, standard_errors: Mapping[str, float]
) -> tuple[FloatArray, FloatArray]:
    """`Settings.units` and `Settings.errors`.

    A heat flow is mostly a product of two parameters: half of its relative error is each one's. The estimate may lack
    all of it as a heat, too, since no robot is a network; where sensors are tested half, for what such a heat explains
    is no fault."""
    model = heating.model
    names = [parameter.name for parameter in model.parameters]
    unknown = set(standard_errors) - set(names)
    if unknown:
        place = f"standard_errors.{sorted(unknown)[0]}"
        raise InputError(model.network.origin, place, "no such parameter", f"some of {', '.join(names[:8])}, …")
    own, around, cooling = unsure(heating), len(surroundings(heating)), _cooling(heating, limits)[: len(model.nodes)]
    told = np.array([standard_errors.get(name, 0.0) for name in names])[own]
    units = np.where(model.values[own] != 0, model.values[own], told)
    relative = np.divide(told, np.abs(units), out=np.zeros(len(own)), where=units != 0)
    air, learns = np.full(around, _AIR), model_error > 0
    estimate = [*(model_error * cooling), *np.hypot(0.5 * model_error, relative * learns), *(air * learns)]
    tested = [*(0.5 * ERROR * cooling), *np.full(len(own), 0.5 * ERROR), *air]
    return np.array([*units, *np.full(around, _ABSOLUTE)]), np.array([estimate, tested])


def _cooling(heating: Heating, limits: dict[str, float]) -> FloatArray:
    """How fast each state would cool at its limit, in a room and without load [K/s]: the scale of the heat that may be
    missing. A node without a limit is taken to be as hot as the hottest limit; a state that hardly cools may lack heat
    all the same, a tenth of the fastest state's; where none cools, for want of air, a tenth of what its neighbours
    would take from it, were they as cold as the room: capacities and resistances are no better known there."""
    model, hottest = heating.model, max(limits.values())
    hot = _at_limits(heating, dict.fromkeys(model.nodes, hottest) | limits)
    if not np.any(hot.rates < 0):
        return np.asarray(0.1 * np.abs(np.diag(hot.slope) * (hot.x - _ROOM)))
    cooling = np.abs(hot.rates)
    limited = [model.places.index(place) for place in limits]
    cooling[limited] = np.abs(_at_limits(heating, limits).rates)[limited]
    return np.asarray(np.maximum(cooling, 0.1 * cooling.max()))


def _by_joint(
    given: Each,
    joints: tuple[str, ...],
    table: str,
    default: float,
    *,
    least: float = 1e-12,
    infinite: bool = False,
) -> FloatArray:
    values = checked_by_place(given, joints, table, least=least, infinite=infinite)
    return np.array([values.get(joint, default) for joint in joints])


# --- stages of the horizon ----------------------------------------------------------------------


def growing_stages(period: float, horizon: float, count: int) -> FloatArray:
    """Lengths of the stages [s], shape (stages,): as long as `period` at first, `horizon` in sum.

    Args:
        period: of the controller [s]: length of the first stage.
        horizon: [s].
        count: at most so many stages; fewer where the horizon holds no more periods.

    Raises:
        ValueError: a period that is not positive, a horizon shorter than it, or no stage.
    """
    if not 0 < period <= horizon < float("inf") or count < 1:
        values = f"period {period:g} s, horizon {horizon:g} s, {count} stages"
        raise ValueError(f"found {values}; expected 0 < period <= horizon, one stage or more")
    count = min(count, max(1, round(horizon / period)))
    if count == 1:
        return np.array([horizon])
    powers = np.arange(count)
    if horizon / period <= count * (1 + 1e-9):
        return np.full(count, horizon / count)
    ratio = float(brentq(lambda r: period * float((r**powers).sum()) - horizon, 1.0, horizon / period + 1))
    lengths = period * ratio**powers
    return np.asarray(lengths * np.concatenate([[1.0], np.full(count - 1, (horizon - period) / lengths[1:].sum())]))
