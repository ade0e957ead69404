"""Sensors that stand, leap or die under the controller: judged as `lptn.online` judges them, and what it costs."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.online.living_sensors import LivingSensor
from lptn.online.quantisation import as_gaussian
from lptn.planners import TorqueMPC
from lptn.planners.compiled import compiled
from lptn.planners.mpc import Plan
from tests.builders import effect, leg
from tests.hardening import plants
from tests.hardening.living_sensors import Case, run
from tests.planners.truth import World, conditions, model_of, true_robot

LIMIT, PERIOD = 60.0, 5.0
_KNEE = """\
[model]
ambient = "temperature.ambient"
[nodes.knee]
capacity = 300
[[links]]
between = ["knee", "ambient"]
resistance = 5
[[effects]]
kind = "copper_loss"
at = "knee"
input = "current"
resistance = 0.2
"""
_WINDING = """\
[model]
joints = ["a"]
ambient = "temperature.ambient"
[nodes.a]
capacity = 60
[nodes.a_case]
capacity = 300
[[links]]
between = ["a", "a_case"]
resistance = 1
[[links]]
between = ["a_case", "ambient"]
resistance = 3
[[effects]]
kind = "copper_loss"
at = "a"
resistance = 0.2
input = "current"
"""
_GLUE = """\
#include "lptn_mpc.c"
lptn_mpc_sensors sensors;
void start(void) { begin_sensors(&sensors); }
void look(double clock, double white, double step, const double *readings, const double *predicted,
          const double *variance, const double *reference, const double *deviation, const double *learned,
          const double *settles, int *flags, double *evidence) {
    sensors.clock = clock;
    judge(&sensors, 5.0, white, step, readings, predicted, variance, reference, deviation, learned, settles);
    for (int i = 0; i < LPTN_NN; i++)
        flags[i] = sensors.stands[i] + 2 * sensors.agrees[i] + 4 * sensors.proven[i] + 8 * sensors.trusted[i] +
                   16 * sensors.lost[i];
    memcpy(evidence, sensors.evidence, sizeof sensors.evidence);
}
void cell(double noise, double grain, double prior, double *innovation, double *variance) {
    static lptn_mpc_settings settings;
    settings.noise = noise, settings.grain = grain;
    of_cell(&settings, prior, innovation, variance);
}
"""


def spoilt(random: np.random.Generator, true: FloatArray, step: float) -> FloatArray:
    """Readings with noise and steps, of which stretches stand, leap, lag behind or are missing."""
    readings = true + 0.1 * random.standard_normal(true.shape)
    if step:
        readings = step * np.round(readings / step)
    for column in readings.T:
        start = random.integers(20, 120)
        stop = start + random.integers(5, 60)
        column[start:stop] = random.choice([column[start], np.nan, 85.0, 0.0])
        column[random.integers(0, len(column), 3)] = 120.0
    return np.asarray(readings)


@pytest.mark.long
@pytest.mark.parametrize("step", [0.0, 0.1, 1.0])
def test_c_judges_each_reading_as_python_does(step: float) -> None:
    mpc = TorqueMPC(Model(leg([effect("copper_loss"), effect("resistance_rise")])), LIMIT)
    library = compiled({**mpc.sources, "glue.c": _GLUE}, "glue.c")
    seen = np.zeros(5, dtype=int)  # of each flag, how often it was up
    for seed in range(8):
        random = np.random.default_rng(seed)
        true = 40 + np.cumsum(random.normal(0, 0.15, (200, 3)), axis=0) + 10 * np.sin(np.arange(200) / 20)[:, None]
        readings = spoilt(random, true, step)
        off = 8.0 * (np.arange(200) > 150)[:, None] * (seed % 3 == 0)  # now and then it is the model that is wrong
        predicted, reference = (true + 0.05 * random.standard_normal(true.shape) + off for _ in range(2))
        sensors = [LivingSensor(0.1**2, step) for _ in range(3)]
        library.start()
        for k, (reading, expected, without) in enumerate(zip(readings, predicted, reference, strict=True)):
            others = [random.uniform(0.0, most, 3) for most in (0.1, 1.0, 4.0, 100.0)]
            others[2] *= -1
            for i, sensor in enumerate(sensors):
                variance, sensor.deviation, learned, sensor.settles = (float(other[i]) for other in others)
                sensor.clock = k * PERIOD
                sensor.judge(PERIOD, float(reading[i]), float(expected[i]), variance, float(without[i]), learned)
            flags, evidence = np.zeros(3, dtype=np.int32), np.zeros(3)
            given = (ctypes.c_double(value) for value in (k * PERIOD, 0.1**2, step))
            arrays = (reading, expected, others[0], without, *others[1:], flags, evidence)
            library.look(*given, *(array.ctypes.data_as(ctypes.c_void_p) for array in arrays))
            own = np.array([[s.stands, s.agrees, s.proven, s.trusted, s.lost] for s in sensors], dtype=int).T
            np.testing.assert_array_equal(flags, 2 ** np.arange(5) @ own)
            np.testing.assert_allclose(evidence, [sensor.evidence for sensor in sensors], rtol=1e-9, atol=1e-9)
            seen += own.sum(axis=1)
    assert (seen > 8).all()


def loop(spoil: dict[str, float], steps: int = 90, resolution: float = 0.0) -> tuple[float, TorqueMPC, set[str]]:
    """A robot whose sensors stand from the 30th step on, at a number or (infinite) at what they read then.

    Returns:
        By how much a joint passed its limit at most [K], the controller, and the sensors not believed in the end.
    """
    mpc = TorqueMPC(model_of(true_robot(1), 0.1, 1), {"*_*": LIMIT}, request="torque", resolution=resolution)
    world, worst, nodes = World(true_robot(1), 45.0, 0.1, 1), -np.inf, list(mpc.model.nodes)
    for k in range(steps):
        read = world.read()
        if resolution:
            read = resolution * np.round(read / resolution)
        if k == 30:
            stands = {node: read[nodes.index(node)] if np.isinf(value) else value for node, value in spoil.items()}
        if k >= 30:
            for node, value in stands.items():
                read[nodes.index(node)] = value
        plan = mpc.step(read, np.tile([7.0, 12.0, 18.0], 4), conditions(mpc.conditions))
        assert plan.converged
        worst = max(worst, float(world.step(plan.admitted, int(PERIOD))[:, :12].max()) - LIMIT)
    for node in plan.untrusted:
        assert any(said.startswith(f"{node} has read ") for said in plan.given_up)
    return worst, mpc, set(plan.untrusted)


@pytest.mark.long
@pytest.mark.parametrize("value", [np.inf, 0.0, 85.0])
def test_limits_hold_though_a_sensor_stands(value: float) -> None:
    """Believed for ever, standing sensors let a joint pass its limit by 2 to 3 K, one at 0 by 15 K."""
    worst, mpc, untrusted = loop({"FR_calf": value, "RL_calf": value})
    assert worst < 0.2
    assert untrusted == {"FR_calf", "RL_calf"}
    assert 57 < mpc.estimate["FR_calf"] < 61


@pytest.mark.long
def test_a_live_sensor_in_whole_degrees_is_believed() -> None:
    worst, _, untrusted = loop({}, resolution=1.0)
    assert worst < 0.05
    assert not untrusted


def one_joint(read: Callable[[int, float, float], float], steps: int = 360, **options: Any) -> tuple[float, list[Plan]]:
    """A knee of 300 J/K, 5 K/W and 0.2 ohm in air of 25 degC is asked for 20 A for half an hour; its model is right.

    Args:
        read: what the sensor reads [degC] in a period, by its number, the true temperature and noise of 0.1 K.
        steps: periods of 5 s.
        options: of the controller.

    Returns:
        By how much the joint passed its limit at most [K], and the plans.
    """
    mpc = TorqueMPC(Model(parse_model(_KNEE, Path("knee.toml")).network), LIMIT, current_limits=30.0, **options)
    random, true, worst, plans = np.random.default_rng(0), 25.0, -np.inf, list[Plan]()
    for k in range(steps):
        reading = read(k, true, 0.1 * random.standard_normal())
        plans.append(mpc.step([reading], [20.0], {"temperature.ambient": 25.0}))
        settles = 25.0 + 5.0 * 0.2 * plans[-1].admitted[0] ** 2
        true = settles + (true - settles) * np.exp(-PERIOD / 1500.0)
        worst = max(worst, true - LIMIT)
    return worst, plans


@pytest.mark.parametrize("value", [-40.0, -1.0, 0.0, 25.0, 40.0, 90.0, np.nan])
@pytest.mark.parametrize("dither", [0.0, 1.0])
def test_a_sensor_that_was_never_alive_is_not_believed(value: float, dither: float) -> None:
    worst, plans = one_joint(lambda _, __, noise: value + dither * noise)
    assert worst < 0
    assert all(plan.given_up for plan in plans[20:])
    assert min(plan.admitted[0] for plan in plans[-50:]) > 3.0  # of 5.9 A that hold the limit: the model goes on


@pytest.mark.parametrize("dither", [0.0, 1.0])
@pytest.mark.parametrize("value", [25.0, 30.0])
def test_a_dead_sensor_is_named_however_little_is_known_of_the_model(value: float, dither: float) -> None:
    """Where the air's resistance may be wrong tenfold no reading is too cold; but what is heated warms."""
    unknown = {"resistance.ambient~knee": 50.0}
    worst, plans = one_joint(lambda _, __, noise: value + dither * noise, standard_errors=unknown)
    named = [k for k, plan in enumerate(plans) if plan.untrusted]
    assert worst < 0
    assert len(named) > 300, named[:3]


