"""Libraries for other platforms, built here and run where an emulator can be had: the same digits everywhere."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path
from zipfile import ZipFile

import pytest

from lptn.fmu import Exported, export
from lptn.fmu.compile import PLATFORMS, universal
from lptn.model import Model
from tests.fmu.conftest import network

HOST = Path(__file__).with_name("host.c")
EMULATORS = {
    "linux64": [],
    "linux-aarch64": ["qemu-aarch64", "-L", "/usr/aarch64-linux-gnu"],
    "win64": ["wine"],
}
pytest.importorskip("ziglang")


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Exported, Path]:
    """An FMU for all platforms, unpacked; the first Windows build takes minutes."""
    folder = tmp_path_factory.mktemp("platforms")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(folder))
        done = export(Model(network("everything")), folder / "x.fmu", platforms=list(PLATFORMS), compiler="zig")
    with ZipFile(done.path) as archive:
        archive.extractall(folder / "unpacked")
    return done, folder / "unpacked"


def _run_on(platform: str, exported: Exported, folder: Path) -> str:
    target = PLATFORMS[platform]
    program = folder / f"host-{platform}{'.exe' if platform == 'win64' else ''}"
    words = [sys.executable, "-m", "ziglang", "cc", "-target", target.target, "-O2", "-o", str(program), str(HOST)]
    libraries = [] if platform == "win64" else ["-ldl"]
    subprocess.run([*words, f"-I{folder / 'sources'}", *libraries], check=True, capture_output=True)
    component = exported.component
    token = next(
        line.split('"')[1]
        for line in (folder / "sources" / "config.h").read_text().splitlines()
        if "define TOKEN" in line
    )
    library = f"binaries/{target.folder3}/everything{target.suffix}".replace("everything", _identifier(folder))
    counts = [component.first("input"), len(component.of("input")), 1, len(component.variables) - 1]
    command = [*EMULATORS[platform], str(program), library, token, "3000", *map(str, counts)]
    environment = os.environ | {"WINEDEBUG": "-all", "WINEPREFIX": str(folder / "wine")}
    done = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, env=environment, check=False, timeout=300
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def _identifier(folder: Path) -> str:
    return next((folder / "binaries").rglob("*.so")).stem


@pytest.mark.slow
@pytest.mark.parametrize("platform", ["linux-aarch64", "win64"])
def test_other_platforms_print_the_same_digits(platform: str, exported: tuple[Exported, Path]) -> None:
    if shutil.which(EMULATORS[platform][0]) is None:
        pytest.skip(f"no {EMULATORS[platform][0]} on this machine")
    expected = [float(line) for line in _run_on("linux64", *exported).split()]
    found = [float(line) for line in _run_on(platform, *exported).split()]
    assert len(expected) == len(exported[0].component.variables) - 1
    # Everything but `exp` and `pow`, which each C library rounds its own way, is the same to the last bit.
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)


@pytest.mark.slow
def test_libraries_for_all_platforms_are_what_they_claim(exported: tuple[Exported, Path]) -> None:
    starts = {"linux": b"\x7fELF", "windows": b"MZ", "darwin": b"\xcf\xfa\xed\xfe"}
    found = {
        path.parent.name: path.read_bytes()[:4] for path in (exported[1] / "binaries").rglob("*") if path.is_file()
    }
    assert set(found) == {each.folder3 for each in PLATFORMS.values()}
    for folder, start in found.items():
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
    monkeypatch.setattr("lptn.fmu.exporter.compile_all", lambda *words: {each: each.name.encode() for each in words[3]})
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
