"""Effects of the catalogue, heat of the gear and an inverter in a trade study, against plain SciPy."""

from __future__ import annotations

from contextlib import suppress

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import RegularGridInterpolator
from scipy.optimize import brentq

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.planners.trade import Design, TradeStudy, solve_study
from lptn.planners.trade.designs import Simulator, peak_temperatures
from tests.cooling import plain_sink as plain
from tests.cooling.studies import study

HOUR = 3600.0  # s
AREA, BETA, GAMMA, DROP = 0.02, 0.0167, 0.3, 0.5  # m², 1/K, s/m, V
WALKS = 1.5  # m/s
AT_HOUSING = f"""
[[effects]]
kind = "forced_convection"
at = "housing"
gamma = {GAMMA}
[[effects]]
kind = "driver_loss"
at = "housing"
input = "current_abs"
voltage = {DROP}
"""
AT_SINK = f"""
[[effects]]
kind = "radiation"
at = "sink"
area = {AREA}
[[effects]]
kind = "natural_convection"
at = "sink"
beta = {BETA}
"""
GEAR = '[[gears]]\nname = "belt"\nratio = 10\nefficiency = 0.8\nheats = "housing"\n'


def _one(asked: TradeStudy) -> Design:
    (design,) = solve_study(asked).designs
    return design


def _hottest(torque: float, extra: float, factor: float = 1.0, sink: tuple[float, float] | None = None) -> float:
    """The U8's winding [degC] after an hour at a torque of its shaft, `extra` W in the housing beside the drive's."""
    capacity, resistance = sink or (1.0, np.inf)

    def rates(_: float, x: FloatArray) -> list[float]:
        w, s, h, k = x
        current = torque / (plain.K_T * (1 + plain.MAGNET * (h - 25.0)))
        copper = current**2 * plain.RESISTANCE * (1 + plain.ALPHA * (w - plain.REFERENCE))
        into_pipes = (s - k) / plain.R_SK * (sink is not None)
        over = k - plain.AMBIENT
        out = over * np.exp(BETA * over) / resistance
        out += 5.670374419e-8 * AREA * ((k + 273.15) ** 4 - (plain.AMBIENT + 273.15) ** 4) * (sink is not None)
        inner, outer = (w - s) / plain.R_WS, (s - h) / plain.R_SH
        housing = outer - factor * (h - plain.AMBIENT) / plain.R_HA + extra + DROP * current * (factor != 1)
        return [(copper - inner) / plain.C_W, (inner - outer - into_pipes) / plain.C_S, housing / plain.C_H,
                (into_pipes - out) / capacity]  # fmt: skip

    course = solve_ivp(rates, (0.0, HOUR), [plain.AMBIENT] * 4, method="LSODA", rtol=1e-9, atol=1e-9)
    return float(course.y[0].max())


@pytest.mark.parametrize(("speed", "share"), [(5.0, 0.25), (-5.0, 0.2)])
def test_effects_and_the_gears_loss_warm_and_cool_the_housing(speed: float, share: float) -> None:
    task = f'duration = {HOUR}\nspeed = {speed}\ninputs = {{ "speed.base" = {WALKS} }}'
    design = _one(study("held_torque", task, more=GEAR + AT_HOUSING + AT_SINK, cooling='"none"'))
    at_shaft = design.value / 10 * (1 / 0.8 if speed > 0 else 0.8)
    lost = share * design.value * abs(speed)  # W; driving the motor gives 1/0.8 of the load's power, braking 0.8 of it
    assert _hottest(at_shaft, lost, 1 + GAMMA * WALKS) == pytest.approx(105.0, abs=2e-3)