@pytest.mark.parametrize(
    ("end", "seconds"), [(-50.0, 20.0), (-50.0, 100.0), (25.0, 100.0), (39.0, 100.0), (25.0, 300.0), (-94.0, 0.1)]
)
def test_a_sensor_that_ceases_to_be_alive_is_not_believed_again(end: float, seconds: float) -> None:
    """Open through a low-pass, come loose, come loose in part: each goes to some temperature and stays there."""

    def read(k: int, true: float, noise: float) -> float:
        gone = PERIOD * (k - 180)
        return true + noise if gone < 0 else end + (true - end) * float(np.exp(-gone / seconds)) + noise

    worst, plans = one_joint(read)
    assert worst < plans[-1].margin[0] + 0.5
    assert all(plan.given_up for plan in plans[200:])


@pytest.mark.parametrize("length", [1, 5, 30])
def test_a_sensor_comes_back_when_it_agrees_again(length: int) -> None:
    """After a spike or a short break in as long as it was away; after a long one when its node has settled, 1500 s."""
    begin, back = 50, 300 if length > 12 else length
    worst, plans = one_joint(lambda k, true, noise: (-50.0 if begin <= k < begin + length else true) + noise, 420)
    assert worst < 0.05
    untrusted = [bool(plan.untrusted) for plan in plans]
    assert not any(untrusted[:begin])
    assert all(untrusted[begin : begin + length + back - 1])
    assert not any(untrusted[begin + length + back + 25 :])


