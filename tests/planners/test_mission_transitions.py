"""Lying down and getting up: what a plan knows of them, and that it rests no more often than they are worth."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from itertools import chain, combinations, pairwise
from typing import Any

import numpy as np
import pytest

from lptn.applications import MissionControl
from lptn.basics.errors import InputError
from lptn.planners.mission import Mission, MissionPlan, MissionProgram, plan_kind, plan_mission
from tests.planners import mission_truth as truth

DOWN = {"from": "*", "to": "rest", "duration": 8, "torque": truth.FOLDING, "velocity": {"*": 0.0}}
UP = {**DOWN, "from": "rest", "to": "*", "duration": 12}
RUN = {"do": "run", "distance": 600, "speed": [0.5, 1.0], "pieces": 3}


def mission(activities: list[dict[str, Any]], transitions: list[dict[str, Any]], **task: Any) -> Mission:
    asked = truth.task(activities, **({"longest_rest": 3000} | task)) | {"transitions": transitions}
    return plan_kind.read(asked, "task.toml", truth.model())


@lru_cache
def plans() -> tuple[MissionPlan, MissionPlan]:
    """A run whose calf has to cool on the way: with transitions for nothing, and as they are."""
    return plan_mission(mission([RUN], [])), plan_mission(mission([RUN], [DOWN, UP]))


def doing(plan: MissionPlan) -> list[tuple[str, float, float, float]]:
    return [(segment.gait.name, time, speed, load) for segment, time, speed, load, _ in plan.pieces]


def rests(plan: MissionPlan) -> int:
    return sum(segment.gait.name == "rest" for segment in plan.segments)


@pytest.mark.long
def test_a_plan_goes_down_and_up_and_keeps_the_limits_in_an_independent_simulation() -> None:
    _, plan = plans()
    names = [name for name, *_ in doing(plan)]
    assert plan.verdict == "met"
    assert "rest" in names
    for before, after in pairwise(names):
        assert "rest" not in (before, after) or " to " in before + after, f"{before}, then {after}"
    assert {(name, time) for name, time, *_ in doing(plan) if " to " in name} == {
        ("run to rest", 8.0), ("rest to run", 12.0)}  # fmt: skip
    hottest = truth.simulate(doing(plan), np.full(3, truth.AMBIENT)).max()
    assert truth.LIMIT - 0.05 < hottest < truth.LIMIT + 0.02


@pytest.mark.long
def test_a_plan_for_which_they_cost_nothing_passes_the_limit_when_they_do() -> None:
    free, _ = plans()
    done: list[tuple[str, float, float, float]] = []
    for piece in doing(free):
        if done and "rest" in (piece[0], done[-1][0]):
            done.append((f"{done[-1][0]} to {piece[0]}", 8.0 if piece[0] == "rest" else 12.0, 0.0, 0.0))
        done.append(piece)
    assert truth.simulate(done, np.full(3, truth.AMBIENT)).max() > truth.LIMIT + 0.5


@pytest.mark.long
@pytest.mark.parametrize("seconds", [8.0, 30.0])
def test_it_rests_where_the_best_of_all_choices_does(seconds: float) -> None:
    asked = mission([RUN], [{**DOWN, "duration": seconds}, {**UP, "duration": seconds}])
    every = chain.from_iterable(combinations(range(3), k) for k in range(4))
    solved = [MissionProgram(asked, which).solve("time") for which in every]
    best = min(solution.total for solution in solved if solution.success)
    assert plan_mission(asked).total == pytest.approx(best, rel=2e-3)


@pytest.mark.long
def test_dear_transitions_make_rests_fewer_and_longer() -> None:
    many = {"do": "walk", "distance": 360, "load": 4, "speed": [0.6, 1.0], "pieces": 6}
    free = plan_mission(mission([many], [], start={"*": 50}))
    dear = plan_mission(mission([many], [{**DOWN, "duration": 20}, {**UP, "duration": 20}], start={"*": 50}))
    assert rests(dear) < rests(free)
    assert dear.total > free.total


def test_between_two_activities_and_from_what_the_robot_is_doing() -> None:
    walk = {"do": "walk", "distance": 20, "load": 4, "pieces": 1}
    stand = {"do": "stand", "duration": 10, "load": 2}
    over = {**DOWN, "from": "walk", "to": "stand", "duration": 3, "loads": [0, 4], "torque": {"*": [5.0, 9.0]}}
    asked = mission([walk, stand], [UP, over], begins="rest")
    plan = plan_mission(asked)
    assert [name for name, *_ in doing(plan)] == ["rest to walk", "walk", "walk to stand", "stand"]
    assert plan.total == pytest.approx(12 + 20 + 3 + 10)
    assert asked.fastest == pytest.approx(plan.total)
    assert plan.load.tolist() == [4.0, 4.0, 2.0, 2.0], "the load of what it leads to"


def test_too_hot_at_the_start_it_lies_down_first() -> None:
    walk = {"do": "walk", "distance": 50, "load": 4, "pieces": 1}
    plan = plan_mission(mission([walk], [DOWN, UP], begins="walk", start=truth.LIMIT + 5.0))
    assert [name for name, *_ in doing(plan)][:3] == ["walk to rest", "rest", "rest to walk"]
    assert max(plan.peaks.values()) < truth.LIMIT + 0.01


def test_an_order_on_the_way_is_for_what_it_leads_to() -> None:
    asked = mission([{"do": "walk", "distance": 50, "load": 4, "pieces": 1}], [DOWN, UP], begins="rest")
    control = MissionControl(asked)
    still = dict.fromkeys(truth.VELOCITY, truth.AMBIENT)
    inputs = dict.fromkeys(asked.model.inputs, 0.0) | {"temperature.ambient": truth.AMBIENT}
    order = control.update(still, inputs, 0.0)
    assert (order.name, order.do, order.speed, order.load) == ("rest to walk", "walk", 0.0, 4.0)
    assert order.seconds == pytest.approx(12.0)
    assert control.remaining().begins == "rest"
    order = control.update(still, inputs, 12.0)
    assert (order.name, order.do, round(order.speed, 6)) == ("walk 1", "walk", 1.0)
    control.update(still, inputs, 5.0)
    assert control.remaining().begins == "walk"


def test_what_is_measured_on_the_way_corrects_its_table() -> None:
    asked = mission([{"do": "walk", "distance": 50, "load": 4, "pieces": 1}], [DOWN, UP], begins="rest")
    control = MissionControl(asked)
    still = dict.fromkeys(truth.VELOCITY, truth.AMBIENT)
    inputs = dict.fromkeys(asked.model.inputs, 0.0) | {"temperature.ambient": truth.AMBIENT}
    control.update(still, inputs, 0.0)
    heavier = {f"torque.{joint}": 1.3 * torque for joint, torque in truth.FOLDING.items()}
    control.update(still, inputs | heavier, 12.0)
    row = asked.model.inputs.index("torque.FR_calf")
    after = {
        between: transition.gait.at(0.0, 4.0)[row] for between, transition in control.remaining().transitions.items()
    }
    factor = np.sqrt((60.0 + 12.0 * 1.3**2) / (60.0 + 12.0))  # the table counts as if measured for a minute
    assert after["rest", "walk"] == pytest.approx(factor * truth.FOLDING["FR_calf"])
    assert after["walk", "rest"] == truth.FOLDING["FR_calf"], "nothing was measured of it yet"


def test_a_rest_of_the_plan_is_corrected_too() -> None:
    standing = {"loads": truth.LOADS, "torque": {"*": 1.0}, "velocity": {"*": 0.0}}  # rests on its feet
    asked = truth.task([{"do": "walk", "distance": 50, "load": 4, "pieces": 1}], longest_rest=3000, start=65.0)
    gaits = truth.GAITS | {"rest": standing}
    read = plan_kind.read(asked | {"gaits": gaits}, "task.toml", truth.model())
    control = MissionControl(read)
    hot = dict.fromkeys(truth.VELOCITY, 65.0)
    inputs = dict.fromkeys(read.model.inputs, 0.0) | {"temperature.ambient": truth.AMBIENT}
    order = control.update(hot, inputs, 0.0)
    assert order.do == "rest"
    control.update(hot, inputs | {"torque.FR_calf": 2.0}, 30.0)
    rest = control.remaining().rest
    assert rest is not None
    assert rest.cells[0, 0, read.model.inputs.index("torque.FR_calf")] == pytest.approx(np.sqrt((60 + 30 * 4) / 90))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"to": "hop"}, 'transitions[0].to: found "hop"'),
        ({"duration": 0}, "transitions[0].duration"),
        ({"torque": {"knee": 3.0}}, 'transitions[0].torque."knee"'),
        ({"torque": {"FR_calf": 3.0}}, "transitions[0].torque"),
        ({"loads": [0, 2], "torque": {"*": [3.0, 4.0]}}, "transitions[0].loads"),
    ],
)
def test_a_mistake_is_named(wrong: dict[str, Any], said: str) -> None:
    walk = {"do": "walk", "distance": 20, "load": 4}
    with pytest.raises(InputError) as caught:
        mission([walk], [{**DOWN, **wrong}])
    assert said in str(caught.value)
    with pytest.raises(InputError, match=r"task\.begins"):
        mission([walk], [DOWN], begins="hop")


def test_without_transitions_nothing_changes() -> None:
    asked = mission([{"do": "walk", "distance": 100, "load": 4, "pieces": 2}], [])
    assert plan_mission(replace(asked, begins="rest")).total == plan_mission(asked).total
