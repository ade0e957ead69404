"""One row of the table: what the thesis prints, what its own formula gives, what a consistent network gives."""

from __future__ import annotations

import math
from dataclasses import dataclass

REPRODUCES, DIFFERS, MISSING, DEFINITION = "reproduces", "does not reproduce", "an input is missing", "definition holds"


@dataclass(frozen=True)
class Row:
    """One number.

    Args:
        id: where the thesis prints it, such as `eq. 2.3`; letters count several from one place.
        what: the quantity in words.
        unit: its unit.
        printed: the thesis's number; `None` where it prints none.
        formula: ours by the formula as printed; `None` where an input is missing.
        network: ours by the consistent network; `None` where it has nothing to say.
        tolerance: how far `formula` may lie from `printed`: the printed number's last digit or the stated accuracy.
        note: what to know.
        most: whether the thesis only says "below" the printed number.
        r_0: the R_0 of equation 4.1 within 1447 to 1453 at which the printed number comes out, where one was sought.
    """

    id: str
    what: str
    unit: str
    printed: float | None
    formula: float | None
    network: float | None = None
    tolerance: float = 0.0
    note: str = ""
    r_0: float | None = None
    most: bool = False

    @property
    def verdict(self) -> str:
        """Whether the printed formula gives the printed number."""
        if self.formula is None:
            return MISSING
        if self.printed is None:
            return DEFINITION
        off = self.formula - self.printed
        if off < 0 if self.most else abs(off) <= self.tolerance:
            return REPRODUCES
        return DIFFERS if self.r_0 is None else f"only with R_0 = {self.r_0:.1f}"


HEADER = ("row", "quantity", "unit", "printed", "printed formula", "consistent network", "verdict", "note")


def cells(row: Row) -> tuple[str, ...]:
    """The row as text."""
    numbers = (number(value) for value in (row.printed, row.formula, row.network))
    return (row.id, row.what, row.unit, *numbers, row.verdict, row.note)


def number(value: float | None) -> str:
    """A number with four digits, a dash for none."""
    if value is None:
        return "–"
    return "never" if math.isinf(value) else f"{value:.4g}"
