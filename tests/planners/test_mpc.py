"""The thermal controller: against IPOPT, in closed loop on a robot that is not its model, and against bad input."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import Bounds, NonlinearConstraint, minimize

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.model.model import Model
from lptn.planners import TorqueMPC
from lptn.planners.mpc.reference import ReferenceProgram
from tests.benchmarks.torque_mpc_levels import loop, ripple
from tests.builders import LEG, effect, leg
from tests.planners.truth import World, conditions, model_of, true_robot

LIMIT = 60.0
REQUEST = np.array([6.0, 10.0, 14.0])
AROUND = {"temperature.ambient": 25.0}
KNOWN: dict[str, float] = {"level": 0.5, "margin": 0.15}
"""Settings for which the limits are those of a plan that knows all: no margin for what is not known."""


@cache
def leg_model(kappa: float = 0.0) -> Model:
    """Three joints with copper loss whose resistance rises."""
    effects = [effect("copper_loss"), effect("resistance_rise")]
    return Model(leg([*effects, effect("torque_constant_drop", kappa=kappa)] if kappa else effects))


@cache
def quadruped(error: float) -> Model:
    return model_of(true_robot(1), error, 1)


def test_it_finds_what_ipopt_finds() -> None:
    mpc = TorqueMPC(leg_model(), LIMIT, period=5, horizon=150, stages=30, **KNOWN)
    reference = ReferenceProgram(mpc.heating, mpc.settings)
    for start in (50.0, 55.0, 59.0, 61.0):
        mpc.reset()
        plan = mpc.step(np.full(3, start), REQUEST, AROUND)
        optimum = reference.solve(np.full(3, start), np.tile(REQUEST, (30, 1)), np.full((30, 1), 25.0))
        assert optimum.converged
        assert plan.converged
        assert plan.cost == pytest.approx(optimum.cost, rel=2e-4)
        np.testing.assert_allclose(plan.temperatures, optimum.temperatures, atol=0.02)


def test_with_smoothing_a_share_rises_slowly_and_falls_at_once() -> None:
    """A second step of the same request at other temperatures; the optimum without smoothing is where it goes."""
    plain, mpc = (TorqueMPC(leg_model(), LIMIT, period=5, smoothing=smoothing, model_error=0.0, noise=0.0, **KNOWN)
                  for smoothing in (0.0, 100.0))  # fmt: skip
    first = mpc.step(np.full(3, 59.0), REQUEST, AROUND).admitted
    assert first == pytest.approx(
        plain.step(np.full(3, 59.0), REQUEST, AROUND).admitted, rel=1e-6
    )  # nothing to rise from
    cooler, wanted = (controller.step(np.full(3, 57.0), REQUEST, AROUND).admitted for controller in (mpc, plain))
    assert (wanted > 1.01 * first).all()
    assert cooler == pytest.approx(first + (1 - np.exp(-5 / 100.0)) * (wanted - first), rel=2e-3)
    hotter, wanted = (controller.step(np.full(3, 60.0), REQUEST, AROUND).admitted for controller in (mpc, plain))
    assert hotter == pytest.approx(wanted, rel=2e-3)
    another, wanted = (controller.step(np.full(3, 57.0), 0.7 * REQUEST, AROUND).admitted for controller in (mpc, plain))
    assert another == pytest.approx(wanted, rel=2e-3)  # another request is no change of share


@pytest.mark.long
@pytest.mark.parametrize("resolution", [0.0, 1.0])
def test_noise_is_followed_slowly_at_a_limit(resolution: float) -> None:
    """Ripple under a constant request; it was twice as large when a node was brought to its limit in one period.

    A robot whose model is wrong by no more than it is told: where it is, readings are doubted by a share that varies.
    """
    assert ripple(102, 0.95, 0.1, resolution, 0.0) < (0.027 if resolution else 0.014)


@pytest.mark.long
def test_smoothing_halves_the_ripple_at_a_limit() -> None:
    ripples = []
    for smoothing in (0.0, 100.0):
        mpc = TorqueMPC(leg_model(), LIMIT, noise=0.3, smoothing=smoothing)
        random, T, admitted = np.random.default_rng(0), np.full(3, 59.0), []
        rate = mpc.heating.rate_function()
        for _ in range(150):
            plan = mpc.step(T + 0.3 * random.standard_normal(3), REQUEST, AROUND)
            T = T + 5 * np.asarray(rate(T, plan.admitted**2, [25.0], mpc.model.values)).ravel()
            admitted.append(plan.admitted)
        ripples.append(np.std(np.diff(admitted[50:], axis=0) / np.mean(admitted[50:], axis=0), axis=0).max())
    assert ripples[1] < 0.6 * ripples[0]


def test_growing_stages_cost_little() -> None:
    few = TorqueMPC(leg_model(), LIMIT, period=5, horizon=300, stages=13)
    many = TorqueMPC(leg_model(), LIMIT, period=5, horizon=300, stages=60)
    for start in (48.0, 54.0, 59.0):
        costs = []
        for mpc in (few, many):
            mpc.reset()
            costs.append(mpc.step(np.full(3, start), REQUEST, AROUND).cost)
        assert costs[0] == pytest.approx(costs[1], rel=0.015)


def test_the_plan_is_what_an_integrator_finds() -> None:
    """Copper loss, rising resistance and a torque constant that falls, written again without the model."""
    kappa = 0.0012
    mpc = TorqueMPC(leg_model(kappa), LIMIT, period=5, horizon=150, stages=30)
    plan = mpc.step(np.full(3, 45.0), REQUEST, AROUND)

    def slope(_: float, T: FloatArray, torque: FloatArray) -> FloatArray:
        current = torque / (0.84 * (1 - kappa * (T - 25)))
        heat = 0.15 * (1 + 0.0039 * (T - 25)) * current**2 - (T - 25.0) / 10
        heat[:2] += np.array([1, -1]) * (T[1] - T[0]) / 3
        heat[1:] += np.array([1, -1]) * (T[2] - T[1]) / 2
        return np.asarray(heat / 300)

    T = np.full(3, 45.0)
    for k, torque in enumerate(plan.currents):
        T = solve_ivp(slope, (0, 5), T, args=(torque,), rtol=1e-8).y[:, -1]
        np.testing.assert_allclose(plan.temperatures[:, k + 1], T, atol=0.02)


def test_a_falling_torque_constant_costs_torque() -> None:
    admitted = [
        TorqueMPC(leg_model(kappa), LIMIT, request="torque").step(np.full(3, 55.0), REQUEST, AROUND).admitted
        for kappa in (0.0, 0.003)
    ]
    assert np.all(admitted[1] < admitted[0])


def test_currents_and_torques_are_the_same_plan() -> None:
    """At a temperature that stays, a current is the torque divided by the torque constant there."""
    model, start = leg_model(0.0012), np.full(3, 59.8)
    torque = TorqueMPC(model, LIMIT, request="torque").step(start, REQUEST, AROUND)
    constant = 0.84 * (1 - 0.0012 * (start - 25))
    current = TorqueMPC(model, LIMIT, request="current").step(start, REQUEST / constant, AROUND)
    np.testing.assert_allclose(current.admitted * constant, torque.admitted, rtol=5e-3)


def test_a_request_that_stays_cool_is_granted_as_it_is() -> None:
    plan = TorqueMPC(leg_model(), LIMIT).step(np.full(3, 30.0), np.array([2.0, 3.0, -4.0]), AROUND)
    assert plan.full
    assert plan.iterations == 0
    assert plan.admitted.tolist() == [2.0, 3.0, -4.0]
    assert plan.given_up == ()


def test_a_heavier_joint_gets_more() -> None:
    equal = TorqueMPC(leg_model(), LIMIT).step(np.full(3, 55.0), REQUEST, AROUND)
    heavy = TorqueMPC(leg_model(), LIMIT, weights={"*": 1, "FR_calf": 5}).step(np.full(3, 55.0), REQUEST, AROUND)
    assert heavy.admitted[2] > equal.admitted[2] * 1.05
    assert heavy.admitted[1] < equal.admitted[1]


def test_the_rate_limit_holds() -> None:
    mpc = TorqueMPC(leg_model(), LIMIT, period=1, horizon=60, rates=0.5)
    before = np.zeros(3)
    for asked in (REQUEST, REQUEST, REQUEST / 2, REQUEST):
        admitted = mpc.step(np.full(3, 58.0), asked, AROUND).admitted
        assert np.all(admitted <= before + 0.5 + 1e-6)
        assert np.all(admitted >= np.minimum(before - 0.5, 0.95 * asked) - 1e-6)
        before = admitted


@pytest.mark.parametrize(("start", "steps"), [(45.0, 120), (61.0, 40), (63.0, 60)])
def test_limits_hold_on_a_robot_that_is_ten_percent_off(start: float, steps: int) -> None:
    mpc = TorqueMPC(quadruped(0.1), {"*_*": LIMIT}, request="torque", recovery=0.0)
    world, idle = World(true_robot(1), start, 0.1, seed=2), World(true_robot(1), start)
    request, around = np.tile([7.0, 12.0, 18.0], 4), conditions(mpc.conditions)
    for _ in range(steps):
        plan = mpc.step(world.read(), request, around)
        assert plan.converged
        # From above the limit nothing can do better than no torque at all.
        bound = np.maximum(idle.step(np.zeros(12), 5)[:, :12], LIMIT)
        assert (world.step(plan.admitted, 5)[:, :12] - bound).max() < 0.05


def test_what_the_model_lacks_is_learnt() -> None:
    """Without the estimate the robot passes the limit; `applied` says what was really done."""
    worst = {}
    for error in (0.0, 0.2):
        mpc = TorqueMPC(quadruped(0.1), {"*_*": LIMIT}, request="torque", margin=0.0, model_error=error, noise=0.02)
        world, around = World(true_robot(1), 50.0), conditions(mpc.conditions)
        worst[error], applied = 0.0, None
        for _ in range(90):
            applied = mpc.step(world.read(), np.tile([7.0, 12.0, 18.0], 4), around, applied).admitted
            worst[error] = max(worst[error], float(world.step(applied, 5)[:, :12].max()) - LIMIT)
    assert worst[0.0] > 0.05
    assert worst[0.2] < 0.02


def test_a_copy_at_other_values_plans_with_its_own() -> None:
    model = leg_model()
    weak = {f"resistance.{node}~ambient": 30.0 for node in LEG}
    values = np.array([weak.get(parameter.name, parameter.value) for parameter in model.parameters])
    mpc = TorqueMPC(model.with_values(values), LIMIT, period=5, horizon=150, stages=30, **KNOWN)
    plan = mpc.step(np.full(3, 55.0), REQUEST, AROUND)
    optimum = ReferenceProgram(mpc.heating, mpc.settings).solve(
        np.full(3, 55.0), np.tile(REQUEST, (30, 1)), np.full((30, 1), 25.0)
    )
    assert plan.cost == pytest.approx(optimum.cost, rel=2e-4)
    assert plan.cost > 1.05 * TorqueMPC(model, LIMIT, horizon=150, **KNOWN).step(np.full(3, 55.0), REQUEST, AROUND).cost


# --- what is not known ---------------------------------------------------------------------------------


@pytest.mark.long
@pytest.mark.parametrize("resolution", [pytest.param(0.0, marks=pytest.mark.slow), 1.0])
def test_limits_are_passed_no_oftener_than_the_level_says(resolution: float) -> None:
    """Parameters 20 % off, an ambient that is unknown by up to 10 K, noise or whole degrees, in closed loop."""
    for level in (0.8, 0.95):
        runs = [loop(seed, level, 0.5 if not resolution else 0.1, resolution) for seed in range(300, 304)]
        over, held, *_ = (np.concatenate(parts) for parts in zip(*runs, strict=True))
        assert held.sum() > 1000
        assert (over[held] > 0).mean() < 1 - level


@pytest.mark.long
def test_sensors_that_are_all_hotter_than_the_model_are_not_called_false() -> None:
    """An air that is 10 K hotter than is told, and parameters 20 % off: as a drift of all it was, 15 K above."""
    over, *_ = loop(1202, 0.8, 0.1, 1.0)
    assert over.max() < 0.5


def test_the_margin_is_what_the_level_asks_of_the_covariance() -> None:
    """Readings taken as they are: their own noise. A filter: less, the longer it has looked; more for whole degrees."""
    start = np.full(3, 55.0)
    plain = TorqueMPC(leg_model(), LIMIT, noise=0.5, model_error=0.0).step(start, REQUEST, AROUND)
    np.testing.assert_allclose(plain.margin, 1.645 * 0.5 * 1.0, rtol=1e-3)
    more = TorqueMPC(leg_model(), LIMIT, noise=0.5, model_error=0.0, level=0.99).step(start, REQUEST, AROUND)
    np.testing.assert_allclose(more.margin, 2.326 * 0.5, rtol=1e-3)
    assert np.all(more.admitted < plain.admitted)
    fine, coarse = TorqueMPC(leg_model(), LIMIT), TorqueMPC(leg_model(), LIMIT, resolution=1.0)
    first = fine.step(start, REQUEST, AROUND).margin
    random, T, rate = np.random.default_rng(0), start, fine.heating.rate_function()
    for _ in range(60):
        read = T + 0.1 * random.standard_normal(3)
        admitted = fine.step(read, REQUEST, AROUND).admitted
        rough = coarse.step(np.round(read), REQUEST, AROUND, applied=admitted).margin
        T = T + 5 * np.asarray(rate(T, admitted**2, [25.0], fine.model.values)).ravel()
    precise = fine.step(T, REQUEST, AROUND).margin
    assert np.all(precise < first)
    assert np.all(rough > precise)


def test_standard_errors_of_parameters_widen_the_margin() -> None:
    name = "resistance.FR_calf~ambient"
    certain = TorqueMPC(leg_model(), LIMIT, model_error=0.05)
    doubted = TorqueMPC(leg_model(), LIMIT, model_error=0.05, standard_errors={name: 5.0})
    # A resistance of 10 K/W that is unsure by half; all else as before, where sensors are tested, too.
    added = np.sqrt(doubted.settings.errors**2 - certain.settings.errors**2)
    assert np.sort(added.ravel())[-2:] == pytest.approx([0.0, 0.5])
    start = np.full(3, 55.0)
    margins = [mpc.step(start, REQUEST, AROUND).margin for mpc in (certain, doubted)]
    assert margins[1][2] > margins[0][2]
    with pytest.raises(InputError, match="no such parameter"):
        TorqueMPC(leg_model(), LIMIT, standard_errors={"resistance.nowhere": 1.0})


def test_a_parameter_of_zero_may_be_unsure() -> None:
    """Its logarithm is none: the error was told and did nothing."""
    model = Model(leg([effect("copper_loss"), effect("resistance_rise"), effect("torque_constant_drop", kappa=0.0)]))
    name = next(parameter.name for parameter in model.parameters if "kappa" in parameter.name)
    margins, found = [], []
    for error in (0.0, 0.002):
        mpc = TorqueMPC(model, LIMIT, request="torque", standard_errors={name: error})
        for reading in (50.0, 50.2, 50.6):  # hotter than the model has it
            plan = mpc.step(np.full(3, reading), REQUEST, AROUND)
        margins.append(plan.margin)
        found.append(mpc.parameters[name])
    assert found[0] == 0.0
    assert found[1] > 1e-4
    assert margins[1][0] > margins[0][0]


# --- what can go wrong --------------------------------------------------------------------------------


def test_a_missing_reading_is_predicted() -> None:
    mpc, start = TorqueMPC(leg_model(), LIMIT), np.array([50.0, 55.0, 58.0])
    mpc.step(start, REQUEST, AROUND)
    expected = mpc.step(start, REQUEST, AROUND).admitted
    for absurd in (np.nan, np.inf, 4000.0, -273.0):
        plan = mpc.step([50.0, absurd, 58.0], REQUEST, AROUND)
        assert plan.converged
        assert any("FR_thigh has no reading; the model stands in" in said for said in plan.given_up)
        np.testing.assert_allclose(plan.admitted, expected, rtol=0.2)


def test_a_node_that_was_never_read_counts_as_hot() -> None:
    warm = TorqueMPC(leg_model(), LIMIT).step([40.0, np.nan, 58.0], REQUEST, AROUND)
    assert warm.temperatures[1, 0] == 58.0
    blind = TorqueMPC(leg_model(), LIMIT, **KNOWN).step([np.nan] * 3, REQUEST, AROUND)
    seen = TorqueMPC(leg_model(), LIMIT, **KNOWN).step(np.full(3, LIMIT - 0.15), REQUEST, AROUND)
    np.testing.assert_allclose(blind.admitted, seen.admitted)


@pytest.mark.parametrize("start", [63.0, 90.0, 300.0])
def test_a_start_above_the_limit_admits_next_to_nothing(start: float) -> None:
    plan = TorqueMPC(leg_model(), LIMIT, recovery=0.0).step(np.full(3, start), REQUEST, AROUND)
    assert plan.converged
    assert np.all(np.abs(plan.admitted) <= 0.05 * REQUEST)
    assert plan.given_up[0].startswith("a limit less its margin can't be met: FR_hip by ")


def test_a_plan_prints_what_is_admitted_and_what_was_given_up() -> None:
    mpc = TorqueMPC(leg_model(), LIMIT)
    idle = mpc.step(np.full(3, 30.0), np.zeros(3), AROUND)
    assert repr(idle) == "<Plan: no joint is asked for anything>"
    light = mpc.step(np.full(3, 30.0), np.array([0.0, 1.0, 1.0]), AROUND)
    assert repr(light) == "<Plan: all that is asked is admitted>"
    np.testing.assert_array_equal(light.shares, [np.nan, 1.0, 1.0])
    mpc.reset()
    hot = mpc.step([40.0, 40.0, 66.0], REQUEST, AROUND)
    least = f"{hot.admitted[2] / REQUEST[2]:.0%}"
    assert f"joints cut, FR_calf most, to {least}; a limit less its margin can't be met: FR_calf by" in repr(hot)
    table = hot.to_pandas()
    assert list(table.columns) == ["joint", "asked [N*m]", "admitted [N*m]", "share"]
    np.testing.assert_array_equal(table["admitted [N*m]"], hot.admitted)
    assert len(str(hot).splitlines()) == 6


def test_a_recovery_spares_the_neighbours() -> None:
    """A hot calf: at once, all that warms it is cut; with a time constant of half a minute the hip goes on."""
    start, grid = np.array([40.0, 40.0, 63.0]), {"period": 5.0, "horizon": 150.0, "stages": 30, **KNOWN}
    at_once = TorqueMPC(leg_model(), LIMIT, recovery=0.0, **grid).step(start, REQUEST, AROUND)
    mpc = TorqueMPC(leg_model(), LIMIT, recovery=60.0, **grid)
    slowly = mpc.step(start, REQUEST, AROUND)
    assert at_once.admitted[0] < 0.1 * REQUEST[0]
    assert slowly.admitted[0] > 0.8 * REQUEST[0]
    course = mpc.settings.planned_limits[2] + (63.0 - mpc.settings.planned_limits[2]) * np.exp(
        -np.arange(31) * 5 / 60.0
    )
    assert np.all(slowly.temperatures[2] <= course + 1e-3)
    optimum = ReferenceProgram(mpc.heating, mpc.settings).solve(
        start, np.tile(REQUEST, (30, 1)), np.full((30, 1), 25.0)
    )
    assert slowly.cost == pytest.approx(optimum.cost, rel=1e-3)


def test_torque_falls_smoothly_with_what_a_node_is_above_its_limit() -> None:
    """From what holds the limit to nothing at 10 K above it, the same law at a hair above the limit as anywhere."""
    mpc, above = TorqueMPC(leg_model(), LIMIT, level=0.5), np.array([0.0, 0.05, 1.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0])
    shares = []
    for over in above:
        mpc.reset()
        plan = mpc.step(np.full(3, LIMIT + over), np.full(3, 14.0), AROUND)
        shares.append((plan.admitted**2).sum())
    shares = np.array(shares) / shares[0]
    assert shares[1] > 0.98
    assert np.all(np.diff(shares) < 1e-6)
    # Heat in proportion to what is left of the band, but that air of 25 degC cools a hotter node a little better.
    np.testing.assert_allclose(shares[2:7], 1 - above[2:7] / 10, atol=0.25)
    assert shares[-1] < 0.35


def test_a_node_above_its_limit_comes_down_by_the_law() -> None:
    """In closed loop, by an integrator: from 6 K above, exponentially, and no faster than the law asks."""
    tau = 300.0
    mpc = TorqueMPC(leg_model(), LIMIT, level=0.5, model_error=0.0, recovery=tau)
    T, course = np.array([50.0, 55.0, 66.0]), []

    def slope(_: float, T: FloatArray, torque: FloatArray) -> FloatArray:
        heat = 0.15 * (1 + 0.0039 * (T - 25)) * (torque / 0.84) ** 2 - (T - 25.0) / 10
        heat[:2] += np.array([1, -1]) * (T[1] - T[0]) / 3
        heat[1:] += np.array([1, -1]) * (T[2] - T[1]) / 2
        return np.asarray(heat / 300)

    for _ in range(40):
        torque = mpc.step(T, np.full(3, 14.0), AROUND).admitted
        T = solve_ivp(slope, (0, 5), T, args=(torque,), rtol=1e-8).y[:, -1]
        course.append(T[2] - LIMIT)
    np.testing.assert_allclose(course, 6 * np.exp(-np.arange(1, 41) * 5 / tau), atol=0.1)


def test_floors_come_first() -> None:
    """What holds the robot up is given though the calf is hot; where less is asked, that is given whole."""
    mpc = TorqueMPC(leg_model(), LIMIT, floors={"FR_calf": 8.0, "FR_thigh": 30.0}, recovery=0.0)
    plan = mpc.step([50.0, 50.0, 66.0], REQUEST, AROUND)
    assert plan.converged
    assert plan.admitted[2] >= 8.0 * 0.999
    assert plan.admitted[1] >= REQUEST[1] * 0.999
    assert plan.admitted[0] < 0.1 * REQUEST[0]
    assert "can't be met: FR_" in plan.given_up[0]


def test_priorities_say_who_gives_way_first() -> None:
    equal = TorqueMPC(leg_model(), LIMIT).step(np.full(3, 57.0), REQUEST, AROUND)
    first = TorqueMPC(leg_model(), LIMIT, priorities={"FR_calf": 1}).step(np.full(3, 57.0), REQUEST, AROUND)
    assert equal.admitted[2] < 0.6 * REQUEST[2]
    assert first.admitted[2] > equal.admitted[2] * 1.1
    assert np.all(first.admitted[:2] < 0.3 * REQUEST[:2])


def test_an_infeasible_task_is_answered_with_its_slack() -> None:
    plan = TorqueMPC(leg_model(), LIMIT).step(np.full(3, 59.0), REQUEST, {"temperature.ambient": 150.0})
    assert plan.converged
    assert plan.slack.max() > 1
    assert np.all(plan.admitted <= REQUEST)
    assert "can't be met" in plan.given_up[0]


def test_ten_times_the_current_limit_is_cut_to_it() -> None:
    mpc = TorqueMPC(leg_model(), LIMIT, current_limits=20.0)
    plan = mpc.step(np.full(3, 30.0), np.full(3, 10 * 20.0 * 0.84), AROUND)
    assert plan.converged
    assert np.all(plan.admitted / 0.84 <= 20.0 + 1e-9)
    assert any("above the current limit" in said for said in plan.given_up)


SPEEDS = {"velocity.FR_hip": 2.0, "velocity.FR_thigh": -3.0, "velocity.FR_calf": 4.0}  # rad/s


def supplied(torque: FloatArray, temperature: FloatArray) -> float:
    """What the leg takes from its supply [W]: copper loss and |torque x speed|, written again."""
    copper = 0.15 * (1 + 0.0039 * (temperature - 25)) * (torque / 0.84) ** 2
    return float((copper + torque * np.abs(list(SPEEDS.values()))).sum())


@pytest.mark.parametrize("limit", [2000.0, 60.0, 30.0, 5.0])
def test_the_power_of_all_joints_is_limited_at_the_least_cost(limit: float) -> None:
    """Of one cool stage, beside SciPy's SLSQP."""
    start = np.array([30.0, 35.0, 40.0])
    mpc = TorqueMPC(leg_model(), LIMIT, stages=1, horizon=5, model_error=0.0, power_limit=limit)
    plan = mpc.step(start, REQUEST, AROUND | SPEEDS)
    room = NonlinearConstraint(lambda torque: [supplied(torque, start)], -np.inf, limit)
    missing = lambda torque: ((torque - REQUEST) ** 2).sum() / (REQUEST**2).sum()  # noqa: E731
    best = minimize(missing, 0.3 * REQUEST, method="SLSQP", bounds=Bounds(0, REQUEST), constraints=room, tol=1e-12)
    assert plan.converged
    assert plan.power[0] == pytest.approx(supplied(plan.admitted, start), rel=1e-6)
    assert plan.power[0] <= limit
    assert plan.full == (limit > supplied(REQUEST, start))
    assert plan.cost == pytest.approx(best.fun, abs=5e-4)


