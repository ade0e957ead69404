"""C sources to shared libraries: for this machine and, with the package `ziglang`, for others."""

from __future__ import annotations

import logging
import os
import platform
import shlex
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

from lptn.basics.errors import InputError

Compiler = Literal["auto", "zig", "cc"]
_FLAGS = (
    "-std=c99",
    "-O2",
    "-fPIC",
    "-fvisibility=hidden",
    "-ffp-contract=off",  # the same digits on every platform
    "-shared",
)
_TIMEOUT = 1200.0  # s; the first build for Windows makes its C library
_PATIENCE = 20.0  # s; a build takes 2 s where the compiler has the platform's C library, 20 s with admissible torques
_PATIENTLY = (
    "%s: still compiling. The first build for it on a machine also makes its C library, which takes %s; "
    "later ones take seconds"
)
_log = logging.getLogger("lptn.fmu")


@dataclass(frozen=True)
class Platform:
    """A platform.

    Args:
        name: what the option calls it.
        folder2: its folder in an FMI 2 FMU.
        folder3: its folder in an FMI 3 FMU.
        target: what zig calls it.
        suffix: of a shared library.
    """

    name: str
    folder2: str
    folder3: str
    target: str
    suffix: str


PLATFORMS = {
    target.name: target
    for target in (
        Platform("linux64", "linux64", "x86_64-linux", "x86_64-linux-gnu.2.17", ".so"),
        Platform("linux-aarch64", "aarch64-linux", "aarch64-linux", "aarch64-linux-gnu.2.17", ".so"),
        Platform("win64", "win64", "x86_64-windows", "x86_64-windows-gnu", ".dll"),
        Platform("darwin-x86_64", "darwin64", "x86_64-darwin", "x86_64-macos", ".dylib"),
        Platform("darwin-arm64", "darwin64", "aarch64-darwin", "aarch64-macos", ".dylib"),
    )
}
_ALIASES = {"darwin64": "darwin-x86_64", "win-x86_64": "win64", "linux-x86_64": "linux64"} | {
    target.folder3: target.name for target in PLATFORMS.values()
}


def platforms_of(names: Sequence[str] | None) -> list[Platform]:
    """The platforms of an option; this machine's where it is `None`, none where it is empty.

    Raises:
        InputError: an unknown platform.
    """
    if names is None:
        return [host()]
    targets = []
    for name in names:
        target = PLATFORMS.get(_ALIASES.get(name, name))
        if target is None:
            raise InputError("command line", "--platforms", f"'{name}'", f"some of {', '.join(PLATFORMS)}, or source")
        targets.append(target)
    return list(dict.fromkeys(targets))


def host() -> Platform:
    """This machine's platform.

    Raises:
        InputError: it is none of `PLATFORMS`.
    """
    machine = {"amd64": "x86_64", "arm64": "aarch64"}.get(platform.machine().lower(), platform.machine().lower())
    system = {"win32": "windows"}.get(sys.platform, sys.platform)
    name = f"{machine}-{system}"
    if name not in _ALIASES:
        raise InputError("this machine", "platform", name, f"one of {', '.join(PLATFORMS)}, or --platforms source")
    return PLATFORMS[_ALIASES[name]]


def compile_all(
    sources: Mapping[str, bytes], main: str, identifier: str, platforms: Sequence[Platform], compiler: Compiler = "auto"
) -> dict[Platform, bytes]:
    """The shared library for each platform.

    Args:
        sources: contents by file name.
        main: the one file to compile; it takes in the others.
        identifier: the libraries' name without suffix.
        compiler: `zig`; `cc`, the C compiler of this machine (environment variable CC); `auto`, zig where it is there.

    Raises:
        InputError: no compiler for a platform, or it fails.
    """
    # First: nothing is built where one is missing.
    commands = {target: _command(target, compiler) for target in platforms}
    with tempfile.TemporaryDirectory(prefix="lptn-fmu-") as name:
        folder = Path(name)
        for path, content in sources.items():
            (folder / path).write_bytes(content)
        return {target: _compile(folder, main, identifier, target, command) for target, command in commands.items()}


def _command(target: Platform, compiler: Compiler) -> list[str]:
    if compiler != "cc" and find_spec("ziglang") is not None:
        return [sys.executable, "-m", "ziglang", "cc", "-target", target.target]
    if compiler == "zig":
        raise InputError(target.name, "compiler", "no ziglang package", "pip install 'lptn[fmu]'")
    local, remedy = local_compiler(), "pip install 'lptn[fmu]', or --platforms source"
    if target != host():
        raise InputError(target.name, "compiler", "no ziglang package, which builds for other platforms", remedy)
    if local is None:
        raise InputError(target.name, "compiler", "neither the ziglang package nor a C compiler", remedy)
    return local


def local_compiler() -> list[str] | None:
    """The words that call this machine's C compiler, `None` where there is none."""
    words = shlex.split(os.environ.get("CC", ""))
    if words and shutil.which(words[0]):
        return words
    installed = next((path for path in map(shutil.which, ("cc", "gcc", "clang")) if path), None)
    return None if installed is None else [installed]


def _run(words: Sequence[str], folder: Path, target: Platform) -> tuple[int, str]:
    """Run a compiler: its exit code and what it said. Who waits long is told for what.

    Raises:
        InputError: it can't be run, or takes more than `_TIMEOUT`.
    """
    try:
        with subprocess.Popen(
            words, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
        ) as running:
            try:
                try:
                    _, said = running.communicate(timeout=_PATIENCE)
                except subprocess.TimeoutExpired:
                    _log.warning(_PATIENTLY, target.name, "some minutes" if target.suffix == ".dll" else "a minute")
                    _, said = running.communicate(timeout=_TIMEOUT)
            except BaseException:
                running.kill()
                raise
            return running.returncode, said
    except (OSError, subprocess.TimeoutExpired) as error:
        raise InputError(target.name, "compiler", str(error), "a working C compiler") from error


def _compile(folder: Path, main: str, identifier: str, target: Platform, command: list[str]) -> bytes:
    (folder / target.name).mkdir()
    library = folder / target.name / f"{identifier}{target.suffix}"
    words = [*command, *_FLAGS, "-o", str(library), main]
    if target.suffix == ".so":
        words += ["-lm", "-Wl,-z,defs", "-s"]
    if target.suffix == ".dll":
        words += ["-s"]
    if target.suffix == ".dylib":
        words += [f"-Wl,-install_name,@rpath/{library.name}"]
    code, said = _run(words, folder, target)
    if code:
        lines = said.splitlines() or ["no message"]
        first = next((line for line in lines if "error" in line), lines[0])
        raise InputError(target.name, "compiler", first[:200], "C code that compiles")
    return library.read_bytes()


def universal(libraries: Sequence[bytes]) -> bytes:
    """Several Mach-O libraries as one file for all: FMI 2 has one folder for both kinds of Mac."""
    align = 14  # pages of 16 KiB
    entries, bodies, position = [], b"", 1 << align
    for library in libraries:
        cpu, sub = struct.unpack_from("<II", library, 4)
        entries.append(struct.pack(">IIIII", cpu, sub, position, len(library), align))
        padded = library + b"\0" * (-len(library) % (1 << align))
        bodies += padded
        position += len(padded)
    head = struct.pack(">II", 0xCAFEBABE, len(libraries)) + b"".join(entries)
    return head.ljust(1 << align, b"\0") + bodies
