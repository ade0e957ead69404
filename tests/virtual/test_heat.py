"""Check the true heat balance against the equations written out by hand, and its numbers against scipy."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lptn.virtual import (
    EFFECTS,
    LEG_JOINTS,
    QUADRUPED_JOINTS,
    Balance,
    Bout,
    Forcing,
    Hidden,
    Job,
    Robot,
    draw_leg,
    leg_logs,
    motion,
    places,
    quadruped,
    quadruped_logs,
    simulate_runs,
)
from lptn.virtual.heat import Exponential, forcing
from lptn.virtual.leg import Signals, averaged, draw_signals, mean
from lptn.virtual.motion import Motion, draw_motion
from lptn.virtual.robot import Array, draw_run_errors
from tests.truth.rough_leg import roughen

# --- the leg -------------------------------------------------------------------------------------------------------

LEG_MOVES = (Bout("squat", 60, 1.0), Bout("trot", 100, 1.5, 4.0), Bout("leg_sweep", 40, 1.5))


def leg_with_everything(size: float = 1.0) -> Robot:
    leg = draw_leg(4, 0.1)
    roughen(leg)
    for effect in EFFECTS:
        Hidden(effect, places(effect)[-1], size).set_in(leg)
    return leg


def acts_on(leg: Robot, signals: Signals, extra: Array, block: int = 10) -> Forcing:
    """Return what acts on the leg; ``extra`` is further heat, W, of shape (samples, nodes)."""
    return forcing(leg, averaged(leg, signals, block), mean(extra, block))


def at_row(acting: Forcing, k: int) -> tuple[Array, Array, Array]:
    return acting.copper[k], acting.other[k], acting.to_air[k]


def test_balance_of_the_baseline_is_the_one_written_down() -> None:
    """C dT/dt = Σ (T_j - T_i)/R_ij + (T_amb - T_i)/R_i + R_d (τ/k)²."""
    leg, T, torque, ambient = draw_leg(1, 0.1), np.array([40.0, 55.0, 70.0]), np.array([3.0, -5.0, 8.0]), 20.0
    (_, _, upper), (_, _, lower) = leg.links
    rows = Signals(np.tile(torque, (10, 1)), np.full((10, 3), 2.0), np.ones(10))
    held = at_row(acts_on(leg, rows, np.zeros((10, 3))), 0)
    copper = leg.resistance * torque**2 / leg.torque_constant**2
    between = np.array([upper * 15, -upper * 15 + lower * 15, -lower * 15])
    expected = (copper + between + leg.to_air * (ambient - T)) / leg.capacity
    assert Balance(leg, ambient).slope(T, *held) == pytest.approx(expected, rel=1e-12)


def test_balance_with_every_effect_is_the_one_written_down() -> None:
    leg = draw_leg(1, 0.1)
    for effect in EFFECTS:
        Hidden(effect, places(effect)[-1], 0.5).set_in(leg)
    base = draw_leg(1, 0.1)
    T, inner, ambient, torque = np.array([40.0, 55.0, 70.0]), np.array([38.0, 52.0, 61.0]), 20.0, 6.0
    w, v, kelvin = 4.0, 1.2, 273.15
    rows = Signals(np.full((10, 3), torque), np.tile([[w], [-w]], (5, 3)), np.full(10, v))
    held = at_row(acts_on(leg, rows, np.full((10, 3), 2.5)), 0)
    made = base.resistance * (1 + 0.00393 / 2 * (T - 25))
    made *= 1.1 * (torque / (base.torque_constant * (1 - 0.0006 * (T - 25)))) ** 2
    made += 0.25 * w + 0.035 * w**2 + 0.1 * w**1.5 + 0.75 + 2.5
    made += 0.05 * torque * w + 0.25 * torque
    lost = 1.15 * base.to_air * np.exp(0.003 * (T - ambient)) * (1 + 0.275 * v) * (T - ambient)
    lost += 0.004 * 5.670374419e-8 * ((T + kelvin) ** 4 - (ambient + kelvin) ** 4)
    (_, _, upper), (_, _, lower) = base.links
    across = (T[2] - T[0]) / 6
    between = np.array([upper * 15 + across, -upper * 15 + lower * 15, -lower * 15 - across])
    into = (T - inner) / 1.5
    frame, into_frame = 47.0, (T - 47.0) / 34
    shared = (into_frame.sum() - 1.5 / 42 * (frame - ambient)) / 180
    expected = [*((made - lost + between - into - into_frame) / (base.capacity - 60)), *(into / 60), shared]
    slope = Balance(leg, ambient).slope(np.concatenate([T, inner, [frame]]), *held)
    assert slope == pytest.approx(np.array(expected), rel=1e-9)


@pytest.mark.long
def test_energy_stored_and_lost_is_the_energy_put_in() -> None:
    """Checked on the log alone, with nothing but the parameters from the truth."""
    leg, log = draw_leg(3, 0.03), leg_logs(seed=3, noise=0)["fit1"]
    T = log[[f"temperature.{joint}" for joint in LEG_JOINTS]].to_numpy()
    torque = log[[f"torque.{joint}" for joint in LEG_JOINTS]].to_numpy()
    put_in = 0.1 * float((leg.resistance * (torque / leg.torque_constant) ** 2)[:-1].sum())
    lost = float((leg.to_air * np.trapezoid(T - 22.0, dx=0.1, axis=0)).sum())
    stored = float((leg.capacity * (T[-1] - T[0])).sum())
    assert stored + lost == pytest.approx(put_in, rel=1e-3)
    assert stored > 0.1 * put_in


@pytest.mark.long
def test_one_second_scheme_agrees_with_scipy_on_the_full_inputs() -> None:
    leg = leg_with_everything()
    signals = draw_signals(LEG_MOVES, np.random.default_rng(0))
    extra = np.zeros_like(signals.torque)
    network = Balance(leg, 25.0)
    start = network.start(np.array([60.0, 70.0, 80.0]))
    ours = network.solve(acts_on(leg, signals, extra), start)
    fine = acts_on(leg, signals, extra, block=1)
    exact = [start]

    def slope(_: float, T: Array, held: tuple[Array, Array, Array]) -> Array:
        return network.slope(T, *held)

    # Sample by sample: across a jump of the inputs solve_ivp is off by more than the scheme under test.
    for k in range(len(signals.base)):
        piece = solve_ivp(slope, (0, 0.1), exact[-1], args=(at_row(fine, k),), rtol=1e-9, atol=1e-9)
        exact.append(piece.y[:, -1])
    seconds = np.array(exact)[::10]
    assert np.ptp(seconds[:, :3], axis=0).max() > 5
    assert np.abs(ours - seconds).max() < 1e-3


# --- the quadruped -------------------------------------------------------------------------------------------------

AMBIENT = 18.0
MOVES = (
    Bout("trot", 200, 0.7, 4.0),
    Bout("hold", 150, joints=("FR_calf", "RL_hip"), torque=12.0),
    Bout("leg_sweep", 100, 1.2),
    Bout("rest", 150),
)
PAIRS = [(3 * leg + i, 3 * leg + j) for leg in range(4) for i, j in ((0, 1), (1, 2), (0, 2))] + [(0, 3), (6, 9)]
HIPS = (0, 3, 6, 9)
Inputs = tuple[Array, Array, Array, float, float]


def conductances(robot: Robot) -> dict[tuple[int, int], float]:
    return {(min(i, j), max(i, j)): g for i, j, g in robot.links}


def heat_between(robot: Robot, T: Array) -> Array:
    """Return what flows into each node along the links."""
    flow = np.zeros(len(T))
    for (i, j), g in conductances(robot).items():
        flow[i] += g * (T[j] - T[i])
        flow[j] += g * (T[i] - T[j])
    return flow


def full_balance(robot: Robot, inputs: Inputs, T: Array) -> Array:
    """C dT/dt of twelve housings, computer, trunk, then twelve windings, with the numbers of SEEDS' virtual robot."""
    torque2, speed, speed2, base, pc = inputs
    housing, winding, rise = T[:14], T[14:], 0.0039 * (T[14:] - 25)
    copper = robot.resistance[:12] * torque2 / (9.1 * 0.0927) ** 2 * (1 + rise)
    across = (winding - housing[:12]) / robot.inside[:12]
    above, kelvin = housing - AMBIENT, 273.15
    wind, on = base**0.8, (torque2 > 0) | (speed > 0)
    heat = heat_between(robot, housing)
    heat[:12] += across + robot.coulomb[:12] * speed + robot.viscous[:12] * speed2
    heat[:12] -= robot.to_air[:12] * np.exp(0.006 * above[:12]) * (1 + 0.55 * wind) * above[:12]
    heat[:12] -= 0.012 * 5.670374419e-8 * ((housing[:12] + kelvin) ** 4 - (AMBIENT + kelvin) ** 4)
    heat[12] += pc - robot.to_air[12] * above[12]
    heat[13] += 12.0 - (1 + 0.25 * wind) / 1.4 * above[13]
    return np.concatenate([heat / robot.capacity, (copper + 4.0 * on - across) / robot.winding[:12]])


