"""Check the true heat balance against the equations written out by hand, and its numbers against scipy."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lptn.virtual import EFFECTS, JOINTS, Hidden, leg_logs, places
from lptn.virtual.forcing import Drive, drive
from lptn.virtual.protocol import Segment, Signals, draw_signals
from lptn.virtual.sensors import lagged
from lptn.virtual.solve import Network
from lptn.virtual.truth import Array, Leg, draw_leg, roughen

MOVES = (Segment("squat", 60), Segment("trot", 100, 1.5, 4.0), Segment("leg_sweep", 40, 1.5))


def leg_with_everything(size: float = 1.0) -> Leg:
    leg = draw_leg(4, 0.1)
    roughen(leg)
    for effect in EFFECTS:
        Hidden(effect, places(effect)[-1], size).set_in(leg)
    return leg


def at_row(forcing: Drive, k: int) -> tuple[Array, Array, Array]:
    return forcing.copper[k], forcing.other[k], forcing.to_air[k]


def test_balance_of_the_baseline_is_the_one_written_down() -> None:
    """C dT/dt = Σ (T_j - T_i)/R_ij + (T_amb - T_i)/R_i + R_d (τ/k)²."""
    leg, T, torque, ambient = draw_leg(1, 0.1), np.array([40.0, 55.0, 70.0]), np.array([3.0, -5.0, 8.0]), 20.0
    (_, _, upper), (_, _, lower) = leg.links
    rows = Signals(np.tile(torque, (10, 1)), np.full((10, 3), 2.0), np.ones(10))
    held = at_row(drive(leg, rows, np.zeros((10, 3))), 0)
    copper = leg.resistance * torque**2 / leg.torque_constant**2
    between = np.array([upper * 15, -upper * 15 + lower * 15, -lower * 15])
    expected = (copper + between + leg.to_air * (ambient - T)) / leg.capacity
    assert Network(leg, ambient).slope(T, *held) == pytest.approx(expected, rel=1e-12)


def test_balance_with_every_effect_is_the_one_written_down() -> None:
    leg = draw_leg(1, 0.1)
    for effect in EFFECTS:
        Hidden(effect, places(effect)[-1], 0.5).set_in(leg)
    base = draw_leg(1, 0.1)
    T, inner, ambient, torque = np.array([40.0, 55.0, 70.0]), np.array([38.0, 52.0, 61.0]), 20.0, 6.0
    w, v, kelvin = 4.0, 1.2, 273.15
    rows = Signals(np.full((10, 3), torque), np.tile([[w], [-w]], (5, 3)), np.full(10, v))
    held = at_row(drive(leg, rows, np.full((10, 3), 2.5)), 0)
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
    slope = Network(leg, ambient).slope(np.concatenate([T, inner, [frame]]), *held)
    assert slope == pytest.approx(np.array(expected), rel=1e-9)


def test_energy_stored_and_lost_is_the_energy_put_in() -> None:
    """Checked on the log alone, with nothing but the parameters from the truth."""
    leg, log = draw_leg(3, 0.03), leg_logs(seed=3, noise=0)["fit1"]
    T = log[[f"temperature.{joint}" for joint in JOINTS]].to_numpy()
    torque = log[[f"torque.{joint}" for joint in JOINTS]].to_numpy()
    put_in = 0.1 * float((leg.resistance * (torque / leg.torque_constant) ** 2)[:-1].sum())
    lost = float((leg.to_air * np.trapezoid(T - 22.0, dx=0.1, axis=0)).sum())
    stored = float((leg.capacity * (T[-1] - T[0])).sum())
    assert stored + lost == pytest.approx(put_in, rel=1e-3)
    assert stored > 0.1 * put_in


def test_one_second_scheme_agrees_with_scipy_on_the_full_inputs() -> None:
    leg = leg_with_everything()
    signals = draw_signals(MOVES, np.random.default_rng(0))
    extra = np.zeros_like(signals.torque)
    network = Network(leg, 25.0)
    start = network.start(np.array([60.0, 70.0, 80.0]))
    ours = network.solve(drive(leg, signals, extra), start)
    fine = drive(leg, signals, extra, block=1)
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


def test_lag_is_the_exact_one() -> None:
    time = np.arange(200.0)
    ramp = np.column_stack([20 + 0.1 * time] * 2)
    read = lagged(ramp, np.array([20.0, 0.0]))
    before = 20.0 - 0.1 * 20 * (1 - np.exp(-time / 20))
    assert read[:, 0] == pytest.approx(before + 0.1 * time, abs=1e-9)
    assert read[:, 1] == pytest.approx(ramp[:, 1], abs=0)
