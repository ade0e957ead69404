"""Gears, supply voltage, speed, prices and metals of a trade study, against plain code."""

from __future__ import annotations

import numpy as np
import pytest
from ankle import WALKING_PERIOD, jump_task, level_walking, walking_speed, walking_task
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.planners.trade import Design, TradeStudy, solve_study
from lptn.planners.trade.answer import as_json, headline, remarks, table
from lptn.planners.trade.figures import study_figure
from lptn.report.planning_pages import trade_html
from tests.cooling import plain_sink as plain
from tests.cooling.studies import HELD, study

VOLTAGE = 22.2  # V
EFFICIENCY = 0.8
GEAR = f'[[gears]]\nname = "belt"\nratio = {{ratio}}\nefficiency = {EFFICIENCY}\nmass = 0.1\n'


def _bare(x: FloatArray, current: float) -> list[float]:
    """Rates of the U8 without a sink [K/s]."""
    w, s, h = x
    loss = current**2 * plain.RESISTANCE * (1 + plain.ALPHA * (w - plain.REFERENCE))
    inner, outer = (w - s) / plain.R_WS, (s - h) / plain.R_SH
    out = (h - plain.AMBIENT) / plain.R_HA
    return [(loss - inner) / plain.C_W, (inner - outer) / plain.C_S, (outer - out) / plain.C_H]


def _constant(housing: float) -> float:
    return plain.K_T * (1 + plain.MAGNET * (housing - 25.0))


def _course(torque: float, duration: float) -> FloatArray:
    """Temperatures of the U8 during a hold of a torque at its shaft [degC], shape (3, n)."""
    times = np.linspace(0.0, duration, 40)
    course = solve_ivp(lambda _, x: _bare(x, torque / _constant(x[2])), (0.0, duration), [plain.AMBIENT] * 3,
                       t_eval=times, rtol=1e-9, atol=1e-9)  # fmt: skip
    return np.asarray(course.y)


def _volts(x: FloatArray, torque: float, speed: float) -> float:
    hot = plain.RESISTANCE * (1 + plain.ALPHA * (x[0] - plain.REFERENCE))
    return float(hot * torque / _constant(x[2]) + _constant(x[2]) * speed)


def held_at(duration: float, speed: float, voltage: float) -> float:
    """The most torque of the U8 at its shaft [N·m] that keeps 105 degC and the voltage."""

    def over(torque: float) -> float:
        course = _course(torque, duration)
        volts = max(_volts(x, torque, speed) for x in course.T)
        return max(float(course[0, -1]) / 105.0, volts / voltage) - 1

    return float(brentq(over, 1e-3, 3.3, xtol=1e-9))


def _one(asked: TradeStudy) -> Design:
    (design,) = solve_study(asked).designs
    return design


def test_a_gear_multiplies_torque_and_loses_its_share() -> None:
    bare = _one(study("held_torque", "duration = 120", cooling='"none"'))
    geared = _one(study("held_torque", "duration = 120", more=GEAR.format(ratio=9), cooling='"none"'))
    assert geared.value == pytest.approx(9 * EFFICIENCY * bare.value, rel=1e-6)
    assert geared.mass == pytest.approx(bare.mass + 0.1)
    assert geared.sensitivities["gear.ratio"] == pytest.approx(geared.value / 9, rel=1e-5)


def test_a_load_that_drives_the_motor_is_helped_by_the_losses() -> None:
    values = []
    for speed in (1.0, -1.0):
        task = f"duration = 120\nspeed = {speed}"
        values.append(_one(study("held_torque", task, more=GEAR.format(ratio=9), cooling='"none"')).value)
    assert values[1] / values[0] == pytest.approx(1 / EFFICIENCY**2, rel=1e-6)


@pytest.mark.parametrize("speed", [100.0, 195.0])
def test_voltage_limits_the_torque_at_speed(speed: float) -> None:
    asked = study("held_torque", f"duration = 120\nspeed = {speed}", f"voltage = {VOLTAGE}", cooling='"none"')
    design = _one(asked)
    assert ("voltage" in design.binding) == (speed > 150)
    assert design.value == pytest.approx(held_at(120.0, speed, VOLTAGE), rel=2e-5)


