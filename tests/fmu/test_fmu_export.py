"""What `export` writes: valid XML, names, units, start values, dependencies; archive; libraries for every platform."""

from __future__ import annotations

import os
import platform
import shutil
import subprocess
import sys
from datetime import UTC, datetime
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile

import fmpy
import numpy as np
import pytest
from fmpy import read_model_description
from fmpy.validation import validate_fmu
from lxml import etree

from lptn.basics.c_library import compiler as c_compiler
from lptn.basics.errors import InputError
from lptn.fmu import Exported, Session, export
from lptn.fmu.archive import unit_of
from lptn.fmu.compile import PLATFORMS, compile_all, host, universal
from lptn.fmu.component import Component
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.robots.presets import presets
from tests.builders import capacity, link
from tests.fmu.conftest import Build, network

from lptn.model.network import Network, NodeDeclaration  # isort: skip


@pytest.mark.long
@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize(
    "name",
    [
        "leg",
        "bare",
        *(pytest.param(name, marks=pytest.mark.slow) for name in (*presets(), "everything") if name != "leg"),
    ],
)
def test_fmpy_finds_no_fault(name: str, fmi: int, tmp_path: Path) -> None:
    exported = export(Model(network(name)), tmp_path / "x.fmu", fmi=fmi, platforms=())
    assert validate_fmu(str(exported.path)) == []


@pytest.mark.parametrize("fmi", [2, 3])
def test_names_units_and_start_values(fmi: int, tmp_path: Path) -> None:
    exported = export(
        Model(network("leg")), tmp_path / "x.fmu", fmi=fmi, platforms=(), limits={"*": 70.0, "*_calf": 90.0}, start=31.0
    )
    description = read_model_description(str(exported.path))
    assert description.modelExchange is not None
    assert description.coSimulation is not None
    variables = {variable.name: variable for variable in description.modelVariables}
    calf = variables["FR_calf.temperature"]
    temperature = calf.declaredType
    assert (calf.causality, temperature.unit, temperature.displayUnit) == ("output", "K", "degC")
    assert (temperature.quantity, float(temperature.nominal), float(calf.min)) == ("ThermodynamicTemperature", 300.0, 0)
    assert float(calf.start) == 31.0 + 273.15
    assert variables["der(FR_calf.temperature)"].derivative is calf
    assert float(variables["FR_calf.temperature_limit"].start) == 90.0 + 273.15
    assert float(variables["FR_hip.temperature_limit"].start) == 70.0 + 273.15
    torque = variables["FR_calf.torque"]
    assert (torque.causality, unit_of(torque)) == ("input", "N*m")
    assert "connect the torque" in torque.description
    assert float(description.defaultExperiment.tolerance) == 1e-6
    resistance = variables["FR_hip.to_FR_thigh.resistance"]
    assert (resistance.causality, resistance.variability, float(resistance.start)) == ("parameter", "tunable", 3.0)
    for name in ("FR_calf.copper_loss.heat_flow", "FR_calf.to_ambient.heat_flow", "FR_calf.torque_scale"):
        assert variables[name].causality == "output"
    (kelvin,) = (unit for unit in description.unitDefinitions if unit.name == "K")
    (celsius,) = kelvin.displayUnits
    assert celsius.name == "degC"
    assert 300.0 * float(celsius.factor or 1) + float(celsius.offset) == pytest.approx(26.85)


SCHEMAS = Path(fmpy.__file__).parent / "schema"
CHECKED = {
    2: {"modelDescription.xml": "fmi2/fmi2ModelDescription.xsd"},
    3: {
        "modelDescription.xml": "fmi3/fmi3ModelDescription.xsd",
        "terminalsAndIcons/terminalsAndIcons.xml": "fmi3/fmi3TerminalsAndIcons.xsd",
        "sources/buildDescription.xml": "fmi3/fmi3BuildDescription.xsd",
    },
}


