"""Rows on heating and cooling (source S1, chapters 3 and 4): times, temperatures, time constants."""

from __future__ import annotations

import as_printed as printed
from as_printed import FAN, PASSIVE, UNALTERED
from circuits import AMBIENT, Circuit
from facts import of_unaltered
from row import Row
from rows_pulses import CIRCUITS, at_35_a, intermittent, needed_r_0, time_at


def rows(unaltered: Circuit, without_sink: Circuit, passive: Circuit, fan: Circuit) -> list[Row]:
    """All rows of this kind; `without_sink` is the motor of the networks with a sink."""
    networks = {"passive": passive, "fan": fan}
    return [
        *_circuit(),
        *_unaltered(unaltered),
        *_steady(without_sink, networks),
        *_at_15_a(unaltered, networks),
        *at_35_a(unaltered, networks),
        *intermittent(unaltered),
    ]


def _circuit() -> list[Row]:
    a, b = printed.slope_and_offset(11.0)
    jump = printed.initial_jump(UNALTERED, 11.0)
    end = printed.heating_from_circuit(UNALTERED, 11.0, 1e6)
    gain = "the stated circuit has negative resistance: 1 - a R_h < 0"
    return [
        Row("S1-E3.1", "heat over a difference of 10 K at 1.2 K/W", "W", None, 10 / UNALTERED.r_w),
        Row("S1-E3.2", "a at 11 A", "W/K", 0.0878, a, tolerance=5e-5, note="printed in W"),
        Row("S1-E3.2b", "b at 11 A", "W", 22.506, b, tolerance=5e-4),
        Row("S1-T3.1", "R_w C, unaltered", "s", 160.0, UNALTERED.r_w * UNALTERED.c, tolerance=0.5),
        Row("S1-T4.1", "R_w C, passive", "s", 288.0, PASSIVE.r_w * PASSIVE.c, tolerance=0.5),
        Row(
            "S1-T4.2",
            "R_w C, fan",
            "s",
            300.0,
            FAN.r_w * FAN.c,
            tolerance=0.5,
            note="a fan lowers a resistance, it adds no capacity",
        ),
        Row("S1-T3.1b", "1 - a R_h, unaltered", "1", None, 1 - printed.loop_gain(11.0, UNALTERED.r_h), note=gain),
        Row("S1-T4.1b", "1 - a R_h, passive", "1", None, 1 - printed.loop_gain(11.0, PASSIVE.r_h), note=gain),
        Row(
            "S1-E3.3c",
            "the circuit's own jump at t = 0, unaltered",
            "K",
            0.0,
            jump,
            tolerance=0.5,
            note="left out of equation 3.3",
        ),
        Row(
            "S1-E3.3d",
            "the circuit's own steady state, unaltered",
            "degC",
            None,
            end,
            note="the fit lives only in the misprinted formula",
        ),
        Row("S1-E4.1", "R_0/I² at 11 A", "K/W", 11.96, printed.housing_resistance(11.0), tolerance=5e-3),
        Row(
            "S1-E4.1b",
            "a R_h at 35 A",
            "1",
            None,
            printed.loop_gain(35.0, printed.housing_resistance(35.0)),
            note="α R R_0: the same at every current",
        ),
        Row(
            "S1-E3.4",
            "cooling at t = 0 from 55 degC",
            "degC",
            55.0,
            printed.cooling_as_printed(55.0, 0.0, 0.0, 160.0),
            55.0,
            0.5,
            "the ambient is missing",
        ),
        Row(
            "S1-E3.4b",
            "cooling in the end",
            "degC",
            AMBIENT,
            printed.cooling_as_printed(55.0, 1e4, 0.0, 160.0),
            AMBIENT,
            0.5,
            "the ambient is missing",
        ),
    ]


def _unaltered(motor: Circuit) -> list[Row]:
    _, housing, delay, cooling = of_unaltered(motor)
    one_node = "one node has no housing"
    return [
        Row(
            "S1-N1",
            "11 A to 55 degC, unaltered",
            "s",
            120.0,
            printed.heating_time(UNALTERED, 11.0, 55.0),
            motor.time_to(55.0, 11.0),
            3.0,
        ),
        Row("S1-N2", "housing's maximum", "degC", 26.5, None, housing, note=one_node),
        Row("S1-N2b", "housing's maximum after the winding's", "s", 100.0, None, delay, note=one_node),
        Row(
            "S1-N2c",
            "cooling time constant",
            "s",
            160.0,
            UNALTERED.r_w * UNALTERED.c,
            cooling,
            0.5,
            "a fact that R_w was taken from",
        ),
        Row(
            "S1-N2d",
            "heating time constant, unaltered",
            "s",
            160.0,
            printed.time_constant(UNALTERED, 11.0),
            None,
            16.0,
            '"same … time constants for both heating and cooling"',
        ),
    ]


def _steady(motor: Circuit, networks: dict[str, Circuit]) -> list[Row]:
    ends = {c.name: AMBIENT + printed.printed_amplitude(c, 11.0) for c in (UNALTERED, PASSIVE, FAN)}
    slow = {c.name: printed.time_constant(c, 11.0) for c in (UNALTERED, PASSIVE, FAN)}
    real = {name: network.steady(11.0) for name, network in networks.items()}
    longer = {name: 100 * (slow[name] / slow["unaltered"] - 1) for name in CIRCUITS}
    return [
        Row(
            "S1-N5",
            "steady state at 11 A lower by, passive",
            "K",
            25.0,
            ends["unaltered"] - ends["passive"],
            motor.steady(11.0) - real["passive"],
            3.0,
        ),
        Row(
            "S1-N5b",
            "steady state at 11 A, fan",
            "degC",
            60.0,
            ends["fan"],
            real["fan"],
            3.0,
            '"below 60"; the formula\'s unaltered motor would hold 60.4',
        ),
        Row("S1-N5c", "time constant longer by, passive", "s", 20.0, slow["passive"] - slow["unaltered"], None, 3.0),
        Row(
            "S1-N6", "time constant longer by, passive", "%", 100.0, longer["passive"], None, 5.0, 'contradicts "+20 s"'
        ),
        Row(
            "S1-N6b",
            "time constant longer by, fan",
            "%",
            360.0,
            longer["fan"],
            None,
            5.0,
            "not by R_w C either (+88 %)",
        ),
    ]


def _at_15_a(motor: Circuit, networks: dict[str, Circuit]) -> list[Row]:
    found = []
    for letter, name, stated in (("", "passive", 50.0), ("b", "fan", 56.0)):
        time = time_at(CIRCUITS[name], 15.0, 55.0)
        note = f"the unaltered motor's network: {motor.time_to(55.0, 15.0):.1f} s, so a benefit is not shown"
        found.append(
            Row(
                f"S1-N4{letter}",
                f"15 A to 55 degC, {name}",
                "s",
                stated,
                time(printed.R_0),
                networks[name].time_to(55.0, 15.0),
                2.0,
                note,
                needed_r_0(stated, time),
            )
        )
    return found
