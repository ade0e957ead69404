"""The variables that an FMU shows: their names, value references, units and start values."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from lptn.errors import InputError

Kind = Literal["time", "state", "rate", "input", "parameter", "output", "admissible", "forecast"]


@dataclass(frozen=True)
class Variable:
    """One variable, in SI with kelvin.

    Args:
        name: structured name.
        reference: FMI's value reference; the kinds stand one behind the other in the order of `Kind`.
        kind: what it is to the model.
        unit: unit of its value, empty where it is unknown.
        start: start value; `None` where it is calculated.
        description: what a person reads.
        celsius: whether it is a temperature (not a difference) that people see in degC.
        minimum: the least value that is taken.
        maximum: the largest value that is taken.
        hidden: whether it is inner to the component: neither input, output nor parameter.
        of: for a rate, the reference of its state.
    """

    name: str
    reference: int
    kind: Kind
    unit: str
    start: float | None
    description: str
    celsius: bool = False
    minimum: float | None = None
    maximum: float | None = None
    hidden: bool = False
    of: int | None = None

    @property
    def causality(self) -> str:
        """FMI's causality."""
        if self.kind == "time":
            return "independent"
        if self.kind in ("input", "parameter"):
            return self.kind
        return "local" if self.hidden else "output"

    @property
    def variability(self) -> str:
        """FMI's variability."""
        return "tunable" if self.kind == "parameter" else "continuous"

    @property
    def initial(self) -> str | None:
        """FMI's `initial`; `None` where the standard wants none."""
        return {"state": "exact", "parameter": "exact", "time": None, "input": None}.get(self.kind, "calculated")

    @property
    def nominal(self) -> float | None:
        """The usual size, where the default of 1 would mislead a solver."""
        return 300.0 if self.celsius else None


def refuse_twice(variables: Sequence[Variable], origin: str) -> None:
    """Refuse two variables of one name.

    Raises:
        InputError: the names of two places differ only in characters that FMI names lack.
    """
    seen: set[str] = set()
    for variable in variables:
        if variable.name in seen:
            raise InputError(origin, "names", f'two FMU variables "{variable.name}"', "places that stay apart as words")
        seen.add(variable.name)