@pytest.mark.long
def test_the_best_ratio_is_that_of_a_search() -> None:
    speed = 4.0
    task, limits = f"duration = 120\nspeed = {speed}", f"voltage = {VOLTAGE}"
    design = _one(study("held_torque", task, limits, more=GEAR.format(ratio="[10, 200]"), cooling='"none"'))
    ratios = np.linspace(44.0, 51.0, 36)
    held = np.array([ratio * EFFICIENCY * held_at(120.0, ratio * speed, VOLTAGE) for ratio in ratios])
    assert design.value >= held.max() - 1e-4
    assert design.value == pytest.approx(held.max(), rel=2e-3)
    assert design.ratio == pytest.approx(ratios[held.argmax()], abs=0.3)
    assert {"winding", "voltage"} <= {*design.binding}


def test_too_fast_a_motor_is_refused_with_the_speed_it_would_need() -> None:
    limits = 'speed = { value = 3000, unit = "rpm" }'
    result = solve_study(
        study("held_torque", "duration = 120\nspeed = 10", limits, more=GEAR.format(ratio=40), cooling='"none"')
    )
    (refusal,) = result.refusals
    assert [(obstacle.name, round(obstacle.needed)) for obstacle in refusal.obstacles] == [("speed", 400)]


def test_a_rotor_takes_torque_to_be_turned_about() -> None:
    inertia, profile, speeds, period, ratio = 2e-4, [4.0, 8.0, 2.0, 1.0], [2.0, 6.0, -3.0, 1.0], 2.0, 20.0
    motor = f'[[motors]]\nname = "U8"\nrotor_inertia = {inertia}'
    task = f'kind = "cycle"\nprofile = {profile}\nspeeds = {speeds}\nperiod = {period}\ncycles = 3'
    more = GEAR.format(ratio=ratio)
    design = _one(study("worst_temperature", task, "current = 100", motor, more, cooling='"none"'))
    x, hottest = np.full(3, plain.AMBIENT), 0.0
    for part in [*range(4)] * 3:
        acceleration = (speeds[(part + 1) % 4] - speeds[part - 1]) / (2 * period / 4)
        through = EFFICIENCY if speeds[part] < 0 else 1 / EFFICIENCY
        torque = profile[part] / ratio * through + inertia * ratio * acceleration

        def rates(_: float, at: FloatArray, torque: float = torque) -> list[float]:
            return _bare(at, torque / _constant(at[2]))

        course = solve_ivp(rates, (0.0, period / 4), x, rtol=1e-9, atol=1e-9)
        x, hottest = course.y[:, -1], max(hottest, float(course.y[0].max()))
    assert design.value == pytest.approx(hottest, abs=1e-3)


@pytest.mark.parametrize("turns", [0.5, 2.0])
def test_a_winding_of_other_turns_is_the_same_motor_at_another_voltage_and_current(turns: float) -> None:
    """n times the turns at U and I bear what the motor bears at U/n and n I."""
    motor = f'[[motors]]\nname = "U8"\nturns = [1, {turns}]'
    fast = study("held_torque", "duration = 120\nspeed = 90", f"voltage = {VOLTAGE}", motor, cooling='"none"')
    held = {design.option.motor.name: design for design in solve_study(fast).designs}
    for name, by in (("U8, 1 × turns", 1.0), (f"U8, {turns:g} × turns", turns)):
        assert held[name].value == pytest.approx(held_at(120.0, 90.0, VOLTAGE / by), rel=1e-4)
        assert ("voltage" in held[name].binding) == (by == 2.0)
    drive = study("held_torque", "duration = 5", "current = 20", motor, cooling='"none"')
    at_drive = {design.option.motor.name: design.value for design in solve_study(drive).designs}
    alone = study("held_torque", "duration = 5", f"current = {20 * turns}", cooling='"none"')
    assert at_drive[f"U8, {turns:g} × turns"] == pytest.approx(_one(alone).value, rel=1e-6)


