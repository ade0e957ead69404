"""Variables and constraints of a nonlinear program as they are gathered, by name, and what a solver found."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import casadi as ca
import numpy as np

from lptn.arrays import BoolArray, FloatArray


@dataclass
class Program:
    """Scalars that are sought, with start and bounds, and expressions that must be zero, or at most zero."""

    names: list[str] = field(default_factory=list)
    symbols: list[Any] = field(default_factory=list)
    starts: list[float] = field(default_factory=list)
    lowers: list[float] = field(default_factory=list)
    uppers: list[float] = field(default_factory=list)
    expressions: list[Any] = field(default_factory=list)
    labels: list[str] = field(default_factory=list)
    equalities: list[bool] = field(default_factory=list)

    def variable(self, name: str, start: float, lower: float, upper: float) -> Any:
        """A new variable's symbol."""
        symbol = ca.SX.sym(name)
        self.names.append(name)
        self.symbols.append(symbol)
        self.starts.append(start)
        self.lowers.append(lower)
        self.uppers.append(upper)
        return symbol

    def constrain(self, expression: Any, label: str, *, equal: bool = False) -> None:
        """Demand an expression to be at most zero, or zero."""
        rows = int(expression.shape[0])
        self.expressions.append(expression)
        self.equalities += [equal] * rows
        self.labels += [label] * rows

    def index(self, name: str) -> int:
        """Where a variable stands."""
        return self.names.index(name)

    @property
    def w(self) -> Any:
        return ca.vertcat(*self.symbols)

    @property
    def g(self) -> Any:
        return ca.vertcat(*self.expressions)

    @property
    def equal(self) -> BoolArray:
        return np.array(self.equalities)

    @property
    def start(self) -> FloatArray:
        return np.array(self.starts)

    @property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Least and greatest of each variable, fresh copies."""
        return np.array(self.lowers), np.array(self.uppers)

    def touched(self, values: FloatArray, tolerance: float) -> list[str]:
        """Labels of the inequalities that reach zero, each once."""
        rows = zip(self.labels, self.equalities, values, strict=True)
        return list(dict.fromkeys(label for label, equal, value in rows if not equal and value > -tolerance))


@dataclass(frozen=True)
class Solution:
    """What IPOPT found.

    Args:
        success: whether it converged; if not, nothing else means anything.
        status: its word.
        objective: the goal's value in its unit.
        variables: mass, volume, torque, duration, capacity, resistance.
        slack: by how much each limit was moved, in its unit.
        gradient: derivative of the goal to each parameter by name; empty unless it converged.
        binding: names of the constraints that it touches.
        states: at the ends of the elements [degC], shape (number of states, elements + 1).
        times: of those [s].
        raw: IPOPT's primal point, to start from.
    """

    success: bool
    status: str
    objective: float
    variables: dict[str, float]
    slack: dict[str, float]
    gradient: dict[str, float]
    binding: tuple[str, ...]
    states: FloatArray
    times: FloatArray
    raw: FloatArray