def test_a_sink_radiates_and_its_film_grows_with_its_warmth() -> None:
    design = _one(study("held_torque", f"duration = {HOUR}", "mass = 0.7", more=AT_SINK, cooling='"passive"'))
    assert design.sink is not None
    assert _hottest(design.value, 0.0, sink=design.sink) == pytest.approx(105.0, abs=2e-3)
    # The fins have the film of `excess` = 30 K there, and so e^(30 β) less at none.
    film, spacing = plain.still_air()
    capacity, resistance = design.sink
    fins = plain.DENSITY * plain.THICKNESS / (2 * film * np.exp(-30 * BETA) * resistance)
    assert "fins" in design.binding
    assert fins == pytest.approx(capacity / plain.HEAT, rel=1e-4)
    assert design.volume - plain.MOTOR_VOLUME == pytest.approx(
        fins / plain.DENSITY * (1 + spacing / plain.THICKNESS), rel=1e-4
    )


def test_a_fans_sink_has_no_film_of_its_own_warmth() -> None:
    radiates = AT_SINK[: AT_SINK.rindex("[[effects]]")]
    with_it, without = (
        _one(study("held_torque", f"duration = {HOUR}", "mass = 0.7", more=more, cooling='"fan"'))
        for more in (AT_SINK, radiates)
    )
    assert with_it.value == pytest.approx(without.value, rel=1e-9)
    assert with_it.volume == pytest.approx(without.volume, rel=1e-6)


def test_a_steady_state_is_none_where_a_film_that_grows_would_overflow() -> None:
    """Newton's method passes temperatures at which the film is beyond all numbers."""
    asked = study("held_torque", f"duration = {HOUR}", "mass = 0.7", more=AT_SINK, cooling='"passive"')
    (option,) = asked.options()
    torques = np.linspace(0.0, 3.0, 200)
    states = Simulator(option, (38.0, 10.0)).steady(torques)
    settles = np.isfinite(states[0])
    last = int(np.flatnonzero(settles)[-1])
    assert settles[: last + 1].all()
    assert np.all(np.diff(states[0, : last + 1]) > 0)
    assert states[0, last] > 450.0
    hour = _hottest(torques[75], 0.0, sink=(38.0, 10.0))
    assert states[0, 75] == pytest.approx(hour, abs=0.5)


def test_an_inverter_counts_by_its_mass_and_price() -> None:
    inverter = "[inverter]\nmass = 0.05\nvolume = 2e-5\nprice = 30\n"
    with_it, without = (
        _one(study("held_torque", "duration = 120", more=more, cooling='"none"')) for more in (inverter, "")
    )
    assert with_it.mass - without.mass == pytest.approx(0.05)
    assert with_it.volume - without.volume == pytest.approx(2e-5)
    assert with_it.price - without.price == pytest.approx(30.0)
    assert with_it.value == pytest.approx(without.value)


def test_a_gears_heat_is_a_number_of_the_study() -> None:
    design = _one(study("held_torque", f"duration = {HOUR}\nspeed = 5", more=GEAR, cooling='"none"'))
    assert design.parameters["gear_heat.gain.housing"] == (1.0, "1")

    def held(gain: float) -> float:
        return float(brentq(lambda torque: _hottest(torque / 8, gain * 0.25 * torque * 5) - 105.0, 5.0, 8.0, xtol=1e-9))

    assert design.value == pytest.approx(held(1.0), rel=1e-5)
    slope = (held(1.0) - held(0.999)) / 0.001
    assert design.sensitivities["gear_heat.gain.housing"] == pytest.approx(slope, rel=2e-3)


