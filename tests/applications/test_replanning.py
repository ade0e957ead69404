"""Missions in closed loop: a leg whose true parameters are not the model's, simulated by scipy."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from lptn.applications.replanning import MissionControl, Order
from lptn.basics.errors import InputError
from lptn.model.model import Model
from lptn.planners.mission import Mission, plan_kind, plan_mission
from tests.planners import mission_truth as truth

WALK = {"do": "walk", "distance": 300, "load": 4, "pieces": 2}
DT = 20.0  # s


def model_off(error: float) -> Model:
    """The leg's model with heat and conductances to the air such that it is too careful (above 0) or too bold."""
    right = truth.model()
    values = right.values
    for row, parameter in enumerate(right.parameters):
        if parameter.name.startswith("copper_loss.resistance") or parameter.name.endswith("~ambient"):
            values[row] *= 1 + error
    return right.with_values(values)


def mission(error: float, activities: list[dict[str, Any]] | None = None, **task: Any) -> Mission:
    asked = truth.task(activities or [WALK, WALK], **({"longest_rest": 3000} | task))
    return plan_kind.read(asked, "task.toml", model_off(error))


def inputs_of(asked: Mission, order: Order, ambient: float, stronger: float = 1.0) -> dict[str, float]:
    gaits = {activity.do: activity.gait for activity in asked.activities} | {"rest": asked.rest}
    gait = gaits[order.do]
    assert gait is not None
    values = dict(zip(asked.model.inputs, gait.at(order.speed, order.load).tolist(), strict=True))
    heavier = {name: stronger * value for name, value in values.items() if name.startswith("torque.")}
    return values | heavier | {"temperature.ambient": ambient, "speed.base": order.speed}


def closed_loop(asked: Mission, hot_from: float = np.inf, **settings: Any) -> tuple[MissionControl, float, float]:
    """The control, how long it took [s], the hottest temperature [degC]; the air is 8 K warmer from `hot_from` on."""
    control = MissionControl(asked, period=90.0, **settings)
    random = np.random.default_rng(3)
    now, clock, hottest = np.full(3, truth.AMBIENT), 0.0, -np.inf
    order = control.update(dict(zip(truth.VELOCITY, now, strict=True)), inputs_of(asked, Order("", "rest"), 25.0), 0.0)
    while not order.finished and clock < 20000:
        seconds = float(np.clip(order.seconds, 0.5, DT))
        air = truth.AMBIENT + 8.0 * (clock >= hot_from)
        path = truth.simulate([(order.do, seconds, order.speed, order.load)], now, air)
        now, clock, hottest = path[:, -1], clock + seconds, max(hottest, path.max())
        readings = dict(zip(truth.VELOCITY, now + 0.1 * random.standard_normal(3), strict=True))
        order = control.update(readings, inputs_of(asked, order, air), seconds)
    return control, clock, hottest


def fixed(asked: Mission) -> tuple[float, float]:
    plan = plan_mission(asked, explain=False)
    doing = [(segment.gait.name, time, speed, load) for segment, time, speed, load, _ in plan.pieces]
    return plan.total, float(truth.simulate(doing, np.full(3, truth.AMBIENT)).max())


@pytest.mark.long
def test_a_plan_that_is_too_careful_becomes_faster_and_keeps_the_limit() -> None:
    asked = mission(+0.15)
    planned, _ = fixed(asked)
    control, took, hottest = closed_loop(asked)
    assert hottest < truth.LIMIT
    assert took < 0.9 * planned
    assert min(control.done.values()) == pytest.approx(1.0, abs=0.01)
    assert len(control.replanned) > 1


@pytest.mark.long
def test_a_plan_that_is_too_bold_yields_before_the_limit() -> None:
    asked = mission(-0.15)
    _, beyond = fixed(asked)
    control, _, hottest = closed_loop(asked)
    assert beyond > truth.LIMIT + 2.0, "the fixed plan must fail"
    assert hottest < truth.LIMIT + 0.1
    assert min(control.done.values()) == pytest.approx(1.0, abs=0.01)
    assert any("above its limit of 60 degC" in change.why for change in control.replanned)


@pytest.mark.long
def test_air_that_warms_is_followed() -> None:
    control, _, hottest = closed_loop(mission(0.0), hot_from=300.0)
    assert hottest < truth.LIMIT + 0.1
    assert control.replanned[-1].plan.mission.ambient == truth.AMBIENT + 8.0


def test_a_gait_becomes_as_heavy_as_it_was_measured() -> None:
    asked = mission(0.0)
    control = MissionControl(asked)
    still = dict.fromkeys(truth.VELOCITY, truth.AMBIENT)
    order = control.update(still, inputs_of(asked, Order("", "rest"), truth.AMBIENT), 0.0)
    for _ in range(10):
        control.update(still, inputs_of(asked, order, truth.AMBIENT, stronger=1.1), 5.0)
    row = asked.model.inputs.index("torque.FR_calf")
    before, after = (m.activities[0].gait.at(0.6, 4.0)[row] for m in (asked, control.remaining()))
    trusted = 60.0 / (60.0 + 50.0)  # the table counts as a minute of measuring
    assert after / before == pytest.approx(np.sqrt(trusted + (1 - trusted) * 1.21), rel=0.02)


def test_what_is_left_is_what_was_not_done() -> None:
    asked = mission(0.0, deadline=4000)
    control = MissionControl(asked)
    still = dict.fromkeys(truth.VELOCITY, truth.AMBIENT)
    order = control.update(still, inputs_of(asked, Order("", "rest"), truth.AMBIENT), 0.0)
    control.update(still, inputs_of(asked, order, truth.AMBIENT), 20.0, moved=12.0)
    left = control.remaining()
    assert left.activities[0].distance == pytest.approx(288.0)
    assert left.activities[1].distance == 300.0
    assert left.deadline == pytest.approx(3980.0)
    assert control.done == {"walk 1": pytest.approx(0.04), "walk 2": 0.0}


@pytest.mark.parametrize("wrong", [{"level": 1.0}, {"period": 0.0}, {"apart": float("nan")}])
def test_settings_that_mean_nothing_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=next(iter(wrong))):
        MissionControl(mission(0.0), **wrong)


def test_when_the_time_is_over_so_is_the_mission() -> None:
    asked = mission(0.0, deadline=100, gives_up="distance")
    control = MissionControl(asked)
    still = dict.fromkeys(truth.VELOCITY, truth.AMBIENT)
    order = control.update(still, inputs_of(asked, Order("", "rest"), truth.AMBIENT), 0.0)
    for _ in range(6):  # without readings: such as stay where they are while a robot walks are not believed
        order = control.update({}, inputs_of(asked, order, truth.AMBIENT), 20.0)
    assert order.finished
    assert sum(control.done.values()) == pytest.approx(100 / 300, rel=0.05), "a metre a second, until the deadline"