@pytest.mark.long
@pytest.mark.parametrize("fmi", [2, 3])
def test_the_standards_own_schemas_find_no_fault(fmi: int, tmp_path: Path) -> None:
    schemas = {path: etree.XMLSchema(file=str(SCHEMAS / name)) for path, name in CHECKED[fmi].items()}
    for name in (*presets(), "everything", "bare"):
        about = {"author": 'J. "Doe" & Söhne', "copyright": "© 2026 J. Doe", "license": "CC-BY-4.0"}
        exported = export(Model(network(name)), tmp_path / "x.fmu", fmi=fmi, platforms=(), **about)
        with ZipFile(exported.path) as archive:
            for path, schema in schemas.items():
                schema.assertValid(etree.fromstring(archive.read(path)))
            assert archive.read("terminalsAndIcons/icon.png" if fmi == 3 else "model.png").startswith(b"\x89PNG")
            root = etree.fromstring(archive.read("modelDescription.xml"))
        assert {key: root.get(key) for key in about} == about


def test_a_terminal_a_joint_joins_what_is_connected_to_it(tmp_path: Path) -> None:
    exported = export(Model(network("quadruped")), tmp_path / "x.fmu", platforms=())
    with ZipFile(exported.path) as archive:
        root = etree.fromstring(archive.read("terminalsAndIcons/terminalsAndIcons.xml"))
    terminals = {element.get("name"): element for element in root.iter("Terminal")}
    members = {
        name: {member.get("memberName"): member.get("variableName") for member in terminal}
        for name, terminal in terminals.items()
    }
    joints = {name for name, terminal in terminals.items() if terminal.get("terminalKind") == "lptn.joint"}
    assert len(joints) == 12
    for joint in joints:
        wanted = {"torque", "velocity", "powered", "temperature", "to_ambient.heat_flow", "copper_loss.heat_flow"}
        assert wanted <= set(members[joint])
        assert members[joint]["torque"] == f"{joint}.torque"
    assert terminals["ambient"].get("terminalKind") == "lptn.temperature"
    assert members["ambient"] == {"temperature": "ambient.temperature"}
    # Two joints are alike: what fits one terminal fits the other.
    of_one, of_other = ({member for member in members[name] if "to_F" not in member} for name in ("FR_calf", "FL_calf"))
    assert of_one == of_other
    shown = {variable.name for variable in exported.component.variables if variable.causality in ("input", "output")}
    assert {name for terminal in members.values() for name in terminal.values()} == shown


def test_types_are_declared_once(tmp_path: Path) -> None:
    exported = export(Model(network("quadruped")), tmp_path / "x.fmu", platforms=())
    with ZipFile(exported.path) as archive:
        text = archive.read("modelDescription.xml").decode()
    assert text.count('displayUnit="degC"') == 1
    assert text.count('quantity="') < 20
    assert text.count('declaredType="Temperature"') > 20


def test_units_have_the_right_base_exponents(tmp_path: Path) -> None:
    exported = export(Model(network("everything")), tmp_path / "x.fmu", platforms=())
    units = {unit.name: unit.baseUnit for unit in read_model_description(str(exported.path)).unitDefinitions}
    exponents = {
        "K/W": {"kg": -1, "m": -2, "s": 3, "K": 1},
        "N*m*s/rad": {"kg": 1, "m": 2, "s": -1, "rad": -1},
        "ohm": {"kg": 1, "m": 2, "s": -3, "A": -2},
    }
    for name, expected in exponents.items():
        base = units[name]
        powers = {unit: getattr(base, unit) for unit in ("kg", "m", "s", "A", "K", "mol", "cd", "rad")}
        assert {unit: power for unit, power in powers.items() if power} == expected


