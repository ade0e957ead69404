"""Missions: plans kept by an independent simulation, optima by bisection, prices by finite differences."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from lptn.basics.errors import InputError
from lptn.model.model import Model
from lptn.planners.mission import Mission, MissionPlan, MissionProgram, plan_kind, plan_mission
from tests.planners import mission_truth as truth


@lru_cache
def leg() -> Model:
    return truth.model()


def mission(activities: list[dict[str, object]], **task: Any) -> Mission:
    return plan_kind.read(truth.task(activities, **({"longest_rest": 3000} | task)), "task.toml", leg())


def pieces(plan: MissionPlan) -> list[tuple[str, float, float, float]]:
    """The plan as the independent simulation wants it."""
    return [(segment.gait.name, time, speed, load) for segment, time, speed, load, _ in plan.pieces]


WALK = {"do": "walk", "distance": 500, "load": 4, "pieces": 2}


@lru_cache
def two_walks() -> MissionPlan:
    return plan_mission(mission([WALK, {**WALK, "load": [0, 4]}], carry=2.0, deadline=4000))


def test_a_plan_keeps_the_limits_in_an_independent_simulation_and_uses_them_up() -> None:
    plan = two_walks()
    hottest = truth.simulate(pieces(plan), np.full(3, truth.AMBIENT)).max()
    assert plan.verdict == "met"
    assert truth.LIMIT - 0.02 < hottest < truth.LIMIT + 0.02


def test_a_plan_does_all_that_was_asked() -> None:
    plan = two_walks()
    walked = sum(speed * time for do, time, speed, _ in pieces(plan) if do == "walk")
    assert walked == pytest.approx(1000.0, rel=1e-6)
    assert {round(load, 4) for _, time, _, load in pieces(plan)[-1:]} == {2.0}, "no more than what has to be carried"
    assert plan.total == pytest.approx(plan.course.time[-1], rel=1e-9)


def test_a_plan_prints_in_a_line() -> None:
    plan = two_walks()
    assert repr(plan) == f"<MissionPlan of mission: met, {len(plan.segments)} pieces, {plan.total:.0f} s>"


def test_the_replay_is_the_independent_simulation() -> None:
    plan = two_walks()
    expected = truth.simulate(pieces(plan), np.full(3, truth.AMBIENT))[:, -1]
    np.testing.assert_allclose(plan.course.states[:, -1], expected, atol=1e-5)
    assert plan.coarseness < 0.05


def test_the_fastest_speed_without_rests_is_the_one_that_bisection_finds() -> None:
    plan = plan_mission(mission([{"do": "run", "distance": 400, "pieces": 1}], longest_rest=0))

    def over(speed: float) -> float:
        run = ("run", 400 / speed, speed, 0.0)
        return float(truth.simulate([run], np.full(3, truth.AMBIENT)).max() - truth.LIMIT)

    assert over(0.2) < 0 < over(1.0), "the task must need a choice"
    assert plan.verdict == "met"
    assert plan.speed[0] == pytest.approx(brentq(over, 0.2, 1.0, xtol=1e-6), rel=1e-3)


def test_a_walk_in_pieces_is_no_slower_than_in_one() -> None:
    totals = [plan_mission(mission([{"do": "run", "distance": 400, "pieces": n}])).total for n in (1, 3)]
    assert totals[1] < totals[0] * 0.999


def test_the_shortest_rest_is_the_one_that_bisection_finds() -> None:
    stand = {"do": "stand", "duration": 300, "load": 4}
    plan = plan_mission(mission([stand, stand], limit=68.0))

    def over(rest: float) -> float:
        held = ("stand", 300.0, 0.0, 4.0)
        return float(truth.simulate([held, ("rest", rest, 0.0, 0.0), held], np.full(3, truth.AMBIENT)).max() - 68.0)

    assert over(1.0) > 0, "the task must need a rest"
    assert plan.total == pytest.approx(600 + brentq(over, 1.0, 3000.0, xtol=1e-4), rel=1e-3)


@pytest.mark.long
def test_no_other_split_of_the_load_is_faster() -> None:
    def total(one: object, other: object) -> float:
        walks = [{**WALK, "load": load} for load in (one, other)]
        return float(plan_mission(mission(walks, carry=4.0 if isinstance(one, list) else 0.0)).total)

    chosen = total([0, 4], [0, 4])
    fixed = [total(load, 4.0 - load) for load in (0.0, 1.0, 2.0, 3.0, 4.0)]
    assert max(fixed) > 1.02 * min(fixed), "the split must matter"
    assert chosen <= min(fixed) * (1 + 1e-6)


# --- prices -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "step", "moved"),
    [
        ("limit.FR_calf", 0.2, lambda d: {"limits": {"FR_calf": truth.LIMIT + d}}),
        ("ambient", 0.2, lambda d: {"ambient": truth.AMBIENT + d}),
        ("carry", 0.05, lambda d: {"carry": 2.0 + d}),
    ],
)
def test_prices_are_what_finite_differences_say(
    name: str, step: float, moved: Callable[[float], dict[str, Any]]
) -> None:
    program = MissionProgram(mission([WALK, {**WALK, "load": [0, 4]}], carry=2.0))
    here = program.solve()
    more, less = (program.solve(near=here, **moved(side * step)) for side in (1, -1))
    assert here.success
    assert more.success
    assert less.success
    assert abs(here.prices[name]) > 1.0, "a price of nothing would prove nothing"
    assert here.prices[name] == pytest.approx((more.total - less.total) / (2 * step), rel=0.02)


def test_the_price_of_work_is_what_finite_differences_say() -> None:
    asked = mission([{**WALK, "distance": 3000}], deadline=1000, gives_up="distance")
    program = MissionProgram(asked)
    here = program.solve("work", deadline=1000)
    more, less = (
        program.solve("work", deadline=1000, near=here, limits={"FR_calf": truth.LIMIT + side * 0.2})
        for side in (1, -1)
    )
    assert here.prices["limit.FR_calf"] > 1.0
    slope = (more.work(asked) - less.work(asked)) / 0.4
    assert here.prices["limit.FR_calf"] == pytest.approx(slope, rel=0.02)


def test_a_failed_solve_has_no_prices() -> None:
    program = MissionProgram(mission([{"do": "stand", "duration": 3000, "load": 4}]))
    solution = program.solve()
    assert not solution.success
    assert solution.prices == {}


def test_without_a_limit_in_the_way_there_is_no_bottleneck() -> None:
    plan = plan_mission(mission([{"do": "walk", "distance": 20}], deadline=100))
    assert plan.verdict == "met"
    assert plan.bottleneck is None
    assert plan.total == pytest.approx(20.0, rel=1e-6), "at full speed"


def test_the_bottleneck_is_named_with_its_price() -> None:
    plan = two_walks()
    assert plan.bottleneck == "FR_calf"
    assert plan.limit_prices["FR_calf"] > 1.0
    assert "FR_calf" in plan_kind.run(plan.mission).text()


# --- what can't be done -------------------------------------------------------------------------


@pytest.mark.long
def test_a_deadline_that_cannot_be_met_is_given_up_and_the_limits_that_would_do_are_right() -> None:
    asked = mission([WALK, WALK], deadline=2000)
    plan = plan_mission(asked)
    assert plan.verdict == "late"
    assert plan.total > 2000
    assert truth.simulate(pieces(plan), np.full(3, truth.AMBIENT)).max() < truth.LIMIT + 0.02
    assert plan.raise_needed is not None
    raised = plan_mission(mission([WALK, WALK], deadline=2000, limit=truth.LIMIT + plan.raise_needed + 0.1))
    lower = plan_mission(mission([WALK, WALK], deadline=2000, limit=truth.LIMIT + plan.raise_needed - 0.1))
    assert (raised.verdict, lower.verdict) == ("met", "late")


@pytest.mark.long
def test_where_the_distance_may_be_given_up_the_deadline_is_kept() -> None:
    plan = plan_mission(mission([WALK, WALK], deadline=1100, gives_up="distance"))
    assert plan.verdict == "cut"
    assert plan.total <= 1100 * (1 + 1e-6)
    assert 0.1 < plan.share.min() < 1
    assert truth.simulate(pieces(plan), np.full(3, truth.AMBIENT)).max() < truth.LIMIT + 0.02


def test_what_no_rest_can_help_is_cut_to_the_length_that_bisection_finds() -> None:
    plan = plan_mission(mission([{"do": "stand", "duration": 3000, "load": 4}]))

    def over(time: float) -> float:
        return float(truth.simulate([("stand", time, 0.0, 4.0)], np.full(3, truth.AMBIENT)).max() - truth.LIMIT)

    assert plan.verdict == "cut"
    when = brentq(over, 1.0, 3000.0)
    assert 3000 * plan.share[0] == pytest.approx(when, rel=2e-3)
    assert plan.obstacle is not None
    assert (plan.obstacle.node, plan.obstacle.name) == ("FR_calf", "stand 1")
    assert plan.obstacle.time == pytest.approx(when, abs=1.5)
    assert "FR_calf passes its 60 degC after" in plan_kind.run(plan.mission).text()
    assert plan.bottleneck == "FR_calf"


@pytest.mark.long
def test_where_no_plan_does_all_of_it_the_rise_that_would_do_is_the_one_of_the_coolest_plan() -> None:
    """By what a kelvin gains in work at the given limits 110 K are missing, more than is tried; it is less by far."""
    held = {"do": "stand", "duration": 900, "load": 4}
    plan = plan_mission(mission([held, held], ambient=58.0, start=40.0))
    stand, rest = ("stand", 900.0, 0.0, 4.0), ("rest", 3000.0, 0.0, 0.0)
    rise = truth.simulate([stand, rest, stand], np.full(3, 40.0), ambient=58.0).max() - truth.LIMIT
    shorter = truth.simulate([stand, ("rest", 2000.0, 0.0, 0.0), stand], np.full(3, 40.0), ambient=58.0).max()
    assert shorter - truth.LIMIT > 1.02 * rise, "the longest rest must be the coolest"
    assert plan.verdict == "cut"
    assert plan.raise_needed is not None
    assert 0.999 * rise < plan.raise_needed < 1.1 * rise + 0.1


def test_a_solve_that_no_plan_can_satisfy_ends_when_its_multipliers_grow_without_bound() -> None:
    """With 13 nodes such a solve took a minute, nearly all of it in the last two steps of IPOPT."""
    solution = MissionProgram(mission([WALK], ambient=65.0, start=40.0)).solve()
    assert (solution.success, solution.status) == (False, "Multipliers_Without_Bound")


def test_what_begins_above_its_limit_rests_until_it_is_below() -> None:
    start = {"*": 50.0, "FR_calf": 63.0}
    plan = plan_mission(mission([{"do": "walk", "distance": 60, "load": 0}], start=start))
    doing = pieces(plan)
    temperatures = truth.simulate(doing, np.array([50.0, 50.0, 63.0]))
    after = temperatures[:, 1 + 200 :]
    assert doing[0][0] == "rest"
    assert plan.verdict == "met"
    assert after.max() < truth.LIMIT + 0.02


def test_a_dead_sensor_is_taken_to_be_at_its_limit() -> None:
    asked = mission([{"do": "walk", "distance": 100, "load": 4, "pieces": 1}])
    blind = replace(asked, start=np.array([25.0, 25.0, np.nan]))
    answer = plan_kind.run(blind)
    hottest = truth.simulate(pieces(answer), np.array([25.0, 25.0, truth.LIMIT])).max()
    assert hottest < truth.LIMIT + 0.02
    assert answer.total > plan_mission(asked).total
    assert "no temperature of FR_calf: taken to be at its limit" in answer.text()
    assert answer.as_json()["assumed"] == ["FR_calf"]


@pytest.mark.long
def test_where_even_a_rest_is_too_hot_the_answer_says_so() -> None:
    asked = mission([{"do": "walk", "distance": 60}], deadline=500)
    answer = plan_kind.run(replace(asked, ambient=61.0, start=np.full(3, 61.0)))
    assert answer.verdict == "none"
    assert answer.prices == {}
    assert "even at rest" in answer.text()
    assert [segment.gait.name for segment in answer.segments] == ["rest"]


def test_limits_below_the_air_are_refused_where_the_task_is_read() -> None:
    with pytest.raises(InputError, match=r"limits\.FR_\w+: found 60 degC, which .* passes by task.ambient of 70 degC"):
        mission([{"do": "walk", "distance": 60}], ambient=70.0, start=25.0, deadline=5000)
    mission([{"do": "walk", "distance": 60}], ambient=70.0, start=25.0, deadline=60)  # cold enough for a minute


@pytest.mark.long
def test_a_rest_that_was_asked_for_yields_to_a_short_deadline() -> None:
    asked = [
        {"do": "walk", "distance": 50, "pieces": 1},
        {"do": "rest", "duration": 600},
        {"do": "walk", "distance": 50},
    ]
    plan = plan_mission(mission(asked, deadline=120, gives_up="distance"))
    assert plan.verdict == "cut"
    assert plan.share[0] == pytest.approx(1.0, abs=1e-4)
    assert plan.share[2] == pytest.approx(1.0, abs=1e-4)
    assert plan.total <= 120 * (1 + 1e-6)
    assert "rest 1 3.3 %" in plan_kind.run(plan.mission).text()


def test_a_deadline_below_the_fastest_time_is_distinguished_from_heat() -> None:
    answer = plan_kind.run(mission([{"do": "walk", "distance": 50}], deadline=20))
    assert answer.verdict == "late"
    assert answer.raise_needed is None
    assert "no rise of the limits would suffice: at its fastest it takes 50 s" in answer.text()


@pytest.mark.long
def test_whatever_is_asked_there_is_an_answer_and_it_is_safe() -> None:
    """Tasks from easy to absurd: none may end in an exception, none may pass a limit."""
    for distance, load, deadline in ((5.0, 0.0, 1.0), (5000.0, 4.0, 30.0), (900.0, 4.0, 86400.0)):
        for gives_up in ("deadline", "distance"):
            asked = mission([{"do": "walk", "distance": distance, "load": load, "pieces": 1}], deadline=deadline,
                            gives_up=gives_up)  # fmt: skip
            plan = plan_mission(asked)
            if plan.segments:
                hottest = truth.simulate(pieces(plan), np.full(3, truth.AMBIENT)).max()
                assert hottest < truth.LIMIT + 0.02, (distance, load, deadline, plan.verdict)
