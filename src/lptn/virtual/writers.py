"""Write logs to files, whole or not at all."""

from __future__ import annotations

import os
import secrets
from collections.abc import Mapping
from pathlib import Path
from typing import Literal, get_args

import pandas as pd

from .robot import check_one_of

Format = Literal["parquet", "csv"]


def write_logs(
    folder: str | Path,
    logs: Mapping[str, pd.DataFrame],
    format: Format = "parquet",  # noqa: A002
) -> list[Path]:
    """Write each log to ``<folder>/<name>.<format>``; makes the folder, replaces files that stand there.

    Args:
        folder: where to.
        logs: by their names.
        format: "parquet" or "csv".

    Returns:
        The files, in the order of the logs.

    Raises:
        ValueError: unknown format.
        OSError: the folder can't be written to.
    """
    check_one_of("format", format, get_args(Format))
    folder, files = Path(folder), []
    for name, log in logs.items():
        folder.mkdir(parents=True, exist_ok=True)
        file = folder / f"{name}.{format}"
        half = file.with_name(f".{file.name[:48]}.{secrets.token_hex(6)}.part")  # two processes may write one log
        try:
            if format == "csv":
                log.to_csv(half, index=False, float_format="%.7g")
            else:
                # Measured values repeat too rarely for a dictionary to pay.
                log.to_parquet(half, index=False, compression="zstd", use_dictionary=False)
            # Forced to the disk, so that its new name never stands for less than the whole.
            with half.open("rb+") as opened:
                os.fsync(opened.fileno())
            half.replace(file)
        finally:
            half.unlink(missing_ok=True)
        files.append(file)
    return files