@pytest.mark.parametrize("fmi", [2, 3])
def test_dependencies_are_those_of_the_numbers(fmi: int, tmp_path: Path) -> None:
    """Each rate moves with exactly the variables that it lists, found by changing one at a time."""
    exported = export(Model(network("everything")), tmp_path / "x.fmu", fmi=fmi, platforms=())
    component = exported.component
    import casadi as ca

    rates = ca.Function("rates", [component.x, component.u, component.p], [component.rates])
    rng = np.random.default_rng(3)
    blocks = [component.of("state"), component.of("input"), component.of("parameter")]
    values = [
        np.array([(v.start or 0.0) * rng.uniform(1.01, 1.1) + (0.7 if v.kind == "input" else 0.0) for v in block])
        for block in blocks
    ]
    moved: dict[str, set[str]] = {variable.name: set() for variable in component.of("rate")}
    for connected in (False, True):  # means of the motion: formed from the raw inputs, and inputs of their own
        values[1] = np.abs(values[1]) if connected else values[1]
        before = rates(*values).full().ravel()
        for block, array in zip(blocks, values, strict=True):
            for row, variable in enumerate(block):
                kept, array[row] = array[row], array[row] * 1.03 + 0.01
                changed = np.flatnonzero(rates(*values).full().ravel() != before)
                array[row] = kept
                for index in changed:
                    moved[component.of("rate")[index].name].add(variable.name)
    description = read_model_description(str(exported.path))
    for parameter in description.derivatives:
        assert {dependency.name for dependency in parameter.dependencies} == moved[parameter.variable.name]


def test_the_archive_holds_sources_documentation_and_the_model(tmp_path: Path) -> None:
    file = tmp_path / "leg.toml"
    file.write_text(presets()["leg"])
    exported = export(file, tmp_path / "x.fmu", platforms=())
    with ZipFile(exported.path) as archive:
        names = set(archive.namelist())
        model = archive.read("resources/model.toml").decode()
        notice = archive.read("documentation/licenses/fmi-headers.txt").decode()
        page = archive.read("documentation/index.html").decode()
    assert model == presets()["leg"]
    assert "Redistribution and use in source and binary forms" in notice
    assert "FR_calf.temperature" in page
    assert {"sources/fmi3.c", "sources/model.c", "sources/buildDescription.xml", "sources/fmi3Functions.h"} <= names
    assert not any(name.endswith((".py", ".pyc")) for name in names)


def test_the_same_model_gives_the_same_bytes(tmp_path: Path) -> None:
    date = datetime(2026, 1, 1, tzinfo=UTC)
    one = export(Model(network("leg")), tmp_path / "one.fmu", platforms=(), date=date)
    other = export(Model(network("leg")), tmp_path / "other.fmu", platforms=(), date=date)
    assert one.path.read_bytes() == other.path.read_bytes()


@pytest.mark.parametrize("fmi", [2, 3])
def test_only_the_interface_is_exported(fmi: int, built: Build, tmp_path: Path) -> None:
    if shutil.which("nm") is None:
        pytest.skip("no nm on this machine")
    with ZipFile(built("leg", fmi).path) as archive:
        (library,) = (name for name in archive.namelist() if name.startswith("binaries/"))
        (tmp_path / "library").write_bytes(archive.read(library))
    done = subprocess.run(
        ["nm", "-D", "--defined-only", str(tmp_path / "library")], capture_output=True, text=True, check=True
    )
    symbols = {line.split()[-1] for line in done.stdout.splitlines()}
    assert len(symbols) > 40
    assert all(symbol.startswith(f"fmi{fmi}") for symbol in symbols)


@pytest.mark.parametrize("face", ["core.inner", "core.outer", "core.front"])
@pytest.mark.parametrize("node", ["arm", "shell"])
def test_a_link_to_a_face_is_called_as_its_heat_flow_is(face: str, node: str) -> None:
    ring = "kind = 'annulus'\ninner_radius = 0.02\nouter_radius = 0.04\nlength = 0.02\nconductivity_radial = 28\n"
    ring += "conductivity_axial = 3\ndensity = 7650\nspecific_heat = 490\n"
    text = f"[model]\nambient = 20\n[nodes.core.element]\n{ring}[nodes.{node}]\ncapacity = 100\n"
    text += "".join(f'[[links]]\nbetween = ["{one}", "{other}"]\n' for one, other in ((face, node), (node, "ambient")))
    exported = Component(Model(parse_model(text, Path("ring.toml")).network))
    flows = {variable.name.removesuffix("heat_flow") for variable in exported.of("output")}
    resistances = {variable.name for variable in exported.of("parameter") if variable.name.endswith("resistance")}
    assert resistances == {f"{flow}resistance" for flow in flows if "to_" in flow}
    assert len(resistances) == 2


