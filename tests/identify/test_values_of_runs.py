"""Quantities that a log lacks, given for one log by its name: a number, the start, or another column."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.basics.errors import InputError
from lptn.identify.data import load_model
from tests.fleet.truth import MODEL, write_log


@pytest.fixture
def logs(tmp_path: Path) -> dict[str, Path]:
    """The same motor on three days; the room is logged on monday, by another name on tuesday, and not on friday."""
    paths = {}
    for seed, day in enumerate(("monday", "tuesday", "friday")):
        paths[day] = tmp_path / f"{day}.csv"
        write_log(paths[day], seed)
        table = pd.read_csv(paths[day])
        if day != "monday":
            table["T_room"] = table.pop("temperature.ambient")
        if day == "friday":
            table = table.drop(columns="T_room")
        table.to_csv(paths[day], index=False)
    (tmp_path / "motor.toml").write_text(MODEL)
    return paths


def test_each_log_has_its_air(tmp_path: Path, logs: dict[str, Path]) -> None:
    model = tmp_path / "motor.toml"
    with pytest.raises(InputError, match=r'"temperature\.ambient@friday"'):
        load_model(model).runs([logs["friday"]])
    entries = """
[columns]
"temperature.ambient@tuesday" = "T_room"
"temperature.ambient@fri*" = { value = 68, unit = "degF" }
"""
    model.write_text(MODEL + entries)
    loaded = load_model(model)
    monday, tuesday, friday = loaded.runs([*logs.values()])
    assert friday.columns["temperature.ambient"] == pytest.approx(np.full(len(friday), 20.0))
    for run, column in ((monday, "temperature.ambient"), (tuesday, "T_room")):
        np.testing.assert_allclose(
            run.columns["temperature.ambient"], pd.read_csv(run.source)[column].mean(), atol=0.01
        )
    by_option = load_model(model, ["temperature.ambient@friday=[value=start]"])
    (begun,) = by_option.runs([logs["friday"]])
    first = pd.read_csv(logs["friday"])["temperature.motor"].iloc[:2].mean()
    assert begun.columns["temperature.ambient"] == pytest.approx(np.full(len(begun), first), abs=0.2)


@pytest.mark.parametrize(
    ("option", "expected"),
    [
        ("temperature.motor@friday=[value=22]", "a column, for it is predicted"),
        ("torque.motor@friday=[value=start]", "a number; the start tells temperatures alone"),
        ("time@friday=[value=3]", "anything but the time"),
        ("temperature.ambient@friday=[value=22; scale=2]", "one of the two"),
        ("temperature.ambient@friday=[value=300]", "at most 200, or its unit with it"),
        ("temperature.nowhere@friday=[value=22]", "a quantity at a place of the model"),
    ],
)
def test_values_that_can_not_be_are_one_line(tmp_path: Path, logs: dict[str, Path], option: str, expected: str) -> None:
    with pytest.raises(InputError, match=expected) as refused:
        load_model(tmp_path / "motor.toml", [option]).runs([logs["friday"]])
    assert "\n" not in str(refused.value)


def test_the_nearer_entry_goes_first(tmp_path: Path, logs: dict[str, Path]) -> None:
    options = [f"temperature.ambient@{of}=[value={air}]" for of, air in (("friday.csv", 21), ("fri*", 22), ("*", 23))]
    (run,) = load_model(tmp_path / "motor.toml", options).runs([logs["friday"]])
    assert run.columns["temperature.ambient"][0] == 21
    (run,) = load_model(tmp_path / "motor.toml", ["velocity.motor@friday=[value=3]", *options]).runs([logs["friday"]])
    assert (run.columns["velocity.motor"] == 3).all()  # of what effects could use, too


def test_a_torque_that_is_none_throughout(tmp_path: Path, logs: dict[str, Path]) -> None:
    table = pd.read_csv(logs["monday"]).drop(columns="torque.motor")
    table.to_csv(logs["monday"], index=False)
    (run,) = load_model(tmp_path / "motor.toml", ["torque.motor@monday=[value=0]"]).runs([logs["monday"]])
    assert not run.columns["torque.motor"].any()
