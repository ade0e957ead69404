"""Something about a log's column that can't be right, or hardly, and what would correct it."""

from __future__ import annotations

from dataclasses import dataclass

from lptn.logs.columns import ColumnSource


@dataclass(frozen=True)
class Issue:
    """Something about a column that can't be right, or hardly.

    Attributes:
        key: the quantity, `temperature.FR_calf`.
        column: its name in the file.
        problem: what is odd.
        remedy: what to write, or to do.
        certain: it can't be right as it is read.
        corrected: the entry of [columns] that the remedy proposes, if it proposes one.
        kind: of what is odd: "unit", "counts", "wrap", "code", "spike", "frozen", "clamped", "dead", "disconnected",
            "interpolated", "held", "few", "duplicate", "exchanged", "offset", "follows", "size", "sign".
        stretch: s, the first and last time of what is odd; all of the log by default.
    """

    key: str
    column: str
    problem: str
    remedy: str
    certain: bool = False
    corrected: ColumnSource | None = None
    kind: str = "unit"
    stretch: tuple[float, float] | None = None

    @property
    def sentence(self) -> str:
        """As a note of a run."""
        return f"{self.key}: {self.problem}; {self.remedy}."

    @property
    def error(self) -> tuple[str, str, str]:
        """Place, found and expected of the InputError that refuses the column."""
        return f"column '{self.column}'", self.problem, f"plausible values: {self.remedy}"
