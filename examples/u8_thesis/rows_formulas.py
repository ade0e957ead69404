"""Rows on motors, textbook formulas and package sizes ([Chen2017, chapter 2; sec. 3.2.1; chapter 5; appendix A])."""

from __future__ import annotations

import csv
from pathlib import Path

from circuits import Circuit
from row import Row
from textbook import (
    U8_RATED_TORQUE,
    U8_RESISTANCE,
    U10_RESISTANCE,
    biot_number,
    box_volume,
    conduction_resistance,
    convection_resistance,
    copper_loss,
    cylinder_surface,
    peak_specific_torque,
    rated_current,
    thermal_specific_torque,
    torque_constant,
    winding_resistance,
    wire_capacity,
    wire_length,
    wire_surface,
)

from lptn.planners.trade.motors import U8, U10

INCH = 0.0254
K_T, K_T_ROUNDED = U8.torque_constant, 0.1
STALL = U8.limits.given["current"]
PACKAGE = 7.0 * 3.5 * 2.5 * INCH**3  # m³
SYSTEM_MASS = 0.867  # kg
LAMINATIONS = 28.0  # W/(m K), steel along the sheets


def propellers() -> list[dict[str, float]]:
    """The propeller table of appendix A.1, numbers only."""
    with (Path(__file__).parent / "propellers.csv").open(encoding="utf-8") as stream:
        return [{key: float(text) for key, text in row.items() if key != "propeller"} for row in csv.DictReader(stream)]


def _worst_propeller() -> tuple[float, float]:
    rows = propellers()
    watts = max(abs(row["volts"] * row["amps"] - row["watts"]) for row in rows)
    return watts, max(abs(row["thrust_g"] / row["watts"] - row["efficiency_g_per_w"]) for row in rows)


def _disorder() -> float:
    """How many pairs of propellers at full throttle are warmer with less power."""
    full = [(row["watts"], row["surface_degC"]) for row in propellers() if row["throttle_percent"] == 100]
    return float(sum(a[0] < b[0] and a[1] > b[1] for a in full for b in full))


def rows(unaltered: Circuit) -> list[Row]:
    """All rows of this kind; the unaltered motor's network gives its thermal resistance."""
    return [*_torque(unaltered), *_materials(), *_appendix(), *_packages()]


def _torque(unaltered: Circuit) -> list[Row]:
    r_th = unaltered.steady(1e-6) - 21.5
    r_th /= copper_loss(1e-6, U8_RESISTANCE)
    m8, m10 = U8.mass, U10.mass
    rated = rated_current(U8_RATED_TORQUE, K_T)
    sat = "with 35 A; i_sat is not given, and 35 A is the U10's continuous rating"
    return [
        Row(
            "eq. 2.1", "torque constant from 100 rpm/V", "N·m/A", 0.1, K_T, tolerance=0.005, note="rounded in the text"
        ),
        Row(
            "eq. 2.2", "peak torque per mass, U8", "N·m/kg", None, None, peak_specific_torque(K_T, STALL, m8), note=sat
        ),
        Row(
            "eq. 2.2 b",
            "peak torque per mass, U10",
            "N·m/kg",
            None,
            None,
            peak_specific_torque(K_T, STALL, m10),
            note=sat,
        ),
        Row(
            "eq. 2.3",
            "continuous torque per mass and √K, U8",
            "N·m/(kg √K)",
            None,
            None,
            thermal_specific_torque(K_T, m8, r_th, U8_RESISTANCE),
            note=f"R_th is not given; the network's is {r_th:.3f} K/W",
        ),
        Row("eq. 2.4", "copper loss at 11 A", "W", 22.506, copper_loss(11.0, U8_RESISTANCE), tolerance=5e-4),
        Row(
            "eq. 2.5",
            "temperature coefficient: text against a/b of table 3.1",
            "1/K",
            0.004,
            0.0878 / 22.506,
            0.0039,
            5e-5,
            "the text's 0.004 gives a = 0.0900 W/K, not 0.0878",
        ),
        Row("eq. 2.5 b", "resistance at 105 degC over that at 25", "1", None, winding_resistance(1.0, 105.0)),
        Row("eq. 2.6", "torque constant at 105 degC over that at 25", "1", None, torque_constant(1.0, 105.0)),
        Row("sec. 4.3", "11 A over the rated current", "%", 104.0, 100 * 11 / rated, tolerance=0.5),
        Row("sec. 4.3 b", "15 A over the rated current", "%", 142.0, 100 * 15 / rated, tolerance=0.5),
        Row(
            "sec. 4.3 c",
            "35 A over the rated current",
            "%",
            330.0,
            100 * 35 / rated,
            tolerance=0.005 * 330.0,
            note="printed to the ten; half a per cent; stall torque over rated torque is 317 %",
        ),
        Row("sec. 3.1.1", "housing's signal over the thermocouple's tolerance", "1", None, (26.5 - 21.5) / 5.0),
        Row("sec. 2.1.3", "jump: torque over that of earlier prostheses", "1", 3.0, None, note="stated, not derived"),
    ]


