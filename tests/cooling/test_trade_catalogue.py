"""Catalogues of motors in CSV and TOML; networks from data sheets."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lptn.basics.errors import InputError
from lptn.planners.trade import TradeStudy, load_study, solve_study

CSV = """\
# motors that nobody makes
name, mass [g], diameter [mm], length [mm], speed_constant [rpm/V], limits.winding [degC], limits.current [A], price, \
data_sheet.resistance [mohm], data_sheet.winding_to_housing [K/W], data_sheet.housing_to_ambient [K/W], \
data_sheet.winding_time [s], data_sheet.motor_time [min], rotor_inertia [g*cm^2]
flat-50, 110, 50, 20, 250, 125, 12, 80, 300, 3.0, 6.0, 15, 9, 130
flat-90, 600, 90, 30, 120, 125, 25, 210, 140, 1.2, 2.0, 40, 20, 3000
long-40, 300, 40, 80, 200, , 18, , 250, 1.5, 3.5, 20, 12, 100
"""
STUDY = """\
[study]
goal = "held_torque"
cooling = ["none"]
catalogue = "motors.csv"
[task]
duration = 120
[limits]
winding = 110
[[motors]]
name = "flat-*"
"""


def _study(folder: Path, text: str = STUDY, catalogue: str = CSV) -> TradeStudy:
    (folder / "motors.csv").write_text(catalogue)
    (folder / "study.toml").write_text(text)
    return load_study(folder / "study.toml")


def test_a_row_of_a_data_sheet_is_a_motor(tmp_path: Path) -> None:
    asked = _study(tmp_path)
    assert [motor.name for motor in asked.motors] == ["flat-50", "flat-90"]
    motor = asked.motors[0]
    assert motor.mass == pytest.approx(0.11)
    assert motor.volume == pytest.approx(math.pi * 0.05**2 / 4 * 0.02)
    assert motor.torque_constant == pytest.approx(60 / (2 * math.pi * 250))
    assert motor.rotor_inertia == pytest.approx(130e-7)
    assert motor.price == 80
    assert motor.limits.given == {"winding": 125.0, "current": 12.0}
    best = solve_study(asked).designs
    held = {design.option.motor.name: design for design in best}["flat-50"]

    def rates(_: float, x: np.ndarray) -> list[float]:
        current = held.value / (motor.torque_constant * (1 - 0.0012 * (x[1] - 25.0)))
        loss = current**2 * 0.3 * (1 + 0.0039 * (x[0] - 25.0))
        inner = (x[0] - x[1]) / 3.0
        return [(loss - inner) / (15 / 3.0), (inner - (x[1] - 25.0) / 6.0) / (540 / 6.0)]

    course = solve_ivp(rates, (0.0, 120.0), [25.0, 25.0], rtol=1e-9, atol=1e-9)
    assert course.y[0, -1] == pytest.approx(110.0, abs=2e-3)


def test_the_same_catalogue_in_toml(tmp_path: Path) -> None:
    text = """
[[motors]]
name = "flat-50"
mass = { value = 110, unit = "g" }
diameter = 0.05
length = 0.02
speed_constant = { value = 250, unit = "rpm/V" }
limits = { winding = 125, current = 12 }
price = 80
rotor_inertia = { value = 130, unit = "g*cm^2" }
source = "nobody"
[motors.data_sheet]
resistance = 0.3
winding_to_housing = 3
housing_to_ambient = 6
winding_time = 15
motor_time = 540
"""
    (tmp_path / "motors.toml").write_text(text)
    other = _study(tmp_path, STUDY.replace("motors.csv", "motors.toml")).motors
    first = _study(tmp_path).motors[0]
    assert len(other) == 1
    assert other[0].network.parameters == first.network.parameters
    assert (other[0].volume, other[0].limits, other[0].price) == (first.volume, first.limits, first.price)


def test_what_a_study_says_comes_before_the_catalogue(tmp_path: Path) -> None:
    said = STUDY.replace(
        'name = "flat-*"', 'name = "flat-50"\ntorque_constant = 0.05\nprice = 60\nlimits = { current = 9 }'
    )
    motor = _study(tmp_path, said).motors[0]
    assert motor.torque_constant == 0.05
    assert motor.price == 60
    assert motor.limits.given == {"winding": 125.0, "current": 9.0}
    everything = _study(tmp_path, STUDY.replace('"flat-*"', '"*"')).motors
    assert [motor.name for motor in everything] == ["U8", "U10", "flat-50", "flat-90", "long-40"]
    own = STUDY.replace('"flat-*"', '"U8"\nmodel = "u8-heat-sink"')
    assert "sink" in _study(tmp_path, own).motors[0].network.dynamic


def test_a_study_may_name_no_catalogue(tmp_path: Path) -> None:
    own = STUDY.replace('"motors.csv"', "[]").replace('"flat-*"', '"*"')
    assert [motor.name for motor in _study(tmp_path, own).motors] == ["U8", "U10"]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("110, 50, 20", "110, fifty, 20", ("motors.csv", "line 3", "diameter", "fifty", "number")),
        ("110, 50, 20", "-110, 50, 20", ("line 3", "mass", "-0.11")),
        ("mass [g]", "mass [s]", ("line 3", "mass", "kg")),
        ("mass [g]", "weight [g]", ("line 3", "weight")),
        ("flat-90", "flat-50", ("line 4", "flat-50", "second time")),
        ("3000\n", "3000, 4\n", ("line 4", "cells")),
        (", 15, 9, 130", ", , 9, 130", ("line 3", "data_sheet", "winding_time")),
        ("flat-50, 110,", "flat-50, ,", ("study.toml", "flat-50", "without mass")),
    ],
)
def test_mistakes_of_a_catalogue_are_said_with_their_line(
    old: str, new: str, said: tuple[str, ...], tmp_path: Path
) -> None:
    assert old in CSV
    with pytest.raises(InputError) as refused:
        _study(tmp_path, catalogue=CSV.replace(old, new, 1))
    for word in said:
        assert word in str(refused.value)


def test_an_absent_catalogue_and_an_empty_one_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="other"):
        _study(tmp_path, STUDY.replace("motors.csv", "other.csv"))
    with pytest.raises(InputError, match="no row"):
        _study(tmp_path, catalogue="name, mass [g]\n")
    with pytest.raises(InputError, match="long-90"):
        _study(tmp_path, STUDY.replace("flat-*", "long-90"))


def test_the_example_of_a_whole_joint_can_be_read() -> None:
    asked = load_study(Path(__file__).parents[2] / "examples" / "u8_trade" / "joint.toml")
    assert [motor.name for motor in asked.motors] == ["U8", "U10", "flat-60", "flat-90"]
    assert len(asked.options()) == 4 * 2 * (1 + 2)
    assert asked.gears[1].is_sought
