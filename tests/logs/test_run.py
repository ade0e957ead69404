"""A run's own methods."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lptn.basics.errors import InputError
from lptn.logs.run import Run


@pytest.fixture
def run() -> Run:
    columns = {
        "temperature.a": np.array([20.0, 22.0, np.nan, 26.0, np.nan, np.nan, 30.0]),
        "torque.a": np.array([3.0, 4.0, 1.0, 1.0, 0.0, 2.0, 9.0]),
        "velocity.a": np.array([1.0, 3.0, 0.0, 2.0, 1.0, 1.0, 9.0]),
    }
    return Run("r", 0.1, 5.0 + 0.1 * np.arange(7.0), columns, False, "r.csv", "00", ("said.",))


def test_a_run_is_a_data_frame_on_its_own_clock(run: Run) -> None:
    frame = run.to_pandas()
    assert list(frame) == list(run.columns)
    assert frame.index.name == "time [s]"
    np.testing.assert_array_equal(frame.index, run.time)
    np.testing.assert_array_equal(frame["torque.a"], run.columns["torque.a"])
    since_1970 = replace(run, time=run.time + 1.74e9).to_pandas()
    assert str(since_1970.index[0]) == "2025-02-19 21:20:05+00:00"


def test_coarsen_reduces_each_column_by_its_rule(run: Run) -> None:
    coarse = run.coarsen(2)
    assert len(coarse) == 3
    assert coarse.averaged
    assert coarse.step == pytest.approx(0.2)
    np.testing.assert_allclose(coarse.time, [5.0, 5.2, 5.4])
    # Readings are joined by straight lines; nothing is said of a block in which none was read.
    np.testing.assert_allclose(coarse.temperature("a"), [22.0, (25.0 + 80.0 / 3) / 2, np.nan])
    np.testing.assert_allclose(coarse.columns["torque.a"], [np.sqrt(12.5), 1.0, np.sqrt(2.0)])
    np.testing.assert_allclose(coarse.columns["velocity.a"], [2.0, 1.0, 1.0])
    assert coarse.notes == ("said.",)


def test_coarsen_keeps_what_was_read_more_seldom_than_there_are_steps(run: Run) -> None:
    warms = np.where(np.arange(40) % 3 == 1, 20.0 + np.arange(40), np.nan)
    seldom = replace(run, step=1.0, time=np.arange(40.0), columns={"temperature.a": warms})
    coarse = seldom.coarsen(5)
    inside = coarse.time[1:-1]
    np.testing.assert_allclose(coarse.temperature("a")[1:-1], 20.0 + inside + 2.5)


def test_coarsen_by_one_changes_nothing(run: Run) -> None:
    assert run.coarsen(1) is run


def test_slice_takes_whole_steps_despite_rounding(run: Run) -> None:
    part = run.slice(5.3, 5.6)  # 5.0 + 0.1 * 3 is above 5.3 by rounding, 5.0 + 0.1 * 6 is 5.6
    np.testing.assert_allclose(part.time, [5.3, 5.4, 5.5])
    np.testing.assert_array_equal(part.columns["torque.a"], [1.0, 0.0, 2.0])


@pytest.mark.parametrize("factor", [0, 8])
def test_an_impossible_factor_is_refused(run: Run, factor: int) -> None:
    with pytest.raises(InputError, match=f"r.csv: coarsen: found factor {factor}; expected a whole number"):
        run.coarsen(factor)


def test_an_empty_window_is_refused(run: Run) -> None:
    with pytest.raises(InputError, match=r"time window 9 to 10 s: found no data in it; expected 5 to 5.7 s"):
        run.slice(9.0, 10.0)


def test_an_unmeasured_place_is_refused(run: Run) -> None:
    assert run.has("temperature.a")
    assert not run.has("temperature.b")
    with pytest.raises(InputError, match=r"column temperature.b: .* one of: temperature.a"):
        run.temperature("b")
