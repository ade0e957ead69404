"""Numbers for drives' limiters: whatever they admit, no winding passes its limit; by SciPy on networks of its own."""

from __future__ import annotations

import ctypes
import subprocess
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import fsolve

from lptn.basics.arrays import FloatArray, IntArray
from lptn.basics.errors import InputError
from lptn.model.model import Model
from lptn.planners.limiter import firmware_kind
from tests.builders import effect
from tests.planners.firmware_truth import Drive, Motors, hottest, worst_rise

LIMIT, AIR = 105.0, 40.0
ONE = Motors(
    winding=np.array([20.0]), housing=np.array([300.0]), inside=np.array([1.0]), outside=np.array([2.0]),
    beside=np.array([]), ohms=np.array([0.1]), alpha=0.0039, beta=0.006,
)  # fmt: skip


def task_of(motors: Motors, peak: float, model: Model | None = None, **more: Any) -> Any:
    table = {"air": [0.0, AIR], **more.pop("task", {})}
    file = {"task": {"kind": "firmware", **table}, "limits": {"w*": LIMIT}, "current_limits": {"*": peak}, **more}
    return firmware_kind.read(file, "task.toml", motors.model() if model is None else model)


def numbers_of(motors: Motors, peak: float, **more: Any) -> Any:
    return firmware_kind.run(task_of(motors, peak, **more))


PER_MOTOR = ("winding", "housing", "inside", "outside", "ohms")


def random_motors(random: np.random.Generator, count: int = 1, linear: bool = False) -> Motors:
    """Of any time constants from seconds to hours; a winding that would melt by its own resistance is none."""

    def of(low: float, high: float, size: int = count) -> FloatArray:
        return np.exp(random.uniform(np.log(low), np.log(high), size))

    return Motors(
        of(5, 100), of(50, 2000), of(0.2, 3), of(0.3, 5), of(0.5, 10, count - 1), of(0.02, 1),
        0.0 if linear else random.choice([0.0, 0.0039]), 0.0 if linear else random.choice([0.0, 0.006]),
    )  # fmt: skip


def settled(motors: Motors, squares: FloatArray) -> FloatArray:
    """Steady temperatures at squared currents [A²]."""

    def rates(T: FloatArray) -> FloatArray:
        return motors.rates(T[:, None], squares[:, None], AIR).ravel()

    return np.asarray(fsolve(rates, np.full(2 * motors.count, AIR + 20.0)))


def continuous(motors: Motors, joint: int = 0) -> float:
    """A current about as large as a motor bears for ever [A]."""
    return float(np.sqrt((LIMIT - AIR) / (motors.inside + motors.outside)[joint] / motors.ohms[joint] / 1.3))


@pytest.mark.long
@pytest.mark.parametrize("seed", range(10))
def test_the_worst_history_of_a_linear_program_comes_to_the_limit_and_not_above(seed: int) -> None:
    random = np.random.default_rng(seed)
    motors = random_motors(random, linear=True)
    peak = random.uniform(1.2, 6.0) * continuous(motors)
    (n,) = numbers_of(motors, peak).numbers.itertuples()
    rise = worst_rise(motors, n.time_constant, n.continuous**2, peak)
    assert rise <= (LIMIT - AIR) * (1 + 1e-6)
    assert rise >= (LIMIT - AIR) * 0.95 or n.continuous == pytest.approx(peak)


def fastest(motors: Motors) -> float:
    """The shortest time constant, about [s]."""
    return float(np.min(1 / (1 / motors.inside + 1 / motors.outside) * np.minimum(motors.winding, motors.housing)))


@pytest.mark.long
@pytest.mark.parametrize("seed", range(10))
def test_no_burst_after_any_rest_passes_the_limit(seed: int) -> None:
    random, count = np.random.default_rng(seed), 1 + seed % 3
    motors = random_motors(random, count)
    peak = random.uniform(1.2, 6.0) * max(continuous(motors, joint) for joint in range(count))
    answer = numbers_of(motors, peak)
    drives = [Drive(peak, n.time_constant, n.continuous) for n in answer.numbers.itertuples()]
    held = settled(motors, np.array([drive.sum for drive in drives]))
    rests = np.concatenate([[0.0], np.geomspace(0.05, 3, 15) * max(drive.time_constant for drive in drives)])
    dt = max(0.3 * fastest(motors), rests[-1] / 5000)
    steps = int((rests[-1] + 5 * float(np.max(motors.inside * motors.winding))) / dt)

    def wanted(k: int) -> FloatArray:
        return np.tile(np.where(k * dt < rests, 0.0, peak), (count, 1))

    start = np.tile(held[:, None], len(rests))
    assert hottest(motors, drives, wanted, steps, dt, AIR, start=start).max() <= LIMIT + 0.02


