"""The controller in a fast loop: the step's own answers, sums between the periods, and what fails on a robot."""

from __future__ import annotations

import time
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.model.model import Model
from lptn.planners import ControlLoop, TorqueMPC
from lptn.planners.mpc.c_code import structs
from tests.builders import effect, leg
from tests.planners.test_mpc import AROUND as AIR
from tests.planners.test_mpc import SPEEDS, leg_model, supplied
from tests.planners.test_mpc_emit import answered, built, needs_a_compiler

LIMIT, TICK, AROUND = 60.0, 0.05, [25.0]
REQUEST, START = np.array([6.0, 10.0, 14.0]), np.array([50.0, 55.0, 58.0])
TICKS = 100  # a control period


def controller() -> TorqueMPC:
    return TorqueMPC(Model(leg([effect("copper_loss"), effect("resistance_rise")])), LIMIT, request="torque")


def swinging(ticks: int, seed: int = 0) -> FloatArray:
    """Torques of either sign about the request, as a gait has them, shape (ticks, joints)."""
    random = np.random.default_rng(seed)
    return np.asarray(REQUEST * (np.sin(np.arange(ticks) / 7)[:, None] + 0.3 * random.standard_normal((ticks, 3))))


def test_a_period_of_ticks_is_a_step_with_their_rms() -> None:
    loop, mpc, asked = ControlLoop(controller(), TICK), controller(), swinging(3 * TICKS + 2)
    scales = np.array([loop.update(torque, START, AROUND).copy() for torque in asked])
    first = mpc.step(START, np.abs(asked[0]), AROUND)
    np.testing.assert_allclose(scales[1] * np.abs(asked[0]), first.admitted, rtol=1e-9)
    # Handed over at the ends of the ticks 0, 100, 200, …; the answer holds from the next tick on.
    for k in range(2):
        stretch = slice(1 + k * TICKS, 1 + (k + 1) * TICKS)
        done = np.sqrt(np.mean((asked[stretch] * scales[stretch]) ** 2, axis=0))
        rms = np.sqrt(np.mean(asked[stretch] ** 2, axis=0))
        plan = mpc.step(START, rms, AROUND, applied=done)
        np.testing.assert_allclose(scales[stretch.stop] * rms, plan.admitted, rtol=1e-9)
    assert np.all(scales[-1] < 1)
    assert loop.plan is not None
    assert loop.given_up == loop.plan.given_up


def test_measured_torques_count_unless_their_sensor_is_dead() -> None:
    """A drive that gives half of what it is asked; its sensor missing, absurd or standing: the command stands in."""
    asked, made = swinging(TICKS + 2), controller().sources
    layout = structs({**made, "lptn_mpc.h": made["lptn_loop.h"]})["lptn_loop"]
    done = {}
    for name in ("none", "half", "nan", "absurd", "stands", "zero"):
        loop = ControlLoop(controller(), TICK)
        for torque in asked:
            measured = 0.5 * torque * loop._scale
            if name != "half":
                measured[1] = {"nan": np.nan, "absurd": 1e30, "stands": 3.0, "zero": 0.0, "none": np.nan}[name]
            loop.update(torque, START, AROUND, None if name == "none" else measured)
        assert (loop.status & 8 > 0) == (name not in ("none", "half"))
        done[name] = np.array(layout.from_buffer(loop._loop).mean_done)  # RMS of the period
    # The request of a single tick, the first, made the first plan; its scales held through the period.
    np.testing.assert_allclose(done["half"], 0.5 * done["none"], rtol=1e-6)
    np.testing.assert_allclose(done["nan"][1], done["none"][1])
    np.testing.assert_allclose(done["absurd"][1], done["none"][1])
    for name in ("stands", "zero"):  # believed for the first second of five
        assert 0.8 * done["none"][1] < done[name][1] < 1.05 * done["none"][1]
    assert "stands in for it" in loop.given_up[0]


