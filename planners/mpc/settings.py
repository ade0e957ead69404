"""What a thermal controller is told once: limits, grid, weights, margins; checked, and spread over a model's places."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.places import matching

from .grid import growing_stages
from .heat import Heating

Each = float | Mapping[str, float]
"""One number for all places, or numbers by name or pattern (`"*_calf"`); what stands later wins."""

_ROOM = 25.0  # degC
_SLACK_LINEAR, _SLACK_QUADRATIC = 10.0, 10.0  # per K and K² at one stage; admitting nothing at all costs 1


@dataclass(frozen=True)
class Settings:
    """Settings spread over a model's places.

    Args:
        stages: lengths [s], shape (stages,).
        limits: degC by node; the margin is not taken off yet.
        margin: K that planning stays below each limit.
        weights: of a squared deviation of each joint, shape (joints,).
        currents: limits [A], shape (joints,), infinite for none.
        rates: largest change of the request's unit per second, shape (joints,), 0 for none.
        recovery: s that a node above its limit may take to come down to it.
        noise: of a reading, standard deviation [K].
        model_error: relative; 0: readings are taken as they are, and nothing is learnt of what the model lacks.
        doubt: heat that the model may lack, as a rate of each state [K/s].
        tolerance: on the duality gap; the cost of admitting nothing is 1.
        iterations: of the solver, at most.
    """

    stages: FloatArray
    limits: dict[str, float]
    margin: float
    weights: FloatArray
    currents: FloatArray
    rates: FloatArray
    recovery: float
    noise: float
    model_error: float
    doubt: FloatArray
    tolerance: float = 1e-6
    iterations: int = 80

    @property
    def planned_limits(self) -> FloatArray:
        """Limits with the margin off [degC], shape (limited nodes,)."""
        return np.array(list(self.limits.values())) - self.margin

    def limits_from(self, start: FloatArray) -> FloatArray:
        """Limits at the stages' ends [degC], shape (limited nodes, stages), with the recovery from a start [degC]."""
        ends, limits = np.cumsum(self.stages), self.planned_limits[:, None]
        left = np.maximum(0.0, 1 - ends / self.recovery) if self.recovery > 0 else np.zeros_like(ends)
        return np.asarray(limits + left * np.maximum(start[:, None] - limits, 0.0))

    @property
    def prices(self) -> tuple[float, float]:
        """Of slack, linear [1/K] and quadratic [1/K²]."""
        return _SLACK_LINEAR, _SLACK_QUADRATIC


def settle(
    heating: Heating,
    limits: Each,
    *,
    period: float,
    horizon: float,
    stages: int,
    margin: float,
    weights: Each,
    current_limits: Each,
    rates: Each,
    recovery: float,
    noise: float,
    model_error: float,
) -> Settings:
    """Check settings and spread them.

    Raises:
        InputError: an unknown place, or a number that can't be used.
        ValueError: period, horizon or number of stages can't be.
    """
    model = heating.model
    bounds = spread(limits, model.nodes, "limits")
    if not bounds:
        raise InputError(model.network.origin, "limits", "none", f"a limit for one of {', '.join(model.nodes)}")
    for place, value, least in (
        ("margin", margin, 0.0),
        ("recovery", recovery, 0.0),
        ("noise", noise, 0.0),
        ("model_error", model_error, 0.0),
    ):
        if not (math.isfinite(value) and value >= least):
            raise InputError(model.network.origin, place, f"{value:g}", "a number from 0 up")
    lengths = growing_stages(period, horizon, stages)
    joints = heating.joints
    return Settings(
        lengths,
        bounds,
        margin,
        _positive(spread(weights, joints, "weights"), joints, "weights", 1.0),
        _positive(spread(current_limits, joints, "current_limits", endless=True), joints, "current_limits", math.inf),
        _positive(spread(rates, joints, "rates", least=0.0), joints, "rates", 0.0, least=0.0),
        recovery,
        noise,
        model_error,
        model_error * _cooling(heating, bounds),
    )


def _cooling(heating: Heating, limits: dict[str, float]) -> FloatArray:
    """How fast each state would cool at its limit, in a room and without load [K/s]: the scale of the heat that may be
    missing."""
    model = heating.model
    hot = np.array([limits.get(node, max(limits.values())) for node in model.nodes])[np.array(model.owners)]
    room = np.array([_ROOM if name.startswith("temperature") else 0.0 for name in heating.conditions])
    rates = heating.rate_function()(hot, np.zeros(len(heating.joints)), room, model.values)
    found = np.abs(np.asarray(rates.full()).ravel())
    return np.asarray(np.maximum(found, 0.1 * found.max()))


def spread(
    given: Each, places: tuple[str, ...] | list[str], what: str, *, endless: bool = False, least: float = -273.15
) -> dict[str, float]:
    """Numbers by place, in the places' order.

    Raises:
        InputError: a pattern that matches nothing, or no number.
    """
    pairs = given if isinstance(given, Mapping) else {"*": given}
    found: dict[str, float] = {}
    for pattern, value in pairs.items():
        names = matching(pattern, places)
        if not names:
            expected = f"one of {', '.join(places)}"
            raise InputError("settings", f"{what}.{pattern}", "a pattern that matches nothing", expected)
        number = float(value)
        if math.isnan(number) or (math.isinf(number) and not endless) or number < least:
            raise InputError("settings", f"{what}.{pattern}", f"{value}", "a number that can be used")
        found |= dict.fromkeys(names, number)
    return {place: found[place] for place in places if place in found}


def _positive(
    values: dict[str, float], places: tuple[str, ...], what: str, default: float, least: float = 1e-12
) -> FloatArray:
    for place, value in values.items():
        if value < least:
            raise InputError("settings", f"{what}.{place}", f"{value:g}", "a positive number")
    return np.array([values.get(place, default) for place in places])
