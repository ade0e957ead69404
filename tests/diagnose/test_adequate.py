"""No verdict is "adequate" whose error is beyond the sensors' noise, whatever the shape of the error."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn import Study
from lptn.basics.arrays import FloatArray
from lptn.diagnose.fit_statistics import LACKING
from lptn.diagnose.improvement import improve
from lptn.robots.presets import presets

TIME, AIR = np.arange(1800.0), 22.0
PAIR = """
[model]
name = "pair"
joints = ["a", "b"]
ambient = "temperature.ambient"
[nodes.a]
capacity = 300
[nodes.b]
capacity = 300
[[links]]
between = ["a", "b"]
resistance = 3
[[links]]
between = ["a", "ambient"]
resistance = 5
[[links]]
between = ["b", "ambient"]
resistance = 5
[[effects]]
kind = "copper_loss"
at = "*"
resistance = 0.2
input = "current"
"""


def logged(
    folder: Path, temperatures: dict[str, FloatArray], load: str, noise: float = 0.05, step: float = 0.0
) -> Path:
    """A log without load."""
    columns, random = {"time": TIME, "temperature.ambient": np.full(TIME.size, AIR)}, np.random.default_rng(1)
    for node, temperature in temperatures.items():
        readings = temperature + noise * random.standard_normal(TIME.size)
        columns[f"temperature.{node}"] = step * np.round(readings / step) if step else readings
        columns[f"{load}.{node}"] = np.zeros(TIME.size)
    path = folder / f"{'_'.join(temperatures)}{noise:g}.csv"
    pd.DataFrame(columns).to_csv(path, index=False)
    return path


def ramp(rate: float) -> FloatArray:
    return np.asarray(AIR + rate * TIME)


RAMPS = pytest.mark.parametrize(
    ("rate", "noise", "step"), [(0.03, 0.05, 0.0), (-0.01, 0.05, 0.0), (0.002, 0.05, 0.0), (0.03, 0.1, 1.0)]
)


def _study_of_a_ramp(folder: Path, rate: float, noise: float, step: float) -> Study:
    (folder / "motor.toml").write_text(presets()["single-motor"])
    return Study(folder / "motor.toml", [logged(folder, {"motor": ramp(rate)}, "torque", noise, step)])


@RAMPS
def test_a_ramp_that_nothing_drives_is_not_adequate(tmp_path: Path, rate: float, noise: float, step: float) -> None:
    """The derivative by a resistance across which no heat flows has the shape of a ramp, and no size."""
    diagnosis = _study_of_a_ramp(tmp_path, rate, noise, step).diagnose()
    assert diagnosis.verdict != "adequate"
    assert max(diagnosis.lack_of_fit.values()) > LACKING


@RAMPS
def test_a_ramp_that_nothing_drives_is_unexplained(tmp_path: Path, rate: float, noise: float, step: float) -> None:
    """A steady heat in a capacity that nothing else tells has no size; nor is it said that held-out data refused it."""
    study = _study_of_a_ramp(tmp_path, rate, noise, step)
    diagnosis = study.diagnose()
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.steps == ()
    assert not any(sentence.label == "Best candidates" for sentence in study.narrative())


def test_nor_is_a_heat_of_all_parts_whose_size_nothing_tells(tmp_path: Path) -> None:
    """Two parts that warm together without a load: any heat explains them, with capacities to match."""
    bounded = PAIR.replace("capacity = 300", "capacity = { value = 300, bounds = [20, 3000] }")
    for ohm in (3, 5):
        bounded = bounded.replace(f"resistance = {ohm}\n", f"resistance = {{ value = {ohm}, bounds = [0.1, 200] }}\n")
    (tmp_path / "pair.toml").write_text(bounded)
    log = logged(tmp_path, {"a": ramp(0.02), "b": ramp(0.012)}, "current")
    diagnosis = Study(tmp_path / "pair.toml", [log]).diagnose()
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.steps == ()


@pytest.mark.parametrize(
    ("shape", "verdict"),
    [
        (lambda: 0 * TIME, "adequate"),
        (lambda: 0.03 * TIME, "unexplained"),
    ],
)
def test_one_node_that_is_met_excuses_no_other(tmp_path: Path, shape: Callable[[], FloatArray], verdict: str) -> None:
    (tmp_path / "pair.toml").write_text(PAIR)
    log = logged(tmp_path, {"a": AIR + 0 * TIME, "b": AIR + shape()}, "current")
    assert Study(tmp_path / "pair.toml", [log]).diagnose().verdict == verdict


@pytest.mark.parametrize(
    ("seconds", "shape", "verdict"),
    [
        (45, lambda: 0 * TIME, "adequate"),
        (45, lambda: 0.1 * TIME, "unexplained"),
        (59, lambda: 0.1 * TIME, "unexplained"),
        (125, lambda: 0 * TIME, "adequate"),
        (125, lambda: 0.5 * np.sin(TIME / 5.0), "unexplained"),  # which is gone in means of a minute
    ],
)
def test_nor_does_a_log_of_few_minutes(
    tmp_path: Path, seconds: int, shape: Callable[[], FloatArray], verdict: str
) -> None:
    (tmp_path / "motor.toml").write_text(presets()["single-motor"])
    log = logged(tmp_path, {"motor": AIR + shape()}, "torque")
    pd.read_csv(log).iloc[:seconds].to_csv(log, index=False)
    assert Study(tmp_path / "motor.toml", [log]).diagnose().remaining == verdict


@pytest.mark.long
def test_nor_do_fitted_runs_a_held_out_one(tmp_path: Path) -> None:
    (tmp_path / "motor.toml").write_text(presets()["single-motor"])
    still = logged(tmp_path, {"motor": AIR + 0 * TIME}, "torque")
    rising = logged(tmp_path, {"motor": ramp(0.03)}, "torque", 0.06)
    assert Study(tmp_path / "motor.toml", [still]).diagnose().verdict == "adequate"
    assert Study(tmp_path / "motor.toml", [still], [rising]).diagnose().verdict == "unexplained"


def test_nor_does_a_search_call_it_adequate(tmp_path: Path) -> None:
    (tmp_path / "motor.toml").write_text(presets()["single-motor"])
    study = Study(tmp_path / "motor.toml", [logged(tmp_path, {"motor": ramp(0.03)}, "torque")])
    history = improve(study.model, study.data, most=1)
    assert history.verdict != "adequate"
    assert history.remaining == "unexplained"