def test_a_solver_that_does_not_answer_leaves_its_plan_then_floors() -> None:
    """The plan goes on stage by stage to the end of the horizon; then joints get their floors."""
    mpc = TorqueMPC(Model(leg([effect("copper_loss"), effect("resistance_rise")])), LIMIT, request="torque",
                    floors={"FR_calf": 7.0})  # fmt: skip
    loop = ControlLoop(mpc, 0.5)
    loop.update(REQUEST, START, AROUND)
    assert loop.plan is not None
    expected = loop.plan.currents / REQUEST
    loop._think = lambda: None
    ends = np.cumsum(mpc.settings.stages)
    for k in range(1, 700):
        scale = loop.update(REQUEST, START, AROUND)
        if k < 595:
            np.testing.assert_allclose(scale, expected[np.searchsorted(np.round(ends / 0.5), k - 1, side="right")])
        assert (loop.status & 2 > 0) == (k > 20)
    np.testing.assert_allclose(scale, [0.0, 0.0, 0.5])
    assert "floors" in " ".join(loop.given_up)


def test_nothing_that_is_missing_stops_it() -> None:
    random, loop = np.random.default_rng(0), ControlLoop(controller(), TICK)
    for _ in range(10 * TICKS):
        given = [random.uniform(-20, 20, 3), random.uniform(40, 62, 3), np.array([25.0]), random.uniform(-20, 20, 3)]
        for array in given:
            array[random.random(array.size) < 0.3] = random.choice([np.nan, np.inf, -np.inf, 1e308])
        scale = loop.update(*given)
        assert np.all((scale >= 0) & (scale <= 1))


def test_a_joint_that_rests_is_not_held_back() -> None:
    loop = ControlLoop(controller(), TICK)
    for _ in range(2 * TICKS + 2):
        scale = loop.update([0.0, 10.0, 14.0], START, AROUND)
    assert scale[0] == 1.0
    assert scale[2] < 0.9


def test_in_a_thread_no_update_waits() -> None:
    loop = ControlLoop(controller(), TICK, background=True)
    try:
        for torque in swinging(TICKS):
            loop.update(torque, START, AROUND)
        until = time.monotonic() + 30
        while loop.update(REQUEST, START, AROUND)[2] == 1 and time.monotonic() < until:
            time.sleep(0.001)
        assert loop.plan is not None
        assert loop.plan.converged
    finally:
        loop.close()


@pytest.mark.long
@needs_a_compiler
def test_the_emitted_loop_is_pythons(tmp_path: Path) -> None:
    loop, asked = ControlLoop(controller(), TICK), swinging(3 * TICKS)
    loop.mpc.emit(tmp_path, START, np.tile(REQUEST, (2, 1)), np.full((2, 1), 25.0))
    random = np.random.default_rng(0)
    readings = START + 0.1 * random.standard_normal((len(asked), 3))
    readings[random.random(readings.shape) < 0.2] = np.nan
    rows = np.hstack([asked, 0.9 * asked, readings, np.full((len(asked), 1), 25.0)])
    options = ("-O1", "-ffp-contract=off", "-fsanitize=address,undefined", "-fno-sanitize-recover")
    program = built(tmp_path, "lptn_loop.c lptn_mpc.c", *options, main="loop.c")
    answers = answered(program, rows, f"{TICK}")
    for row, torque, reading in zip(answers, asked, readings, strict=True):
        np.testing.assert_allclose(row[:3], loop.update(torque, reading, AROUND, 0.9 * torque), rtol=0, atol=1e-9)
        assert row[3] == loop.status


