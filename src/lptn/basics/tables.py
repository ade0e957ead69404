"""Results that people hold: a short line as `repr`, a table in a terminal, a notebook and pandas, or a file."""

from __future__ import annotations

import io
from abc import ABC, abstractmethod
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from lptn.basics.files import TABLES, check_ending, write_whole

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
        return f"<p>{escape(self.summary)}</p>\n{rows_html(table) if len(table) else ''}"


def rows_html(table: pd.DataFrame) -> str:
    """A table as HTML."""
    rows = table.to_html(index=False, na_rep="–", border=0, float_format=lambda value: f"{value:.{_DIGITS}g}")
    return str(rows)


# --- Tables as files ------------------------------------------------------------------------------


def write_table(path: Path, table: pd.DataFrame, digits: int | None = None) -> None:
    """Write a table whole, without its index.

    Args:
        path: its ending says how.
        table: to write.
        digits: significant ones of numbers in a `.csv`; as many as they have by default.

    Raises:
        InputError: the file name ends in neither `.csv` nor `.parquet`, or can't be written.
    """
    check_ending(path, *TABLES)
    if path.suffix.lower() == ".csv":
        write_whole(path, table.to_csv(index=False, float_format=f"%.{digits}g" if digits else None))
    else:
        buffer = io.BytesIO()
        table.to_parquet(buffer, index=False)
        write_whole(path, buffer.getvalue())