@pytest.mark.long
@pytest.mark.parametrize("seed", range(10))
def test_no_load_before_a_trip_on_the_housing_passes_the_limit_and_the_warning_is_in_time(seed: int) -> None:
    random, seconds = np.random.default_rng(seed), 5.0
    motors, air = random_motors(random), random.choice([0.0, AIR])
    peak = random.uniform(1.05, 2.5) * continuous(motors)
    answer = numbers_of(motors, peak, sensors={"*": "h0"}, task={"warning": seconds, "burst": 2 * seconds})
    (n,) = answer.numbers.itertuples()
    if np.isnan(n.trip):
        return
    loads = peak * np.linspace(0, 1, 12)
    fast, slow = motors.inside[0] * motors.winding[0], 3 * (motors.outside[0] + motors.inside[0]) * motors.housing[0]
    dt = min(0.3 * motors.inside[0] / (1 / motors.winding[0] + 1 / motors.housing[0]), seconds / 20)
    held = int(min(slow, 4000 * dt) / dt)
    course = run(motors, n, loads, held, held + int((5 * fast + 10 * seconds) / dt), dt, air)
    assert course.hottest.max() <= LIMIT + 0.02
    for warned, tripped in zip(course.warned, course.tripped, strict=True):
        if warned > held and tripped > 0:  # at peak current from the warning on
            assert tripped - warned >= seconds / dt - 2


class Course(NamedTuple):
    """Of several histories the hottest winding [degC], and the steps of first warning and of the trip, 0 for none."""

    hottest: FloatArray
    warned: IntArray
    tripped: IntArray


def run(motors: Motors, n: Any, loads: FloatArray, held: int, steps: int, dt: float, air: float) -> Course:
    """Each load for some steps, then the peak current; a drive that trips when the housing is too hot."""
    T, off = np.full((2, len(loads)), air), np.zeros(len(loads), dtype=bool)
    warned, tripped = np.zeros(len(loads), dtype=int), np.zeros(len(loads), dtype=int)
    most = T[0]
    for k in range(steps):
        off = (off & (T[1] > n.restart)) | (T[1] >= n.trip) if not np.isnan(n.restart) else off | (T[1] >= n.trip)
        warned = np.where((warned == 0) & (T[1] >= n.warning), k, warned)
        tripped = np.where((tripped == 0) & off, k, tripped)
        T = motors.step(T, np.where(off, 0.0, loads if k < held else n.peak)[None] ** 2, air, dt)
        most = np.maximum(most, T[0])
    return Course(most, warned, tripped)


