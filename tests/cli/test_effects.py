"""`lptn effects`: what a person reads of an effect, and what other programs get."""

from __future__ import annotations

import pytest

from lptn.cli.catalogue import catalogue_json, columns_text, show_effects
from lptn.effects import catalogue


def test_an_effect_is_shown_with_equation_option_columns_and_references(capsys: pytest.CaptureFixture[str]) -> None:
    show_effects("copper_loss")
    shown = " ".join(capsys.readouterr().out.split())
    for text in (
        "Q = f R_d I²",
        "I = τ / k_τ where only the joint torque is logged",
        'Option: input = "torque" | "current"',
        'Option: resistance_of = "phase" | "line_to_line" | "delta"',
        "Log columns: `torque.<place>` or `current.<place>`.",
        "Chen (2017), eq. 2.4",
        "A. E. Chen (2017). Effectiveness of Active Cooling on Torque Performance for Prosthetic Applications.",
        "eq. 2.4: winding loss I²R_m.",
    ):
        assert text in shown


def test_columns_are_those_that_a_log_has() -> None:
    effects = catalogue()
    assert columns_text(effects["gear_loss"]) == "`torque.<place>` and `velocity.<place>`"
    assert columns_text(effects["forced_convection"]) == "`speed.base`"
    assert columns_text(effects["loss_scale"]).endswith("it acts on `copper_loss` at the same place")


def test_other_programs_get_equations_options_and_references() -> None:
    entry = catalogue_json("fan")["fan"]
    assert isinstance(entry, dict)
    assert entry["equations"] == ["1/R′ = (1 + γ s)/R"]
    assert entry["options"] == {"input": ["fan", "fan_speed"]}
    assert entry["source"] == "Chen (2017), table 4.2"
    assert len(entry["references"]) == 2