def test_what_is_foreseen_is_planned_for() -> None:
    """Three minutes in 25 degC, two in a hall of 80 degC: the leg written again, and integrated by SciPy."""
    hottest = {}

    def air(time: float) -> float:
        return 80.0 if 180.0 <= time < 300.0 else 25.0

    def slope(time: float, T: FloatArray, torque: FloatArray) -> FloatArray:
        heat = 0.15 * (1 + 0.0039 * (T - 25)) * (torque / 0.84) ** 2 - (T - air(time)) / 10
        heat[:2] += np.array([1, -1]) * (T[1] - T[0]) / 3
        heat[1:] += np.array([1, -1]) * (T[2] - T[1]) / 2
        return np.asarray(heat / 300)

    for foreseen in (False, True):
        model = Model(leg([effect("copper_loss"), effect("resistance_rise")]))
        mpc = TorqueMPC(model, LIMIT, request="torque", stages=60, level=0.5, margin=0.1, model_error=0.0)
        loop, T = ControlLoop(mpc, 5.0), np.full(3, 59.8)
        hottest[foreseen] = 59.8
        edges = np.concatenate([[0.0], np.cumsum(mpc.settings.stages)])
        for k in range(60):
            time = 5.0 * k
            if foreseen:
                loop.foresee(conditions=np.array([[air(time + 1e-6 + edge)] for edge in edges[:-1]]))
            loop.update(REQUEST, T, [air(time)])
            assert loop.plan is not None
            np.testing.assert_allclose(loop.plan.asked, REQUEST)
            torque = loop.plan.admitted  # which the loop applies from the next tick on
            T = solve_ivp(slope, (time, time + 5.0), T, args=(torque,), rtol=1e-8, max_step=1.0).y[:, -1]
            hottest[foreseen] = max(hottest[foreseen], float(T.max()))
    assert hottest[True] <= LIMIT
    assert hottest[False] > LIMIT + 0.5


def test_requests_that_are_foreseen_are_a_steps_rows() -> None:
    """A load that comes in a minute: the joints give less before it, so that they have room for it."""
    loop, mpc, plain = ControlLoop(controller(), 5.0), controller(), ControlLoop(controller(), 5.0)
    ahead = np.where(np.cumsum(mpc.settings.stages)[:, None] > 60.0, 2.0 * REQUEST, 0.6 * REQUEST)
    loop.foresee(ahead)
    for each in (loop, plain):
        each.update(0.6 * REQUEST, START, AROUND)
    assert loop.plan is not None
    assert plain.plan is not None
    np.testing.assert_allclose(loop.plan.currents, mpc.step(START, ahead, AROUND).currents, rtol=1e-12)
    assert loop.plan.admitted[2] < 0.9 * plain.plan.admitted[2]
    loop.foresee()
    with pytest.raises(InputError, match="shape"):
        loop.foresee(ahead[:2])


def test_what_is_not_foreseen_is_as_measured() -> None:
    """Of a column or joint that is left out; speeds among them bound the power."""
    measured, powers, torques = AIR | SPEEDS, [], []
    known: tuple[dict[str, dict[str, float]], ...] = (
        {},
        {"conditions": AIR},
        {"request": {"FR_hip": REQUEST[0]}, "conditions": {"velocity.FR_calf": SPEEDS["velocity.FR_calf"]}},
    )
    for ahead in known:
        mpc = TorqueMPC(leg_model(), LIMIT, request="torque", power_limit=30.0, model_error=0.0)
        loop = ControlLoop(mpc, 5.0)
        loop.foresee(**ahead)
        for _ in range(3):
            loop.update(REQUEST, np.full(3, 40.0), measured)
        assert loop.plan is not None
        assert loop.given_up == ()
        powers.append(supplied(loop.plan.admitted, np.full(3, 40.0)))
        torques.append(loop.plan.currents)
    assert 25.0 < powers[0] <= 30.0 * 1.01
    for torque in torques[1:]:
        np.testing.assert_allclose(torque, torques[0], rtol=1e-12)


def test_mistakes_are_said_in_one_line() -> None:
    mpc = controller()
    for tick in (0.0, 6.0, float("nan")):
        with pytest.raises(InputError, match="at most 5 s"):
            ControlLoop(mpc, tick)
    with pytest.raises(InputError, match="unknown name"):
        ControlLoop(mpc).update({"FL_calf": 1.0}, START, AROUND)