def test_names_that_are_no_identifiers_are_quoted(tmp_path: Path) -> None:
    nodes = (
        NodeDeclaration("motor-1", capacity()),
        NodeDeclaration("Hüfte", capacity()),
        NodeDeclaration("ambient", temperature="temperature.ambient"),
    )
    odd = Network("odd names", nodes, (link("motor-1", "ambient"), link("motor-1", "Hüfte")))
    exported = export(Model(odd), tmp_path / "x.fmu", platforms=())
    assert validate_fmu(str(exported.path)) == []
    assert {"'motor-1'.temperature", "H_u00FCfte.temperature"} <= set(exported.variables)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ({"fmi": 1}, "--fmi"),
        ({"platforms": ["amiga"]}, "--platforms"),
        ({"solver": "euler"}, "solver"),
        ({"step": -1.0}, "step"),
        ({"limits": {"tail": 80.0}}, "limits"),
        ({"limits": -300.0}, "limits"),
        ({"step": 1e9}, "ros2"),
    ],
)
def test_what_cannot_be_exported_is_said(words: dict[str, object], said: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=said):
        export(Model(network("leg")), tmp_path / "x.fmu", **{"platforms": (), **words})
    assert not list(tmp_path.iterdir())


def test_a_step_too_long_for_the_model_is_divided_and_said(tmp_path: Path) -> None:
    exported = export(Model(network("leg")), tmp_path / "x.fmu", platforms=(), step=1000.0)
    (note,) = exported.integration.notes
    assert exported.integration.step < 0.5 * exported.integration.fastest
    assert "divided into" in note


def test_without_any_compiler_one_line_says_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lptn.fmu.compile.find_spec", lambda name: None)
    monkeypatch.setattr("lptn.fmu.compile.compiler_here", lambda: None)
    with pytest.raises(InputError, match="source"):
        export(Model(network("leg")), tmp_path / "x.fmu")
    with pytest.raises(InputError, match="ziglang"):
        export(Model(network("leg")), tmp_path / "x.fmu", platforms=["win64", "darwin-arm64"])
    assert not list(tmp_path.iterdir())


def _compiler(monkeypatch: pytest.MonkeyPatch, folder: Path, does: str) -> None:
    """A C compiler that does this before it writes an empty library."""
    script, written = folder / "compiler", "open(sys.argv[sys.argv.index('-o') + 1], 'w').close()"
    script.write_text(f"#!{sys.executable}\nimport os, sys, time\n{does}\n{written}\n")
    script.chmod(0o700)
    monkeypatch.setenv("CC", str(script))


def _compile() -> None:
    assert compile_all({"x.c": b""}, "x.c", "x", [host()], "cc") == {host(): b""}