def plain_balance(robot: Robot, inputs: Inputs, T: Array) -> Array:
    """C dT/dt of one mass a joint, then the computer."""
    torque2, speed, _, _, pc = inputs
    heat = heat_between(robot, T) - robot.to_air * (T - AMBIENT)
    heat[:12] += robot.resistance[:12] * torque2 / (9.1 * 0.0927) ** 2 + 4.0 * ((torque2 > 0) | (speed > 0))
    heat[12] += pc
    return heat / robot.capacity


BALANCES: dict[str, Callable[[Robot, Inputs, Array], Array]] = {"full": full_balance, "plain": plain_balance}


def row(moved: Motion, k: int) -> Inputs:
    means = moved.means()
    return means.torque2[k], means.speed[k], means.speed2[k], float(moved.base[k]), float(moved.pc[k])


def test_plain_links_are_those_of_the_baseline() -> None:
    expected = {*PAIRS, *((hip, 12) for hip in HIPS)}
    assert set(conductances(quadruped(seed=3, physics="plain"))) == expected
    assert set(conductances(quadruped(seed=3))) == {*PAIRS, *((hip, 13) for hip in HIPS), (12, 13)}


@pytest.mark.parametrize("physics", ["full", "plain"])
def test_balance_is_the_one_written_down(physics: str) -> None:
    robot = quadruped(seed=2, physics=physics)  # type: ignore[arg-type]
    moved = draw_motion(MOVES, np.random.default_rng(1))
    network = Balance(robot, AMBIENT)
    acting = forcing(robot, moved.means(robot.wind_exponent), extra(robot, moved))
    for k in (10, 250, 400, 550):
        T = np.random.default_rng(k).uniform(20, 80, len(network.capacity))
        slope = network.slope(T, acting.copper[k], acting.other[k], acting.to_air[k])
        assert slope == pytest.approx(BALANCES[physics](robot, row(moved, k), T), rel=1e-9)