@pytest.mark.parametrize(
    ("task", "more", "said"),
    [
        ("", '[[effects]]\nkind = "radiation"\nat = "shell"\n', ("effects[0].at", "shell")),
        ("", '[[effects]]\nkind = "radiance"\nat = "housing"\n', ("line 15, effects[0].kind", "radiation")),
        ("", '[[effects]]\nkind = "fan"\nat = "housing"\n', ("fan.housing", "inputs = {")),
        ("", '[[gears]]\nname = "g"\nratio = 9\nheats = "shell"\n', ("gears[0].heats", "shell", "housing")),
        ('inputs = { "speed.base" = 1 }', "", ('task.inputs."speed.base"', "no model reads")),
        ('inputs = { "current.winding" = 1 }', "", ('task.inputs."current.winding"', "says already")),
    ],
)
def test_what_no_model_can_use_is_refused(task: str, more: str, said: tuple[str, ...]) -> None:
    with pytest.raises(InputError) as refused:
        solve_study(study("held_torque", f"duration = 120\n{task}", more=more, cooling='"none"'))
    for word in said:
        assert word in str(refused.value)


# --- a gear's map, a fan's curve ----------------------------------------------------------------

SPEEDS, TORQUES = [0.0, 50.0, 200.0], [1.0, 5.0, 20.0]  # rad/s, N·m
MAP = [[0.6, 0.5, 0.4], [0.8, 0.78, 0.6], [0.9, 0.88, 0.7]]
MAPPED = f"{GEAR}[gears.map]\nspeed = {SPEEDS}\ntorque = {TORQUES}\nefficiency = {MAP}\n".replace("0.8\n", "0.95\n", 1)
_BILINEAR = RegularGridInterpolator((TORQUES, SPEEDS), np.array(MAP))


def _efficiency(torque: float, speed: float) -> float:
    return 0.95 * float(_BILINEAR([(np.clip(torque, 1.0, 20.0), min(abs(speed), 200.0))])[0])


@pytest.mark.parametrize("speed", [7.0, 30.0, -7.0])
def test_a_gear_is_as_good_as_its_map_says_at_speed_and_torque(speed: float) -> None:
    design = _one(study("held_torque", f"duration = {HOUR}\nspeed = {speed}", more=MAPPED, cooling='"none"'))
    efficiency = _efficiency(design.value, 10 * speed)
    through = 1 / efficiency if speed > 0 else efficiency
    assert 0.4 < efficiency < 0.9
    heat = design.value * speed * (through - 1)
    assert _hottest(design.value / 10 * through, heat) == pytest.approx(105.0, abs=2e-3)


def test_the_map_of_a_cycle_for_ever_goes_through_its_design_with_the_gears_map() -> None:
    cycle = 'kind = "cycle"\nperiod = 4\nprofile = [4, 12, 2, 1]\nspeeds = [2, 15, -5, 0]'
    more = MAPPED.replace('heats = "housing"\n', "")
    design = _one(study("worst_temperature", cycle, "mass = 0.7", more=more, cooling='"passive"'))
    profile, motion = np.array([4.0, 12.0, 2.0, 1.0]), np.array([2.0, 15.0, -5.0, 0.0])
    by_part = [_efficiency(torque, 10 * speed) for torque, speed in zip(profile, motion, strict=True)]
    through = [1 / of if speed >= 0 else of for of, speed in zip(by_part, motion, strict=True)]
    held = np.sqrt(np.mean((profile / 10 * through) ** 2))
    assert design.sink is not None
    capacity, resistance = (np.array([value]) for value in design.sink)
    mean = plain.hottest(capacity, resistance, np.array([held]), 12_000.0, 2.0)
    found = peak_temperatures(design.option, capacity, resistance, np.array([12.0]), 4.0)
    assert found == pytest.approx(mean, abs=0.01)
    assert design.value == pytest.approx(mean[0], abs=2.0)  # it ripples by the winding's own capacity


FLOW, PRESSURE = [0.0, 0.002, 0.004], [20.0, 12.0, 0.0]  # m³/s, Pa
FAN = f"[fan]\nmass = 0.03\n[fan.curve]\nflow = {FLOW}\npressure = {PRESSURE}\n"