@pytest.mark.parametrize("kind", ["a full disk", "a file", "a circle of links", "nobody's"])
def test_a_cache_that_zig_can_t_write_is_none(kind: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It would wait for it without end."""
    cache, seen = tmp_path / "cache", tmp_path / "seen"
    monkeypatch.delenv("ZIG_GLOBAL_CACHE_DIR", raising=False)
    monkeypatch.setattr("platformdirs.user_cache_path", lambda name: cache / name)
    _compiler(monkeypatch, tmp_path, f"open({str(seen)!r}, 'w').write(os.environ.get('ZIG_GLOBAL_CACHE_DIR', ''))")
    _compile()
    assert seen.read_text() == ""
    if kind == "a full disk":
        monkeypatch.setattr("lptn.fmu.compile._ROOM", 1 << 62)
    else:
        shutil.rmtree(cache)
    if kind == "a file":
        cache.write_text("")
    if kind == "a circle of links":
        cache.symlink_to(cache)
    if kind == "nobody's":
        cache.symlink_to("/proc/nowhere")
    _compile()
    assert Path(seen.read_text()).name == "zig"
    assert Path(seen.read_text()).parent.name.startswith("lptn-fmu-")


def test_who_waits_for_a_compiler_is_told_for_what(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A large model on a busy machine."""
    monkeypatch.setattr("lptn.fmu.compile._PATIENCE", 0.05)
    _compiler(monkeypatch, tmp_path, "time.sleep(0.4)")
    _compile()
    assert f"{host().name}: still compiling" in caplog.text
    caplog.clear()
    monkeypatch.setattr("lptn.fmu.compile._PATIENCE", 20.0)
    _compiler(monkeypatch, tmp_path, "")
    _compile()
    assert not caplog.text


# --- libraries for other platforms: the same digits everywhere ----------------------------------------


HOST = Path(__file__).with_name("host.c")
EMULATORS = {
    "linux64": [],
    "linux-aarch64": ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"],
    "win64": ["wine"],
}


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Exported, Path]:
    """An FMU for all platforms, unpacked."""
    pytest.importorskip("ziglang")
    folder = tmp_path_factory.mktemp("platforms")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(folder))
        done = export(Model(network("everything")), folder / "x.fmu", platforms=list(PLATFORMS), compiler="zig")
    with ZipFile(done.path) as archive:
        archive.extractall(folder / "unpacked")
    return done, folder / "unpacked"


def _run_on(system: str, exported: Exported, folder: Path) -> str:
    target = PLATFORMS[system]
    program = folder / f"host-{system}{'.exe' if system == 'win64' else ''}"
    words = [sys.executable, "-m", "ziglang", "cc", "-target", target.target, "-O2", "-o", str(program), str(HOST)]
    libraries = [] if system == "win64" else ["-ldl"]
    subprocess.run([*words, f"-I{folder / 'sources'}", *libraries], check=True, capture_output=True)
    component = exported.component
    token = next(
        line.split('"')[1]
        for line in (folder / "sources" / "config.h").read_text().splitlines()
        if "define TOKEN" in line
    )
    library = f"binaries/{target.folder3}/everything{target.suffix}".replace("everything", _identifier(folder))
    counts = [component.of("input")[0].reference, len(component.of("input")), 1, len(component.variables) - 1]
    command = [*EMULATORS[system], str(program), library, token, "3000", *map(str, counts)]
    environment = os.environ | {"WINEDEBUG": "-all", "WINEPREFIX": str(folder / "wine")}
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, env=environment, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def _identifier(folder: Path) -> str:
    return next((folder / "binaries").rglob("*.so")).stem


@pytest.mark.slow
@pytest.mark.parametrize("system", ["linux-aarch64", "win64"])
def test_other_platforms_print_the_same_digits(system: str, exported: tuple[Exported, Path]) -> None:
    if shutil.which(EMULATORS[system][0]) is None:
        pytest.skip(f"no {EMULATORS[system][0]} on this machine")
    expected = [float(line) for line in _run_on("linux64", *exported).split()]
    digits = [float(line) for line in _run_on(system, *exported).split()]
    assert len(expected) == len(exported[0].component.variables) - 1
    # Everything but `exp` and `pow`, which each C library rounds its own way, is the same to the last bit.
    assert digits == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.mark.slow
