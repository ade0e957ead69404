"""From a motor's drawing to a trade study: every refusal says what to write next, and writing it leads to a figure."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import casadi as ca
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray
from lptn.cli.main import main
from lptn.planners.trade import DesignProblem, load_study
from lptn.planners.trade.designs import Simulator
from lptn.planners.trade.plant import Load
from lptn.planners.trade.study import attachable
from tests.cooling.studies import HELD, study

Command = Callable[..., tuple[int, str, str]]
STUDY = """\
[study]
goal = "held_torque"
cooling = ["passive"]

[task]
duration = 120

[limits]
mass = {{ value = 900, unit = "g" }}
volume = {{ value = 600, unit = "cm^3" }}
{limits}

[[motors]]
{motor}

{sink}
"""
NUMBERS = 'mass = { value = 500, unit = "g" }\nvolume = { value = 100, unit = "cm^3" }\ntorque_constant = 0.1'
OWN = f'name = "mine"\nmodel = "motor.toml"\n{NUMBERS}'


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Command:
    """Run a command: its exit status, and what it printed on both streams."""

    def run(*words: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main([str(word) for word in words])
        printed = capsys.readouterr()
        return int(stop.value.code or 0), printed.out, printed.err

    return run


@pytest.fixture
def folder(tmp_path: Path, command: Command) -> Path:
    """A folder with the sample drawing and the model made of it."""
    assert command("motor", "-o", tmp_path / "drawing.toml")[0] == 0
    assert command("motor", tmp_path / "drawing.toml", "-o", tmp_path / "motor.toml")[0] == 0
    return tmp_path


def test_each_refusal_says_what_to_write_next(folder: Path, command: Command) -> None:
    path = folder / "study.toml"

    def refused(*, motor: str = OWN, limits: str = "winding = 120", sink: str = "") -> str:
        path.write_text(STUDY.format(motor=motor, limits=limits, sink=sink))
        status, _, line = command("trade", path)
        assert status == 2
        assert line.count("\n") == 1
        return line

    line = refused(motor='name = "motor.toml"')
    assert all(word in line for word in ("line 14", "U8", "model = ", "mass", "volume", "torque_constant"))
    line = refused(motor='name = "mine"\nmodel = "motor.toml"')
    assert all(word in line for word in ("without mass, volume, torque_constant", "kg", "m^3", "N*m/A"))
    line = refused(limits="")
    assert "winding = … in degC" in line
    line = refused(sink='[sink]\nat = "housing_z1"')
    assert all(word in line for word in ("sink.at", "a body", "housing_z1.outer"))
    assert "housing_z1," not in line  # what is offered is what is accepted
    assert "housing_z1.outer" in refused(sink='[sink]\nat = "stator"')
    assert "motors[0].sink_at" in refused(motor=f'{OWN}\nsink_at = "stator"')
    assert "winding_r1_z1" in refused(motor=f'{OWN}\nwinding = "coil"')
    assert "magnets_z1" in refused(motor=f'{OWN}\nmagnet = "rotor"')


@pytest.mark.long
def test_every_place_that_is_offered_is_accepted(folder: Path) -> None:
    path = folder / "study.toml"
    path.write_text(STUDY.format(motor=OWN, limits="winding = 120", sink=""))
    (option,) = load_study(path).options()
    places = attachable(option.motor.network)
    assert "housing_z1.outer" in places
    for place in [*places, "end_winding_*.front"]:
        path.write_text(STUDY.format(motor=OWN, limits="winding = 120", sink=f'[sink]\nat = "{place}"'))
        (option,) = load_study(path).options()
        assert "sink" in option.network().dynamic


@pytest.mark.long
def test_a_drawing_becomes_a_study_and_a_figure(folder: Path, command: Command) -> None:
    coarse = (folder / "drawing.toml").read_text().replace("\nwinding = 3", "\nwinding = 1")  # a third of the time
    (folder / "drawing.toml").write_text(coarse)
    assert command("motor", folder / "drawing.toml", "-o", folder / "motor.toml")[0] == 0
    path, answer, picture = folder / "study.toml", folder / "study.json", folder / "study.png"
    path.write_text(STUDY.format(motor=OWN, limits="winding = 120", sink=""))
    status, out, err = command("trade", path, "--json", answer, "--plot", picture)
    assert status == 0, err
    assert "mine, passive" in out
    (design,) = json.loads(answer.read_text())["designs"]
    assert design["binding"][0] == "winding"
    assert design["checked"] == pytest.approx(design["winding"], abs=0.05)
    assert "resistance.housing*.outer~sink" in design["sensitivities"]
    assert picture.stat().st_size > 30_000


def test_the_hottest_of_several_windings_is_limited(folder: Path) -> None:
    path = folder / "study.toml"
    path.write_text(STUDY.format(motor=OWN, limits="winding = 120", sink="").replace('"passive"', '"none"'))
    (option,) = load_study(path).options()
    assert set(option.motor.winding_nodes) == {
        *(f"winding_r{layer}_z1" for layer in (1, 2, 3)), "end_winding_front", "end_winding_back",
    }  # fmt: skip
    assert option.motor.magnet_nodes == ("magnets_z1",)
    solution = DesignProblem(option).solve()
    assert solution.success
    rows = [option.network().dynamic.index(node) for node in option.motor.winding_nodes]
    assert solution.states[rows].max() == pytest.approx(120.0, abs=1e-6)
    assert solution.states[rows, -1].min() < 119.0


def test_a_model_driven_by_torque_is_refused_with_the_mend(folder: Path, command: Command) -> None:
    drawing = (folder / "drawing.toml").read_text()
    lines = ['input = "torque"\ntorque_constant = 0.1' if line.startswith("input =") else line
             for line in drawing.splitlines()]  # fmt: skip
    (folder / "drawing.toml").write_text("\n".join(lines))
    assert command("motor", folder / "drawing.toml", "-o", folder / "motor.toml")[0] == 0
    (folder / "study.toml").write_text(STUDY.format(motor=OWN, limits="winding = 120", sink=""))
    status, _, line = command("trade", folder / "study.toml")
    assert status == 2
    assert "driven by torque" in line
    assert 'input = "current"' in line


def test_heat_through_the_pipes_is_what_the_sink_takes_in() -> None:
    (option,) = study("held_torque", "duration = 120", HELD, cooling='"passive"').options()
    plant = DesignProblem(option, (100.0, 2.0)).plant
    x, torque = ca.SX.sym("x", len(plant.states)), ca.SX.sym("torque")
    sink = plant.states.index("sink")
    load = Load(torque)
    taken_in = plant.capacity * plant.rates(x, load)[sink] + (x[sink] - plant.ambient) / plant.resistance
    both = ca.Function("both", [x, torque, plant.parameters.stacked], [plant.pipe_power(x, load), taken_in])
    through, stored = both(np.array([90.0, 70.0, 50.0, 40.0]), 1.5, plant.parameters.values())
    assert float(through) == pytest.approx(30.0 / 0.177)
    assert float(stored) == pytest.approx(float(through))


def test_steps_follow_the_rates_and_are_stable_at_any_length() -> None:
    (option,) = study("held_torque", "duration = 120", HELD, cooling='"passive"').options()
    simulator, start = Simulator(option, (100.0, 2.0)), np.full(4, 21.5)
    torque, x = np.array([1.5, 1.8]), np.tile(start[:, None], 2)
    for _ in range(240):
        x = simulator.advance(x, torque, 0.5)

    def rates(_: float, states: FloatArray, peak: float) -> FloatArray:
        return np.asarray(simulator.rates(states, [peak, 0.0, 0.0], 100.0, 2.0).full()).ravel()

    for case, peak in enumerate(torque.tolist()):
        exact = solve_ivp(rates, (0.0, 120.0), start, method="LSODA", rtol=1e-10, atol=1e-10, args=(peak,)).y[:, -1]
        assert x[:, case] == pytest.approx(exact, abs=2e-3)
    for _ in range(20):  # it settles
        x = simulator.advance(x, torque / 2, 1e5)
    assert x == pytest.approx(simulator.steady(torque / 2), abs=1e-6)
