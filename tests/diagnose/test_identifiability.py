"""Which effects a run could reveal, and why not: each reason by a run that lacks one thing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.diagnose.excitation import excitation, identifiability
from lptn.effects import catalogue
from lptn.identify.data import load_model
from tests.diagnose.pair_runs import MODEL, run, table


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """A model of two joints."""
    path = tmp_path / "model.toml"
    path.write_text(MODEL)
    return path


def reasons(model: Path, *tables: pd.DataFrame) -> dict[str, str]:
    """Effect -> why not; '' for those that could show."""
    loaded = load_model(model).model
    runs = [run(log, f"log{number}") for number, log in enumerate(tables)]
    verdicts = identifiability(loaded, runs, excitation(runs, loaded.nodes))
    assert all(verdict.identifiable == (not verdict.why) for verdict in verdicts)
    return {verdict.effect: verdict.why for verdict in verdicts}


def test_a_rich_run_could_show_nearly_all_that_is_logged(model: Path) -> None:
    explanations = reasons(model, table())
    for effect in (
        "forced_convection",
        "radiation",
        "natural_convection",
        "resistance_rise",
        "viscous_friction",
        "coulomb_friction",
        "conduction",
        "sensor_lag",
        "sensor_offset",
        "second_mass",
    ):
        assert explanations[effect] == "", effect
    assert "copper_loss" not in explanations  # the model has it
    assert explanations["drive_heat"] == "not logged: powered.<node>"
    assert explanations["fan"] == "not logged: fan.<node> or speed.fan"
    assert set(explanations) <= set(catalogue())


@pytest.mark.parametrize(
    ("data", "effect", "why"),
    [
        (table().drop(columns="speed.base"), "forced_convection", "not logged: speed.base"),
        (table(speed=0.0), "forced_convection", "speed.base is 0 throughout"),
        (table().assign(**{"speed.base": 0.5}), "forced_convection", "speed.base hardly changes"),
        (table(10), "sensor_drift", "10 min are too short"),
        (table(apart=0.0), "conduction", "differ by"),
        (table(), "ambient_lag", "no change of the surroundings is logged"),
        (table().drop(columns=["velocity.a", "velocity.b"]), "viscous_friction", "not logged: velocity.<node>"),
        (table().assign(**{"temperature.a": 24.0, "temperature.b": 25.0}), "radiation", "only 3 K above"),
    ],
)
def test_one_thing_lacking(model: Path, data: pd.DataFrame, effect: str, why: str) -> None:
    assert why in reasons(model, data)[effect]


def test_one_operating_point(model: Path) -> None:
    steady = table().assign(**{"torque.a": 8.0, "torque.b": 8.0, "velocity.a": 3.0, "velocity.b": 3.0})
    explanations = reasons(model, steady)
    assert explanations["radiation"] == "one level of load and no cool-down"
    assert explanations["sensor_lag"] == "no jump of the load from one minute to the next"
    assert "no standstill" in explanations["constant_heat"]
    assert "hardly changes" in explanations["viscous_friction"]


def test_speed_that_follows_the_load(model: Path) -> None:
    data = table()
    tied = data.assign(**{f"velocity.{joint}": data[f"torque.{joint}"] ** 2 / 50 for joint in "ab"})
    assert "speed and load go together (correlation 1.00)" in reasons(model, tied)["viscous_friction"]


def test_surroundings_that_change_from_one_day_to_another_do_not_change(model: Path) -> None:
    cool, warm = (table().assign(**{"temperature.ambient": air}) for air in (18.0, 24.0))
    assert reasons(model, cool, warm)["ambient_lag"] == "no change of the surroundings is logged"
    warm["temperature.ambient"] += warm["time"] / warm["time"].max()
    assert "by more than 0.9" in reasons(model, cool, warm)["ambient_lag"]
    warm["temperature.ambient"] += warm["time"] / warm["time"].max()
    assert reasons(model, cool, warm)["ambient_lag"] == ""


def test_a_column_that_only_one_run_has_does_not_count(model: Path) -> None:
    assert reasons(model, table(), table().drop(columns="speed.base"))["forced_convection"] == "not logged: speed.base"


@pytest.mark.parametrize("name", ["room", "water", "base_plate"])
def test_surroundings_by_another_name_are_surroundings(tmp_path: Path, name: str) -> None:
    """A given temperature that changes could show what air that changes could."""
    whole = MODEL.replace('ambient = "temperature.ambient"', "").replace('["*", "ambient"]', f'["[ab]", "{name}"]')
    whole = whole.replace('at = "*"', 'at = "[ab]"')
    path = tmp_path / "model.toml"
    path.write_text(f'{whole}\n[nodes.{name}]\ntemperature = "temperature.{name}"\n')
    steady = table().rename(columns={"temperature.ambient": f"temperature.{name}"})
    moving = steady.assign(**{f"temperature.{name}": 20 + 3 * np.sin(steady["time"] / 900)})
    assert reasons(path, steady)["ambient_lag"] == "no change of the surroundings is logged"
    assert reasons(path, moving)["ambient_lag"] == ""
