"""Task files of missions: what they say arrives, mistakes are named with their line, the shipped examples run."""

from __future__ import annotations

import json
import re
import tomllib
from functools import lru_cache
from pathlib import Path
from textwrap import wrap

import numpy as np
import pandas as pd
import pytest

from lptn.basics.errors import InputError
from lptn.cli.main import main
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.planners.mission import Mission, plan_kind
from lptn.robots.presets import preset_text
from tests.planners import mission_truth as truth
from tests.planners.test_mission_gaits import rms, write_log

FROM_LOGS = """
task = { kind = "mission" }
limits = { "*" = 60 }
activities = [{ do = "walk", distance = 100, load = 2 }]

[gaits.rest]

[gaits.walk]
speeds = [0.2, 1.0]
loads = [0, 4]

[[gaits.walk.logs]]
file = "empty.parquet"

[[gaits.walk.logs]]
file = "loaded.parquet"
load = 4
start = 10
"""
EXAMPLES = Path(__file__).parents[2] / "examples" / "plan"
DELIVERIES = EXAMPLES / "mission_deliveries.toml"


@lru_cache
def quadruped() -> Model:
    return Model(parse_model(preset_text("quadruped"), Path("quadruped.toml")).network)


def read(path: Path) -> Mission:
    return plan_kind.read(tomllib.loads(path.read_text(encoding="utf-8")), str(path), quadruped())


def test_an_example_arrives_as_it_is_written() -> None:
    mission = read(DELIVERIES)
    assert [activity.do for activity in mission.activities] == ["walk", "stand", "walk", "rest", "walk"]
    assert mission.activities[0].load == (0.0, 4.0)
    assert mission.activities[2].speed == (0.2, 0.8)
    assert mission.activities[3].duration == (120.0, 120.0)
    assert mission.limits["FR_calf"] == 60.0
    assert mission.start[mission.model.nodes.index("RL_calf")] == 35.0
    assert mission.start[mission.model.nodes.index("RL_hip")] == 25.0
    assert (mission.deadline, mission.carry, mission.longest_rest) == (2100.0, 6.0, 600.0)