@pytest.mark.parametrize(("rate", "most"), [(0.005, 7.0), (0.01, 3.5), (0.02, 0.0), (0.03, 0.0)])
def test_what_a_sensor_may_drift_by_is_kept_below_the_limit(rate: float, most: float) -> None:
    """Half an hour. Before a drift is certain the margin grows with its odds; without it 8 to 12 K above the limit."""
    worst, plans = one_joint(lambda k, true, noise: true - rate * PERIOD * k + noise)
    assert worst < most
    assert max(plan.margin[0] for plan in plans) > 5.0


@pytest.mark.parametrize("off", [0.8, 1.25])
def test_a_model_that_is_wrong_costs_no_sensor_its_trust(off: float) -> None:
    """The true knee heats by a fifth less, or a quarter more, than the model says."""
    _, plans = one_joint(lambda _, true, noise: 25.0 + off * (true - 25.0) + noise)
    assert not any(plan.untrusted for plan in plans)


@pytest.mark.parametrize("reads", [-40.0, 0.0, 25.0, 40.0, None])
def test_a_sensor_that_is_dead_teaches_a_winding_beside_it_nothing(reads: float | None) -> None:
    """Only the housing is read; its sensor is dead from the start, or comes loose in 300 s after a quarter hour."""
    mpc = TorqueMPC(Model(parse_model(_WINDING, Path("winding.toml")).network), {"a": 80.0}, current_limits=40.0)
    random, x, worst = np.random.default_rng(0), np.array([25.0, 25.0, 1.0]), -np.inf
    for k in range(360):
        loose = 25.0 + (x[1] - 25.0) * float(np.exp(-max(k - 180, 0) / 60))
        reading = (loose if reads is None else reads) + 0.1 * random.standard_normal()
        plan = mpc.step({"a_case": reading}, [20.0], {"temperature.ambient": 25.0})
        rate = np.zeros((3, 3))
        rate[0] = [-1 / 60, 1 / 60, 0.2 * plan.admitted[0] ** 2 / 60]
        rate[1] = [1 / 300, -(1 + 1 / 3) / 300, 25 / 3 / 300]
        x = expm(PERIOD * rate) @ x
        worst = max(worst, x[0] - 80.0)
    assert worst < 0.5
    assert plan.given_up


@pytest.mark.parametrize("step", [0.0, 0.1, 0.5, 1.0])
@pytest.mark.parametrize("spread", [1e-4, 0.01, 1.0, 25.0])
def test_a_rounded_reading_says_in_c_what_it_says_in_python(step: float, spread: float) -> None:
    library = compiled({**TorqueMPC(Model(leg([effect("copper_loss")])), LIMIT).sources, "glue.c": _GLUE}, "glue.c")
    library.cell.argtypes = [ctypes.c_double] * 3 + [ctypes.POINTER(ctypes.c_double)] * 2
    away = np.linspace(-3.0, 3.0, 61)
    expected = as_gaussian(away, np.full(61, spread), np.full(61, 0.1**2), np.full(61, step))
    for innovation, *wanted in zip(away, *expected, strict=True):
        found, variance = ctypes.c_double(innovation), ctypes.c_double()
        grain = step / np.sqrt(12)
        library.cell(float(np.hypot(0.1, grain)), grain, spread, ctypes.byref(found), ctypes.byref(variance))
        # A reading that says next to nothing has a variance that is the rest of two large numbers.
        np.testing.assert_allclose([found.value, variance.value], wanted, rtol=1e-5, atol=1e-6)


