"""A parameter: its name, value, unit, bounds, off-value, and who has it in common."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError

Share = Literal["each", "class", "sides", "all"]
Scale = Literal["", "capacity", "conductance", "resistance", "link"]
"""What the usual size of a parameter goes with, from a gram of copper to a wall; `""` for what is the same at both."""
LARGEST = 1e12
"""In any unit: the bound of a size that nature does not bound; priors say what is plausible, and not bounds."""


@dataclass(frozen=True)
class Parameter:
    """A number of the model as it is declared, before it is spread over places.

    Args:
        name: the key under which model files give it.
        value: its value where nothing else is said, in `unit`.
        unit: SI unit, as people write it (`"K/W"`).
        bounds: least and largest possible value: what is usual `typical` says. A positive lower bound makes the fit
            work with the logarithm.
        off: the value at which the effect vanishes exactly; `None` for a parameter that can't switch
            its effect off (a shape, a data-sheet number).
        typical: the size at which the effect is usually met, at a robot's joint; scales the search. By default its
            value, 1 where that is 0.
        title: what a person calls it.
        fixed: `True` keeps the fit away from it.
        share: who has it in common.
        on: the value it is held at once the effect is added, for an amplitude that is all or nothing.
        grid: shapes at which the effect is scored before one is fitted (time constants, exponents).
        prior: mean and standard deviation, in `unit`, of what is known of it beforehand, as a data sheet and its
            tolerance are; a fit weighs it with the data. `None` where only they speak.
        relative_to: what that size goes with at other places (`lptn.model.sizes`): a place's heat `"capacity"`, its
            `"conductance"` or its `"resistance"` to all around it, or the conductance of the `"link"` that is changed.

    Raises:
        ValueError: bounds in the wrong order, a value or the prior's mean outside them, or a standard deviation that is
            not above 0.

    Example:
        >>> import lptn
        >>> lptn.Parameter("capacity", 300.0, "J/K", bounds=(20.0, 3000.0), share="class").value
        300.0
    """

    name: str
    value: float
    unit: str
    bounds: tuple[float, float] = (-math.inf, math.inf)
    off: float | None = None
    typical: float = math.nan
    title: str = ""
    fixed: bool = False
    share: Share = "each"
    on: float | None = None
    grid: tuple[float, ...] = ()
    prior: tuple[float, float] | None = None
    relative_to: Scale = ""

    def __post_init__(self) -> None:
        if math.isnan(self.typical):
            object.__setattr__(self, "typical", abs(self.value) or 1.0)
        lower, upper = self.bounds
        if not lower <= upper:
            raise ValueError(f"{self.name}: bounds {lower:g} to {upper:g} are in the wrong order")
        if not lower <= self.value <= upper:
            raise ValueError(f"{self.name}: value {self.value:g} lies outside its bounds {lower:g} to {upper:g}")
        if self.prior is not None:
            mean, deviation = self.prior
            if not lower <= mean <= upper:
                raise ValueError(
                    f"{self.name}: mean {mean:g} of its prior lies outside its bounds {lower:g} to {upper:g}"
                )
            if not deviation > 0:
                raise ValueError(
                    f"{self.name}: standard deviation {deviation:g} of its prior, where more than 0 is asked"
                )

    @property
    def unit_behind(self) -> str:
        """What stands behind a number in its unit: a space and the unit, nothing for a plain number."""
        return "" if self.unit == "1" else f" {self.unit}"

    @property
    def one_sided(self) -> bool:
        """Whether it can't be below where its effect is off."""
        return self.off == self.bounds[0]

    @property
    def ends_by_nature(self) -> tuple[float, ...]:
        """Of its bounds those that nobody chose: where its effect vanishes, where a share is all or gone."""
        is_share = self.unit == "1" and self.off == 0.0
        return tuple(end for end in self.bounds if end == self.off or (is_share and abs(end) == 1.0))

    @property
    def switched_off(self) -> Parameter:
        """The same parameter at its off-value; unchanged where it has none."""
        return self if self.off is None else replace(self, value=self.off)

    @property
    def switched_on(self) -> Parameter:
        """The same parameter as a newly added effect starts with it."""
        if self.off is None:
            return self
        return replace(self, value=self.typical) if self.on is None else replace(self, value=self.on, fixed=True)


_NEAR_ZERO = 0.1  # of the typical size: below it what may be 0, or a conductance, is searched in even steps


@dataclass(frozen=True)
class Setting:
    """What somebody sets of a parameter; `None` leaves it as it is.

    Args:
        name: of the parameter, `"resistance.FR_hip~ambient"`.
        value: in its SI unit; where a free parameter's search starts, or what a fixed one is.
        bounds: least and largest possible value, in its SI unit.
        fixed: `True` keeps fits away from it.
    """

    name: str
    value: float | None = None
    bounds: tuple[float, float] | None = None
    fixed: bool | None = None

    def of(self, declared: Parameter) -> Parameter:
        """The parameter so set; a value that only new bounds exclude is moved to the nearer one.

        Raises:
            InputError: bounds in the wrong order, or a value outside them.
        """
        lower, upper = declared.bounds if self.bounds is None else self.bounds
        value = min(max(declared.value, lower), upper) if self.value is None else self.value
        if not lower <= value <= upper:
            problem = f"{value:g}{declared.unit_behind} with bounds {lower:g} to {upper:g}"
            raise InputError(
                "parameter", self.name, problem, "the lower bound, the value and the upper bound in this order"
            )
        fixed = declared.fixed if self.fixed is None else self.fixed
        return replace(declared, value=value, bounds=(lower, upper), fixed=fixed)


