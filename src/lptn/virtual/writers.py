"""Write logs to files, whole or not at all, in pieces that need not fit into memory together."""

from __future__ import annotations

import os
import secrets
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Literal, get_args

import pandas as pd

Format = Literal["parquet", "csv", "mcap"]


def write_logs(
    folder: str | Path,
    logs: Mapping[str, pd.DataFrame],
    format: Format = "parquet",  # noqa: A002
) -> list[Path]:
    """Write each log to ``<folder>/<name>.<format>``; makes the folder, replaces files that stand there.

    Returns:
        The files, in the order of the logs.

    Raises:
        ValueError: unknown format, or "mcap" without the package rosbags.
        OSError: the folder can't be written to.
    """
    return write_pieces(folder, ((name, (table,)) for name, table in logs.items()), format)


def write_pieces(
    folder: str | Path,
    logs: Iterable[tuple[str, Iterable[pd.DataFrame]]],
    format: Format = "parquet",  # noqa: A002
) -> list[Path]:
    """Write logs whose rows come in pieces, as ``write_logs`` does; only one piece is held at a time.

    Raises:
        ValueError: unknown format, or "mcap" without the package rosbags.
        OSError: the folder can't be written to.
    """
    write = _writer(format)
    folder = Path(folder)
    files = []
    for name, pieces in logs:
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / f"{name}.{format}"
        half = file.with_name(f".{file.name[:48]}.{secrets.token_hex(6)}.part")  # two processes may write one log
        try:
            write(pieces, half)
            _to_the_disk(half)
            half.replace(file)
        finally:
            half.unlink(missing_ok=True)
        files.append(file)
    return files


def _to_the_disk(file: Path) -> None:
    """Force a file to the disk, so that its new name never stands for less than the whole."""
    with file.open("rb+") as stream:
        os.fsync(stream.fileno())


def _writer(format: str) -> Callable[[Iterable[pd.DataFrame], Path], None]:  # noqa: A002
    if format not in get_args(Format):
        raise ValueError(f"format: found {format!r}; expected one of {', '.join(get_args(Format))}")
    if format == "mcap":
        from . import mcap

        mcap.check_installed()
        return mcap.write
    return {"parquet": _write_parquet, "csv": _write_csv}[format]


def _write_parquet(pieces: Iterable[pd.DataFrame], file: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    writer = None
    try:
        for piece in pieces:
            table = pa.Table.from_pandas(piece, preserve_index=False)
            # Measured values repeat too rarely for a dictionary to pay.
            writer = writer or pq.ParquetWriter(file, table.schema, compression="zstd", use_dictionary=False)
            writer.write_table(table)
    finally:
        if writer:
            writer.close()


def _write_csv(pieces: Iterable[pd.DataFrame], file: Path) -> None:
    with file.open("w", encoding="utf-8", newline="") as out:
        for k, piece in enumerate(pieces):
            piece.to_csv(out, index=False, header=k == 0, float_format="%.7g")
