"""A log opened by its path: one file or folder, or two logs of one run that are joined."""

from __future__ import annotations

import re
from collections.abc import Mapping
from pathlib import Path

from lptn.errors import InputError
from lptn.logs.columns import ColumnSource
from lptn.logs.tables import Table, open_table

_PAIR = re.compile(r"(?P<first>.+?)\+(?P<second>[^+]+?)(?:@(?P<shift>[-+]?\d+(?:\.\d+)?))?")
_ENDINGS = (".gz", ".csv", ".parquet", ".mcap", ".db3", ".ulg", ".ulog")


def open_log(path: Path, columns: Mapping[str, ColumnSource]) -> tuple[Table, dict[str, ColumnSource]]:
    """Open what a path names, and give the mapping that is left for it.

    Args:
        path: a log; or two logs of one run, `a.csv+b.csv`, joined on the onset of heating, or with the second's clock
            set forward by so many seconds, `a.csv+b.csv@12.5`.
        columns: where the quantities stand.

    Raises:
        InputError: a log can't be opened, or the two can't be joined.
    """
    pair = pair_of(path)
    if pair is None:
        return open_table(path), dict(columns)
    from lptn.logs.joining import join

    first, second, shift = pair
    return join(path, open_table(first), open_table(second), shift, columns)


def pair_of(path: Path) -> tuple[Path, Path, float | None] | None:
    """The two logs that a path `a.csv+b.csv` names, and the shift that it gives; `None` for the path of one log.

    The second is looked for beside the first, and then where its own path says. Where neither is found it is one path.

    Raises:
        InputError: more than two are named.
    """
    if path.exists() or "+" not in str(path):
        return None
    match = _PAIR.fullmatch(str(path))
    if match is None:
        return None
    if "+" in match["first"] and not Path(match["first"]).exists():
        raise InputError(path, "log", "more than two logs joined by +", "two: LOG+OTHER")
    first, second, shift = Path(match["first"]), Path(match["second"]), match["shift"]
    beside = first.parent / second
    second = beside if beside.exists() else second
    if not first.exists() and not second.exists():  # a + in the name of a folder, and no such file in it
        return None
    return first, second, None if shift is None else float(shift)


def run_name(path: Path) -> str:
    """What a run of this log is called: the file's name without its ending; of two, the first's."""
    pair = pair_of(path)
    name = (pair[0] if pair else path).name
    if (pair[0] if pair else path).is_dir():
        return name
    name = name.removesuffix(".gz")
    return name.rpartition(".")[0] if name.endswith(_ENDINGS) else name
