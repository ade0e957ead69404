"""Where a plan goes: a table, and a folder of C code."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lptn.basics.errors import InputError
from lptn.basics.files import write_whole

from .kind import EmitsC, Kind

if TYPE_CHECKING:
    from pandas import DataFrame


def check_table(path: Path | None) -> None:
    """Refuse a kind of table that can't be written.

    Raises:
        InputError: the file name ends in neither .csv nor .parquet.
    """
    if path is not None and path.suffix.lower() not in (".csv", ".parquet"):
        raise InputError(path, "--output", f"a file name ending in '{path.suffix}'", "one ending in .csv or .parquet")


def write_table(table: DataFrame, path: Path) -> None:
    """Write a plan's table, whole or not at all."""
    if path.suffix.lower() == ".csv":
        write_whole(path, table.to_csv(index=False))
        return
    content = io.BytesIO()
    table.to_parquet(content, index=False)
    write_whole(path, content.getvalue())


def check_folder(folder: Path | None, kind: Kind[Any], origin: str) -> None:
    """Refuse a folder for C code that can't be made, and a kind of task that has no C code.

    Raises:
        InputError: it is a file, or lies in no folder; or the kind has no C code.
    """
    if folder is None:
        return
    if not isinstance(kind, EmitsC):
        raise InputError(origin, "--emit-c", "a kind of task without a controller step", 'kind = "track" or "limit"')
    if folder.exists() and not folder.is_dir():
        raise InputError(folder, "--emit-c", "a file", "a folder")
    if not folder.absolute().parent.is_dir():
        raise InputError(folder, "--emit-c", "no such folder", "a folder in one that exists")


def write_c(kind: Kind[Any], task: Any, folder: Path) -> None:
    """Write a kind's C code into a folder that `check_folder` has passed."""
    if isinstance(kind, EmitsC):
        for path in kind.emit_c(task, folder):
            print(f"wrote {path}")