def test_whole_degrees_cost_little_torque() -> None:
    """Their rounding was kept off the limit as if no model knew better: three times as much was lost."""
    given = {}
    for step in (0.0, 1.0):
        read = (lambda k, true, noise: round(true + noise)) if step else (lambda k, true, noise: true + noise)
        worst, plans = one_joint(read, resolution=step)
        assert worst < 0.0
        given[step] = np.mean([plan.admitted[0] for plan in plans])
    assert given[1.0] > 0.993 * given[0.0]


def both_read(
    read: Callable[[float, FloatArray], FloatArray], heats: float = 1.0, start: float = 25.0
) -> tuple[float, list[Plan]]:
    """A winding of 30 J/K in a housing of 200 J/K, both limited and read, asked for 25 A for half an hour.

    Args:
        read: what the sensors read [degC], by time [s] and true temperatures, before noise of 0.1 K.
        heats: true loss over the model's.
        start: of both [degC].

    Returns:
        By how much limit and margin were passed at most [K], and the plans.
    """
    replaced = _WINDING.replace("= 60\n", "= 30\n").replace("= 300\n", "= 200\n").replace("= 3\n", "= 1\n")
    model = Model(parse_model(replaced, Path("motor.toml")).network)
    mpc = TorqueMPC(model, LIMIT, request="current", current_limits=40.0)
    random, x, worst, plans = np.random.default_rng(0), np.array([start, start, 1.0]), -np.inf, list[Plan]()
    for k in range(360):
        readings = read(PERIOD * k, x[:2]) + 0.1 * random.standard_normal(2)
        plans.append(mpc.step(readings, [25.0], {"temperature.ambient": 25.0}))
        rate = np.zeros((3, 3))
        rate[0] = [-1 / 30, 1 / 30, heats * 0.2 * plans[-1].admitted[0] ** 2 / 30]
        rate[1] = [1 / 200, -2 / 200, 25 / 200]
        x = expm(PERIOD * rate) @ x
        worst = max(worst, float((x[:2] - LIMIT - plans[-1].margin).max()))
    return worst, plans


@pytest.mark.parametrize("heats", [0.8, 1.0, 1.2])
@pytest.mark.parametrize("rate", [0.01, 0.02, 0.05])
def test_a_winding_that_reads_too_hot_gets_no_more_for_it(rate: float, heats: float) -> None:
    """A bound on what is learnt moved the sensor's reference, too: the motor passed its limit by 1 to 6 K."""
    worst, _ = both_read(lambda time, true: true + np.array([rate * time, 0.0]), heats)
    assert worst < 0.5


@pytest.mark.parametrize("heats", [0.8, 1.0, 1.2])
def test_a_model_that_is_wrong_by_what_is_told_costs_nothing(heats: float) -> None:
    _, plans = both_read(lambda _, true: true, heats)
    assert not any(plan.untrusted or plan.doubted for plan in plans[20:])


def loose(share: float, since: float, seconds: float, *sensors: int) -> Callable[[float, FloatArray], FloatArray]:
    """Sensors that come to read a share of the air, with a time constant [s]."""
    reached = share * np.isin([0, 1], sensors)
    return lambda time, true: true - reached * (true - 25.0) * (1 - np.exp(-max(time - since, 0.0) / seconds))


@pytest.mark.parametrize(
    ("read", "most"),
    [
        (loose(0.6, 900.0, 100.0, 0), 3.0),
        (loose(0.5, 900.0, 300.0, 0), 6.0),
        (loose(0.4, 600.0, 100.0, 0, 1), 8.0),
        (lambda time, true: true - np.array([0.01 * time, 0.0]), 7.0),
        (lambda time, true: true - np.array([0.03 * time, 0.0]), 7.5),
        (lambda time, true: true - 0.02 * time, 20.0),
    ],
)
def test_a_cold_sensor_counts_less_where_the_model_would_have_to_be_worse_than_told(
    read: Callable[[float, FloatArray], FloatArray], most: float
) -> None:
    """Believed in part until 3.5 standard errors they let the winding pass its limit by 4, 8, 19, 8, 9 and 35 K."""
    worst, _ = both_read(read)
    assert worst < most


@pytest.mark.parametrize("since", [400.0, 700.0, 1000.0])
@pytest.mark.parametrize("below", [0.2, 0.5])
def test_a_sensor_that_is_stuck_at_the_limit_is_not_followed(since: float, below: float) -> None:
    """Under a constant request nothing tells it; believed without end it let the knee pass its limit by 6 K."""

    def read(k: int, true: float, noise: float) -> float:
        return (true if PERIOD * k < since else LIMIT - below) + noise

    worst, plans = one_joint(read)
    assert worst < plans[-1].margin[0] + 1.0


