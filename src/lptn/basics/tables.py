"""Results that people hold: a short line as `repr`, a table in a terminal, a notebook and pandas."""

from __future__ import annotations

from abc import ABC, abstractmethod
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

_DIGITS = 3  # significant digits of numbers in a printed table; `to_pandas()` keeps all


class Tabular(ABC):
    """A result with a one-line summary and a table."""

    @property
    @abstractmethod
    def summary(self) -> str:
        """The result in one line."""

    @abstractmethod
    def to_pandas(self) -> pd.DataFrame:
        """The result as a data frame, in full precision; units are in the names of the columns."""

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.summary}>"

    def __str__(self) -> str:
        table = self.to_pandas()
        if table.empty:
            return self.summary
        text = table.to_string(index=False, na_rep="–", float_format=lambda value: f"{value:.{_DIGITS}g}")
        return f"{self.summary}\n\n{text}"

    def _repr_html_(self) -> str:
        table = self.to_pandas()
        rows = table.to_html(index=False, na_rep="–", border=0, float_format=lambda value: f"{value:.{_DIGITS}g}")
        return f"<p>{escape(self.summary)}</p>\n{rows if len(table) else ''}"