def test_the_library_for_windows_runs_and_gives_the_digits_of_linux(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Mapped into a Linux program, which gives it the C functions that it imports; it formats messages itself."""
    pytest.importorskip("ziglang")
    compiler = c_compiler()
    if compiler is None or (sys.platform, platform.machine()) != ("linux", "x86_64"):
        pytest.skip("no C compiler, or another machine")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    loader = Path(__file__).with_name("windows.c")
    subprocess.run([*compiler, "-O1", "-o", "windows", str(loader), "-lm"], cwd=tmp_path, check=True)
    done = export(Model(network("everything")), tmp_path / "x.fmu", platforms=["linux64", "win64"], compiler="zig")
    inputs, outputs = done.component.of("input"), done.component.of("state", "rate")
    with ZipFile(done.path) as archive:
        archive.extractall(tmp_path)
        token = ElementTree.fromstring(archive.read("modelDescription.xml")).get("instantiationToken") or ""
    (library,) = (tmp_path / "binaries" / "x86_64-windows").iterdir()
    words = [str(library), token, "100", str(inputs[0].reference), str(len(inputs)), "1", str(len(outputs))]
    ran = subprocess.run([tmp_path / "windows", *words], capture_output=True, text=True, check=True, timeout=60)
    *digits, said = ran.stdout.splitlines()
    with Session(done.path, outputs=[variable.name for variable in outputs]) as session:
        session.inputs[:] = [u if u >= 200 else 1.0 + k % 5 for k, u in enumerate(session.inputs)]
        for _ in range(100):
            session.step(0.1)
        assert [float(text) for text in digits] == pytest.approx(session.outputs, rel=1e-12, abs=1e-12)
    assert f"{inputs[0].name} ({inputs[0].reference}): nan refused" in said


@pytest.mark.slow
def test_libraries_for_all_platforms_are_what_they_claim(exported: tuple[Exported, Path]) -> None:
    starts = {"linux": b"\x7fELF", "windows": b"MZ", "darwin": b"\xcf\xfa\xed\xfe"}
    heads = {
        path.parent.name: path.read_bytes()[:4] for path in (exported[1] / "binaries").rglob("*") if path.is_file()
    }
    assert set(heads) == {target.folder3 for target in PLATFORMS.values()}
    for folder, start in heads.items():
        assert start.startswith(starts[folder.partition("-")[2]])


@pytest.mark.slow
@pytest.mark.parametrize("fmi", [2, 3])
def test_fmpy_compiles_a_source_fmu_by_its_own_description(fmi: int, tmp_path: Path) -> None:
    """Without our flags: what other tools do with the sources."""
    if shutil.which("cmake") is None:
        pytest.skip("no cmake on this machine")
    done = export(Model(network("leg")), tmp_path / "x.fmu", fmi=fmi, platforms=())
    subprocess.run(
        [sys.executable, "-m", "fmpy", "compile", str(done.path)], cwd=tmp_path, check=True, capture_output=True
    )
    with ZipFile(done.path) as archive:
        assert [name for name in archive.namelist() if name.endswith(".so")]


def test_linux_on_arm_is_found_by_importers_of_fmi_2(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """FMI 2 has no name for it: the library also stands where 64-bit Linux is sought, unless that is there itself."""
    monkeypatch.setattr(
        "lptn.fmu.exporter.compile_all", lambda *words: {target: target.name.encode() for target in words[3]}
    )
    folders = {}
    for chosen in (["linux-aarch64"], ["linux-aarch64", "linux64"]):
        done = export(Model(network("bare")), tmp_path / "x.fmu", fmi=2, platforms=chosen)
        with ZipFile(done.path) as archive:
            names = [name for name in archive.namelist() if name.startswith("binaries/")]
            folders[len(chosen)] = {name.split("/")[1]: archive.read(name) for name in names}
    assert folders[1] == {"aarch64-linux": b"linux-aarch64", "linux64": b"linux-aarch64"}
    assert folders[2] == {"aarch64-linux": b"linux-aarch64", "linux64": b"linux64"}


def test_two_mac_libraries_as_one_file() -> None:
    """The head of a universal file, as Apple's <mach-o/fat.h> has it; each part on a page of its own."""
    one, other = (b"\xcf\xfa\xed\xfe" + cpu.to_bytes(4, "little") + bytes(100) for cpu in (0x01000007, 0x0100000C))
    whole = universal([one, other])
    assert whole[:8] == bytes.fromhex("cafebabe00000002")
    for row, library in enumerate((one, other)):
        cpu, _, offset, size, align = (int.from_bytes(whole[8 + 20 * row + 4 * k :][:4], "big") for k in range(5))
        assert cpu == int.from_bytes(library[4:8], "little")
        assert offset % (1 << align) == 0
        assert whole[offset : offset + size] == library
