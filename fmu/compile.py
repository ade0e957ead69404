"""C sources to shared libraries: for this machine and, with the package `ziglang`, for others."""

from __future__ import annotations

import logging
import os
import platform
import shutil
import struct
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from typing import Literal

import platformdirs

from lptn.basics.c_library import compiler as compiler_here
from lptn.basics.c_library import run_compiler
from lptn.basics.errors import InputError
from lptn.basics.own_folder import own_folder

Compiler = Literal["auto", "zig", "cc"]
_FLAGS = ("-std=c99", "-O2", "-fPIC", "-fvisibility=hidden", "-ffp-contract=off")  # the same digits on every platform
_ROOM = 100_000_000  # bytes; zig keeps 30 MB for each platform in its cache
_PATIENCE = 20.0  # s; a build takes 2 s, 20 s with admissible torques
_PATIENTLY = "%s: still compiling; a large model or a busy machine takes a minute"
# Linked without zig's own runtime: the code uses nothing of it, and zig would first build it on each machine.
_LINK = ("build-lib", "-dynamic", "-OReleaseFast", "-fstrip", "-fno-compiler-rt", "-fno-ubsan-rt", "-lc")
# Where Windows 10 and later have C's library: the Universal C Runtime. MinGW's own would take minutes to build.
_WINDOWS = {
    "api-ms-win-crt-heap-l1-1-0.dll": "calloc free malloc realloc",
    "api-ms-win-crt-private-l1-1-0.dll": "memchr memcmp memcpy memmove",
    "api-ms-win-crt-stdio-l1-1-0.dll": "__stdio_common_vsprintf",
    "api-ms-win-crt-string-l1-1-0.dll": "memset strcmp strcpy strlen strncmp",
    "api-ms-win-crt-math-l1-1-0.dll": "acos acosh asin asinh atan atan2 atanh cbrt ceil copysign cos cosh erf erfc "
    "exp exp2 expm1 fabs fdim floor fma fmax fmin fmod hypot ldexp log log10 log1p log2 nearbyint pow remainder rint "
    "round sin sinh sqrt tan tanh trunc",
}
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
    local = {target: _local_compiler_for(target, compiler) for target in platforms}
    with tempfile.TemporaryDirectory(prefix="lptn-fmu-") as name:
        folder = Path(name)
        for path, content in sources.items():
            (folder / path).write_bytes(content)
        return {target: _compile(folder, main, identifier, target, words) for target, words in local.items()}


def _local_compiler_for(target: Platform, compiler: Compiler) -> tuple[str, ...] | None:
    """The words that call this machine's own compiler for a platform, `None` where zig builds it.

    Raises:
        InputError: neither can.
    """
    if compiler != "cc" and find_spec("ziglang") is not None:
        return None
    if compiler == "zig":
        raise InputError(target.name, "compiler", "no ziglang package", "pip install 'lptn[fmu]'")
    local, remedy = compiler_here(), "pip install 'lptn[fmu]', or --platforms source"
    if target != host():
        raise InputError(target.name, "compiler", "no ziglang package, which builds for other platforms", remedy)
    if local is None:
        raise InputError(target.name, "compiler", "neither the ziglang package nor a C compiler", remedy)
    return local


def _surroundings(folder: Path) -> dict[str, str]:
    """A compiler's environment variables: zig waits without end for a cache that it can't write, and gets one here."""
    with suppress(OSError):
        if shutil.disk_usage(own_folder(platformdirs.user_cache_path("zig"))).free > _ROOM:
            return dict(os.environ)
    return {"ZIG_GLOBAL_CACHE_DIR": str(folder / "zig"), **os.environ}


def _compile(folder: Path, main: str, identifier: str, target: Platform, local: tuple[str, ...] | None) -> bytes:
    (folder / target.name).mkdir()
    library = folder / target.name / f"{identifier}{target.suffix}"
    if local is not None:
        ending = ["-lm", "-Wl,-z,defs", "-s"] if target.suffix == ".so" else []
        if target.suffix == ".dylib":
            ending = [f"-Wl,-install_name,@rpath/{library.name}"]
        _checked([*local, *_FLAGS, "-shared", "-o", str(library), main, *ending], folder, target)
        return library.read_bytes()
    zig = [sys.executable, "-m", "ziglang"]
    object_file = library.with_suffix(".o")
    _checked([*zig, "cc", "-target", target.target, *_FLAGS, "-c", "-o", str(object_file), main], folder, target)
    if target.suffix == ".dll":
        _link_for_windows(zig, folder, object_file, library, target)
        return library.read_bytes()
    ending = ["-z", "defs"] if target.suffix == ".so" else ["-install_name", f"@rpath/{library.name}"]
    words = [*zig, *_LINK, "-target", target.target, "--name", identifier, str(object_file), f"-femit-bin={library}"]
    _checked([*words, *ending], folder, target)
    return library.read_bytes()


def _link_for_windows(zig: list[str], folder: Path, object_file: Path, library: Path, target: Platform) -> None:
    """A library that needs nothing but itself and the Universal C Runtime; it has nothing to do when it is loaded."""
    own = folder / target.name / "windows.o"
    source = folder / target.name / "windows.c"
    source.write_bytes((files("lptn.fmu") / "c" / "windows.c").read_bytes())
    # Without -fno-builtin the compiler may make vsnprintf from vsnprintf.
    _checked(
        [*zig, "cc", "-target", target.target, *_FLAGS, "-fno-builtin", "-c", "-o", str(own), str(source)],
        folder,
        target,
    )
    imports = []
    for number, (dll, names) in enumerate(_WINDOWS.items()):
        definition, imported = (folder / target.name / f"{number}.{ending}" for ending in ("def", "lib"))
        definition.write_bytes("\n".join([f"LIBRARY {dll}", "EXPORTS", *names.split(), ""]).encode())
        _checked([*zig, "dlltool", "-m", "i386:x86-64", "-d", str(definition), "-l", str(imported)], folder, target)
        imports.append(str(imported))
    words = ["lld-link", "-lldmingw", "-dll", "-noentry", "-machine:x64", "-Brepro", f"-out:{library}"]
    _checked([*zig, *words, str(object_file), str(own), *imports], folder, target)


def _checked(words: Sequence[str], folder: Path, target: Platform) -> None:
    """Run a compiler. Who waits long is told for what.

    Raises:
        InputError: it can't be run, has no end, or fails; its first error is said.
    """
    still = partial(_log.warning, _PATIENTLY, target.name)
    try:
        run_compiler(words, folder, _surroundings(folder), still, _PATIENCE)
    except OSError as error:
        raise InputError(target.name, "compiler", str(error), "a working C compiler") from error
    except subprocess.CalledProcessError as error:
        lines = error.stderr.splitlines() or ["no message"]
        first = next((line for line in lines if "error" in line), lines[0])
        raise InputError(target.name, "compiler", first[:200], "C code that compiles") from error


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
