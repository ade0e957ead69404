"""The sources' rows beside ours: `python -m tests.sources`; `--fast` without the slow ones, `-o PAGE.md` as a page.

On a page that is there, rows that were not worked out stay as they are. Exits 1 where a row falls short.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from lptn.basics.files import write_whole
from tests.sources.table import NOT_RUN, Line, evaluate, page, rows, text


def main(arguments: Sequence[str] | None = None) -> int:
    """Work out, print, perhaps write the page; 1 where a row falls short."""
    parser = argparse.ArgumentParser(prog="python -m tests.sources", description=__doc__)
    parser.add_argument("--fast", action="store_true", help="leave out the rows that take minutes")
    parser.add_argument("--only", nargs="+", metavar="ROW", help="these rows only, such as S1-N7")
    parser.add_argument("-o", "--output", type=Path, help="write the page (Markdown) too, or renew its rows")
    given = parser.parse_args(arguments)
    chosen = rows() if given.only is None else [row for row in rows() if row.id in given.only]
    lines: list[Line] = []
    for row in chosen:
        lines.append(evaluate(row, given.fast))
        print(text(lines[-1]), flush=True)
    short = [line.row.id for line in lines if line.short]
    left = sum(line.verdict == NOT_RUN for line in lines)
    print(f"{len(lines)} rows, {len(short)} short{': ' if short else ''}{', '.join(short)}; {left} not run")
    if given.output is not None:
        old = given.output.read_text(encoding="utf-8") if given.output.is_file() else ""
        write_whole(given.output, page(lines, old))
    return 1 if short else 0


if __name__ == "__main__":
    sys.exit(main())