@pytest.mark.parametrize("rate", [0.01, 0.02, 0.05, 0.1, 0.2])
@pytest.mark.parametrize("heats", [0.9, 1.0, 1.1])
def test_no_sensors_together_drag_a_motor_below_what_the_model_may_be_wrong_by(rate: float, heats: float) -> None:
    """Both drift alike, which looks like heat that is taken away: 35 K too hot with a right model."""
    worst, _ = both_read(lambda time, true: true - rate * time, heats)
    assert worst < heats * 35.0 / 0.8 - 35.0 + 3.0  # 35 K above the air at its limit


@pytest.mark.parametrize("heats", [0.8, 1.0, 1.2])
@pytest.mark.parametrize("seconds", [60.0, 90.0, 120.0])
def test_a_winding_whose_sensor_is_lost_is_not_taught_by_a_late_housing(seconds: float, heats: float) -> None:
    """Both sensors tell what was before: the housing's taught that the current hardly heats, 20 to 75 K above;
    as soon as the winding's was believed again it got all its torque, 6 K above."""
    past: list[FloatArray] = []

    def read(_: float, true: FloatArray) -> FloatArray:
        past.append(true)
        return past[max(0, len(past) - 1 - round(seconds / PERIOD))]

    assert both_read(read, heats)[0] < 2.0


@pytest.mark.parametrize("heats", [0.9, 1.0, 1.1])
@pytest.mark.parametrize("values", [(25.0, 25.0), (40.0, 40.0), (-40.0, -40.0), (25.0, 30.0), (0.0, 25.0)])
def test_beside_a_false_sensor_none_is_believed_that_has_not_moved(values: tuple[float, float], heats: float) -> None:
    """A warm motor, both sensors dead: the housing's was believed until it should have moved, 8.5 K above."""
    assert both_read(lambda _, true: np.array(values), heats, start=50.0)[0] < 0.5


@pytest.mark.parametrize("heats", [0.9, 1.1, 1.2])
@pytest.mark.parametrize("seconds", [45.0, 75.0, 90.0, 120.0])
def test_a_sensor_that_was_lost_is_believed_against_the_model_when_that_is_paid_off(
    seconds: float, heats: float
) -> None:
    """The winding's readings are late: each time they were believed again it got 4 to 16 K too hot."""
    past: list[float] = []

    def read(_: float, true: FloatArray) -> FloatArray:
        past.append(float(true[0]))
        return np.array([past[max(0, len(past) - 1 - round(seconds / PERIOD))], true[1]])

    worst, plans = both_read(read, heats)
    assert worst < 1.5
    assert any(plan.untrusted for plan in plans)


@pytest.mark.long
@pytest.mark.parametrize("start", ["cold", "hot"])
@pytest.mark.parametrize(
    "value", ["dead at -40", "dead at -1", "dead at 25", "dead at 40", "stuck at 25 with dither", "missing"]
)
def test_a_sensor_that_was_never_alive_costs_its_neighbours_nothing(value: str, start: str) -> None:
    """Its node was taken to be at its limit, and so heated its neighbours' references: their sensors were lost, too."""
    fault = value if value.startswith("stuck") else f"{value} from the start"
    for robot, seed in (("leg", 3), ("leg", 4), ("leg", 6), ("quadruped", 3)):
        result = run(Case(robot, "python", fault, "one", start, "signs", seed))
        assert result.healthy is not None
        assert result.healthy > 0.99
        assert result.beyond < 0.5


@pytest.mark.long
@pytest.mark.parametrize(("robot", "which"), [("knee", "all"), ("motor", "one"), ("motor", "all"), ("leg", "all")])
@pytest.mark.parametrize("fault", ["dead at -40", "dead at 25", "dead at 40", "missing"])
def test_with_sensors_that_were_never_alive_no_limit_is_passed(fault: str, robot: str, which: str) -> None:
    """A winding beside its housing: what the housing had taught beside a winding that was false made it 5 K too hot."""
    for start, seed in (("cold", 1), ("cold", 2), ("hot", 3)):
        result = run(Case(robot, "python", f"{fault} from the start", which, start, "signs", seed))
        assert result.beyond < 0.5
        assert result.torque > 0.55 * result.ideal


