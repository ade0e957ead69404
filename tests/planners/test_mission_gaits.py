"""What the joints do in an activity: tables between their cells, cells learned from logs, mistakes in both."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pandas as pd
import pytest

from lptn.basics.errors import InputError
from lptn.model.model import Model
from lptn.planners.mission import (
    Gait,
    LogPart,
    gait_from_logs,
    gait_from_tables,
    plan_kind,
    plan_mission,
)
from tests.planners import mission_truth as truth

SPEEDS, LOADS = [0.2, 0.5, 1.0], [0.0, 2.0, 4.0]


@lru_cache
def leg() -> Model:
    return truth.model()


def tables(**changed: Any) -> dict[str, Any]:
    given: dict[str, Any] = {
        "torque": {"*": 2.0, "FR_calf": [[4.0, 5.0, 7.0], [5.0, 6.5, 9.0], [6.5, 8.0, 11.0]]},
        "velocity": {"*": [1.0, 2.0, 4.0]},
    }
    return given | changed


def made(**changed: Any) -> Gait:
    speeds, loads = changed.pop("speeds", SPEEDS), changed.pop("loads", LOADS)
    return gait_from_tables("walk", speeds, loads, tables(**changed), leg(), "task.toml")


def row(column: str) -> int:
    return leg().inputs.index(column)


def test_a_table_is_exact_at_its_cells() -> None:
    gait, expected = made(), tables()["torque"]["FR_calf"]
    for j, load in enumerate(LOADS):
        for i, speed in enumerate(SPEEDS):
            assert gait.at(speed, load)[row("torque.FR_calf")] == pytest.approx(expected[j][i], abs=1e-12)


def test_with_two_cells_it_is_straight_between_them() -> None:
    quantities = {key: truth.GAITS["walk"][key] for key in ("torque", "velocity")}
    gait = gait_from_tables("walk", [0.2, 1.0], [0.0, 4.0], quantities, leg(), "task.toml")
    assert gait.at(0.6, 1.0)[row("torque.FR_calf")] == pytest.approx((6.0 + 7.5) / 2 * 0.75 + (8.0 + 10.0) / 2 * 0.25)


def test_the_expression_for_the_solver_is_the_table() -> None:
    gait, v, m = made(), ca.SX.sym("v"), ca.SX.sym("m")
    function = ca.Function("f", [v, m], [gait.inputs(v, m)])
    slope = ca.Function("s", [v, m], [ca.jacobian(gait.inputs(v, m), v)])
    for speed, load in ((0.2, 0.0), (0.33, 1.2), (0.5, 2.0), (0.77, 3.9), (1.0, 4.0)):
        np.testing.assert_allclose(function(speed, load).full().ravel(), gait.at(speed, load), atol=1e-12)
    before, after = (slope(0.5 + side, 1.0).full()[row("torque.FR_calf"), 0] for side in (-1e-7, 1e-7))
    assert before == pytest.approx(after, abs=1e-4), "a kink would stop the solver"


def test_a_mean_speed_alone_gives_the_rms_of_a_sine() -> None:
    turn = np.sin(np.linspace(0, 2 * np.pi, 20000, endpoint=False))
    gait = made()
    ratio = gait.at(0.5, 0.0)[row("velocity_rms.FR_calf")] / gait.at(0.5, 0.0)[row("velocity.FR_calf")]
    assert ratio == pytest.approx(np.sqrt((turn**2).mean()) / np.abs(turn).mean(), rel=1e-4)


@pytest.mark.parametrize(
    ("changed", "place", "expected"),
    [
        ({"torque": {"*": 2.0, "knee": 3.0}}, 'gaits.walk.torque."knee"', "FR_hip"),
        ({"torque": {"FR_hip": 1.0, "FR_calf": 2.0}}, "gaits.walk.torque", "FR_thigh"),
        ({"torque": {"*": [[1.0, 2.0]]}}, 'gaits.walk.torque."*"', "3 rows (loads) of 3 numbers (speeds)"),
        ({"torque": {"*": -1.0}}, 'gaits.walk.torque."*"', "none below 0"),
        ({"torque": {"*": float("nan")}}, 'gaits.walk.torque."*"', "none below 0"),
        ({"torque": {"*": [[1.0], [2.0, 3.0], [4.0]]}}, 'gaits.walk.torque."*"', "a number"),
        ({"torque": 2.0}, "gaits.walk.torque", "a table of places"),
        ({"current": {"*": 2.0}}, 'gaits.walk.current."*"', "the model has none"),
        ({"torque": {"*": [9.0, 0.0, 9.0]}}, "gaits.walk", "stays above zero"),
    ],
)
def test_a_table_that_cannot_be_used_is_refused(changed: dict[str, Any], place: str, expected: str) -> None:
    with pytest.raises(InputError) as caught:
        made(**changed)
    assert caught.value.place == place
    assert expected in str(caught.value)


# --- learned from logs --------------------------------------------------------------------------


def write_log(path: Path, speeds: list[float], load: float, seconds: int = 120, heavier: float = 1.0) -> Path:
    """Walking at these speeds in turn, 50 Hz, torque a sine whose RMS is linear in speed and load."""
    time = np.arange(0.0, seconds * len(speeds), 0.02)
    speed = np.repeat(speeds, seconds * 50)
    log = {"time": time, "speed.base": speed, "temperature.ambient": 25.0}
    for k, joint in enumerate(truth.VELOCITY):
        log[f"torque.{joint}"] = heavier * np.sqrt(2) * rms(k, speed, load) * np.sin(2 * np.pi * 1.9 * time)
        log[f"velocity.{joint}"] = (k + speed) * np.sin(2 * np.pi * 1.9 * time)
        log[f"temperature.{joint}"] = 25.0 + 0.001 * time
        log[f"powered.{joint}"] = 1.0
    pd.DataFrame(log).to_parquet(path)
    return path


def rms(joint: int, speed: Any, load: float) -> Any:
    return (1.0 + joint) * (1 + 0.4 * speed) * (12 + load) / 12


def test_cells_are_learned_from_logs(tmp_path: Path) -> None:
    parts = [
        LogPart(file=write_log(tmp_path / "empty.parquet", [0.2, 0.6, 1.0], 0.0)),
        LogPart(file=write_log(tmp_path / "loaded.parquet", [0.2, 0.5, 1.0], 4.0), load=4.0),
    ]
    gait = gait_from_logs("walk", [0.2, 1.0], [0.0, 4.0], parts, leg(), "task.toml")
    for k, joint in enumerate(truth.VELOCITY):
        for speed, load in ((0.2, 0.0), (1.0, 4.0), (0.6, 2.0)):
            inputs = gait.at(speed, load)
            assert inputs[row(f"torque.{joint}")] == pytest.approx(rms(k, speed, load), rel=5e-3)
            assert inputs[row(f"velocity.{joint}")] == pytest.approx((k + speed) * 2 / np.pi, rel=5e-3)
            assert inputs[row(f"velocity_rms.{joint}")] == pytest.approx((k + speed) / np.sqrt(2), rel=5e-3)
            assert inputs[row(f"powered.{joint}")] == pytest.approx(1.0)


def test_a_part_of_a_log_is_only_that_part(tmp_path: Path) -> None:
    log = write_log(tmp_path / "log.parquet", [0.3, 0.9], 0.0)
    first = gait_from_logs("walk", [0.3], [0.0], [LogPart(file=log, end=120.0)], leg(), "task.toml")
    second = gait_from_logs("walk", [0.3], [0.0], [LogPart(file=log, start=120.0, end=240.0)], leg(), "task.toml")
    assert first.at(0.3, 0.0)[row("torque.FR_calf")] == pytest.approx(rms(2, 0.3, 0.0), rel=1e-3)
    assert second.at(0.3, 0.0)[row("torque.FR_calf")] == pytest.approx(rms(2, 0.9, 0.0), rel=1e-3)


def test_a_cell_that_no_log_has_seen_is_refused(tmp_path: Path) -> None:
    parts = [LogPart(file=write_log(tmp_path / "log.parquet", [0.2, 1.0], 0.0))]
    with pytest.raises(InputError, match=r"0\.0 windows near 4 kg at 0\.2 m/s"):
        gait_from_logs("walk", [0.2, 1.0], [0.0, 4.0], parts, leg(), "task.toml")


# --- postures ------------------------------------------------------------------------------------

HEIGHTS = [0.25, 0.30, 0.35]


def crouching(height: float, load: float) -> list[float]:
    """Hip, thigh, calf [N*m]: what a crouch costs the calf, standing tall costs the thigh."""
    return [2.0, 4.0 + 20.0 * (height - 0.25), (7.0 - 40.0 * (height - 0.25)) * (1 + load / 8)]


def with_heights() -> Gait:
    rows = np.array([[[crouching(height, load)] for load in LOADS] for height in HEIGHTS])
    torque = {joint: rows[..., k].tolist() for k, joint in enumerate(("FR_hip", "FR_thigh", "FR_calf"))}
    given = {"torque": torque, "velocity": {"*": 1.0}}
    return gait_from_tables("stand", [0.0], LOADS, given, leg(), "task.toml", {"height": HEIGHTS})


def test_a_table_for_each_posture_is_exact_at_its_cells_and_straight_between_them() -> None:
    gait = with_heights()
    for height, load in ((0.25, 0.0), (0.35, 4.0), (0.3, 2.0), (0.32, 3.0)):
        expected = crouching(height, load)
        at = gait.at(0.0, load, [height])
        assert [at[row(f"torque.FR_{part}")] for part in ("hip", "thigh", "calf")] == pytest.approx(expected)


def test_the_expression_with_a_posture_is_the_table() -> None:
    gait, q, m = with_heights(), ca.SX.sym("q"), ca.SX.sym("m")
    function = ca.Function("f", [q, m], [gait.inputs(0.0, m, [q])])
    np.testing.assert_allclose(function(0.31, 1.5).full().ravel(), gait.at(0.0, 1.5, [0.31]), atol=1e-12)


def test_postures_are_learned_from_logs(tmp_path: Path) -> None:
    parts = [
        LogPart(
            file=write_log(tmp_path / f"{height}_{load}.parquet", [0.2, 1.0], load, heavier=1 + height), load=load,
            posture={"height": height},
        )
        for height in (0.0, 0.5) for load in (0.0, 4.0)
    ]  # fmt: skip
    gait = gait_from_logs("walk", [0.2, 1.0], [0.0, 4.0], parts, leg(), "task.toml", postures={"height": [0.0, 0.5]})
    low, high = (gait.at(0.6, 2.0, [height])[row("torque.FR_calf")] for height in (0.0, 0.5))
    assert high / low == pytest.approx(1.5, rel=0.01)


def test_the_posture_that_is_chosen_is_the_best_of_all() -> None:
    """Standing low heats the calf, standing tall the thigh: the most time lies between."""

    def mission(height: list[float]) -> Any:
        task = truth.task([{"do": "stand", "duration": 2000, "load": 4, "posture": {"height": height}}], limit=50.0)
        task["gaits"]["stand"] = {  # type: ignore[index]
            "loads": LOADS, "postures": {"height": HEIGHTS}, "velocity": {"*": 1.0},
            "torque": {
                joint: [[[crouching(h, load)[k]] for load in LOADS] for h in HEIGHTS]
                for k, joint in enumerate(("FR_hip", "FR_thigh", "FR_calf"))
            },
        }  # fmt: skip
        return plan_mission(plan_kind.read(task, "task.toml", leg()), explain=False)

    chosen = mission([0.25, 0.35])
    fixed = [mission([height, height]).share[0] for height in (0.25, 0.28, 0.31, 0.35)]
    assert chosen.verdict == "cut"
    assert max(fixed) > 1.1 * min(fixed), "the posture must matter"
    assert chosen.share[0] >= max(fixed) * (1 - 1e-6)
    assert "height" in chosen.text()


def test_a_posture_that_the_gait_has_not_is_refused() -> None:
    task = truth.task([{"do": "stand", "duration": 60, "posture": {"lean": 0.1}}])
    with pytest.raises(InputError, match=r"posture\.lean: found a posture that the gait has not"):
        plan_kind.read(task, "task.toml", leg())
