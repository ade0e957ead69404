"""Something about a log's column that can't be right, or hardly, and what would correct it."""

from __future__ import annotations

from dataclasses import dataclass, replace

from lptn.logs.columns import ColumnSource, as_line_or_option, column_unit


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
            "held", "few", "duplicate", "exchanged", "offset", "follows", "size", "sign".
        stretch: s, the first and last time of what is odd; all of the log by default.
    """

    key: str
    column: str
    problem: str
    remedy: str
    certain: bool
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


def correctable(
    key: str, problem: str, corrected: ColumnSource, certain: bool, remedy: str = "write {}", kind: str = "unit"
) -> Issue:
    """An issue whose remedy is an entry of [columns], put into the text `remedy`."""
    remedy = remedy.replace("{}", as_line_or_option(key, corrected))
    return Issue(key, corrected.columns[0], problem, remedy, certain, corrected, kind)


def in_unit(key: str, source: ColumnSource, unit: str, problem: str, certain: bool = True) -> Issue:
    """The issue that a column seems to be in `unit`."""
    remedy = f"write {{}}; if it is {column_unit(key)} all the same, say so as its unit"
    return correctable(key, problem, replace(source, unit=unit), certain, remedy)