@pytest.mark.parametrize("robot", ["geared", "airless"])
@pytest.mark.parametrize(
    "fault",
    [*(f"dead at {value} from the start" for value in (-40, -1, 0, 25, 40)), "missing from the start",
     "stuck at 25 with dither", "dead at 25, later", "comes loose", "opens through 100 s"],
)  # fmt: skip
def test_sensors_of_a_robot_without_air_are_tested_by_the_heat_put_in(fault: str, robot: str) -> None:
    """Nothing cools there: no heat was taken to be missing, so that each reading was believed, at full torque."""
    for which, seed in (("all", 1), ("all", 2), ("one", 3)):
        result = run(Case(robot, "python", fault, which, "cold", "signs", seed))
        assert result.beyond < 0.5
        assert result.said is not None


@pytest.mark.long
@pytest.mark.parametrize("robot", ["geared", "airless"])
@pytest.mark.parametrize("face", ["loop", "c"])
@pytest.mark.parametrize("fault", ["dead at 0 from the start", "dead at 25 from the start", "comes loose"])
def test_loop_and_c_test_sensors_of_a_robot_without_air_alike(fault: str, face: str, robot: str) -> None:
    result = run(Case(robot, face, fault, "all", "cold", "signs", 1))
    assert result.beyond < 0.5
    assert result.said is not None


@pytest.mark.parametrize("make", [plants.geared, plants.airless])
@pytest.mark.parametrize("seed", [1, 2, 3, 4])
def test_healthy_sensors_of_a_robot_without_air_cost_a_short_mission_nothing(
    make: Callable[[], plants.Robot], seed: int
) -> None:
    """Five minutes, in which the limit is reached, of 10 % off in every value; no prescribed temperature at all."""
    robot = make()
    text = robot.toml().replace('ambient = "temperature.ambient"', "")
    true = robot.off_by(0.1, "signs", np.random.default_rng([seed, 5]))
    given = []
    for ideal in (False, True):
        told = true.toml().replace('ambient = "temperature.ambient"', "") if ideal else text
        options = {"level": 0.5, "noise": 0.0, "model_error": 0.0} if ideal else {"noise": 0.1}
        mpc = TorqueMPC(Model(parse_model(told, Path("robot.toml")).network), {"*": LIMIT}, period=PERIOD,
                        current_limits=1.5 * robot.asked, **options)  # fmt: skip
        plant, random, total = plants.Plant(true, plants.AIR, PERIOD), np.random.default_rng(seed), 0.0
        for _ in range(60):
            noise = 0.0 if ideal else 0.1 * random.standard_normal(len(robot.nodes))
            plan = mpc.step(plant.temperature + noise, np.full(len(robot.driven), robot.asked))
            plant.step(np.asarray(plan.admitted))
            total += float(np.sum(plan.admitted))
            assert not plan.untrusted
            assert plant.temperature.max() < LIMIT + np.max(plan.margin)
        given.append(total)
    assert given[0] > 0.99 * given[1]


@pytest.mark.parametrize("value", [-1.0, 0.0, 10.0, 25.0])
def test_of_many_sensors_that_are_dead_none_teaches_that_currents_cool(value: float) -> None:
    """Four legs at a trunk, 13 sensors at one number: gains beyond their bound let joints get to twice their limit."""
    robot = plants.quadruped()
    mpc = TorqueMPC(Model(parse_model(robot.toml(), Path("quadruped.toml")).network), LIMIT, request="current")
    plant, order = plants.Plant(robot, 50.0, PERIOD), [mpc.joints.index(robot.nodes[node]) for node in robot.driven]
    for _ in range(80):
        plan = mpc.step(np.full(13, value), np.full(12, 20.0), {"temperature.ambient": 25.0})
        plant.step(plan.admitted[order])
        assert plant.temperature.max() < LIMIT + 0.5


@pytest.mark.parametrize("spike", [85.0, -50.0])
@pytest.mark.parametrize("at", [0, 1, 2])
def test_one_false_reading_at_the_start_costs_little(spike: float, at: int) -> None:
    worst, plans = one_joint(lambda k, true, noise: spike if k == at else true + noise)
    assert worst < 0.05
    assert not any(plan.untrusted for plan in plans[at + 20 :])
    assert np.mean([plan.admitted[0] for plan in plans[:60]]) > 8.0  # of 12.8 without it


def test_what_a_joint_gets_that_has_lost_its_sensor_is_the_users_choice() -> None:
    def read(k: int, true: float, noise: float) -> float:
        return true + noise if k < 15 else 0.0

    ways = {way: one_joint(read, 60, lost_sensor=way)[1] for way in ("model", "derate", "stop")}
    soon = {way: plans[20].admitted[0] for way, plans in ways.items()}
    assert soon["model"] > 10.0  # it is still cool
    assert soon["stop"] < 0.1 < 3.0 < soon["derate"] < 5.92
    floor = one_joint(read, 60, lost_sensor="stop", floors=2.0)[1]
    assert floor[-1].admitted[0] == pytest.approx(2.0, rel=1e-2)
    with pytest.raises(InputError, match="lost_sensor"):
        TorqueMPC(Model(parse_model(_KNEE, Path("knee.toml")).network), LIMIT, lost_sensor="hope")


