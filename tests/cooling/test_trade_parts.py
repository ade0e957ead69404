"""Motor data, the heat sink's correlations, ankle profiles, the command and its figure, the example studies."""

from __future__ import annotations

import importlib
import json
from pathlib import Path
from textwrap import wrap

import facts
import numpy as np
import pytest
import textbook
from ankle import JUMP_RATIO, PEAK, STANCE, jump, jump_task, level_walking, walking_task
from scipy.optimize import minimize_scalar

from lptn.cli.main import main
from lptn.planners.trade import load_study, motors, solve_study
from lptn.planners.trade.motors import U8, U10
from lptn.planners.trade.sink import SinkNumbers, blown_air, fin_efficiency, still_air
from tests.cooling.studies import study

EXAMPLES = Path(__file__).parents[2] / "examples" / "u8_trade"


def test_motor_data_are_complete_and_have_sources() -> None:
    for motor in motors.MOTORS.values():
        for number in (motor.mass, motor.package, motor.constant, *motor.limits.given.values()):
            assert number is not None
            assert number > 0
        assert set(motor.limits.given) == {"winding", "magnet", "current"}
        assert motor.source is not None
        for said in ("mass", "size", "100 rpm/V", "current", "[Chen2017"):
            assert said in motor.source


def test_torque_metrics() -> None:
    k8, k10 = U8.torque_constant, U10.torque_constant
    assert k8 * 11 == pytest.approx(1.050, abs=5e-4)
    assert textbook.peak_specific_torque(0.1, 35, U8.mass) == pytest.approx(14.6, abs=0.05)
    assert textbook.peak_specific_torque(k10, 35, U10.mass) == pytest.approx(8.36, abs=0.01)
    assert textbook.thermal_specific_torque(0.1, 0.24, 2.976, 0.186) == pytest.approx(0.560, abs=5e-4)
    assert textbook.torque_constant(1.0, 105.0) == pytest.approx(0.904)
    assert textbook.winding_resistance(1.0, 105.0) == pytest.approx(1.312)
    assert textbook.rated_current(1.01, k8) == pytest.approx(10.58, abs=0.005)
    assert U8.package == pytest.approx(158.8e-6, rel=1e-3)


def test_fin_spacing_is_where_a_given_volume_sheds_most_heat() -> None:
    # Bar-Cohen and Rohsenow's composite Nusselt number, maximised here, must give their closed form.
    driving = 9.81 * 30.0 / 310.0 / (1.67e-5 * 2.36e-5)

    def lost(log_spacing: float) -> float:
        spacing = np.exp(log_spacing)
        elenbaas = driving * spacing**4 / 0.08
        nusselt = (576 / elenbaas**2 + 2.873 / np.sqrt(elenbaas)) ** -0.5
        return float(-nusselt * 0.0267 / spacing / spacing)  # film times surface per volume

    best = minimize_scalar(lost, bounds=(np.log(1e-3), np.log(3e-2)), method="bounded", options={"xatol": 1e-8})
    air = still_air(30.0, 0.08)
    assert air.spacing == pytest.approx(float(np.exp(best.x)), rel=0.01)
    assert air.film == pytest.approx(-best.fun * np.exp(best.x), rel=0.01)
    assert 4.0 < air.film < 8.0


def test_a_fan_of_the_textbook_cools_less_than_the_thesis_projects() -> None:
    still, blown = still_air(30.0, 0.08), blown_air(3.0, 0.08)
    films = [air.film * fin_efficiency(air.film, 1e-3, 0.03) for air in (still, blown)]
    assert blown_air(6.0, 0.08).film == pytest.approx(blown.film * np.sqrt(2))
    # The exchanger of [Chen2017, sec. 4.1] with the same fins, blown on at 3 m/s: 67 degC at 11 A, where the thesis
    # projects "below 60" from its curves; no other fact of it depends on the fan.
    values = facts.RECOMMENDED.copy()
    values[9] = values[8] * films[0] / films[1]
    _, passive, fan = facts.STATOR.build(values)
    assert passive.steady(11.0) == pytest.approx(86.6, abs=0.2)
    assert fan.steady(11.0) == pytest.approx(67.1, abs=0.2)
    # A sink of its resistance and capacity fits into the 1004 cm³ and the 867 g that it took with the motor.
    numbers = SinkNumbers(films[0], 1e-3, still.spacing)
    assert numbers.spent(353.0, 3.3)["volume"] < (1003.7 - 159) * 1e-6
    assert numbers.fin_mass(3.3) < 0.867 - 0.240
    assert fin_efficiency(1e-6, 1e-3, 0.03) == pytest.approx(1.0)


