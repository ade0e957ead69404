"""Check the leg of finite volumes: its balance closes, its grid is fine enough, cases that can be solved by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.optimize import brentq

from lptn.virtual.robot import Array
from tests.truth.finite_volumes import (
    ALUMINIUM,
    COIL,
    KELVIN,
    KINDS,
    STEFAN_BOLTZMANN,
    Assembly,
    Body,
    Leg,
    Solution,
    assemble,
    draw_finite_volumes,
    film,
    solve,
)

LOSSES = (12.0, 1.0, 0.5, 0.5, 0.5, 0.0)  # W, in the order of KINDS


def run_leg(leg: Leg, seconds: int = 1800, cells: int = 1, step: float = 1.0, refresh: int = 4) -> Solution:
    """Load all joints for a while, then let them rest."""
    assembly = assemble(leg, cells=cells)
    steps = round(seconds / step)
    heat = np.tile([*LOSSES * 3, *[20.0] * leg.computer], (steps, 1))
    heat[steps // 2 :] *= 0.1
    air, still = np.full((steps, 4), 20.0), np.zeros(steps)
    return solve(assembly, heat, air, still, still, 20.0, step=step, refresh=refresh)


def alone(body: Body, cell: int) -> Assembly:
    """A body with one source, in one cell, and no sensor."""
    count = len(body.capacity)
    share = np.eye(count)[[cell]]
    return Assembly(body, share, np.zeros(1), np.zeros(1), share, [], np.zeros(count), [])


def settled(assembly: Assembly, watts: float) -> Array:
    """Temperatures long after this source was switched on, in air of 20 degC."""
    still = np.zeros(4000)
    heat, air = np.full((4000, 1), watts), np.full((4000, 1), 20.0)
    last: Array = solve(assembly, heat, air, still, still, 20.0, step=30.0).temperature[-1]
    return last


@pytest.mark.parametrize("computer", [False, True])
@pytest.mark.parametrize("wax", [0.0, 0.05])
def test_the_balance_of_heat_closes(computer: bool, wax: float) -> None:
    leg = draw_finite_volumes(2, computer)
    leg.joints["FR_calf"].wax = wax
    done = run_leg(leg)
    assert done.generated - done.lost - done.stored == pytest.approx(0, abs=1e-6 * done.generated)
    assert done.lost > 0.2 * done.generated


@pytest.mark.slow
def test_finer_cells_and_shorter_steps_change_little_and_ever_less() -> None:
    leg = draw_finite_volumes(2)

    def read(cells: int, step: float = 1.0, refresh: int = 4) -> Array:
        reads = assemble(leg, cells=cells).reads
        done: Array = run_leg(leg, cells=cells, step=step, refresh=refresh).temperature[:: round(60 / step)] @ reads.T
        return done

    coarse, fine, finest = (read(cells) for cells in (1, 2, 4))
    assert np.abs(coarse - finest).max() < 0.15
    assert np.abs(fine - finest).max() < 0.5 * np.abs(coarse - finest).max()
    # What a step costs beside the grid: below any sensor's noise.
    assert np.abs(coarse - read(1, step=0.25, refresh=1)).max() < 0.02


def test_a_rod_between_heat_and_air_settles_where_the_formulas_say() -> None:
    """All heat leaves at the far end, so the rod's profile is a straight line above a film that is solved for."""
    body, watts, area, diameter = Body(), 5.0, 0.01, 0.05
    rod = body.row(ALUMINIUM, 0.2, 1e-4, 20, 0)
    end = body.row(ALUMINIUM, 0.01, 0.01, 1, 0, area=area, diameter=diameter, emissivity=0.8)
    body.join(rod[-1], end[0], 2.0)

    def excess(above: float) -> float:
        convected = 1.32 * (above / diameter) ** 0.25 * above
        radiated = 0.8 * STEFAN_BOLTZMANN * ((20 + above + KELVIN) ** 4 - (20 + KELVIN) ** 4)
        return float(area * (convected + radiated) - watts)

    surface = 20 + brentq(excess, 1, 300)
    through_end = watts * (1 / 2.0 + 0.005 / (ALUMINIUM.conductivity * 0.01))
    along = watts * (0.2 - 0.005) / (ALUMINIUM.conductivity * 1e-4)  # from the first cell's centre
    temperature = settled(alone(body, rod[0]), watts)
    assert temperature[end[0]] == pytest.approx(surface, abs=1e-6)
    assert temperature[rod[0]] - temperature[end[0]] == pytest.approx(through_end + along, abs=1e-6)