@pytest.mark.long
def test_a_trip_protects_beside_the_i2t_of_the_other_joint_whatever_its_limit() -> None:
    """The neighbour went on heating what a trip had stopped: 99 degC at a limit of 60, with the other's at 120.

    All robots are simulated at once, the joint that trips first.
    """
    random, robots, cases = np.random.default_rng(0), list[Motors](), []
    for _ in range(15):
        drawn, low, air = random_motors(random, 2), random.uniform(0.3, 1.0), random.choice([0.0, AIR])
        swapped = replace(drawn, **{name: getattr(drawn, name)[::-1] for name in PER_MOTOR})
        limits = (AIR + low * (LIMIT - AIR), LIMIT)
        peak = random.uniform(1.2, 4.0) * max(continuous(drawn, joint) for joint in range(2))
        slow = 3 * float(np.max((drawn.inside + drawn.outside) * (drawn.winding + drawn.housing)))
        dt = min(0.2 * fastest(drawn), slow / 2000)
        for motors, (own, other) in ((drawn, limits), (swapped, limits[::-1])):
            table = numbers_of(motors, peak, limits={"w0": own, "w1": other}).numbers
            trip, restart = table.loc["w0", ["trip", "restart"]]
            if not np.isnan(trip):
                robots.append(motors)
                i2t = table.loc["w1", ["time_constant", "continuous"]]
                cases.append((air, dt, min(slow / dt, 10000), peak, own, other, trip, np.fmax(restart, -1e9), *i2t))
    assert len(robots) > 20
    air, dt, steps, peak, own, other, trip, restart, constant, current = np.array(cases, dtype=float).T
    tripping, summing = Drive(peak, trip=trip, restart=restart), Drive(peak, constant, current)
    motors, T = Motors.together(robots), np.tile(air, (4, 1))
    above, late = np.full(len(robots), -np.inf), np.zeros(len(robots))
    for _ in range(int(steps.max())):
        flowed = ~tripping.tripped
        currents = np.array([tripping.admitted(peak, T[0], dt), summing.admitted(peak, T[1], dt)])
        late = np.where(flowed & tripping.tripped, np.maximum(late, T[0] - trip), late)  # a drive looks once a step
        T = motors.step(T, currents**2, air, dt)
        above = np.maximum(above, (T[:2] - [own, other]).max(axis=0))
    assert (above <= 0.02 + late).all()


def test_a_joint_without_a_limited_node_has_no_trip() -> None:
    motors = Motors(
        winding=np.repeat(ONE.winding, 2), housing=np.repeat(ONE.housing, 2), inside=np.repeat(ONE.inside, 2),
        outside=np.repeat(ONE.outside, 2), beside=np.array([2.0]), ohms=np.repeat(ONE.ohms, 2),
        alpha=ONE.alpha, beta=ONE.beta,
    )  # fmt: skip
    answer = numbers_of(motors, 20.0, limits={"w0": LIMIT})
    assert np.isnan(answer.numbers.loc["w1", "trip"])
    assert "no limited node is the joint's own" in answer.text()


def test_a_sensor_on_the_winding_trips_at_the_limit_less_its_error() -> None:
    answer = numbers_of(ONE, 20.0, task={"sensor_error": 2.0, "margin": 3.0})
    assert answer.numbers.loc["w0", "trip"] == pytest.approx(LIMIT - 5.0, abs=0.01)


def test_a_drive_that_is_late_trips_lower_by_what_the_winding_rises_meanwhile() -> None:
    rise = 0.5 * ONE.ohms[0] * (1 + ONE.alpha * (LIMIT - 25)) * 20.0**2 / ONE.winding[0]
    trip = numbers_of(ONE, 20.0, task={"delay": 0.5}).numbers.loc["w0", "trip"]
    assert LIMIT - rise - 0.01 <= trip <= LIMIT - 0.9 * rise


def test_one_mass_is_its_own_i2t() -> None:
    """A winding apart from any housing: its time constant and its steady state keep everything."""
    alone = replace(
        ONE, inside=np.array([1e-3]), winding=np.array([50.0]), housing=np.array([50.0]), alpha=0.0, beta=0.0
    )
    (n,) = numbers_of(alone, 60.0).numbers.itertuples()
    assert n.continuous == pytest.approx(np.sqrt((LIMIT - AIR) / (alone.outside * alone.ohms).item()), rel=3e-3)
    assert n.time_constant == pytest.approx((100 * alone.outside).item(), rel=0.1)
    assert n.kept > 0.96


def test_a_fixed_time_constant_and_a_nominal_current_are_kept() -> None:
    (n,) = numbers_of(ONE, 30.0, time_constants={"*": 7.0}, nominal_currents={"w*": 4.0}).numbers.itertuples()
    assert n.time_constant == 7.0
    assert n.continuous == pytest.approx(4.0)
    assert n.peak_time == pytest.approx(-7.0 * np.log(1 - (4 / 30) ** 2))


