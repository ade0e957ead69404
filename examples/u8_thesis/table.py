"""Every number of the thesis beside ours: `python examples/u8_thesis/table.py` (add a file name for CSV)."""

from __future__ import annotations

import csv
import io
import sys
from functools import cache
from pathlib import Path

import rows_formulas
import rows_thermal
from circuits import Circuit, two_nodes
from facts import RECOMMENDED, STATOR, fit_two_nodes
from row import HEADER, Row, cells

from lptn.basics.files import write_whole


@cache
def networks() -> tuple[Circuit, Circuit, Circuit, Circuit]:
    """Two nodes from the four unaltered facts; three nodes without sink, with it, with fan from all facts."""
    return two_nodes(*fit_two_nodes()), *STATOR.build(RECOMMENDED)


@cache
def table() -> tuple[Row, ...]:
    """All rows."""
    unaltered, *with_sink = networks()
    return (*rows_formulas.rows(unaltered), *rows_thermal.rows(unaltered, *with_sink))


def main(output: Path | None = None) -> None:
    """Print the table, or write it as CSV."""
    lines = [HEADER, *(cells(row) for row in table())]
    if output is not None:
        text = io.StringIO()
        csv.writer(text).writerows(lines)
        write_whole(output, text.getvalue())
        return
    widths = [max(len(line[column]) for line in lines) for column in range(len(HEADER) - 1)]
    for line in lines:
        print("  ".join([*(text.ljust(width) for text, width in zip(line, widths, strict=False)), line[-1]]).rstrip())


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else None)