def test_power_and_temperatures_are_limited_together_as_by_ipopt() -> None:
    mpc = TorqueMPC(leg_model(), LIMIT, stages=30, horizon=150, model_error=0.0, power_limit=40.0, **KNOWN)
    reference, given = ReferenceProgram(mpc.heating, mpc.settings), AROUND | SPEEDS
    around = np.tile([given[name] for name in mpc.conditions], (30, 1))
    for start in (40.0, 55.0, 59.0):
        mpc.reset()
        plan = mpc.step(np.full(3, start), REQUEST, given)
        optimum = reference.solve(np.full(3, start), np.tile(REQUEST, (30, 1)), around)
        assert plan.converged
        assert plan.cost == pytest.approx(optimum.cost, rel=2e-4)
        np.testing.assert_allclose(plan.temperatures, optimum.temperatures, atol=0.05)
        for torque, ends in zip(plan.currents, plan.temperatures.T, strict=False):
            assert supplied(torque, ends) <= 40.0 * 1.001


def test_floors_that_need_more_than_the_power_limit_are_told() -> None:
    mpc = TorqueMPC(leg_model(), LIMIT, floors={"FR_calf": 10.0}, power_limit=5.0)
    plan = mpc.step(np.full(3, 40.0), REQUEST, AROUND | SPEEDS)
    assert plan.admitted[2] == pytest.approx(10.0, rel=1e-3)
    assert plan.power[0] > 5.0
    assert any("power is above its limit" in said for said in plan.given_up)
    with pytest.raises(InputError, match="a power above 0 W"):
        TorqueMPC(leg_model(), LIMIT, power_limit=0.0)


