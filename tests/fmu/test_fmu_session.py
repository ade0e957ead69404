"""Co-Simulation by itself against independent solutions: steps, inputs, tuning, heat flows, forecasts, golden FMUs."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pandas as pd
import pytest
from fmpy.validation import validate_fmu

from lptn.effects import catalogue
from lptn.fmu import FmuError, Session, export
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.robots.presets import presets
from tests.builders import effect, with_every_effect
from tests.fmu.conftest import Build
from tests.fmu.truth import ROOM, ZERO, bead_and_motor_by_hand, in_kelvin, leg_by_hand, solved, steps
from tests.model import slot


def _temperatures(session: Session, rows: np.ndarray, step: float, ramps: bool = False) -> np.ndarray:
    readings = []
    for k, row in enumerate(rows):
        session.inputs[:] = row
        target = rows[min(k + 1, len(rows) - 1)] if ramps else None
        readings.append(session.step(step, target).copy())
    return np.array(readings) - ZERO


def _session(built: Build, name: str, fmi: int = 3, solver: str = "rk4", **more: object) -> Session:
    exported = built(name, fmi, solver)
    states = [variable.name for variable in exported.component.of("state")]
    return Session(exported.path, outputs=states, **more)


@pytest.mark.parametrize(("fmi", "solver"), [(2, "rk4"), (3, "rk4"), (3, "ros2")])
def test_piecewise_constant_inputs(fmi: int, solver: str, built: Build) -> None:
    inputs = steps(built("leg", fmi, solver).component.model, 120)
    with _session(built, "leg", fmi, solver) as session:
        temperatures = _temperatures(session, in_kelvin(built("leg", fmi, solver).component.model, inputs), 5.0)
    assert np.abs(temperatures - leg_by_hand(inputs, 5.0)).max() < 1e-6


@pytest.mark.long
def test_every_effect_of_the_catalogue(built: Build) -> None:
    model = built("everything").component.model
    inputs = np.abs(steps(model, 60))
    with _session(built, "everything") as session:
        temperatures = _temperatures(session, in_kelvin(model, inputs), 2.0)
    assert np.abs(temperatures - solved(model, inputs, 2.0)).max() < 1e-6


def test_steps_of_any_size_give_the_same_end(built: Build) -> None:
    model = built("leg").component.model
    row = in_kelvin(model, steps(model, 1))[0]
    ends = []
    for sizes in ([600.0], [1e-3, 0.1, 99.899, 0.37, 499.63], [0.25] * 2400):
        with _session(built, "leg") as session:
            for size in sizes:
                session.inputs[:] = row
                session.step(size)
            assert session.time == pytest.approx(600.0)
            ends.append(session.outputs.copy())
    assert np.ptp(np.array(ends), axis=0).max() < 1e-9


@pytest.mark.parametrize("fmi", [2, 3])
def test_inputs_in_straight_lines(fmi: int, built: Build) -> None:
    model = built("leg", fmi).component.model
    inputs = steps(model, 40)
    with _session(built, "leg", fmi, ramps=True) as session:
        ramped = _temperatures(session, in_kelvin(model, inputs), 5.0, ramps=True)
        session.reset()
        held = _temperatures(session, in_kelvin(model, inputs), 5.0)
    truth = solved(model, inputs, 5.0, ramps=True)
    assert np.abs(ramped - truth).max() < 1e-6
    assert np.abs(held - truth).max() > 0.05  # what holding the inputs would have cost


@pytest.mark.long
def test_a_stiff_network_by_ros2(built: Build) -> None:
    """Time constants of 20 ms beside minutes: steps of 0.5 s, error falling with the square of the inner step."""
    model = built("stiff", 3, "ros2", 0.1).component.model
    inputs = np.abs(steps(model, 40))
    truth = bead_and_motor_by_hand(inputs, 0.5)
    errors = []
    for step in (0.1, 0.05):
        exported = built("stiff", 3, "ros2", step)
        with Session(exported.path, outputs=[v.name for v in exported.component.of("state")]) as session:
            errors.append(np.abs(_temperatures(session, in_kelvin(model, inputs), 0.5) - truth).max())
    assert errors[0] < 1e-4
    assert errors[1] < errors[0] / 2


def test_tuning_a_resistance_between_steps(built: Build) -> None:
    """A heat sink mounted in mid-run: the FMU goes on as the model with the new value does."""
    component = built("leg").component
    model = component.model
    inputs = steps(model, 40)
    rows = in_kelvin(model, inputs)
    index = [parameter.name for parameter in model.parameters].index("resistance.FR_calf~ambient")
    values = model.values.copy()
    values[index] = 2.0
    with _session(built, "leg") as session:
        first = _temperatures(session, rows[:20], 5.0)
        session.write({"FR_calf.to_ambient.resistance": 2.0})
        second = _temperatures(session, rows[20:], 5.0)
    state = first[-1]
    for row, expected in zip(inputs[20:], second, strict=True):
        state = model.run(100)(state, np.repeat(row[:, None], 100, axis=1), values, 0.05).full()[:, -1]
        assert np.abs(state - expected).max() < 1e-8


def test_a_parameter_tuned_past_the_step_divides_it_and_says_so(built: Build) -> None:
    with _session(built, "leg", values={"FR_hip.capacity": 0.01}) as session:
        session.inputs[1] = 1.0
        outputs = session.step(10.0).copy()
        assert "too long" in session.messages[-1]
    expected = solved(built("leg").component.model, np.array([[ROOM, 1.0, 0, 0]]), 10.0, values=_with_small_hip(built))
    assert np.abs(outputs - ZERO - expected[0]).max() < 1e-3


def _with_small_hip(built: Build) -> np.ndarray:
    model = built("leg").component.model
    values = model.values.copy()
    values[[parameter.name for parameter in model.parameters].index("capacity.FR_hip")] = 0.01
    return np.asarray(values)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["quadruped", "everything"])
def test_heat_flows_add_up_to_what_warms_each_node(name: str, built: Build) -> None:
    exported = built(name)
    component, model = exported.component, exported.component.model
    outputs = [variable.name for variable in component.of("output") if variable.name.endswith(".heat_flow")]
    inner = [key for key, kind in catalogue().items() if kind.changes_link or kind.scales_heat]
    with Session(exported.path, outputs=outputs) as session:
        rows = in_kelvin(model, np.abs(steps(model, 5)))
        _temperatures(session, rows, 20.0)
        flows = dict(zip(outputs, session.outputs, strict=True))
        for node in model.nodes:
            warming = session.read([f"der({node}.temperature)"])[0]
            capacity = model.parameters[model.network.capacities[node]].value
            total = 0.0
            for flow, value in flows.items():
                place, middle, _ = flow.split(".")
                if middle.partition("_to_")[0] in inner:
                    continue  # a share of another flow
                other = middle.rpartition("to_")[2] if "to_" in middle else ""
                total += value * ((other == node) - (place == node) if other else (place == node))
            assert total == pytest.approx(warming * capacity, abs=1e-9)


def test_what_an_effect_adds_is_the_difference_that_it_makes(built: Build) -> None:
    with Session(
        built("everything").path, values={"a.temperature": 350.0, "base.speed": 2.0, "a.torque": 5.0}
    ) as session:
        names = [
            "a.copper_loss.heat_flow",
            "a.resistance_rise.heat_flow",
            "a.to_ambient.heat_flow",
            "a.radiation.heat_flow",
        ]
        heat, rise, away, radiated = session.read(names)
        session.write({"a.resistance_rise.alpha": 0.0, "a.radiation.area": 0.0})
        heat_without, _, away_without, _ = session.read(names)
    assert rise == pytest.approx(heat - heat_without)
    assert radiated == pytest.approx(away_without - away)
    assert rise > 0 > radiated


@pytest.mark.parametrize("solver", ["rk4", "ros2"])
def test_the_time_to_a_limit_is_when_it_is_reached(solver: str, built: Build) -> None:
    exported = built("leg", 3, solver, forecast=True)
    start = {"FR_calf.torque": 12.0, "FR_hip.torque": 2.0}
    with Session(exported.path, outputs=["FR_calf.temperature"], values=start) as session:
        said, never = session.read(["FR_calf.time_to_limit", "FR_hip.time_to_limit"])
        session.step(said)
        assert session.outputs[0] - ZERO == pytest.approx(80.0, abs=2e-3 if solver == "rk4" else 0.1)
        assert never == 3600.0
        session.step(10.0)
        assert session.read(["FR_calf.time_to_limit"])[0] == 0.0


def test_the_torque_scale_falls_below_the_limit(built: Build) -> None:
    with Session(built("leg").path) as session:
        for temperature, expected in ((60.0, 1.0), (70.0, 1.0), (75.0, 0.5), (80.0, 0.0), (90.0, 0.0)):
            session.reset({"FR_calf.temperature": temperature + ZERO})
            assert session.read(["FR_calf.torque_scale"])[0] == pytest.approx(expected, abs=1e-12)


def test_a_step_that_runs_away_is_taken_back(built: Build) -> None:
    with Session(built("everything").path, outputs=["a.temperature"]) as session:
        session.step(1.0)
        before = session.outputs.copy()
        session.inputs[session.input_names.index("a.torque")] = 1e200
        with pytest.raises(FmuError, match=r"run away|inner steps"):
            session.step(1.0)
        assert session.read(["a.temperature"])[0] == before[0]
        session.inputs[session.input_names.index("a.torque")] = 1.0
        session.time = session.read(["time"])[0]
        session.step(1.0)


# --- effects of one run -------------------------------------------------------------------------------


@pytest.fixture
def trusted(tmp_path: Path) -> Iterator[Path]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path))
        yield tmp_path


@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
def test_every_effect_of_a_run_of_any_name(fmi: int, trusted: Path) -> None:
    every = with_every_effect()
    confined = [replace(effect(key), run="2026.11.21 ~hot~ {1}") for key in catalogue()]
    model = Model(every.with_effects(confined))
    path = export(model, trusted / "x.fmu", fmi=fmi).path
    assert validate_fmu(str(path)) == []
    states = [variable.name for variable in export(model, trusted / "y.fmu", platforms=()).component.of("state")]
    inputs = np.abs(steps(model, 20))
    on = model.in_run("2026.11.21 ~hot~ {1}", model.values)
    with Session(path, outputs=states) as session:
        (indicator,) = (name for name in session.variables if name.endswith(".run"))
        for flag, values in ((0.0, model.values), (1.0, on)):
            session.reset({indicator: flag})
            outputs = []
            for row in in_kelvin(model, inputs):
                session.inputs[:] = row
                outputs.append(session.step(2.0).copy())
            assert (
                np.abs(np.array(outputs) - ZERO - solved(model, inputs, 2.0, values=values)).max() < 1e-5
            )  # RK4 of its own step
    assert not np.array_equal(on, model.values)


# --- golden FMUs --------------------------------------------------------------------------------------


REFERENCE = Path(__file__).parents[2] / "fmu" / "reference"


def _apart(fmu: Path, name: str) -> float:
    """The largest difference between an FMU and the reference [K]."""
    inputs = pd.read_csv(REFERENCE / name / f"{name}_in.csv")
    expected = pd.read_csv(REFERENCE / name / f"{name}_ref.csv")
    outputs, driven = [*expected.columns[1:]], [*inputs.columns[1:]]
    with Session(fmu, inputs=driven, outputs=outputs, trust=True) as session:
        results = [session.outputs.copy()]
        for row, step in zip(inputs.iloc[::2].to_numpy(), np.diff(expected["time"]), strict=True):
            session.inputs[:] = row[1:]
            results.append(session.step(float(step)).copy())
    return float(np.abs(np.array(results) - expected[outputs].to_numpy()).max())


def test_each_preset_has_its_folder() -> None:
    folders = {path.name for path in REFERENCE.iterdir() if path.is_dir() and not path.name.startswith("__")}
    assert folders == set(presets())


@pytest.mark.skipif(sys.platform != "linux", reason="the stored libraries are for Linux")
@pytest.mark.parametrize("name", presets())
def test_the_stored_fmu_gives_the_reference(name: str) -> None:
    assert _apart(REFERENCE / name / f"{name}.fmu", name) < 1e-6


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", presets())
def test_the_stored_description_is_what_export_writes(name: str, fmi: int, tmp_path: Path) -> None:
    exported = export(parse_model(presets()[name], Path(f"{name}.toml")), tmp_path / "x.fmu", fmi=fmi, platforms=())
    with ZipFile(exported.path) as archive:
        new = archive.read("modelDescription.xml").decode()
    stored = (REFERENCE / name / f"FMI{fmi}.xml").read_text()
    # All but the head, which holds date, version and token; `fmu/reference/make.py` brings the stored one up to date.
    assert new.partition("<ModelExchange")[2] == stored.partition("<ModelExchange")[2]


@pytest.mark.long
@pytest.mark.parametrize(("name", "fmi"), [("leg", 2), ("leg", 3), ("quadruped", 3)])
def test_a_new_fmu_gives_the_reference(name: str, fmi: int, built: Build) -> None:
    assert _apart(built(name, fmi).path, name) < 1e-6


@pytest.mark.long
def test_a_hottest_point_is_an_output_with_a_limit_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    path, places = tmp_path / "slot.fmu", ["winding", "iron", "winding.hottest"]
    export(slot.model(), path, limits={"*": 200.0, "winding.hottest": 98.0}, start=slot.AIR, forecast=True)
    outputs = [*(f"{place}.temperature" for place in places), "winding.hottest.time_to_limit", "winding.torque_scale"]
    with Session(path, outputs=outputs, trust=True) as session:
        session.inputs[session.input_names.index("winding.current")] = 20.0
        session.inputs[session.input_names.index("ambient.temperature")] = slot.AIR + ZERO
        results = np.array([session.step(1.0).copy() for _ in range(300)])
    truth = slot.truth(np.full(1200, 20.0), 1.0)
    rise = truth["winding.hottest"] - slot.AIR
    assert np.abs(results[:, 2] - ZERO - truth["winding.hottest"][:300]).max() < 0.02 * rise[299]
    reached = int((truth["winding.hottest"] > 98.0).argmax()) + 1
    assert results[-1, 3] == pytest.approx(reached - 300, abs=1.5)
    derated = results[:, 4] < 1
    assert derated.any()
    np.testing.assert_array_equal(derated, results[:, 2] - ZERO > 88.0, "10 K below the hottest point's limit")
