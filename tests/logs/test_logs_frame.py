"""Logs that are data frames already."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.basics.errors import InputError
from lptn.logs.reading import read_log


def frame(rows: int = 60) -> pd.DataFrame:
    """A joint that warms by 0.01 K/s."""
    time = np.arange(rows, dtype=float)
    return pd.DataFrame({"time": time, "temperature.knee": 20 + 0.01 * time, "current.knee": 2.0})


def test_a_data_frame_reads_like_its_file(tmp_path: Path) -> None:
    frame().to_parquet(tmp_path / "log.parquet")
    (read,) = read_log(frame(), name="log")
    (filed,) = read_log(tmp_path / "log.parquet")
    assert read.name == filed.name == "log"
    assert read.step == filed.step
    for column, values in filed.columns.items():
        np.testing.assert_array_equal(read.columns[column], values)


@pytest.mark.parametrize(
    "index",
    [
        pd.date_range("2026-01-01", periods=60, freq="1s"),
        pd.timedelta_range(0, periods=60, freq="1s"),
        pd.Index(np.arange(60.0), name="time"),
    ],
    ids=["dates", "durations", "named"],
)
def test_an_index_of_times_is_the_time(index: pd.Index) -> None:
    indexed = frame().drop(columns="time").set_index(index)
    (run,) = read_log(indexed)
    np.testing.assert_allclose(np.diff(run.time), 1.0)
    np.testing.assert_array_equal(run.columns["temperature.knee"], read_log(frame())[0].columns["temperature.knee"])


def test_the_digest_tells_frames_apart_and_knows_the_same_again() -> None:
    other = frame()
    other.loc[3, "current.knee"] = 2.5
    assert read_log(frame())[0].fingerprint == read_log(frame())[0].fingerprint
    assert read_log(frame())[0].fingerprint != read_log(other)[0].fingerprint


@pytest.mark.parametrize(
    ("broken", "place"),
    [
        (frame().drop(columns="time"), "column time"),
        (frame().iloc[:0], "log"),
        (frame().set_axis(pd.MultiIndex.from_product([["a"], range(3)]), axis="columns"), "columns"),
        (frame().assign(**{"current.knee": "two"}), "row 1, column 'current.knee'"),
    ],
)
def test_a_frame_that_is_no_log_is_refused(broken: pd.DataFrame, place: str) -> None:
    with pytest.raises(InputError, match="monday") as refused:
        read_log(broken, name="monday")
    assert place in str(refused.value)