def _fins(resistance: float) -> tuple[float, float, float]:
    """Of fins of a resistance to the air, each of two sides: air between them [m/s], film with efficiency, spacing."""
    nu, diffusivity, k, rho, height, depth = 1.67e-5, 2.36e-5, 0.0267, 1.138, 0.08, 0.03

    def film_and_spacing(speed: float) -> tuple[float, float]:
        reynolds = speed * height / nu
        film = 0.664 * np.sqrt(reynolds) * (nu / diffusivity) ** (1 / 3) * k / height
        ml = np.sqrt(2 * film / (200.0 * plain.THICKNESS)) * depth
        return film * np.tanh(ml) / ml, 2 * 5 * height / np.sqrt(reynolds)

    def too_much(speed: float) -> float:
        film, spacing = film_and_spacing(speed)
        channels = 1 / (film * resistance) / (2 * height * depth)
        friction = 1.328 / np.sqrt(speed * height / nu) * rho * speed**2 / 2  # on one side [Pa]
        lost = rho * speed**2 / 2 + 2 * friction * height / spacing
        return float(lost - np.interp(channels * spacing * depth * speed, FLOW, PRESSURE))

    speed = float(brentq(too_much, 0.05, 8.0, xtol=1e-12))
    return speed, *film_and_spacing(speed)


@pytest.mark.parametrize("limits", ["mass = 0.55", "mass = 0.7\nvolume = 1e-3"])
def test_a_fan_moves_what_its_curve_lets_through_the_fins(limits: str) -> None:
    design = _one(study("held_torque", f"duration = {HOUR}", limits, more=FAN, cooling='"fan"'))
    assert design.sink is not None
    capacity, resistance = design.sink
    speed, film, spacing = _fins(resistance)
    assert 0.1 < speed < 5.0
    area = 1 / (film * resistance)
    fins = plain.DENSITY * plain.THICKNESS * area / 2
    volume = plain.MOTOR_VOLUME + 1e-4 + area / 2 * (plain.THICKNESS + spacing)
    volume += capacity / plain.HEAT / plain.DENSITY - fins / plain.DENSITY
    assert design.volume == pytest.approx(volume, rel=2e-3)
    hottest = plain.hottest(np.array([capacity]), np.array([resistance]), np.array([design.value]), HOUR, 2.0)
    assert hottest[0] == pytest.approx(105.0, abs=0.01)
    # Of so much metal no fins of less resistance can be built.
    metal, least = capacity / plain.HEAT, np.inf
    for other in resistance * np.geomspace(0.7, 1.4, 140):
        with suppress(ValueError):  # the fan has not so much air
            _, film, spacing = _fins(float(other))
            area = 1 / (film * other)
            fins = plain.DENSITY * plain.THICKNESS * area / 2
            volume = plain.MOTOR_VOLUME + 1e-4 + area / 2 * (plain.THICKNESS + spacing)
            volume += (metal - fins) / plain.DENSITY
            if fins <= metal and ("volume" not in limits or volume <= 1e-3):
                least = min(least, float(other))
    assert least == pytest.approx(resistance, rel=0.006)
    # Below the resistance whose fins take all the air that the fan has, none can be built.
    numbers = design.option.sink(np.array([0.5, resistance]))
    assert numbers.fin_share(1e4, 0.5)[0] > 1 > numbers.fin_share(1e4, resistance)[1]


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (MAPPED.replace("[0.6, 0.5, 0.4]", "[0.6, 0.5]"), ("gears[0].map.efficiency", "3 rows", "of 3 numbers")),
        (MAPPED.replace("[1.0, 5.0", "[5.0, 1.0"), ("gears[0].map.torque", "numbers that rise")),
        (FAN.replace("12.0", "25.0"), ("fan.curve.pressure", "falling")),
        (FAN.replace("0.002, ", ""), ("fan.curve.pressure", "a pressure for each flow")),
    ],
)
def test_curves_that_are_none_are_refused(more: str, said: tuple[str, ...]) -> None:
    with pytest.raises(InputError) as refused:
        study("held_torque", "duration = 120", more=more)
    for word in said:
        assert word in str(refused.value)