def test_readings_taken_as_they_are_may_stand() -> None:
    """Without learning the temperatures come from an estimator, which has looked at the sensors itself."""
    mpc = TorqueMPC(Model(leg([effect("copper_loss"), effect("resistance_rise")])), LIMIT, model_error=0.0)
    for _ in range(40):
        plan = mpc.step([30.0, 40.0, 50.0], [1.0, 1.0, 1.0], {"temperature.ambient": 30.0})
    assert plan.untrusted == {}
    assert plan.temperatures[:, 0].tolist() == [30.0, 40.0, 50.0]


@pytest.mark.parametrize("value", [-40.0, 0.0])
@pytest.mark.parametrize("name", ["leg", "motor", "windings"])
def test_no_plan_begins_colder_than_all_around_at_a_node_without_a_sensor(name: str, value: float) -> None:
    robot = plants.windings() if name == "windings" else plants.ROBOTS[name]()
    read = {"leg": ("FR_hip", "FR_calf"), "motor": ("motor_case",)}.get(name, ("hip_case", "thigh_case", "calf_case"))
    model = Model(parse_model(robot.toml(), Path("robot.toml")).network)
    mpc = TorqueMPC(model, {"*": LIMIT}, request="current", current_limits=1.5 * robot.asked, period=PERIOD)
    rows = [row for row, node in enumerate(model.nodes) if node not in read]
    for _ in range(60):
        plan = mpc.step(dict.fromkeys(read, value), np.full(len(mpc.joints), robot.asked), np.array([plants.AIR]))
        assert (plan.temperatures[rows, 0] >= plants.AIR - 0.1).all()


def _pump() -> plants.Robot:
    """A winding in a housing on a frame; only the winding is read."""
    capacity, to_air, loss = map(np.array, ([20.0, 150.0, 800.0], [0.0, 0.1, 0.9], [0.2, 0.0, 0.0]))
    return plants.Robot("pump", ("winding", "housing", "frame"), capacity, to_air, ((0, 1, 1.5), (1, 2, 0.5)), loss,
                        (0,), 18.0)  # fmt: skip


HIDDEN: dict[str, Callable[[], plants.Robot]] = {
    "prosthesis": plants.prosthesis,
    "pump": _pump,
    "motor": lambda: replace(plants.motor(), measured=(0,)),
    "leg": lambda: replace(plants.housed(), measured=(0, 1, 2), limit=80.0, limited=()),
}


@pytest.mark.parametrize("value", [-40.0, -1.0, 10.0])
@pytest.mark.parametrize("name", list(HIDDEN))
def test_a_node_nobody_reads_is_warmed_though_sensors_beside_it_are_dead(name: str, value: float) -> None:
    """It began as cold as the sensors read, and cooled the winding in all plans: 11 K above limit and margin."""
    robot = HIDDEN[name]()
    model = Model(parse_model(robot.toml(), Path("robot.toml")).network)
    for seed in (31, 32):
        mpc = TorqueMPC(model, robot.limits, request="current", current_limits=1.5 * robot.asked, period=PERIOD)
        plant = plants.Plant(robot.off_by(0.1, "signs", np.random.default_rng([seed, 5])), plants.AIR, PERIOD)
        places = [robot.nodes.index(node) for node in mpc.settings.limits]
        order = [mpc.joints.index(robot.nodes[node]) for node in robot.driven]
        for _ in range(200):
            dead = dict.fromkeys((robot.nodes[node] for node in robot.measured), value)
            plan = mpc.step(dead, np.full(len(order), robot.asked), {"temperature.ambient": plants.AIR})
            plant.step(np.asarray(plan.admitted)[order])
            assert (plant.temperature[places] - robot.limit < plan.margin + 0.5).all()


@pytest.mark.parametrize("name", ["prosthesis", "pump", "motor", "leg"])
def test_a_limit_of_a_housing_slows_no_winding_that_is_too_hot(name: str) -> None:
    """It was to come down in five minutes, as if the housing were at its own limit, where it cools in ten seconds."""
    robot = HIDDEN[name]()
    model = Model(parse_model(robot.toml(), Path("robot.toml")).network)
    windings = {robot.nodes[node]: robot.limit for node in robot.driven}
    alone = TorqueMPC(model, windings, request="current").settings.recovery
    every = TorqueMPC(model, windings | robot.limits, request="current").settings.recovery
    np.testing.assert_allclose(every[: len(alone)], alone, rtol=0.9)
    assert (every[: len(alone)] <= 1.01 * alone).all()