def test_columns_that_hold_act_as_the_movement_they_are_of() -> None:
    robot = quadruped(seed=2)
    moved = draw_motion(MOVES, np.random.default_rng(1))
    means, network, k = moved.means(robot.wind_exponent), Balance(robot, AMBIENT), 250
    columns = {"temperature.ambient": AMBIENT + 2.0, "speed.base": float(moved.base[k]), "power.pc": float(moved.pc[k])}
    drives = (means.torque2[k] > 0) | (means.speed[k] > 0)
    rows = {
        "torque": means.torque2[k] ** 0.5, "velocity": means.speed[k], "velocity_rms": means.speed2[k] ** 0.5,
        "powered": drives,
    }  # fmt: skip
    for name, values in rows.items():
        columns |= {f"{name}.{joint}": float(value) for joint, value in zip(robot.nodes, values, strict=False)}
    held, moving = network.held(columns, 3), forcing(robot, means, extra(robot, moved))
    assert held.copper.shape == (3, len(robot.nodes))
    assert held.shift == pytest.approx([2.0] * 3)
    wind = robot.to_air * (1 + float(moved.base[k]) ** robot.wind_exponent * robot.forced_convection)
    for found, expected in ((held.copper, moving.copper[k]), (held.other, moving.other[k]), (held.to_air, wind)):
        assert found[2] == pytest.approx(expected, rel=1e-9)


def extra(robot: Robot, moved: Motion) -> Array:
    heat = np.zeros((len(moved.base), len(robot.nodes)))
    heat[:, 12] = moved.pc
    return heat