def test_heat_spread_over_a_slab_makes_a_parabola() -> None:
    body, thick, section, watts = Body(), 0.002, 0.0075, 20.0
    slab = body.row(COIL, thick, section, 40, 0)
    shell = body.row(ALUMINIUM, 0.01, 0.05, 1, 0, area=0.05)
    body.join(slab[-1], shell[0], 1e6)
    spread = np.zeros((1, len(body.capacity)))
    spread[0, slab] = 1 / len(slab)
    temperature = settled(Assembly(body, spread, np.zeros(1), np.zeros(1), spread, [], 0 * spread[0], []), watts)
    drop = watts / (COIL.conductivity * section) * thick / 2  # from the middle of the coil to its face
    face = temperature[slab[-1]] - temperature[slab[0]]
    assert -face == pytest.approx(drop, rel=0.03)  # between cells' centres


def test_cooling_of_one_lump_takes_as_long_as_the_integral_says() -> None:
    body = Body()
    body.row(ALUMINIUM, 0.05, 0.002, 1, 0, area=0.01, diameter=0.05, emissivity=0.8)
    steps, capacity = 3000, body.capacity[0]
    still, air = np.zeros(steps), np.full((steps, 1), 20.0)
    T = solve(alone(body, 0), np.zeros((steps, 1)), air, still, still, 70.0).temperature[:, 0]

    def seconds_a_kelvin(temperature: float) -> float:
        above = temperature - 20
        radiated = 0.8 * STEFAN_BOLTZMANN * ((temperature + KELVIN) ** 4 - (20 + KELVIN) ** 4)
        return float(capacity / 0.01 / (1.32 * (above / 0.05) ** 0.25 * above + radiated))

    lasts = quad(seconds_a_kelvin, T[-1], 70)[0]
    assert lasts == pytest.approx(steps, rel=1e-4)


def test_films_of_air_are_as_in_the_tables() -> None:
    one = np.ones(1)
    assert film(30 * one, 0 * one, 0.085 * one)[0] == pytest.approx(5.72, abs=0.02)
    # A cylinder of 12.7 mm at 10 m/s, 128.4 degC in air of 26.2: 105 W/(m² K) by Hilpert at film temperature;
    # [IncroperaDeWitt, chapter 7]. Properties at 300 K give a little more.
    assert film(102 * one, 10 * one, 0.0127 * one)[0] == pytest.approx(105, rel=0.15)
    speeds = film(30 * np.ones(50), np.linspace(0, 3, 50), 0.085 * np.ones(50))
    assert (np.diff(speeds) >= 0).all()


def test_copper_and_grease_follow_their_temperature() -> None:
    assembly = assemble(draw_finite_volumes(1))
    kinds = len(KINDS)
    assert assembly.sources.sum(axis=1) == pytest.approx(1)
    assert assembly.reads.sum(axis=1) == pytest.approx(1)
    assert (assembly.rises > 0).tolist() == [k % kinds == 0 for k in range(3 * kinds)]
    assert (assembly.thins > 0).tolist() == [k % kinds == 3 for k in range(3 * kinds)]


def test_a_sensor_lies_between_its_motor_and_the_one_that_is_bolted_to_its_back() -> None:
    """One joint alone is heated: how far another's sensor is from its own mean, on the way to the heated one's."""

    def share(leg: Leg, sensor: int, heated: int) -> float:
        assembly, heat = assemble(leg), np.zeros((1800, 3 * len(KINDS)))
        heat[:, heated * len(KINDS)] = 20.0
        still = np.zeros(1800)
        last = solve(assembly, heat, np.full((1800, 3), 20.0), still, still, 20.0).temperature[-1]
        own = np.array(assembly.body.zone) == sensor
        capacity, reads = np.array(assembly.body.capacity), assembly.reads @ last
        mean = capacity[own] @ last[own] / capacity[own].sum()
        return float((reads[sensor] - mean) / (reads[heated] - mean))

    legs, (hip, thigh, calf) = [draw_finite_volumes(seed) for seed in range(5)], range(3)
    assert all(0.05 < share(leg, thigh, calf) < 0.2 for leg in legs)
    assert all(0.05 < share(leg, calf, thigh) < 0.3 for leg in legs)
    assert all(share(leg, hip, thigh) < 0 for leg in legs)  # heat comes through the hip's gear, far from its sensor


def test_dimensions_scatter_and_the_seed_fixes_them() -> None:
    assert draw_finite_volumes(4).joints == draw_finite_volumes(4).joints
    paste = [draw_finite_volumes(seed).joints["FR_hip"].paste for seed in range(20)]
    assert 0.2 < (max(paste) - min(paste)) / np.mean(paste) / 2 <= 0.27
    capacities = [sum(assemble(draw_finite_volumes(seed)).body.capacity) for seed in range(5)]
    assert 1000 < min(capacities) < max(capacities) < 2000  # J/K, all three joints and what lies between
