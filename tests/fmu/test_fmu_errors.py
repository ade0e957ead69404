"""Calls that are wrong: an error with a reason, nothing changed, and never a crash."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Model

from lptn.fmu import FmuError, Session, export
from lptn.fmu.compile import local_compiler
from lptn.model import Model
from tests.fmu.conftest import Build, network

HARNESS = Path(__file__).with_name("fuzz.c")


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"FR_calf.torque": float("nan")}, "FR_calf.torque"),
        ({"FR_calf.torque": float("inf")}, "inf refused"),
        ({"FR_calf.capacity": 0.0}, "must lie from"),
        ({"ambient.temperature": -1.0}, "must lie from"),
        ({"FR_calf.temperature": 300.0}, "can't be set in step mode"),
        ({"FR_calf.copper_loss.heat_flow": 1.0}, "can't be set"),
        ({"FR_calf.torque": 3.0, "FR_hip.torque": float("nan")}, "nan"),
    ],
)
def test_a_refused_value_is_said_and_changes_nothing(
    fmi: int, values: dict[str, float], said: str, built: Build
) -> None:
    with Session(built("leg", fmi).path) as session:
        session.step(1.0)
        before = session.read(session.variables)
        with pytest.raises(FmuError, match=said):
            session.write(values)
        assert (session.read(session.variables) == before).all()
        session.step(1.0)


@pytest.mark.parametrize("fmi", [2, 3])
def test_degrees_celsius_in_place_of_kelvin_are_suspected(fmi: int, built: Build) -> None:
    with Session(built("leg", fmi).path) as session:
        session.write({"ambient.temperature": 22.0})
        assert "kelvin" in session.messages[-1]


def test_an_old_warning_is_not_taken_for_the_reason_of_an_error(built: Build) -> None:
    def silent() -> None:
        raise RuntimeError("no reason given")

    with Session(built("leg").path) as session:
        session.write({"ambient.temperature": 22.0})
        with pytest.raises(FmuError, match="no reason given"):
            session._call(silent)


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("point", [(5.0, 1.0), (0.0, 0.0), (0.0, -1.0), (0.0, float("nan"))])
def test_a_step_from_elsewhere_or_of_no_size_is_refused(fmi: int, point: tuple[float, float], built: Build) -> None:
    with Session(built("leg", fmi).path) as session:
        session.time = point[0]
        with pytest.raises(FmuError, match=r"step size|communication point"):
            session.step(point[1])


@pytest.mark.parametrize("fmi", [2, 3])
def test_an_unknown_value_reference_is_refused(fmi: int, built: Build) -> None:
    with Session(built("leg", fmi).path) as session:
        values = np.zeros(1)
        with pytest.raises(FmuError, match="no variable with value reference 4000"):
            session._call(session._get, *session._arguments([4000], values))


def _instance(built: Build, folder: Path, said: list[str]) -> Any:
    description = fmpy.read_model_description(str(built("leg").path))
    fmpy.extract(str(built("leg").path), str(folder))
    fmu = FMU3Model(
        guid=description.guid,
        modelIdentifier=description.modelExchange.modelIdentifier,
        unzipDirectory=str(folder),
        instanceName="one",
    )
    fmu.instantiate(logMessage=lambda environment, status, category, message: said.append(message.decode()))
    return fmu


def test_calls_out_of_order_are_refused_with_the_mode(built: Build, tmp_path: Path) -> None:
    said: list[str] = []
    fmu = _instance(built, tmp_path, said)
    for call in (fmu.exitInitializationMode, fmu.enterContinuousTimeMode, fmu.terminate, fmu.enterConfigurationMode):
        with pytest.raises(FMICallException):
            call()
    assert "fmi3ExitInitializationMode: not allowed in the instantiated state" in said
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    with pytest.raises(FMICallException):
        fmu.enterInitializationMode()
    fmu.freeInstance()


def test_a_wrong_token_gives_no_instance(built: Build, tmp_path: Path) -> None:
    fmpy.extract(str(built("leg").path), str(tmp_path))
    fmu = FMU3Model(guid="{wrong}", modelIdentifier="leg", unzipDirectory=str(tmp_path), instanceName="one")
    said: list[str] = []
    with pytest.raises(Exception, match="Failed to instantiate"):
        fmu.instantiate(logMessage=lambda environment, status, category, message: said.append(message.decode()))
    assert "token" in said[0]


def _harness(name: str, fmi: int, folder: Path, flags: list[str]) -> Path:
    compiler = local_compiler()
    if compiler is None:
        pytest.skip("no C compiler on this machine")
    exported = export(Model(network(name)), folder / "x.fmu", fmi=fmi, platforms=())
    with ZipFile(exported.path) as archive:
        archive.extractall(folder)
    shutil.copy(HARNESS, folder / "sources")
    program = folder / "fuzz"
    strict = ["-Wall", "-Wextra", "-Werror", "-Wno-unused-function", "-Wno-unused-parameter"]
    words = ["-std=c99", "-g", "-O1", *strict, f"-DFMI={fmi}", *flags]
    subprocess.run([*compiler, *words, "sources/fuzz.c", "-o", "fuzz", "-lm"], cwd=folder, check=True)
    return program


@pytest.mark.parametrize("fmi", [2, 3])
def test_random_calls_under_sanitizers(fmi: int, tmp_path: Path) -> None:
    flags = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    program = _harness("single-motor", fmi, tmp_path, flags)
    done = subprocess.run([str(program), "10000", "3"], capture_output=True, text=True, check=False, timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.slow
@pytest.mark.parametrize("name", ["leg", "everything", "quadruped"])
@pytest.mark.parametrize("fmi", [2, 3])
def test_random_calls_under_valgrind(name: str, fmi: int, tmp_path: Path) -> None:
    valgrind = shutil.which("valgrind")
    if valgrind is None:
        pytest.skip("no valgrind on this machine")
    program = _harness(name, fmi, tmp_path, [])
    words = [
        valgrind,
        "--error-exitcode=9",
        "--leak-check=full",
        "--show-leak-kinds=all",
        "--errors-for-leak-kinds=all",
    ]
    done = subprocess.run(
        [*words, str(program), "10000", "7"], capture_output=True, text=True, check=False, timeout=1200
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "All heap blocks were freed" in done.stderr
