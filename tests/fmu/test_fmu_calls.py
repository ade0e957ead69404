"""Calls that are wrong, and states saved and restored: an error with a reason, nothing changed, never a crash."""

from __future__ import annotations

import shutil
import subprocess
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any
from zipfile import ZipFile

import fmpy
import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from fmpy.fmi3 import FMU3Model

from lptn.basics.arrays import FloatArray
from lptn.basics.c_library import compiler as c_compiler
from lptn.fmu import FmuError, Session, export
from lptn.fmu.archive import Access
from lptn.model.model import Model
from tests.fmu.conftest import Build, network
from tests.fmu.truth import in_kelvin, steps

HARNESS = Path(__file__).with_name("fuzz.c")


@pytest.mark.long
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
        unknown = session._block(Access((4000,), 1, None))
        with pytest.raises(FmuError, match="no variable with value reference 4000"):
            session._call(session._get, *unknown.arguments)


def _instance(built: Build, folder: Path, said: list[str]) -> Any:
    description = fmpy.read_model_description(str(built("leg").path))
    fmpy.extract(str(built("leg").path), str(folder))
    fmu = FMU3Model(
        guid=description.guid,
        modelIdentifier=description.modelExchange.modelIdentifier,
        unzipDirectory=str(folder),
        instanceName="one",
    )
    fmu.instantiate(
        loggingOn=True, logMessage=lambda environment, status, category, message: said.append(message.decode())
    )
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


def _harness(name: str, fmi: int, folder: Path, flags: list[str], **options: bool) -> Path:
    compiler = c_compiler()
    if compiler is None:
        pytest.skip("no C compiler on this machine")
    exported = export(Model(network(name)), folder / "x.fmu", fmi=fmi, platforms=(), **options)
    with ZipFile(exported.path) as archive:
        archive.extractall(folder)
    shutil.copy(HARNESS, folder / "sources")
    program = folder / "fuzz"
    strict = ["-Wall", "-Wextra", "-Werror", "-Wno-unused-function", "-Wno-unused-parameter"]
    words = ["-std=c99", "-g", "-O1", *strict, f"-DFMI={fmi}", *flags]
    subprocess.run([*compiler, *words, "sources/fuzz.c", "-o", "fuzz", "-lm"], cwd=folder, check=True)
    return program


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "fmi", "options"),
    [
        ("single-motor", 2, {}),
        ("single-motor", 3, {}),
        ("single-motor", 2, {"forecast": True, "events": True}),
        ("leg", 3, {"forecast": True, "events": True, "arrays": True}),
    ],
)
def test_random_calls_under_sanitizers(name: str, fmi: int, options: dict[str, bool], tmp_path: Path) -> None:
    flags = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all"]
    program = _harness(name, fmi, tmp_path, flags, **options)
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


# --- states saved, restored and turned into bytes; reset; instances; threads: the same to the last bit


CASES = [("leg", 2, "rk4"), ("leg", 3, "rk4"), ("everything", 3, "rk4"), ("leg", 3, "ros2")]


@pytest.fixture(params=CASES, ids=lambda case: "-".join(map(str, case)))
def case(request: pytest.FixtureRequest, built: Build) -> tuple[Any, FloatArray]:
    """An FMU and rows of inputs for it."""
    exported = built(*request.param)
    model = exported.component.model
    return exported, in_kelvin(model, np.abs(steps(model, 60)))


def _run(session: Session, rows: FloatArray) -> FloatArray:
    outputs = []
    for row in rows:
        session.inputs[:] = row
        outputs.append(session.step(1.3).copy())
    return np.array(outputs)


def _state(session: Session) -> Any:
    fmu = session._fmu
    return fmu.getFMUstate() if session._fmi == 2 else fmu.getFMUState()


def _restore(session: Session, state: Any) -> None:
    fmu = session._fmu
    (fmu.setFMUstate if session._fmi == 2 else fmu.setFMUState)(state)
    session.time = float(session.read(["time"])[0])


def _bytes(session: Session, state: Any) -> bytes:
    fmu = session._fmu
    return bytes((fmu.serializeFMUstate if session._fmi == 2 else fmu.serializeFMUState)(state))


def _from_bytes(session: Session, content: bytes) -> Any:
    fmu = session._fmu
    return (fmu.deSerializeFMUstate if session._fmi == 2 else fmu.deserializeFMUState)(content)


@pytest.mark.long
def test_a_restored_state_goes_on_to_the_last_bit(case: tuple[Any, FloatArray]) -> None:
    exported, rows = case
    with Session(exported.path) as session:
        _run(session, rows[:20])
        state = _state(session)
        first = _run(session, rows[20:])
        _restore(session, state)
        assert (_run(session, rows[20:]) == first).all()


@pytest.mark.long
def test_a_state_goes_as_bytes_into_another_instance(case: tuple[Any, FloatArray]) -> None:
    exported, rows = case
    with Session(exported.path) as one, Session(exported.path) as other:
        _run(one, rows[:20])
        content = _bytes(one, _state(one))
        expected = _run(one, rows[20:])
        _restore(other, _from_bytes(other, content))
        assert (_run(other, rows[20:]) == expected).all()


@pytest.mark.long
def test_bytes_of_something_else_are_refused(built: Build) -> None:
    with Session(built("leg").path) as session, Session(built("everything").path) as stranger:
        content = bytearray(_bytes(session, _state(session)))
        with pytest.raises(Exception, match="fmi3DeserializeFMUState"):
            _from_bytes(stranger, bytes(content))
        assert "no state" in stranger.messages[-1] or "another FMU" in stranger.messages[-1]
        content[-9] ^= 1
        with pytest.raises(Exception, match="fmi3DeserializeFMUState"):
            _from_bytes(session, bytes(content))
        assert "damaged" in session.messages[-1]


def test_reset_begins_anew(case: tuple[Any, FloatArray]) -> None:
    exported, rows = case
    with Session(exported.path) as session:
        first = _run(session, rows)
        session.write({exported.component.of("parameter")[0].name: 77.0})
        session.reset()
        assert (_run(session, rows) == first).all()


def test_two_instances_do_not_disturb_each_other(case: tuple[Any, FloatArray]) -> None:
    exported, rows = case
    with Session(exported.path) as session:
        alone = [_run(session, rows)]
        session.reset()
        alone.append(_run(session, rows[::-1]))
    with Session(exported.path) as one, Session(exported.path) as other:
        mixed: list[list[FloatArray]] = [[], []]
        for first, second in zip(rows, rows[::-1], strict=True):
            mixed[0].append(_run(one, first[None])[0])
            mixed[1].append(_run(other, second[None])[0])
    assert (np.array(mixed) == np.array(alone)).all()


def test_eight_threads_give_what_one_gives(case: tuple[Any, FloatArray]) -> None:
    exported, rows = case
    many = np.tile(rows, (20, 1))
    scales = np.linspace(0.3, 1.0, 8)
    driven = [np.where(many > 200, many, many * scale) for scale in scales]
    with ExitStack() as stack:
        sessions = [stack.enter_context(Session(exported.path)) for _ in scales]
        with ThreadPoolExecutor(8) as pool:
            together = list(pool.map(_run, sessions, driven))
        for session, expected, inputs in zip(sessions, together, driven, strict=True):
            session.reset()
            assert (_run(session, inputs) == expected).all()
