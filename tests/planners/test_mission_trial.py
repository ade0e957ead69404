"""The whole way: logs of a virtual robot, a fit, gaits learned from them, a plan, and the robot that does it."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import pytest

from lptn import fit, load_model
from lptn.model.file import read_model_file
from lptn.model.model import Model
from lptn.planners.mission import MissionPlan, plan_kind
from lptn.robots.presets import preset_text
from lptn.virtual import Bout, Job, Logs, quadruped_logs, write_logs
from tests.builders import bound_runs

LIMIT, LOADS = 58.0, (0, 4)
STRETCHES = ((10, 390), (710, 1090), (1410, 1690))  # s, in which it trots
TASK = f"""
limits = {{ "*_*" = {LIMIT} }}
[task]
kind = "mission"
deadline = 3000
carry = 6
[[activities]]
do = "walk"
distance = 400
load = [0, 4]
[[activities]]
do = "walk"
distance = 400
load = [0, 4]
[gaits.rest]
power = {{ pc = 16 }}
[gaits.walk]
speeds = [0.2, 1.0]
loads = [0, 4]
"""


def logged(seed: int, runs: dict[str, Job]) -> Logs:
    return quadruped_logs(seed=seed, runs=runs, physics="full", level="none", quantisation=0.0)


def planned(folder: Path, seed: int) -> MissionPlan:
    """Log, fit, learn, plan."""
    for load in LOADS:
        trots = [Bout("trot", seconds, speed, float(load)) for seconds, speed in ((400, 0.2), (400, 0.6), (300, 1.0))]
        rests = [Bout("rest", seconds) for seconds in (300, 300, 600)]
        happens = tuple(segment for pair in zip(trots, rests, strict=True) for segment in pair)
        write_logs(folder, logged(seed, {f"trot_{load}": Job(happens, cutout=None)}))
    model = folder / "quadruped.toml"
    model.write_text(preset_text("quadruped"), encoding="utf-8")
    loaded = load_model(model)
    runs = loaded.runs([folder / f"trot_{load}.parquet" for load in LOADS])
    fitted = fit(loaded.model, bound_runs(loaded.model, runs))
    read_model_file(model).with_fit(fitted.table()).write(model)
    logs = [
        f'[[gaits.walk.logs]]\nfile = "trot_{load}.parquet"\nload = {load}\nstart = {start}\nend = {end}\n'
        for load in LOADS
        for start, end in STRETCHES
    ]
    task = folder / "task.toml"
    task.write_text(TASK + "".join(logs), encoding="utf-8")
    asked = plan_kind.read(
        tomllib.loads(task.read_text(encoding="utf-8")), str(task), Model(read_model_file(model).network)
    )
    return plan_kind.run(asked)


def hottest(plan: MissionPlan, seed: int) -> float:
    """The hottest joint [degC] of the virtual robot that does what was planned, each walk with luck of its own."""
    doing = [
        Bout("rest" if segment.gait.name == "rest" else "trot", max(1, round(time)), min(speed, 1.0), load)
        for segment, time, speed, load, _ in plan.pieces
    ]
    truth = logged(seed, {"mission": Job(tuple(doing), cutout=None)}).truth["mission"]
    joints = [f"temperature.{joint}" for joint in plan.mission.limits]
    return float(np.max(truth[joints]))


@pytest.mark.slow
def test_a_plan_from_logs_is_kept_by_the_robot_to_a_few_kelvins(tmp_path: Path) -> None:
    """The robot's torques scatter by 6 % from walk to walk: no plan can know them."""
    beyond = []
    for seed in (1, 2, 3, 4):
        folder = tmp_path / str(seed)
        folder.mkdir()
        plan = planned(folder, seed)
        assert plan.verdict == "met"
        assert plan.bottleneck is not None
        beyond.append(hottest(plan, seed) - LIMIT)
    print("above the limit [K]:", np.round(beyond, 2))
    assert max(np.abs(beyond)) < 5.0
    assert abs(np.mean(beyond)) < 2.0
