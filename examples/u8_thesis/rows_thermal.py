"""Rows on heating and cooling ([Chen2017, chapter 3, 4]): times, temperatures, time constants."""

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
        *_at_15_a(without_sink, networks),
        *at_35_a(without_sink, networks),
        *intermittent(unaltered),
    ]


def _circuit() -> list[Row]:
    a, b = printed.slope_and_offset(11.0)
    jump = printed.initial_jump(UNALTERED, 11.0)
    end = printed.heating_from_circuit(UNALTERED, 11.0, 1e6)
    gain = "the stated circuit has negative resistance: 1 - a R_h < 0"
    return [
        Row("eq. 3.1", "heat over a difference of 10 K at 1.2 K/W", "W", None, 10 / UNALTERED.r_w),
        Row("eq. 3.2", "a at 11 A", "W/K", 0.0878, a, tolerance=5e-5, note="printed in W"),
        Row("eq. 3.2 b", "b at 11 A", "W", 22.506, b, tolerance=5e-4),
        Row("table 3.1", "R_w C, unaltered", "s", 160.0, UNALTERED.r_w * UNALTERED.c, tolerance=0.5),
        Row("table 4.1", "R_w C, passive", "s", 288.0, PASSIVE.r_w * PASSIVE.c, tolerance=0.5),
        Row(
            "table 4.2",
            "R_w C, fan",
            "s",
            300.0,
            FAN.r_w * FAN.c,
            tolerance=0.5,
            note="a fan lowers a resistance, it adds no capacity",
        ),
        Row("table 3.1 b", "1 - a R_h, unaltered", "1", None, 1 - printed.loop_gain(11.0, UNALTERED.r_h), note=gain),
        Row("table 4.1 b", "1 - a R_h, passive", "1", None, 1 - printed.loop_gain(11.0, PASSIVE.r_h), note=gain),
        Row(
            "eq. 3.3 c",
            "the circuit's own jump at t = 0, unaltered",
            "K",
            0.0,
            jump,
            tolerance=0.5,
            note="left out of equation 3.3",
        ),
        Row(
            "eq. 3.3 d",
            "the circuit's own steady state, unaltered",
            "degC",
            None,
            end,
            note="the fit lives only in the misprinted formula",
        ),
        Row("eq. 4.1", "R_0/I² at 11 A", "K/W", 11.96, printed.housing_resistance(11.0), tolerance=5e-3),
        Row(
            "eq. 4.1 b",
            "a R_h at 35 A",
            "1",
            None,
            printed.loop_gain(35.0, printed.housing_resistance(35.0)),
            note="α R R_0: the same at every current",
        ),
        Row(
            "eq. 3.4",
            "cooling at t = 0 from 55 degC",
            "degC",
            55.0,
            printed.cooling_as_printed(55.0, 0.0, 0.0, 160.0),
            55.0,
            0.5,
            "the ambient is missing",
        ),
        Row(
            "eq. 3.4 b",
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
            "sec. 3.1.2",
            "11 A to 55 degC, unaltered",
            "s",
            120.0,
            printed.heating_time(UNALTERED, 11.0, 55.0),
            motor.time_to(55.0, 11.0),
            3.0,
        ),
        Row("sec. 3.1.2 b", "housing's maximum", "degC", 26.5, None, housing, note=one_node),
        Row("sec. 3.1.2 c", "housing's maximum after the winding's", "s", 100.0, None, delay, note=one_node),
        Row(
            "sec. 3.1.2 d",
            "cooling time constant",
            "s",
            160.0,
            UNALTERED.r_w * UNALTERED.c,
            cooling,
            0.5,
            "a fact that R_w was taken from",
        ),
        Row(
            "sec. 3.1.2 e",
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
            "sec. 4.3 f",
            "steady state at 11 A lower by, passive",
            "K",
            25.0,
            ends["unaltered"] - ends["passive"],
            motor.steady(11.0) - real["passive"],
            3.0,
        ),
        Row(
            "sec. 4.3 g",
            "steady state at 11 A, fan",
            "degC",
            60.0,
            ends["fan"],
            real["fan"],
            note='"remains below 60"; the formula\'s unaltered motor would hold 60.4',
            most=True,
        ),
        Row(
            "sec. 4.3 h", "time constant longer by, passive", "s", 20.0, slow["passive"] - slow["unaltered"], None, 3.0
        ),
        Row(
            "chapter 5",
            "time constant longer by, passive",
            "%",
            100.0,
            longer["passive"],
            None,
            5.0,
            'contradicts "+20 s"',
        ),
        Row(
            "chapter 5 b",
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
    section = []
    for letter, name, stated in (("d", "passive", 50.0), ("e", "fan", 56.0)):
        time = time_at(CIRCUITS[name], 15.0, 55.0)
        note = f"the same network without exchanger: {motor.time_to(55.0, 15.0):.1f} s; no such run is reported"
        section.append(
            Row(
                f"sec. 4.3 {letter}",
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
    return section