def _materials() -> list[Row]:
    length = wire_length(U8_RESISTANCE, 1e-3)
    area = wire_surface(length, 1e-3)
    # Neither h nor V nor k is given. Laminations conduct 28 W/(m K), a stator of this motor fills 20 to 40 cm³, and no
    # value of h is taken: what the printed number says of h is told instead.
    needed = [0.003 / biot_number(1.0, volume, area, LAMINATIONS) for volume in (40e-6, 20e-6)]
    return [
        Row(
            "eq. 2.7",
            "film resistance, 10 W/(m² K) on the motor's cylinder",
            "K/W",
            None,
            convection_resistance(10.0, cylinder_surface(U8.diameter, U8.length)),
            note="h is not given; 10 W/(m² K) is a textbook's free convection",
        ),
        Row(
            "eq. 2.8",
            "Biot number of the stator",
            "1",
            0.003,
            None,
            note=f"h, V, k not given; 20 to 40 cm³ of laminations need {needed[0]:.0f} to {needed[1]:.0f} W/(m² K)",
        ),
        Row(
            "eq. 2.8 b",
            "h up to which a stator of 30 cm³ is one mass (Biot number 0.1)",
            "W/(m² K)",
            None,
            0.1 / biot_number(1.0, 30e-6, area, LAMINATIONS),
        ),
        Row(
            "eq. 2.9",
            "wall resistance, 1 mm of laminations",
            "K/W",
            None,
            conduction_resistance(1e-3, LAMINATIONS, area),
        ),
        Row("sec. 3.2.1", "length of the wire", "m", 8.7, length, tolerance=0.05),
        Row("sec. 3.2.1 b", "surface of the wire", "cm²", 273.18, 1e4 * area, tolerance=0.01),
        Row(
            "table 3.1 c",
            'capacity of the winding, "from copper volume"',
            "J/K",
            133.3,
            wire_capacity(length, 1e-3),
            wire_capacity(length, 1e-3) * 1.5,
            0.5,
            "the wire is 61 g; 133.3 J/K is 346 g of copper in a 240 g motor; network column: three phases",
        ),
        Row("sec. 2.5", "Browne: 5 A in 0.21 ohm", "W", 5.25, copper_loss(5.0, 0.21), tolerance=5e-3),
    ]


def _appendix() -> list[Row]:
    table = propellers()
    watts, efficiency = _worst_propeller()
    hot = copper_loss(STALL, winding_resistance(U8_RESISTANCE, 105.0))
    return [
        Row(
            "table A.1",
            "stall torque from 35 A",
            "N·m",
            3.2,
            K_T * STALL,
            tolerance=0.05,
            note="data sheet: 0.0914 N·m/A, the constant of magnets at 61 degC; 35 A is not V/R (119 A)",
        ),
        Row(
            "table A.1 b",
            "no-load speed on 22.2 V",
            "rpm",
            2200.0,
            22.2 * 100,
            tolerance=50.0,
            note="printed to the hundred",
        ),
        Row("table A.1 p", "propeller table: rows", "1", 33.0, float(len(table)), tolerance=0.0),
        Row("table A.1 q", "propeller table: largest |V A - W|", "W", 0.0, watts, tolerance=0.01),
        Row("table A.1 r", "propeller table: largest |thrust/W - efficiency|", "g/W", 0.0, efficiency, tolerance=0.01),
        Row(
            "table A.1 s",
            "propellers at full throttle: order of surface temperature by electric power, disorder",
            "1",
            0.0,
            _disorder(),
            tolerance=0.0,
            note="38 to 45 degC after 10 min; 131 to 360 W; two propellers have no row of 100 %",
        ),
        Row("appendix A.2", "U10: loss at 35 A over the U8's", "1", None, U10_RESISTANCE / U8_RESISTANCE),
        Row("appendix A.3", "torque sensor: 2000 in-lb", "N·m", 225.0, 2000 * 0.112984829, tolerance=0.5),
        Row(
            "appendix A.3 b",
            "torque sensor: compensated up to 160 degF",
            "degC",
            72.0,
            (160.0 - 32) / 1.8,
            tolerance=0.5,
            note="15.6 to 71.1 degC, rounded outwards to 15 and 72",
        ),
        Row(
            "appendix A.4",
            "four heat pipes of 65 W",
            "W",
            None,
            4 * 65.0,
            note=f"35 A makes {hot:.0f} W at 105 degC: more than the pipes carry",
        ),
    ]


def _packages() -> list[Row]:
    increase = 100 * (SYSTEM_MASS / U8.mass - 1)
    box8 = box_volume(U8.diameter, U8.length)
    box10 = box_volume(U10.diameter, U10.length)
    return [
        Row(
            "chapter 5 c",
            "mass of motor and exchanger: increase",
            "%",
            360.0,
            increase,
            tolerance=2.0,
            note="867/240 = 3.61 is the ratio; the increase is 261 %",
        ),
        Row("chapter 5 d", "package of motor and exchanger", "cm³", None, 1e6 * PACKAGE),
        Row(
            "chapter 5 e",
            "package: increase over the motor",
            "%",
            475.0,
            100 * (PACKAGE / box8 - 1),
            tolerance=2.5,
            note="the motor's size is not in the thesis; box around 87.1 × 26.65 mm; the ratio is 4.96",
        ),
        Row(
            "chapter 5 f",
            "U10 over U8: mass",
            "%",
            167.0,
            100 * U10.mass / U8.mass,
            tolerance=1.0,
            note="a ratio, not an increase",
        ),
        Row(
            "chapter 5 g",
            "U10 over U8: volume",
            "%",
            130.0,
            100 * box10 / box8,
            tolerance=4.0,
            note="a ratio, not an increase",
        ),
        Row("chapter 5 h", "U10 over U8: torque per root of loss", "1", None, (U8_RESISTANCE / U10_RESISTANCE) ** 0.5),
        Row(
            "chapter 5 i", "the same per mass", "1", None, (U8_RESISTANCE / U10_RESISTANCE) ** 0.5 * U8.mass / U10.mass
        ),
    ]