def test_profiles_keep_the_heat_and_say_what_the_source_says() -> None:
    for samples in (10, 40, 200):
        walking, jumping = level_walking(samples), jump(samples)
        assert walking.shape == jumping.shape == (samples,)
        assert np.mean(walking**2) == pytest.approx(np.mean(level_walking(400) ** 2), rel=2e-3)
        assert np.mean(jumping**2) == pytest.approx(JUMP_RATIO**2 * PEAK**2 * 0.5 * 0.3 * (1 + 0.25), rel=2e-3)
    walking, jumping = level_walking(200), jump(200)
    assert walking[int(200 * STANCE) + 1 :].max() == 0.0
    assert walking.max() == pytest.approx(PEAK, rel=0.01)
    assert jumping.max() == pytest.approx(3 * PEAK, rel=0.01)
    assert jumping[62:98].max() == 0.0
    assert walking_task(gear=55.0) in (EXAMPLES / "ankle_walking.toml").read_text(encoding="utf-8")
    assert jump_task(12, 100.0, 0.9) in (EXAMPLES / "ankle_jumps.toml").read_text(encoding="utf-8")


@pytest.mark.long
@pytest.mark.parametrize("name", ["held_torque", "ankle_jumps", "ankle_walking", "prosthesis"])
def test_example_studies_run(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    target, picture = tmp_path / "found.json", tmp_path / "study.png"
    with pytest.raises(SystemExit) as stop:
        main(["trade", str(EXAMPLES / f"{name}.toml"), "--json", str(target), "--plot", str(picture)])
    assert not stop.value.code
    out = capsys.readouterr().out
    written = json.loads(target.read_text())
    assert written["best"] == written["designs"][0]["option"]
    assert written["best"] in out
    assert sum(len(wrap(line, 80)) for line in out.splitlines()) <= 15
    assert all(name in out for name in written["designs"][0]["binding"])
    assert "Most sensitive to: " in out
    assert picture.stat().st_size > 30_000
    for design in written["designs"]:
        assert design["checked"] == pytest.approx(design["winding"], abs=0.05)
    assert len(written["time_to_limit"]) == len(written["designs"])
    assert np.array(written["map"]["winding"]).shape == (30, 30)
    if name == "held_torque":
        # In words: spend the mass on the bigger motor, then on a sink.
        assert [point["option"] for point in written["pareto"]["front"]][:2] == ["U8, no sink", "U10, no sink"]


def test_a_model_with_a_sink_of_its_own_is_the_same_as_one_with_it_added() -> None:
    own = '[[motors]]\nname = "U8"\nmodel = "u8-heat-sink"'
    results = [
        solve_study(study("held_torque", "duration = 60", "mass = 0.6\nvolume = 5e-4", motor, cooling='"passive"')).best
        for motor in ('[[motors]]\nname = "U8"', own)
    ]
    assert results[0].value == pytest.approx(results[1].value, rel=1e-7)
    assert results[0].resistance == pytest.approx(results[1].resistance, rel=1e-5)


def test_the_fan_carries_its_battery() -> None:
    asked = load_study(EXAMPLES / "held_torque.toml")
    assert asked.fan.mass_with_battery == pytest.approx(0.05 + 2 * 3600 / 5.4e5)


@pytest.mark.long
def test_the_thesis_last_chapter_in_numbers(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.syspath_prepend(str(EXAMPLES))
    example = importlib.import_module("compare_designs")
    curves = example.main(tmp_path / "compare.png")
    assert (tmp_path / "compare.png").stat().st_size > 40_000
    short, long = (example.DURATIONS.index(duration) for duration in (10.0, 3600.0))
    held = {name: (torques[short], torques[long]) for name, torques in curves.items()}
    alone, bigger = held["U8 alone"], held["U10 alone"]
    structure = held["U8, prosthesis's structure as the sink"]
    # For seconds nothing helps; for an hour a sink gives a seventh more, the bigger motor four fifths.
    assert max(values[0] for values in held.values()) - min(values[0] for values in held.values()) < 0.01
    assert alone[1] == pytest.approx(1.00, abs=0.005)
    assert structure[1] / alone[1] == pytest.approx(1.14, abs=0.01)
    assert bigger[1] / alone[1] == pytest.approx(1.81, abs=0.01)
    # Against the thesis's hope: no sink whatever makes a U8 do what a U10 does.
    assert held["U8, a sink without any resistance"][1] < bigger[1]
    assert example.time_held(example.CANDIDATES[0], 3.2) == pytest.approx(18.8, abs=0.1)
