"""Rows on the 35 A pulse and on pulses in a row ([Chen2017, sec. 4.3]), and how they hang on R_0."""

from __future__ import annotations

import math
from collections.abc import Callable

import as_printed as printed
import numpy as np
from as_printed import FAN, PASSIVE
from circuits import AMBIENT, Circuit
from row import Row
from scipy.optimize import brentq

_LOWEST, _HIGHEST = 1447.0, 1453.0  # R_0 [K A²/W]: what 0.4 % of it can do
RESOLUTION = 0.25  # K, of the MAX31855 that read the thermocouples [Chen2017, sec. 3.1.1]; its data sheet
CIRCUITS = {"passive": PASSIVE, "fan": FAN}


def needed_r_0(wanted: float, value: Callable[[float], float]) -> float | None:
    """The R_0 of equation 4.1 at which a printed number comes out, `None` outside 1447 to 1453."""
    ends = value(_LOWEST) - wanted, value(_HIGHEST) - wanted
    if not np.isfinite(ends).all() or ends[0] * ends[1] > 0:
        return None
    return float(brentq(lambda r_0: value(r_0) - wanted, _LOWEST, _HIGHEST))


def time_at(circuit: printed.Circuit, current: float, level: float) -> Callable[[float], float]:
    return lambda r_0: printed.heating_time(circuit, current, level, printed.housing_resistance(current, r_0))


def _temperature_at(circuit: printed.Circuit, current: float, time: float) -> Callable[[float], float]:
    return lambda r_0: printed.heating(circuit, current, time, printed.housing_resistance(current, r_0))


def at_35_a(motor: Circuit, networks: dict[str, Circuit]) -> list[Row]:
    rows = []
    pulse = np.array([1.0])
    for letter, name, stated in (("i", "passive", 47.0), ("j", "fan", 45.5)):
        value = _temperature_at(CIRCUITS[name], 35.0, 1.0)
        rise = networks[name].rise(35.0, pulse)[0, 0]
        rows.append(
            Row(
                f"sec. 4.3 {letter}",
                f"35 A for 1 s, {name}",
                "degC",
                stated,
                value(printed.R_0),
                AMBIENT + rise,
                0.05 if stated % 1 else 0.5,
                "energy allows 9.9 K at most",
                needed_r_0(stated, value),
            )
        )
    for letter, name in (("k", "passive"), ("l", "fan")):
        time = time_at(CIRCUITS[name], 35.0, 105.0)
        rows.append(
            Row(
                f"sec. 4.3 {letter}",
                f"35 A to 105 degC, {name}",
                "s",
                4.0,
                time(printed.R_0),
                networks[name].time_to(105.0, 35.0),
                0.5,
                "",
                needed_r_0(4.0, time),
            )
        )
    for capacity in (300.0, 400.0):
        circuit = printed.Circuit("", 1.2, capacity, 0.0)
        hot = _temperature_at(circuit, 35.0, 1.0)(printed.R_0)
        rows.append(
            Row(
                f"fig. 4-10, C = {capacity:.0f} J/K",
                f"35 A for 1 s, C = {capacity:.0f} J/K",
                "degC",
                None,
                hot,
                AMBIENT + motor.rise(35.0, pulse)[0, 0],
                note="no sink reaches the winding within 1 s",
            )
        )
    return rows


def intermittent(motor: Circuit) -> list[Row]:
    """A pulse and what is left of it after 25 minutes; pulses in a row."""
    pause = 25 * 60.0
    after = motor.rise(35.0, np.array([1.0]))[:, 0]
    left = float(motor.rise(0.0, np.array([pause]), after)[0, 0])
    by_formula = (47.0 - AMBIENT) * math.exp(-pause / (PASSIVE.r_w * PASSIVE.c))
    rows = [
        Row(
            "sec. 4.3 m",
            "left 25 min after 35 A for 1 s, passive",
            "K",
            0.0,
            by_formula,
            left,
            RESOLUTION,
            '"25 minutes to fully return to ambient": below what the thermocouples\' amplifier resolves',
        )
    ]
    for every in (20.0, 10.0, 5.0):
        effective = 35.0 / np.sqrt(every)
        rows.append(
            Row(
                f"sec. 4.3, every {every:.0f} s",
                f"35 A for 1 s every {every:.0f} s: steady state",
                "degC",
                None,
                None,
                motor.steady(float(effective)),
                note=f"RMS current {effective:.1f} A",
            )
        )
    return rows