def test_a_power_whose_speed_was_never_known_is_floors() -> None:
    """No speed is assumed, for any would be a guess; one that was known once stands in."""
    mpc = TorqueMPC(leg_model(), LIMIT, request="torque", floors={"FR_calf": 2.0}, power_limit=30.0, model_error=0.0)
    told = mpc.step(np.full(3, 40.0), REQUEST, AROUND | SPEEDS)
    mpc.reset()
    blind = AROUND | SPEEDS | {"velocity.FR_thigh": np.nan, "velocity.FR_calf": np.nan}
    first = mpc.step(np.full(3, 40.0), REQUEST, blind)
    assert first.admitted[0] == pytest.approx(REQUEST[0], rel=1e-3)
    assert first.admitted[1] < 0.002 * REQUEST[1]
    assert first.admitted[2] == pytest.approx(2.0, rel=1e-3)
    assert supplied(first.admitted, np.full(3, 40.0)) <= 30.0
    assert any("under a power limit" in said for said in first.given_up)
    for given_now in (AROUND | SPEEDS, blind):
        plan = mpc.step(np.full(3, 40.0), REQUEST, given_now)
        assert plan.cost == pytest.approx(told.cost, abs=1e-4)
        assert 25.0 < supplied(plan.admitted, np.full(3, 40.0)) <= 30.0 * 1.001