@pytest.mark.long
def test_standard_errors_leave_a_margin_that_holds_for_such_robots() -> None:
    """True motors differ from the model by its standard errors; of 200 some 5 % may pass."""
    model = ONE.model(resistance=0.1, capacity=0.1, copper_loss=0.1)
    (n,) = numbers_of(ONE, 30.0, model=model).numbers.itertuples()
    assert n.continuous < numbers_of(ONE, 30.0).numbers.loc["w0", "continuous"]
    random, passed = np.random.default_rng(0), 0
    for _ in range(200):
        a, b, c, d, e = np.exp(0.1 * random.standard_normal((5, 1)))
        true = replace(ONE, winding=a * ONE.winding, housing=b * ONE.housing, inside=c * ONE.inside,
                       outside=d * ONE.outside, ohms=e * ONE.ohms)  # fmt: skip
        passed += settled(true, np.array([n.threshold]))[0] > LIMIT
    assert 0 < passed <= 20


def test_the_c_code_does_what_a_drive_does(tmp_path: Path) -> None:
    task = task_of(ONE, 25.0, task={"burst": 2.0, "warning": 2.0})
    (n,) = firmware_kind.run(task).numbers.itertuples()
    assert firmware_kind.emit_c is not None
    firmware_kind.emit_c(task, tmp_path)
    library = tmp_path / "drive.so"
    flags = ["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-std=c99", "-O2", "-shared", "-fPIC"]
    subprocess.run(["cc", *flags, "drive.c", "-o", library, "-lm"], cwd=tmp_path, check=True)
    c, state = ctypes.CDLL(str(library)), (ctypes.c_double * 4)()
    c.lptn_drive_limit.restype = ctypes.c_double
    c.lptn_drive_start(state, 0)
    drive = Drive(n.peak, n.time_constant, n.continuous, n.warning, n.trip, n.restart)
    random, rested = np.random.default_rng(0), 0
    for k in range(4000):
        wanted, period = float(random.uniform(-40, 40)), float(random.uniform(1e-4, 2.0))
        reading = float(np.nan if k % 97 == 0 else n.restart + (n.trip - n.restart) * random.uniform(-0.3, 1.05))
        if k % 97 == 3:
            reading = n.restart - 1
        given = c.lptn_drive_limit(state, *map(ctypes.c_double, (wanted, reading, period)))
        assert given == pytest.approx(np.sign(wanted) * float(drive.admitted(wanted, reading, period)), abs=1e-9)
        rested += bool(drive.tripped)
    assert 100 < rested < 3900
    c.lptn_drive_limit(state, *map(ctypes.c_double, (30.0, n.restart - 1, 1e6)))  # at its threshold
    for period in (0.0, -1.0, np.nan, np.inf, 1e-3):
        given = c.lptn_drive_limit(state, *map(ctypes.c_double, (30.0, n.restart - 1, period)))
        assert 0.0 <= given <= n.continuous * (1 + 1e-6)
    for reading in (-273.0, -np.inf, np.nan, n.trip):
        assert c.lptn_drive_limit(state, *map(ctypes.c_double, (30.0, reading, 1e-3))) == 0.0
    for joint in (-1, 1, 2**31 - 1):
        c.lptn_drive_start(state, joint)
        assert c.lptn_drive_limit(state, *map(ctypes.c_double, (30.0, 20.0, 1e-3))) == 0.0


def test_a_drift_of_a_sensor_stands_still() -> None:
    """Its state is a clock, which no heat moves."""
    plain = ONE.model()
    drifting = Model(plain.network.with_effects([effect("sensor_drift", "w0", rate=1.0)]))
    expected = numbers_of(ONE, 20.0).numbers
    pd.testing.assert_frame_equal(numbers_of(ONE, 20.0, model=drifting).numbers, expected, rtol=1e-6)


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ({"task": {"air": [0.0, 110.0]}}, "without any current in the hottest air"),
        ({"sensors": {"*": "magnet"}}, "magnet"),
        ({"sensors": {"x*": "h0"}}, "no such place"),
        ({"time_constants": {"w0": -1.0}}, "time_constants"),
        ({"nominal_currents": {"w0": 21.0}}, "at most the peak current, 20 A"),
        ({"conditions": {"temperature.ambient": 70.0}}, '"air" has both ends'),
    ],
)
def test_mistakes_are_said(more: dict[str, Any], said: str) -> None:
    with pytest.raises(InputError, match=said):
        numbers_of(ONE, 20.0, **more)
