"""How long each torque can be held at each speed, against plain code; the command's figure and page."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

from lptn.cli.main import main
from lptn.planners.trade import parse_study, solve_study, torque_speed
from tests.cooling.studies import study
from tests.cooling.test_trade_gears import held_at

VOLTAGE = 22.2  # V


@pytest.mark.long
def test_points_of_the_diagram_are_those_of_plain_code() -> None:
    task = "duration = 120\nlongest = 1800"
    (design,) = solve_study(study("held_torque", task, f"voltage = {VOLTAGE}", cooling='"none"')).designs
    diagram = torque_speed(design)
    assert diagram.durations.tolist() == [0, 10, 30, 60, 180, 600, 1800, np.inf]
    most = 35.0 * 60 / (2 * np.pi * 100)  # the sheet's current with magnets at 25 degC
    for row, duration in ((3, 60.0), (5, 600.0)):
        for column in (0, 20, 40, 46):
            expected = min(held_at(duration, float(diagram.speed[column]), VOLTAGE), most)
            assert diagram.torque[row, column] == pytest.approx(expected, abs=1.5e-3)
    # The longer, the less; and at every speed no more than at a slower one.
    fine = 35.0 / 10 / 2**14  # N·m, to which it is halved
    assert (np.diff(diagram.torque[:, :48], axis=0) <= fine).all()
    assert (np.diff(diagram.torque[:, :48], axis=1) <= fine).all()


@pytest.mark.long
def test_the_longer_the_less_beyond_a_runaway_too() -> None:
    """Currents so large that the copper's rise in resistance runs away within seconds."""
    limits = f"voltage = {2 * VOLTAGE}\ncurrent = 200"
    (design,) = solve_study(study("held_torque", "duration = 120", limits, cooling='"none"')).designs
    diagram = torque_speed(design)
    fine = 200.0 / 10 / 2**14  # N·m
    held = diagram.torque[:, ~np.isnan(diagram.torque[0])]
    assert (np.diff(held, axis=0) <= fine).all()
    assert held[-1, 0] < 0.6 * held[3, 0]


@pytest.mark.long
def test_for_ever_is_where_heat_in_and_heat_out_meet() -> None:
    (design,) = solve_study(study("held_torque", "duration = 120", "speed = 100", cooling='"none"')).designs
    diagram = torque_speed(design)
    total = 1.084 + 1.105 + 0.779

    def over(current: float) -> float:
        return float(current**2 * 0.186 * (1 + 0.0039 * (105.0 - 21.5)) * total - (105.0 - 21.5))

    current = brentq(over, 1.0, 30.0)
    housing = 21.5 + 0.779 / total * (105.0 - 21.5)
    constant = 60 / (2 * np.pi * 100) * (1 - 0.0012 * (housing - 25.0))
    assert diagram.torque[-1] == pytest.approx(current * constant, abs=1e-3)  # at all speeds: nothing heats by turning
    assert diagram.speed[-1] == pytest.approx(100.0)


@pytest.mark.long
def test_iron_that_warms_leaves_less_at_speed(tmp_path: Path) -> None:
    from lptn.robots.presets import presets

    iron = '\n[[effects]]\nkind = "iron_loss"\nat = "stator"\ngain = 0.02\nexponent = 1.5\n'
    (tmp_path / "iron.toml").write_text(presets()["u8"] + iron)
    motor = '[[motors]]\nname = "U8"\nmodel = "iron.toml"'
    text = (
        f'[study]\ngoal = "held_torque"\ncooling = ["none"]\n[task]\nduration = 120\n[limits]\nspeed = 120\n{motor}\n'
    )
    (design,) = solve_study(parse_study(text, tmp_path / "study.toml")).designs
    diagram = torque_speed(design)
    for_ever = diagram.torque[-1]
    assert for_ever[0] > 1.1 * for_ever[-1]
    # Heat of 0.02 · 100^1.5 = 20 W into the stator warms the winding by all that it passes on the way out.
    at = int(np.argmin(np.abs(diagram.speed - 100.0)))
    assert diagram.speed[at] == pytest.approx(100.0)
    warmer = 20.0 * (1.105 + 0.779)

    def over(current: float) -> float:
        loss = current**2 * 0.186 * (1 + 0.0039 * (105.0 - 21.5))
        return float(loss * (1.084 + 1.105 + 0.779) + warmer - (105.0 - 25.0))

    current = brentq(over, 1.0, 30.0)
    loss = current**2 * 0.186 * (1 + 0.0039 * 83.5)
    constant = 60 / (2 * np.pi * 100) * (1 - 0.0012 * 0.779 * (loss + 20.0))
    assert for_ever[at] == pytest.approx(current * constant, abs=1e-3)


@pytest.mark.long
def test_the_command_draws_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = '[study]\ngoal = "held_torque"\ncooling = ["none"]\n[task]\nduration = 120\n[limits]\nvoltage = 22.2\n'
    path, picture, target = tmp_path / "study.toml", tmp_path / "diagram.png", tmp_path / "found.json"
    path.write_text(text + '[[motors]]\nname = "*"\n')
    page = tmp_path / "page.html"
    with pytest.raises(SystemExit) as stop:
        main(["trade", str(path), "--diagram", str(picture), "--json", str(target), "--report", str(page)])
    assert not stop.value.code
    assert picture.stat().st_size > 20_000
    diagrams = json.loads(target.read_text())["torque_speed"]
    assert [diagram["option"] for diagram in diagrams] == ["U10, no sink", "U8, no sink"]
    assert diagrams[0]["durations"][-1] is None
    assert np.shape(diagrams[0]["torque"]) == (len(diagrams[0]["durations"]), len(diagrams[0]["speed"]))
    text = page.read_text()
    assert "How long each torque can be held at each speed" in text
    assert all(f'"keys":["{name}"]' in text for name in ("U10, no sink", "U8, no sink"))


def test_a_diagram_needs_an_end(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "study.toml"
    path.write_text(
        '[study]\ngoal = "held_torque"\ncooling = ["none"]\n[task]\nduration = 120\n[[motors]]\nname = "U8"\n'
    )
    with pytest.raises(SystemExit) as stop:
        main(["trade", str(path), "--diagram", str(tmp_path / "diagram.png")])
    assert stop.value.code == 2
    assert "voltage = " in capsys.readouterr().err
    assert not (tmp_path / "diagram.png").exists()
