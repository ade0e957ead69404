"""Admissible torque: against bisection on a simulator that shares nothing with the model."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.model.model import Model
from lptn.model.network import Network
from lptn.planners import Limiter
from tests.builders import AMBIENT, effect, leg, link, node
from tests.planners.truth import World, conditions, model_of, true_robot

LIMIT, MOST = 60.0, 60.0  # degC, A
CONSTANT = 9.1 * 0.0927  # N*m/A
AROUND = [25.0]


@cache
def limiter() -> Limiter:
    return Limiter(model_of(true_robot(3), 0.0), {"*_*": LIMIT}, current_limits=MOST)


def stays_cool(torque: FloatArray, start: FloatArray, seconds: int) -> bool:
    """Whether no joint of the true robot passes the limit."""
    return bool(World(true_robot(3), start).step(torque, seconds)[:, :12].max() <= LIMIT)


def bisected(load: FloatArray, direction: FloatArray, start: FloatArray, seconds: int, most: float) -> float:
    """The largest factor on `direction`, added to the load, that stays cool."""
    low, high = 0.0, most
    if stays_cool(load + high * direction, start, seconds):
        return most
    for _ in range(16):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stays_cool(load + middle * direction, start, seconds) else (low, middle)
    return 0.5 * (low + high)


@pytest.mark.long
@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(("row", "seconds"), [(0, 10), (1, 60), (2, 300)])
def test_admissible_torque_is_what_bisection_finds(seed: int, row: int, seconds: int) -> None:
    random = np.random.default_rng(seed)
    start, load = random.uniform(30, 58, 13), random.uniform(0, 5, 12)
    admissible = limiter().admissible(start, load, conditions(limiter().conditions))
    for joint in (0, 4, 8, 11):
        others, direction = load * (np.arange(12) != joint), np.eye(12)[joint]
        expected = bisected(others, direction, start, seconds, MOST * CONSTANT)
        assert admissible[joint, row] == pytest.approx(expected, rel=1e-3)


@pytest.mark.long
def test_continuous_torque_settles_at_the_limit() -> None:
    load, around = np.full(12, 1.5), conditions(limiter().conditions)
    admissible = limiter().admissible(np.full(13, 40.0), load, around)[:, 3]
    for joint in (2, 7):
        torque = np.where(np.arange(12) == joint, admissible[joint], load)
        settled = World(true_robot(3), 50.0).step(torque, 20_000)[-1, :12]
        assert settled.max() == pytest.approx(LIMIT, abs=0.02)


@pytest.mark.long
@pytest.mark.parametrize("seconds", [10.0, 60.0, 300.0])
def test_the_largest_scale_is_what_bisection_finds(seconds: float) -> None:
    activity, start = np.tile([4.0, 7.0, 9.0], 4), np.linspace(40, 55, 13)
    scale = limiter().largest_scale(start, activity, seconds, conditions(limiter().conditions))
    expected = bisected(np.zeros(12), activity, start, int(seconds), 20.0)
    assert scale == pytest.approx(min(expected, MOST * CONSTANT / 9.0), rel=1e-3)


def test_longer_is_less() -> None:
    load = np.full(12, 1.0)
    admissible = limiter().admissible(np.full(13, 45.0), load, conditions(limiter().conditions))
    assert np.all(np.diff(admissible, axis=1) <= 1e-9)
    assert admissible.min() > 1.0


# --- edges, on three joints -----------------------------------------------------------------------------


@cache
def small(kappa: float = 0.0, **more: float) -> Limiter:
    effects = [effect("copper_loss"), effect("resistance_rise")]
    extra = [effect("torque_constant_drop", kappa=kappa)] if kappa else []
    return Limiter(Model(leg(effects + extra)), LIMIT, **more)


def test_a_node_above_its_limit_admits_nothing() -> None:
    assert not small().admissible(np.full(3, 62.0), np.zeros(3), AROUND)[:, :1].any()
    assert small().largest_scale(np.full(3, 62.0), np.ones(3), 10.0, AROUND) == 0.0


def test_a_neighbour_that_overheats_by_itself_admits_nothing() -> None:
    admissible = small().admissible([40.0, 40.0, 59.9], [0.0, 0.0, 40.0], AROUND)
    assert not admissible[0].any()
    assert not admissible[1].any()
    assert admissible[2, 0] > 0


def test_what_is_no_number_admits_nothing() -> None:
    admissible = small().admissible([40.0, np.nan, 40.0], np.zeros(3), AROUND)
    assert np.all(admissible == 0.0)
    assert np.all(small().admissible(np.full(3, 40.0), np.zeros(3), [np.nan]) == 0.0)


def test_the_current_limit_is_an_end() -> None:
    admissible = small(current_limits=5.0).admissible(np.full(3, 30.0), np.zeros(3), AROUND)
    assert admissible[:, 0].tolist() == pytest.approx([5.0 * 0.84] * 3)


def test_no_load_has_no_largest_scale() -> None:
    assert small().largest_scale(np.full(3, 30.0), np.zeros(3), 60.0, AROUND) == float("inf")


def test_a_falling_torque_constant_admits_less() -> None:
    start = np.full(3, 50.0)
    assert np.all(small(0.003).admissible(start, np.zeros(3), AROUND) < small().admissible(start, np.zeros(3), AROUND))


def test_the_function_is_what_is_called() -> None:
    one, x, load = small(0.0012), np.array([40.0, 50.0, 55.0]), np.array([1.0, 2.0, 3.0])
    flat = one.function(x, load, AROUND, one.model.values, one.limits, one.most)
    admissible = one.admissible(x, load, AROUND)
    np.testing.assert_allclose(np.asarray(flat).reshape(admissible.shape), admissible, rtol=1e-12)


def test_mistakes_are_refused() -> None:
    with pytest.raises(InputError):
        Limiter(small().model, {"nowhere": 60.0})
    with pytest.raises(InputError):
        Limiter(small().model, {})
    with pytest.raises(ValueError, match="horizons"):
        Limiter(small().model, 60.0, horizons=(0.0,))
    with pytest.raises(InputError, match="unknown name"):
        small().admissible({"FL_calf": 3.0}, np.zeros(3), AROUND)


# --- on the safe side -----------------------------------------------------------------------------------


@pytest.mark.parametrize("limit", [60.0, 150.0])
def test_it_errs_to_the_safe_side_by_a_hundred_thousandth_at_most(limit: float) -> None:
    """Far below a high limit copper's resistance rises by half on the way, and Newton's method comes from above."""
    effects = [effect("copper_loss"), effect("resistance_rise"), effect("torque_constant_drop", kappa=0.0012)]
    limiter = Limiter(Model(leg(effects)), limit, horizons=(10.0, 300.0))
    random = np.random.default_rng(1)
    for _ in range(4):
        start = random.uniform(20, limit - 1, 3)
        admissible = limiter.admissible(start, np.zeros(3), AROUND)
        for column, seconds in enumerate(limiter.horizons):
            held = hottest(start, np.array([0, 0, admissible[2, column]]), seconds) - limit
            more = hottest(start, np.array([0, 0, admissible[2, column] * (1 + 1e-5)]), seconds) - limit
            assert held < 5e-3  # K, of RK4's steps
            assert more > -5e-3


def hottest(start: FloatArray, torque: FloatArray, seconds: float) -> float:
    """Of three joints with copper loss, by SciPy [degC]."""

    def slope(_: float, T: FloatArray) -> FloatArray:
        current = torque / (0.84 * (1 - 0.0012 * (T - 25)))
        heat = 0.15 * (1 + 0.0039 * (T - 25)) * current**2 - (T - 25.0) / 10
        heat[:2] += np.array([1, -1]) * (T[1] - T[0]) / 3
        heat[1:] += np.array([1, -1]) * (T[2] - T[1]) / 2
        return np.asarray(heat / 300)

    return float(solve_ivp(slope, (0, seconds), start, rtol=1e-10, atol=1e-9).y.max())


def test_what_nothing_limits_is_infinite() -> None:
    """A joint that no limited node feels; with a current limit that is the end."""
    effects = [effect("copper_loss"), effect("resistance_rise")]
    alone = Network("apart", (node("a"), node("b"), AMBIENT),
                    (link("a", "ambient"), link("b", "ambient")), tuple(effects))  # fmt: skip
    admissible = Limiter(Model(alone), {"a": 60.0}).admissible(np.full(2, 30.0), np.zeros(2), AROUND)
    assert np.all(np.isinf(admissible[1, :3]))
    assert np.all(np.isfinite(admissible[0]))
    cut = Limiter(Model(alone), {"a": 60.0}, current_limits=10.0)
    assert cut.admissible(np.full(2, 30.0), np.zeros(2), AROUND)[1].tolist() == pytest.approx([8.4] * 4)
    hot = Limiter(Model(alone), {"a": 60.0}).admissible([61.0, 30.0], np.zeros(2), AROUND)
    assert not hot[0, :2].any()