@dataclass(frozen=True)
class ParameterInstance:
    """One number of a model: a parameter at the place, or group of places, that owns it.

    Args:
        declared: the parameter, with its value here.
        owner: a node, an edge, a class or a pattern; for an effect of one run with the run behind it.
        effect: name of the effect that it belongs to; `""` for a node's or a link's own.
        mirrored: who owns it on the robot's other side, when it is shared by "sides".
    """

    declared: Parameter
    owner: str
    effect: str = ""
    mirrored: str = ""

    @cached_property
    def name(self) -> str:
        """`"<parameter>.<owner>"`, for an effect `"<effect>.<parameter>.<owner>"`."""
        return self._of(self.owner)

    @property
    def mirror(self) -> str | None:
        """The name of the same parameter on the robot's other side, where the sides have it in common."""
        return self._of(self.mirrored) if self.mirrored else None

    def _of(self, owner: str) -> str:
        own = f"{self.declared.name}.{owner}"
        return f"{self.effect}.{own}" if self.effect else own

    @property
    def value(self) -> float:
        """Value in the parameter's unit."""
        return self.declared.value

    @property
    def free(self) -> bool:
        """Whether the fit may change it."""
        return not self.declared.fixed

    @property
    def logarithmic(self) -> bool:
        """Whether the fit works with its logarithm; degrees Celsius have no natural zero."""
        return self.declared.bounds[0] > 0 and self.declared.unit != "degC"

    @property
    def resistance(self) -> bool:
        """Whether it is a thermal resistance, whose conductance may be none."""
        return self.logarithmic and self.declared.unit == "K/W"


class Transform:
    """Between parameter values and the well-scaled coordinates in which a fit searches.

    A positive parameter is searched by its logarithm, one that may be 0 by the inverse hyperbolic sine, which goes
    over into the logarithm far above it, any other by its share of the typical size. Multiplying all capacitances,
    conductances and heat by one factor changes hardly a temperature: along logarithms that valley is straight. A
    thermal resistance is searched by its conductance so, which may be none: along its own logarithm a search that
    once took a link away would see no slope that leads back.

    Args:
        parameters: the m parameters, in order.
    """

    def __init__(self, parameters: Sequence[ParameterInstance]) -> None:
        self._resistance = np.array([parameter.resistance for parameter in parameters], dtype=bool)
        self._log = np.array([parameter.logarithmic for parameter in parameters], dtype=bool) & ~self._resistance
        zero = np.array([parameter.declared.bounds[0] == 0 for parameter in parameters], dtype=bool)
        self._from_zero = zero & ~self._log & ~self._resistance
        typical = np.array([abs(parameter.declared.typical) or 1.0 for parameter in parameters])
        self._scale = np.where(self._from_zero, _NEAR_ZERO * typical, typical)
        self._scale = np.where(self._resistance, typical / _NEAR_ZERO, self._scale)

    def forward(self, values: FloatArray) -> FloatArray:
        """Coordinates, shape (m,), of parameter values, shape (m,)."""
        shares = values / self._scale
        logarithms = np.log(np.where(self._log, values, 1.0))
        conductances = 1.0 / np.where(self._resistance, shares, 1.0)
        curved = np.where(self._resistance, -np.arcsinh(conductances), np.arcsinh(shares))
        return np.where(self._log, logarithms, np.where(self._from_zero | self._resistance, curved, shares))

    def backward(self, coordinates: FloatArray) -> FloatArray:
        """Parameter values, shape (m,), of coordinates, shape (m,)."""
        positive = np.exp(np.where(self._log, coordinates, 0.0))
        from_zero = np.sinh(np.where(self._from_zero, coordinates, 0.0))
        shares = np.where(self._from_zero, from_zero, coordinates)
        nearly_none = -1e-12  # coordinate of a resistance without end, whose square a computer still can hold
        with np.errstate(over="ignore"):  # a search may try what no computer holds
            conductances = np.sinh(-np.where(self._resistance, np.minimum(coordinates, nearly_none), -1.0))
        return np.where(self._log, positive, self._scale * np.where(self._resistance, 1.0 / conductances, shares))

    def expression(self, place: int, coordinate: Any) -> Any:
        """One parameter's value as an expression of its coordinate, which has methods `exp` and `sinh` as CasADi's."""
        if self._log[place]:
            return coordinate.exp()
        if self._resistance[place]:
            return float(self._scale[place]) / (-coordinate).sinh()
        return float(self._scale[place]) * (coordinate.sinh() if self._from_zero[place] else coordinate)

    def slope(self, values: FloatArray) -> FloatArray:
        """d value / d coordinate, shape (m,)."""
        of_resistances = values * np.hypot(1.0, values / self._scale)
        straight = np.where(self._from_zero, np.hypot(values, self._scale), self._scale)
        return np.where(self._log, values, np.where(self._resistance, of_resistances, straight))
