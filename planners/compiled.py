"""C code of the planners compiled for Python, as a robot would compile it."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Mapping
from importlib.resources import files
from subprocess import CalledProcessError

import casadi as ca

from lptn.basics.c_library import shared_library
from lptn.model.array_function import ArrayFunction

_OPTIONS = ("-std=c99", "-O2", "-ftree-vectorize", "-ffp-contract=off")
"""Without contraction of products and sums a robot computes the same digits as Python does here."""

_QUIET = """\
#if defined(__GNUC__)
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-parameter" /* CasADi's functions all have the same parameters */
#endif
"""
_LOUD = """
#if defined(__GNUC__)
#pragma GCC diagnostic pop
#endif
"""


def compiled(sources: Mapping[str, str], main: str) -> ctypes.CDLL:
    """A library of C sources, loaded.

    Args:
        sources: contents by file name.
        main: the one to compile; it includes the others.

    Raises:
        OSError: no C compiler, or the cache of libraries can't be used.
        subprocess.CalledProcessError: the compiler failed.
    """
    return ctypes.CDLL(str(shared_library(sources, main, _OPTIONS)))


def c_files(room: str, names: Iterable[str]) -> dict[str, str]:
    """C files as they stand in the folder `c` of a room of the planners, contents by name."""
    folder = files(f"lptn.planners.{room}").joinpath("c")
    return {name: folder.joinpath(name).read_text(encoding="utf-8") for name in names}


def c_code(file: str, *functions: ca.Function) -> str:
    """CasADi functions as C, in CasADi's calling convention with `long long` for integers."""
    generator = ca.CodeGenerator(file, {"with_header": False, "casadi_int": "long long"})
    for function in functions:
        generator.add(function)
    return f"{_QUIET}{generator.dump()}{_LOUD}"


def compiled_function(function: ca.Function) -> ArrayFunction:
    """A CasADi function of dense vectors with one result as machine code, where it can be compiled; else as it is.

    Without a C compiler CasADi's interpreter takes twenty times as long.
    """
    sources = {"function.c": c_code("function.c", function)}
    try:
        library = shared_library(sources, "function.c", _OPTIONS)
    except (OSError, CalledProcessError):
        return ArrayFunction(function)
    return ArrayFunction(ca.external(function.name(), str(library)))
