"""Admissible torques as outputs of an FMU: against the limiter in Python, differences, and an FMU without them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from zipfile import ZipFile

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.cli.main import main
from lptn.effects.copper_loss import CopperLoss
from lptn.fmu import Session, export
from lptn.fmu.archive import unit_of
from lptn.fmu.component import DEFAULT_LIMIT
from lptn.model.model import Model
from lptn.planners import Limiter
from tests.builders import AMBIENT, effect, leg, link, node
from tests.fmu.conftest import Build, network, unknowns_and_knowns
from tests.fmu.truth import ZERO

from lptn.model.network import Network  # isort: skip

JOINTS = ("FR_hip", "FR_thigh", "FR_calf")
HORIZONS = ("10s", "60s", "300s", "continuous")
NAMES = [f"{joint}.admissible_torque_{horizon}" for joint in JOINTS for horizon in HORIZONS]
CASES = {
    "cool": ([30.0, 41.0, 25.0], [0.0, 0.0, 0.0], 25.0),
    "loaded": ([55.0, 62.5, 71.0], [2.0, -7.0, 5.5], 12.0),
    "near": ([79.0, 60.0, 79.9], [0.1, 3.0, -2.0], 35.0),
    "too hot": ([60.0, 50.0, 83.0], [1.0, 2.0, 3.0], 25.0),
    "overloaded neighbour": ([40.0, 40.0, 79.5], [0.0, 0.0, 60.0], 25.0),
}


def _values(temperatures: list[float], torques: list[float], ambient: float) -> dict[str, float]:
    """A case as the FMU takes it."""
    values = {f"{joint}.temperature": warm + ZERO for joint, warm in zip(JOINTS, temperatures, strict=True)}
    values |= {f"{joint}.torque": torque for joint, torque in zip(JOINTS, torques, strict=True)}
    return values | {"ambient.temperature": ambient + ZERO}


def _expected(case: str, limits: float | Mapping[str, float] = DEFAULT_LIMIT, current: float = np.inf) -> FloatArray:
    temperatures, torques, ambient = CASES[case]
    limiter = Limiter(Model(network("leg")), limits, current_limits=current)
    return np.asarray(limiter.admissible(temperatures, torques, [ambient])).ravel()


@pytest.mark.long
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("case", CASES)
def test_the_outputs_are_those_of_the_limiter(case: str, fmi: int, built: Build) -> None:
    with Session(built("leg", fmi, admissible=True).path, outputs=NAMES, values=_values(*CASES[case])) as session:
        outputs = session.read(NAMES)
    expected = _expected(case)
    assert outputs == pytest.approx(expected, rel=1e-9)
    assert expected.any()
    assert (case in ("too hot", "overloaded neighbour")) == (not expected.all())


@pytest.mark.long
@pytest.mark.parametrize("fmi", [2, 3])
def test_the_outputs_follow_a_step(fmi: int, built: Build) -> None:
    temperatures = [f"{joint}.temperature" for joint in JOINTS]
    _, torques, ambient = CASES["loaded"]
    path = built("leg", fmi, admissible=True).path
    with Session(path, outputs=[*NAMES, *temperatures], values=_values(*CASES["loaded"])) as session:
        outputs = session.step(30.0).copy()
    limiter = Limiter(Model(network("leg")), DEFAULT_LIMIT)
    expected = limiter.admissible((outputs[len(NAMES) :] - ZERO).tolist(), torques, [ambient]).ravel()
    assert outputs[: len(NAMES)] == pytest.approx(expected, rel=1e-9)
    assert np.abs(expected / _expected("loaded") - 1).max() > 1e-3


@pytest.mark.parametrize("fmi", [2, 3])
def test_model_exchange_shows_them_too(fmi: int, built: Build) -> None:
    rows = fmpy.simulate_fmu(
        str(built("leg", fmi, admissible=True).path),
        fmi_type="ModelExchange",
        stop_time=1.0,
        output_interval=1.0,
        start_values=_values(*CASES["loaded"]),
        output=NAMES,
    )
    assert [rows[0][name] for name in NAMES] == pytest.approx(_expected("loaded").tolist(), rel=1e-9)


@pytest.mark.slow
def test_limits_are_tunable_and_currents_an_end(tmp_path: Path) -> None:
    limits = {"FR_hip": 60.0, "FR_thigh": 70.0, "FR_calf": 90.0}
    exported = export(
        Model(network("leg")), tmp_path / "x.fmu", limits=limits, admissible=True, current_limits={"*": 12.0}
    )
    with Session(exported.path, outputs=NAMES, values=_values(*CASES["cool"]), trust=True) as session:
        expected = _expected("cool", limits, 12.0)
        assert session.read(NAMES) == pytest.approx(expected, rel=1e-9)
        assert expected.max() == pytest.approx(12.0 * 0.84357)
        assert expected.min() < 6.0
        tuned = {"FR_hip": 80.0, "FR_thigh": 60.0, "FR_calf": 65.0}
        session.write({f"{joint}.temperature_limit": limit + ZERO for joint, limit in tuned.items()})
        assert session.read(NAMES) == pytest.approx(_expected("cool", tuned, 12.0), rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("solver", ["rk4", "ros2"])
def test_fmpy_finds_no_fault(fmi: int, solver: str, tmp_path: Path) -> None:
    exported = export(
        Model(network("quadruped")), tmp_path / "x.fmu", fmi=fmi, solver=solver, platforms=(), admissible=True
    )
    assert validate_fmu(str(exported.path)) == []
    description = fmpy.read_model_description(str(exported.path))
    assert description.modelExchange is not None
    assert description.coSimulation is not None
    torques = [output for output in description.outputs if "admissible" in output.variable.name]
    assert len(torques) == 12 * 4
    assert all(unit_of(output.variable) == "N*m" and output.variable.causality == "output" for output in torques)
    depends = {variable.name for variable in torques[0].dependencies}
    assert {"FR_calf.temperature", "RL_hip.torque", "RL_hip.temperature_limit", "FR_calf.capacity"} <= depends
    assert not {"limiter.band", "limiter.horizon"} & depends


# --- derivatives ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("case", ["loaded", "too hot"])
def test_forward_derivatives_are_those_of_differences(case: str, fmi: int, built: Build) -> None:
    exported = built("leg", fmi, admissible=True)
    starts = {v.name: float(v.start or 0.0) for v in exported.component.of("state", "input", "parameter")}
    starts |= _values(*CASES[case])
    knowns = [exported.variables[name] for name in starts]
    asked = [exported.variables[name] for name in NAMES]
    direction = np.random.default_rng(4).normal(size=len(knowns)) * np.array([abs(v or 1.0) for v in starts.values()])
    with Session(exported.path, values=starts) as session:
        derivatives = np.array(session._fmu.getDirectionalDerivative(asked, knowns, direction.tolist()))
        sides = []
        for sign in (1.0, -1.0):
            moved = zip(starts.items(), direction, strict=True)
            session.reset({name: value + sign * 1e-6 * step for (name, value), step in moved})
            sides.append(session.read(NAMES))
    differences = (sides[0] - sides[1]) / 2e-6
    assert np.count_nonzero(differences) == np.count_nonzero(_expected(case))
    assert derivatives == pytest.approx(differences, rel=2e-4, abs=1e-4)


@pytest.mark.parametrize("case", ["loaded", "too hot"])
def test_adjoint_and_forward_derivatives_are_one(case: str, built: Build) -> None:
    exported = built("leg", 3, admissible=True)
    parameters, knowns = unknowns_and_knowns(exported)
    rng = np.random.default_rng(6)
    down, up = rng.normal(size=len(knowns)), rng.normal(size=len(parameters))
    with Session(exported.path, values=_values(*CASES[case])) as session:
        across = up @ np.array(session._fmu.getDirectionalDerivative(parameters, knowns, down.tolist()))
        back = np.array(session._fmu.getAdjointDerivative(parameters, knowns, up.tolist(), len(knowns)))
    assert back @ down == pytest.approx(across, rel=1e-10)


# --- asked for or not -----------------------------------------------------------------------------------


@pytest.mark.slow
def test_without_the_option_nothing_of_it_is_there(built: Build) -> None:
    with ZipFile(built("leg").path) as plain, ZipFile(built("leg", admissible=True).path) as more:
        texts = [name for name in plain.namelist() if not name.startswith("binaries/")]
        assert plain.namelist() == more.namelist()
        assert not any(b"admissible" in plain.read(name) for name in texts)
        other = {name for name in texts if plain.read(name) != more.read(name)}
    changed = {"modelDescription.xml", "sources/model.c", "terminalsAndIcons/terminalsAndIcons.xml"}
    assert other <= changed | {"documentation/index.html", "sources/config.h"}
    assert changed <= other


def test_a_current_is_admissible_where_currents_drive(tmp_path: Path) -> None:
    nodes = (node("motor", 200.0), AMBIENT)
    loss = replace(effect("copper_loss", "motor"), effect=CopperLoss(input="current"))
    model = Model(Network("one", nodes, (link("motor", "ambient", 3.0),), (loss,)))
    exported = export(model, tmp_path / "x.fmu", platforms=(), admissible=True)
    (first, *_) = exported.component.of("admissible")
    assert (first.name, first.unit) == ("motor.admissible_current_10s", "A")


def test_a_model_without_torques_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="torque or current"):
        export(Model(leg()), tmp_path / "x.fmu", platforms=(), admissible=True)
    with pytest.raises(InputError, match="current_limits"):
        export(Model(network("leg")), tmp_path / "x.fmu", platforms=(), admissible=True, current_limits={"tail": 3.0})
    assert not list(tmp_path.iterdir())


def test_the_command_adds_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert _exit_code("new", "leg", "-o", "leg.toml") == 0
    words = ["fmu", "leg.toml", "-o", "x.fmu", "--platforms", "source", "--limit", "60", "--limit", "FR_calf=70"]
    assert _exit_code(*words, "--current-limit", "20") == 2
    assert _exit_code(*words, "--admissible", "--current-limit", "much") == 2
    assert not Path("x.fmu").exists()
    assert _exit_code(*words, "--admissible", "--current-limit", "20") == 0
    variables = {variable.name: variable for variable in fmpy.read_model_description("x.fmu").modelVariables}
    assert set(NAMES) <= set(variables)
    assert float(variables["FR_calf.temperature_limit"].start) == 70.0 + ZERO


def _exit_code(*words: str) -> int | str | None:
    """How `lptn` ends."""
    with pytest.raises(SystemExit) as ended:
        main(list(words))
    return ended.value.code
