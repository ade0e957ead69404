"""Predicted temperatures written as a log that can be read again."""

from __future__ import annotations

import io
from pathlib import Path

import numpy as np
import pandas as pd

from lptn.compare import Comparison
from lptn.errors import InputError
from lptn.files import write_whole


def check_ending(path: Path) -> None:
    """Refuse a kind of table that can't be written.

    Raises:
        InputError: the file name ends in neither `.csv` nor `.parquet`.
    """
    if path.suffix not in (".csv", ".parquet"):
        raise InputError(path, "--output", f"a file name ending in '{path.suffix}'", "one ending in .csv or .parquet")


def write_predictions(comparison: Comparison, path: Path) -> None:
    """Write time [s], each node's predicted reading [degC] and the inputs, runs one after the other.

    Raises:
        InputError: the file name ends in neither `.csv` nor `.parquet`, or can't be written.
    """
    check_ending(path)
    tables = []
    for prediction in comparison.predictions:
        columns = {"time": prediction.drive.run.time}
        for node, readings in zip(comparison.model.nodes, prediction.readings, strict=True):
            columns[f"temperature.{node}"] = readings
        for column, values in zip(comparison.model.inputs, prediction.drive.inputs, strict=True):
            columns.setdefault(column, values)
        tables.append(pd.DataFrame(columns))
    table = pd.concat(tables, ignore_index=True)
    if path.suffix == ".csv":
        write_whole(path, table.to_csv(index=False, float_format="%.6g"))
    else:
        buffer = io.BytesIO()
        table.astype(np.float64).to_parquet(buffer, index=False)
        write_whole(path, buffer.getvalue())
