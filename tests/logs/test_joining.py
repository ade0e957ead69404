"""Two logs of one run: joined on one clock, or with the second's set forward."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.logs.columns import ColumnSource
from lptn.logs.joining import ONE_CLOCK
from lptn.logs.reading import read_log

Refuse = Callable[..., str]


def files(folder: Path, shift: float) -> tuple[Path, Path]:
    """Temperatures at 2 Hz by one clock; a swinging torque at 50 Hz by another that is `shift` s behind it."""
    time = np.arange(0.0, 400.0, 0.5)
    pd.DataFrame({"clock": time, "T": 22 + 0.02 * np.maximum(time - 40, 0)}).to_csv(folder / "warm.csv", index=False)
    fast = np.arange(max(0.0, shift), 380.0, 0.02)
    torque = (fast > 40) * 10 * np.abs(np.sin(9 * fast)) * np.where(fast < 250, 1, 0.3)
    pd.DataFrame({"t_ms": (fast - shift) * 1000, "tau": torque}).to_csv(folder / "moved.csv", index=False)
    return folder / "warm.csv", folder / "moved.csv"


COLUMNS = {
    "time": ColumnSource(("clock",)),
    "time.2": ColumnSource(("t_ms",), "ms"),
    "temperature.motor": ColumnSource(("T",)),
    "torque.motor": ColumnSource(("tau",)),
}


@pytest.mark.parametrize(("shift", "said"), [(12.4, "@12.4"), (-33.3, "@-33.3"), (0.0, "@0"), (0.0, "")])
def test_the_second_clock_is_set_forward(tmp_path: Path, shift: float, said: str) -> None:
    warm, moved = files(tmp_path, shift)
    (run,) = read_log(f"{warm}+{moved}{said}", COLUMNS, step=1.0)
    assert run.name == "warm"
    # Mixed rates: RMS of the fast torque, mean of the slow temperature, on one clock.
    on = run.time[int((run.columns["torque.motor"] > 1).argmax())]
    assert on == pytest.approx(40.0, abs=1.0)
    assert run.columns["torque.motor"][(run.time > 60) & (run.time < 240)].mean() == pytest.approx(7.07, rel=0.02)
    assert run.temperature("motor")[-1] > 28
    note = f"moved.csv: its clock set forward by {shift:g} s, as given."
    assert (note in run.notes) == bool(said)


def test_the_other_way_round_the_shift_turns_its_sign(tmp_path: Path) -> None:
    warm, moved = files(tmp_path, 12.4)
    swapped = COLUMNS | {"time": COLUMNS["time.2"], "time.2": COLUMNS["time"]}
    (run,) = read_log(f"{moved}+{warm}@-12.4", swapped, step=1.0)
    assert run.time[int((run.columns["torque.motor"] > 1).argmax())] == pytest.approx(40.0 - 12.4, abs=1.0)


def test_without_a_shift_every_command_says_that_the_clocks_are_taken_for_one(tmp_path: Path) -> None:
    warm, moved = files(tmp_path, 0.0)
    (run,) = read_log(f"{warm}+{moved}", COLUMNS, step=1.0)
    (note,) = (note for note in run.notes if ONE_CLOCK in note)
    assert (
        note == f"moved.csv: its clock is taken for that of warm.csv; if it is another, write {warm}+{moved}@SECONDS."
    )


@pytest.mark.parametrize("said", ["", "@1000", "@-1000"])
def test_clocks_that_have_nothing_in_common(tmp_path: Path, refuse: Refuse, said: str) -> None:
    warm, moved = files(tmp_path, 0.0)
    table = pd.read_csv(moved)
    table.assign(t_ms=table["t_ms"] + (0 if said else 1.7e12)).to_csv(moved, index=False)
    path = f"{warm}+{moved}{said}"
    found = refuse(path, read_log, path, COLUMNS)
    assert "join: found times from 0 to 399.5 s, and from " in found
    assert (f"{path}@SECONDS" in found) == (not said)


def test_a_missing_time_is_named_by_its_file(tmp_path: Path, refuse: Refuse) -> None:
    warm, moved = files(tmp_path, 5.0)
    path = f"{warm}+{moved}"
    columns = {key: source for key, source in COLUMNS.items() if key != "time.2"}
    assert "column time.2: found no such column" in refuse(moved, read_log, path, columns)
    columns["time.2"] = ColumnSource(("t_ms",))
    said = refuse(moved, read_log, path, columns)
    assert '"time.2" = { column = "t_ms", unit = "ms" }' in said
    assert '--map "time.2=t_ms[ms]"' in said


def test_paths_that_can_not_be_joined(tmp_path: Path, refuse: Refuse) -> None:
    warm, moved = files(tmp_path, 5.0)
    path = f"{warm}+{moved}+{moved}"
    assert "more than two logs" in refuse(path, read_log, path, COLUMNS)
    missing = tmp_path / "none.csv"
    assert "no such file" in refuse(missing, read_log, f"{warm}+{missing}", COLUMNS)
    missing = tmp_path / "run+1" / "log.csv"
    assert "no such file" in refuse(missing, read_log, missing, COLUMNS)


def test_a_file_with_a_plus_in_its_name_is_one_log(tmp_path: Path) -> None:
    path = tmp_path / "a+b.csv"
    pd.DataFrame({"time": np.arange(20.0), "temperature.a": 20 + np.arange(20.0)}).to_csv(path, index=False)
    assert read_log(path)[0].name == "a+b"


def test_columns_of_one_name_are_told_apart(tmp_path: Path) -> None:
    time = np.arange(60.0)
    one = pd.DataFrame({"time": time, "temperature.a": 20 + time, "x": 1.0})
    other = pd.DataFrame({"time": time, "torque.a": 1.0, "x": 2.0})
    one.to_csv(tmp_path / "one.csv", index=False)
    other.to_csv(tmp_path / "other.csv", index=False)
    columns = {"power.one": ColumnSource(("x",)), "power.other": ColumnSource(("x:2",))}
    (run,) = read_log(tmp_path / "one.csv+other.csv@0", columns)
    assert run.name == "one"
    assert (run.columns["power.one"][0], run.columns["power.other"][0]) == (1.0, 2.0)
    assert any(note.startswith("x: in both files") for note in run.notes)