def test_windings_above_the_motors_own_limit_are_said() -> None:
    for torque, said in ((1.0, 0), (2.5, 1)):
        asked = study("worst_temperature", f"torque = {torque}\nduration = 120", cooling='"none"')
        lines = [line for line in remarks(solve_study(asked)) if "allows a winding of 105 degC" in line]
        assert len(lines) == said


def test_walking_turns_the_ankle_as_its_angle_says() -> None:
    speeds = walking_speed(200)
    assert speeds.mean() == pytest.approx(0.0, abs=1e-9)  # it comes back to where it was
    assert 3.0 < speeds.max() < 6.0  # rad/s; push-off, some 230 degrees a second
    assert speeds[int(np.argmax(level_walking(200)))] > 0  # the ankle pushes where the moment is largest
    assert walking_speed(50, 2 * WALKING_PERIOD) == pytest.approx(walking_speed(50) / 2)
    # Behind the same gear the motor turns as many times as fast.
    limits, gear = "mass = 0.6\nvoltage = 40", '[[gears]]\nname = "one"\nratio = 50\n'
    geared = _one(study("worst_temperature", walking_task(gear=1.0), limits, more=gear, cooling='"none"'))
    stated = _one(study("worst_temperature", walking_task(gear=50.0), limits, cooling='"none"'))
    assert geared.value == pytest.approx(stated.value, rel=1e-9)


def test_prices_add_up_and_the_cheapest_is_the_lightest_of_one_metal() -> None:
    task, limits = "torque = 1.68\nduration = 120", "volume = 450e-6"
    prices = "[pipes]\nprice = 4\n[sink]\nprice = 10\n[materials.aluminium]\nprice = 6"
    motor = '[[motors]]\nname = "U8"\nprice = 180'
    cheap = _one(study("price", task, limits, motor, prices, cooling='"passive"'))
    light = _one(study("mass", task, limits, motor, prices, cooling='"passive"'))
    assert cheap.capacity == pytest.approx(light.capacity, rel=1e-4)
    assert cheap.price == pytest.approx(180 + 10 + 4 * 4 + 6 * (cheap.capacity or 0.0) / plain.HEAT, rel=1e-9)
    assert cheap.value == pytest.approx(cheap.price)


def test_a_metal_is_as_dense_and_conducts_as_it_is_said() -> None:
    sinks = {}
    for name in ("aluminium", "copper"):
        asked = study("held_torque", "duration = 120", HELD, more=f'[sink]\nmaterial = "{name}"', cooling='"passive"')
        sinks[name] = _one(asked)
    copper = sinks["copper"]
    assert copper.capacity is not None
    assert copper.resistance is not None
    assert copper.mass == pytest.approx(plain.MOTOR_MASS + plain.PIPES_MASS + copper.capacity / 385.0, rel=1e-9)
    # Fins of copper: the same film, less lost along them; their mass, and that of the slab, by its density.
    _, spacing = plain.still_air()
    film = 1.307 * 0.0267 / spacing
    ml = np.sqrt(2 * film / (390.0 * plain.THICKNESS)) * 0.03
    area = 1 / (film * np.tanh(ml) / ml * copper.resistance)
    fins = 8960.0 * area / 2 * plain.THICKNESS
    package = plain.MOTOR_VOLUME + area / 2 * (plain.THICKNESS + spacing) + (copper.capacity / 385.0 - fins) / 8960.0
    assert copper.volume == pytest.approx(package, rel=1e-6)
    assert copper.value < sinks["aluminium"].value  # heavier for what it stores and gives away
    there = plain.held_torque(np.array([copper.capacity]), np.array([copper.resistance]), 120.0, 105.0)
    assert copper.value == pytest.approx(there[0], abs=2e-5)