@pytest.mark.parametrize("face", ["python", "loop", "c"])
@pytest.mark.parametrize(
    "fault", ["dead at -40 from the start", "swapped", "delayed by 60 s", "every second one missing"]
)
def test_a_fast_winding_above_its_limit_comes_down(fault: str, face: str) -> None:
    """By its doubted part it came down in two minutes and by its margin in five: 10, 8, 6 and 1 K above both."""
    for start in ("cold", "hot") if face == "python" else ("cold",):
        assert run(Case("prosthesis", face, fault, "all", start, "signs", 31)).beyond < 0.5


# What hides a mass that the model lacks hides a false sensor of a winding as well, which settles in half a minute.
_HIDDEN = pytest.mark.xfail(strict=True, reason="a winding with a mass within reads so for some seconds")


@pytest.mark.long
@pytest.mark.parametrize(
    ("robot", "fault", "which", "most"),
    [
        ("prosthesis", "drifts by -0.02 K/s", "one", 5.0),
        ("prosthesis", "drifts by -0.02 K/s", "all", 9.0),
        *(pytest.param("prosthesis", "averages five minutes", which, 5.0, marks=_HIDDEN) for which in ("one", "all")),
        ("motor", "drifts by -0.02 K/s", "one", 4.0),
        ("prosthesis", "dead at 25 from the start", "all", 0.5),
    ],
)
def test_what_no_robot_explains_whose_values_stay_is_not_believed(
    robot: str, fault: str, which: str, most: float
) -> None:
    """A winding settles in half a minute; what its model lacks was learnt as fast as a drift asks, 11 to 24 K above."""
    for start, seed in (("cold", 1), ("hot", 1), ("hot", 41)):
        assert run(Case(robot, "python", fault, which, start, "signs", seed)).beyond < most


@pytest.mark.parametrize("robot", ["knee", "leg", "quadruped", "arm"])
def test_a_mass_that_the_model_lacks_costs_no_healthy_sensor_its_trust(robot: str) -> None:
    """A winding within each joint, 40 s apart: all sensors were lost in minutes, with up to 44 % of the torque."""
    result = run(Case(robot, "python", "healthy", "all", "cold", "cores", 97))
    assert result.said is None
    assert result.healthy is not None
    assert result.healthy > 0.98
    assert result.beyond < 0.5


@pytest.mark.parametrize("start", ["cold", "hot"])
@pytest.mark.parametrize("fault", ["drops by 12 K, later", pytest.param("comes loose", marks=_HIDDEN)])
def test_what_was_learnt_before_a_sensor_fell_judges_its_return(fault: str, start: str) -> None:
    """With all forgotten a robot that cools better explained both sensors 12 K below: trusted again, 9 K above."""
    which = "two" if "drops" in fault else "all"
    assert run(Case("motor", "python", fault, which, start, "signs", 94)).beyond < 1.0


@pytest.mark.long
@pytest.mark.parametrize("robot", ["knee", "motor", "leg", "geared", "airless", "prosthesis"])
def test_no_sensor_of_a_robot_whose_every_value_is_off_is_called_false(robot: str) -> None:
    """Without air the model alone counted as evidence against its sensors: 4 % of a geared motor's torque."""
    results = [run(Case(robot, "python", "healthy", "all", start, "signs", seed))
               for start, seed in (("cold", 41), ("hot", 42))]  # fmt: skip
    assert all(result.said is None for result in results)
    assert np.mean([result.torque / result.ideal for result in results]) > 0.99


@pytest.mark.long
@pytest.mark.parametrize("face", ["python", "c"])
@pytest.mark.parametrize(
    ("robot", "told"), [("quadruped", ""), ("motor", ", later"), ("leg", ", later"), ("gripper", ", later")]
)
def test_air_that_is_told_wrong_costs_no_sensor_its_trust(robot: str, told: str, face: str) -> None:
    """A jump of what is told of the air made all sensors false after a minute, and 4 to 18 % of the torque went."""
    for off in ("hot", "cold"):
        result = run(Case(robot, face, f"air told 10 K too {off}{told}", "all", "cold", "signs", 91))
        assert result.said is None
        assert result.beyond < 0.5
        assert result.torque > 0.95 * result.ideal


@pytest.mark.parametrize("off", [-10.0, 10.0])
def test_what_the_air_is_off_by_is_learnt(off: float) -> None:
    """A knee without load: how it cools tells of the air, or of a missing heat, each as likely as it is large."""
    mpc = TorqueMPC(Model(parse_model(_KNEE, Path("knee.toml")).network), LIMIT, request="current")
    plant, random = plants.Plant(plants.knee(), 50.0, PERIOD), np.random.default_rng(0)
    assert mpc.air == {"temperature.ambient": 0.0}
    for _ in range(720):
        mpc.step(plant.temperature + 0.1 * random.standard_normal(1), [0.0], [25.0 + off])
        plant.step(np.zeros(1))
    assert 0.05 < mpc.air["temperature.ambient"] / -off < 1.0  # 3 K of air beside 7 K of a missing heat, squared