def test_requests_and_conditions_that_are_no_numbers() -> None:
    mpc = TorqueMPC(leg_model(), LIMIT)
    plan = mpc.step(np.full(3, 50.0), [np.nan, 10.0, np.inf], {"temperature.ambient": 25.0})
    assert plan.admitted[0] == 0.0
    assert plan.admitted[2] == 0.0
    assert any("taken as zero" in said for said in plan.given_up)
    later, other = [], TorqueMPC(leg_model(), LIMIT)
    other.step(np.full(3, 50.0), [np.nan, 10.0, np.inf], AROUND)
    for controller, ambient in ((mpc, np.nan), (other, 25.0)):
        later.append(controller.step(np.full(3, 50.0), REQUEST, {"temperature.ambient": ambient}))
    assert any("condition is no number" in said for said in later[0].given_up)
    assert later[0].admitted.tolist() == later[1].admitted.tolist()


def test_one_absurd_moment_is_forgotten() -> None:
    """An ambient of 1e30 degC is a finite number, and the plan of that moment is worth nothing; but the next one is."""
    mpc, spared = TorqueMPC(leg_model(), LIMIT), TorqueMPC(leg_model(), LIMIT)
    for ambient in (25.0, 1e30, 1e308):
        spared.step(np.full(3, 55.0), REQUEST, AROUND)
        plan = mpc.step(np.full(3, 55.0), REQUEST, {"temperature.ambient": ambient})
        assert np.all(np.isfinite(plan.admitted))
        assert np.all(np.abs(plan.admitted) <= REQUEST)
    later = mpc.step(np.full(3, 55.0), REQUEST, AROUND)
    np.testing.assert_allclose(later.admitted, spared.step(np.full(3, 55.0), REQUEST, AROUND).admitted, rtol=1e-4)
    assert later.converged