@pytest.mark.long
def test_prices_are_in_the_currency_that_the_study_names() -> None:
    prices = "[pipes]\nprice = 4\n[sink]\nprice = 10\n[materials.aluminium]\nprice = 6\n"
    prices += '[pareto]\nagainst = "price"\nleast = 206.2\nmost = 206.6\npoints = 2'
    motor = '[[motors]]\nname = "U8"\nprice = 180'

    def told(currency: str) -> str:
        asked = study("held_torque", "duration = 120", "price = 206.3", motor, prices, '"passive"', currency)
        result = solve_study(asked)
        drawn = [ax.get_xlabel() for ax in study_figure(result).axes]
        return "\n".join([headline(result), *map(" ".join, table(result)), *remarks(result), *drawn,
                          str(as_json(result)), trade_html(result)])  # fmt: skip

    named, usual = told("CHF"), told("")
    for words in ("price [CHF]", "'currency': 'CHF'", "limit.price 206.3 CHF", "fixed_price 206 CHF", "N*m per CHF"):
        assert words in named
    assert "EUR" not in named
    assert "price [EUR]" in usual


def test_fronts_over_price_ratio_and_voltage() -> None:
    gears = '[[gears]]\nname = "small"\nratio = 9\nprice = 20\n[[gears]]\nname = "large"\nratio = 30\nprice = 60\n'
    motor = '[[motors]]\nname = "U8"\nprice = 100'
    task, limits = "duration = 120\nspeed = 4", f"voltage = {VOLTAGE}\nprice = 200"

    def front(against: str, least: float, most: float) -> list[tuple[float, float]]:
        sweep = f'[pareto]\nagainst = "{against}"\nleast = {least}\nmost = {most}\npoints = 5\n'
        result = solve_study(study("held_torque", task, limits, motor, gears + sweep, cooling='"none"'))
        return [(point.amount, point.value) for point in result.front]

    assert [amount for amount, _ in front("price", 110, 200)] == [120, 160]
    volts = front("voltage", 5, 40)
    assert [value for _, value in volts] == sorted(value for _, value in volts)
    ratios = dict(front("ratio", 14, 54))
    assert list(ratios) == [14, 24, 34, 44, 54]
    assert ratios[34] < ratios[44] > ratios[54]  # beyond, the motor turns so fast that the voltage leaves little torque


@pytest.mark.parametrize(
    ("more", "limits", "said"),
    [
        ("", "price = 300", ("motors", "U8", "price")),
        ('[[gears]]\nname = "g"\nratio = 5\n', "price = 300", ("motors", "price")),
        ('[sink]\nmaterial = "gold"', "", ("sink.material", "gold", "aluminium", "[materials.gold]")),
        ("[materials.gold]\ndensity = 19300", "", ("materials.gold", "specific_heat")),
        ('[[gears]]\nname = "g"\nratio = [9, 3]\n', "", ("gears[0].ratio: found [9, 3]", "expected [least, most]")),
        ('[[gears]]\nname = "g"\nratio = -5\n', "", ("gears[0].ratio", "found -5", "greater than 0")),
        ('[[gears]]\nname = "g"\nratio = [0, 3]\n', "", ("gears[0].ratio[0]: found 0", "greater than 0")),
        ('[[gears]]\nname = "g"\nratio = "high"\n', "", ("gears[0].ratio", "a number, or [least, most]")),
        ('[[gears]]\nname = "g"\nratio = 9\nefficiency = 1.2\n', "", ("gears[0].efficiency", "1.2")),
        ('[[gears]]\nname = "g"\nratio = 9\n[[gears]]\nname = "g"\nratio = 8\n', "", ("gears[1].name", "second time")),
        ('[pareto]\nagainst = "ratio"\nleast = 3\nmost = 9\n', "", ("pareto.against", "[[gears]]")),
        ('[pareto]\nagainst = "voltage"\nleast = 3\nmost = 9\n', "", ("pareto.against", "voltage")),
    ],
)
def test_what_cannot_be_is_refused(more: str, limits: str, said: tuple[str, ...]) -> None:
    with pytest.raises(InputError) as refused:
        solve_study(study("held_torque", "duration = 120", limits, more=more, cooling='"passive"'))
    for word in said:
        assert word in str(refused.value)


def test_a_jump_without_speeds_has_no_voltage() -> None:
    with pytest.raises(InputError, match=r"limits.voltage.*speeds"):
        study("worst_temperature", jump_task(), "voltage = 20", cooling='"none"')