def test_units_may_be_given(tmp_path: Path) -> None:
    path = tmp_path / "task.toml"
    text = DELIVERIES.read_text(encoding="utf-8")
    path.write_text(text.replace("deadline = 2100 ", 'deadline = { value = 35, unit = "min" } '), encoding="utf-8")
    assert read(path).deadline == pytest.approx(2100.0)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('do = "stand"', 'do = "hop"', ['activities[1].do: found "hop"', "walk, stand, rest"]),
        ("duration = 60 ", "distance = 60 ", ["activities[1]", "expected a duration [s]"]),
        ("duration = 120", "duration = -1", ["activities[3].duration", "found -1"]),
        ("speed = [0.2, 0.8]", "speed = [0.2, 1.8]", ["activities[2].speed", "within 0.2 to 1 m/s"]),
        ("speed = [0.2, 0.8]", "speed = [0.8, 0.2]", ["activities[2].speed: found [0.8, 0.2]", "[least, most]"]),
        ("speed = [0.2, 0.8]", "speed = 0", ["activities[2].speed", "found 0", "greater than 0"]),
        ("speed = [0.2, 0.8]", 'speed = "fast"', ["activities[2].speed", "[least, most]"]),
        ("load = [0, 4] ", "load = [0, 9] ", ["activities[0].load", "within 0 to 4 kg"]),
        ('"*_*" = 60', '"*_knee" = 60', ['limits."*_knee"', "no such place"]),
        ('"*_calf" = 35', '"*_knee" = 35', ['task.start."*_knee"', "no such place"]),
        ("carry = 6 ", "carry = 60 ", ["task.carry: found 60 kg"]),
        ("deadline = 2100 ", "deadline = 0 ", ["task.deadline", "greater than 0"]),
        ("deadline = 2100 ", "dedline = 2100 ", ["task.dedline", 'no key "dedline"']),
        ("longest_rest = 600", "longest_rest = nan", ["task.longest_rest"]),
        ('"*_calf" = 35', '"*_calf" = nan', ['task.start."*_calf"', "found nan"]),
        ("pieces = 3", "pieces = 300", ["activities[0].pieces"]),
        ("speeds = [0.2, 0.6, 1.0]", "speeds = [0.6, 0.2, 1.0]", ["gaits.walk.speeds", "rising numbers"]),
        ("power = { pc = 26 }", "power = { cpu = 26 }", ['gaits.walk.power."cpu"', "pc"]),
        ("distance = 350 ", "distance = 1e9 ", ["activities[0]: found 1e+09 s in all", "a day at most"]),
        ("duration = 120", "duration = 86400", ["activities[3]: found 8.7", "a day at most"]),
        ("[gaits.rest] ", "[gaits.break] ", ["gaits.break.torque", "nothing for FR_hip"]),
    ],
)  # fmt: skip
def test_a_mistake_is_named_with_its_line(tmp_path: Path, old: str, new: str, said: list[str]) -> None:
    text = DELIVERIES.read_text(encoding="utf-8")
    assert old in text
    path = tmp_path / "task.toml"
    path.write_text(text.replace(old, new), encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read(path)
    message = str(caught.value)
    assert "line " in message
    for words in said:
        assert words in message


def test_a_gait_may_come_from_a_log_beside_the_task(tmp_path: Path) -> None:
    write_log(tmp_path / "empty.parquet", [0.2, 1.0], 0.0)
    write_log(tmp_path / "loaded.parquet", [0.2, 1.0], 4.0)
    path = tmp_path / "task.toml"
    path.write_text(FROM_LOGS, encoding="utf-8")
    mission = plan_kind.read(tomllib.loads(FROM_LOGS), str(path), truth.model())
    inputs = mission.activities[0].gait.at(0.6, 2.0)
    assert inputs[mission.model.inputs.index("torque.FR_calf")] == pytest.approx(rms(2, 0.6, 2.0), rel=5e-3)
    for name, said in (('"lost.parquet"', r"lost\.parquet"), ("5", "found 5; expected a text in quotes")):
        wrong = FROM_LOGS.replace('"loaded.parquet"', name)
        with pytest.raises(InputError, match=said):
            plan_kind.read(tomllib.loads(wrong), str(path), truth.model())


@pytest.mark.long
def test_the_command_plans_the_deliveries(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    model, table, result, plot = (tmp_path / name for name in ("q.toml", "plan.csv", "plan.json", "plan.png"))
    model.write_text(preset_text("quadruped"), encoding="utf-8")
    with pytest.raises(SystemExit) as left:
        main(["plan", str(model), str(DELIVERIES), "-o", str(table), "--json", str(result), "--plot", str(plot)])
    assert left.value.code in (0, None)
    answer, rows = json.loads(result.read_text()), pd.read_csv(table)
    assert answer["verdict"] == "met"
    assert answer["total"] < answer["deadline"] == 2100.0
    assert max(answer["peaks"][node] - limit for node, limit in answer["limits"].items()) < 0.01
    assert rows["distance [m]"].sum() == pytest.approx(1050.0, rel=1e-4)
    assert np.isclose(rows["duration [s]"].sum(), answer["total"])
    out = capsys.readouterr().out
    assert "bottleneck" in out
    assert sum(len(wrap(line.replace(str(tmp_path), ""), 80)) or 1 for line in out.splitlines()) <= 15
    left_out = re.search(r"and (\d+) more lines: --details", out)
    assert left_out
    assert int(left_out[1]) + len(out.splitlines()) > 15
    assert plot.stat().st_size > 10_000


@pytest.mark.slow
def test_what_cannot_be_done_is_said_first() -> None:
    answer = plan_kind.run(read(EXAMPLES / "mission_too_much.toml"))
    given_up, in_the_way, needed, *_ = answer.text().splitlines()
    assert "given up: part of the work" in given_up
    assert "calf passes its 60 degC after 0 s" in in_the_way
    assert "higher" in needed
    assert answer.total <= 900.0 * (1 + 1e-6)
    assert answer.segments[0].gait.name == "rest", "two knees begin above their limit"
    assert max(peak - answer.mission.limits[node] for node, peak in answer.peaks.items()) < 0.01


@pytest.mark.parametrize(("capacity", "resistance"), [(300.0, 1e-6), (1e-3, 0.5), (1e-3, 30.0)])
def test_a_plan_of_more_steps_than_end_in_a_minute_is_refused(
    capacity: float, resistance: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A day of a model whose time constant is a thousandth of a second or so."""
    model = '[model]\nambient = "temperature.ambient"\n[nodes.motor]\ncapacity = {}\n[[links]]\n'
    model += 'between = ["motor", "ambient"]\nresistance = {}\n[[effects]]\nkind = "copper_loss"\nat = "motor"\n'
    (tmp_path / "fast.toml").write_text(model.format(capacity, resistance))
    (tmp_path / "task.toml").write_text(
        """task = { kind = "mission", deadline = 80000, ambient = 25, start = { motor = 25 } }
limits = { motor = 60 }
activities = [{ do = "walk", distance = 40000 }]
gaits.walk = { speeds = [0.2, 0.6], torque = { motor = [2, 3] } }
gaits.rest = {}
"""
    )
    with pytest.raises(SystemExit):
        main(["plan", str(tmp_path / "fast.toml"), str(tmp_path / "task.toml")])
    said = capsys.readouterr().err
    assert "fast.toml: a time constant of 0.0" in said
    assert "steps; expected at most 500,000" in said