def test_nothing_asked_is_nothing_admitted() -> None:
    plan = TorqueMPC(leg_model(), LIMIT).step(np.full(3, 70.0), np.zeros(3), AROUND)
    assert plan.admitted.tolist() == [0.0, 0.0, 0.0]


_STARTS = ((20.0, 60.0), (55.0, 65.0), (20.0, 120.0))


@given(st.integers(0, 10**6))
def test_it_always_converges_and_never_admits_more_than_is_asked(seed: int) -> None:
    random = np.random.default_rng(seed)
    mpc = _any_controller()
    if random.random() < 0.5:
        mpc.reset()
    request = random.uniform(0, 10 ** random.uniform(0, 3), (mpc.settings.stages.size, 3))
    request[random.random(request.shape) < 0.2] = 0.0
    plan = mpc.step(random.uniform(*_STARTS[random.integers(3)], 3), request, AROUND)
    assert plan.converged
    assert np.all((plan.currents >= 0) & (plan.currents <= request + 1e-9))
    over = plan.temperatures[:3, 1:].T - mpc.settings.planned_limits
    judged = [
        node not in plan.untrusted for node in plan.limited
    ]  # a lost sensor's node comes to its limit in its time
    assert np.all((over <= plan.slack + 1e-6)[:, judged])