@pytest.mark.long
@pytest.mark.parametrize("physics", ["full", "plain"])
def test_both_schemes_agree_with_scipy(physics: str) -> None:
    robot = quadruped(seed=2, physics=physics)  # type: ignore[arg-type]
    moved = draw_motion(MOVES, np.random.default_rng(1))
    network = Balance(robot, AMBIENT)
    acting = forcing(robot, moved.means(robot.wind_exponent), extra(robot, moved))
    start = network.start(np.random.default_rng(0).uniform(30, 60, len(robot.nodes)))
    exact = [start]
    for k in range(len(moved.base)):
        inputs = row(moved, k)
        piece = solve_ivp(
            lambda _, T, held: BALANCES[physics](robot, held, T),
            (0, 1),
            exact[-1],
            args=(inputs,),
            rtol=1e-8,
            atol=1e-8,
        )
        exact.append(piece.y[:, -1])
    fast, slow = Exponential(network).solve(acting, start), network.solve(acting, start)
    assert np.ptp(fast, axis=0).max() > 20
    assert np.abs(slow - exact).max() < 1e-3
    assert np.abs(fast - exact).max() < 1e-3


@pytest.mark.long
def test_means_of_a_second_do_for_its_hundred_samples() -> None:
    """The samples' own heat, sample by sample, against the scheme fed with means."""
    robot, moved = quadruped(seed=2), draw_motion(MOVES[:1], np.random.default_rng(1))
    network = Balance(robot, AMBIENT)
    start = network.start(np.random.default_rng(0).uniform(30, 60, len(robot.nodes)))
    ours = Exponential(network).solve(forcing(robot, moved.means(robot.wind_exponent), extra(robot, moved)), start)
    torque, velocity = moved.samples(0, 15)
    T = start
    for k in range(1500):
        speed = np.abs(velocity[k])
        held = (torque[k] ** 2, speed, speed**2, float(moved.base[k // 100]), float(moved.pc[k // 100]))
        T = solve_ivp(lambda _, x, h: full_balance(robot, h, x), (0, 0.01), T, args=(held,), rtol=1e-6, atol=1e-9).y[
            :, -1
        ]
    assert np.abs(T - ours[15]).max() < 1e-3
    assert np.abs(T - start).max() > 1


def test_means_are_those_of_the_samples() -> None:
    moved = draw_motion(MOVES, np.random.default_rng(5))
    means = moved.means()
    torque, velocity = moved.samples(0, len(moved.base))
    for values, ours in (
        (torque**2, means.torque2),
        (np.abs(velocity), means.speed),
        (velocity**2, means.speed2),
        (np.abs(velocity) ** 1.5, means.speed15),
    ):
        assert ours == pytest.approx(values.reshape(len(ours), 100, 12).mean(axis=1), abs=1e-9)
    part, _ = moved.samples(123, 345)
    assert np.array_equal(part, torque[12300:34500])


def test_loaded_trot_reaches_60_degrees_at_553_s(monkeypatch: pytest.MonkeyPatch) -> None:
    """[QuadrupedLPTN, application 3]: from 27 degC; nominal robot, steady gait, equal legs."""
    monkeypatch.setattr(motion, "SHARE", 0.0)
    monkeypatch.setattr(motion, "MODULATION", 0.0)
    run = Job((Bout("trot", 700, 0.2, 4.0),), 27.0, cutout=None)
    logs = quadruped_logs(seed=0, runs={"trot": run}, level="none", scatter=0, noise=0, quantisation=0)
    rms = [np.sqrt((logs["trot"][f"torque.FR_{part}"] ** 2).mean()) for part in ("hip", "thigh", "calf")]
    assert rms == pytest.approx([2.31, 3.88, 8.32], rel=2e-3)
    truth = logs.truth["trot"]
    first = {joint: int((truth[f"temperature.{joint}"] > 60).argmax()) for joint in QUADRUPED_JOINTS}
    assert [first[f"{leg}_calf"] for leg in ("FR", "FL", "RR", "RL")] == pytest.approx([553.0] * 4, abs=2)
    assert not any(first[joint] for joint in QUADRUPED_JOINTS if not joint.endswith("calf"))


def test_scatter_of_the_parameters_is_as_wide_as_said() -> None:
    robots = [quadruped(seed=seed) for seed in range(40)]
    for field, spread in (("resistance", 0.04), ("winding", 0.03), ("to_air", 0.06), ("coulomb", 0.1)):
        values = np.array([getattr(robot, field)[:12] for robot in robots])
        assert (values / values.mean(axis=0)).std() == pytest.approx(spread, rel=0.15)
    nominal = quadruped(seed=5, scatter=0)
    assert nominal.capacity == pytest.approx([*(231, 210, 210) * 4, 420, 2600])
    assert 1 / nominal.to_air == pytest.approx([*(13.75, 11, 10.45) * 4, 2.4, 1.4])
    assert nominal.resistance[0] / nominal.torque_constant[0] ** 2 == pytest.approx(0.211, abs=5e-4)


@pytest.mark.parametrize(("level", "spreads"), [("none", (0, 0)), ("default", (1.0, 0.15)), ("strong", (2.0, 0.25))])
def test_hidden_errors_of_runs(level: str, spreads: tuple[float, float]) -> None:
    robot = quadruped(seed=1)
    drawn = [draw_run_errors(robot, level, 1, f"run{k}") for k in range(300)]  # type: ignore[arg-type]
    ambient = np.std([error for _, error in drawn])
    air = np.std([np.log(own.to_air[0] / robot.to_air[0]) for own, _ in drawn])
    assert (ambient, air) == pytest.approx(spreads, rel=0.12)
    assert len({own.constant[13] for own, _ in drawn}) == (1 if level == "none" else 300)
    assert all(np.array_equal(one.capacity, other.capacity) for (one, _), (other, _) in pairwise(drawn))


MIXED = {
    "mix": Job(
        (Bout("trot", 200, 0.7, 4.0), Bout("sway", 150, 1.0), Bout("rest", 150), Bout("stand", 100)),
        20.0,
        cutout=None,
    )
}
HIDDEN = (
    *(("gear_loss", "*", 1.0), ("driver_loss", "*_hip", 1.0), ("computer_heat", "FR_calf", 1.0)),
    *(("battery_heat", "pc", 1.0), ("solar", "*_thigh", 1.0), ("fan", "*", 1.0), ("shared_mass", "*_calf", 1.0)),
    *(("loss_scale", "RL_calf", 1.0), ("surface_scale", "RR_hip", -1.0), ("ambient_lag", "ambient", 1.0)),
)


@pytest.mark.long
def test_heat_is_the_one_written_down() -> None:
    """The robot's log alone, its parameters and the docstrings' numbers, integrated by scipy."""
    robot = quadruped(seed=4, physics="plain")
    (record,) = simulate_runs(quadruped(HIDDEN, seed=4, physics="plain"), MIXED, 4, "none")
    means, motion, air = record.motion.means(), record.motion, record.ambient
    battery = motion.pc + 4 * motion.powered.sum(axis=1)
    battery += (0.15 / (9.1 * 0.0927) ** 2 * means.torque2 + means.power).sum(axis=1)
    part = np.array([joint.rpartition("_")[2] for joint in QUADRUPED_JOINTS] + ["pc"])
    calves, loss, surface = np.flatnonzero(part == "calf"), np.ones(12), np.ones(13)
    loss[QUADRUPED_JOINTS.index("RL_calf")], surface[QUADRUPED_JOINTS.index("RR_hip")] = 1.2, 0.7
    outside = (air.true[:-1] + air.true[1:]) / 2

    def slope(_: float, T: Array, k: int) -> Array:
        node, frame = T[:13], T[13]
        heat = np.zeros(13)
        heat[:12] = loss * robot.resistance[:12] * means.torque2[k] / (9.1 * 0.0927) ** 2 + 4 * motion.powered[k]
        heat[:12] += 0.1 * means.power[k] + 0.5 * means.torque1[k] * (part[:12] == "hip")
        heat[2] += 0.1 * motion.pc[k]
        heat[12] += motion.pc[k] + 0.01 * battery[k]
        heat += 0.005 * motion.sun[k] * (part == "thigh")
        heat -= surface * (1 + 0.5 * motion.fan[k]) * robot.to_air * (node - outside[k])
        for i, j, conductance in robot.links:
            heat[i] += conductance * (node[j] - node[i])
            heat[j] += conductance * (node[i] - node[j])
        heat[calves] += (frame - node[calves]) / 17
        into = ((node[calves] - frame) / 17).sum() - 4 / 42 * (frame - outside[k])
        return np.append(heat / robot.capacity, into / 480)

    exact = [np.full(14, 20.0)]
    for k in range(600):
        exact.append(solve_ivp(slope, (0, 1), exact[-1], args=(k,), rtol=1e-8, atol=1e-8).y[:, -1])
    assert np.ptp(exact, axis=0).max() > 5
    assert np.abs(record.states - exact).max() < 1e-3