@cache
def _any_controller() -> TorqueMPC:
    return TorqueMPC(leg_model(), {"*": LIMIT, "FR_hip": 55.0}, current_limits=40.0)


# --- mistakes -----------------------------------------------------------------------------------------


def test_mistakes_are_said_in_one_line() -> None:
    model = leg_model()
    mistakes: tuple[dict[str, Any], ...] = (
        {"limits": {"FL_calf": 60.0}},
        {"limits": {"*": float("nan")}},
        {"limits": {}},
        {"limits": 60.0, "margin": -1.0},
        {"limits": 60.0, "weights": {"FR_hip": 0.0}},
        {"limits": 60.0, "recovery": -1.0},
        {"limits": 60.0, "floors": -1.0},
        {"limits": 60.0, "level": 1.0},
        {"limits": 60.0, "priorities": 3},
    )
    for wrong in mistakes:
        with pytest.raises(InputError):
            TorqueMPC(model, **wrong)
    with pytest.raises(ValueError, match="period"):
        TorqueMPC(model, 60.0, period=10, horizon=5)
    mpc = TorqueMPC(model, 60.0)
    with pytest.raises(InputError, match="unknown name"):
        mpc.step({"FL_calf": 30.0}, REQUEST, AROUND)
    with pytest.raises(InputError, match="shape"):
        mpc.step(np.zeros(4), REQUEST, AROUND)


def test_a_model_without_currents_is_refused() -> None:
    with pytest.raises(InputError, match="no torque or current"):
        TorqueMPC(Model(leg([effect("constant_heat")])), 60.0)


def test_names_or_order_are_the_same() -> None:
    by_name = TorqueMPC(leg_model(), LIMIT).step(
        dict(zip(LEG, (50.0, 55.0, 58.0), strict=True)), dict(zip(LEG, REQUEST, strict=True)), AROUND
    )
    by_order = TorqueMPC(leg_model(), LIMIT).step([50.0, 55.0, 58.0], REQUEST, [25.0])
    assert by_name.admitted.tolist() == by_order.admitted.tolist()
