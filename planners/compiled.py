"""C code of the planners compiled for Python, as a robot would compile it."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.c_library import shared_library

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
    library: Path = shared_library(sources, main, _OPTIONS)
    return ctypes.CDLL(str(library))


def c_code(file: str, *functions: ca.Function) -> str:
    """CasADi functions as C, in CasADi's calling convention with `long long` for integers."""
    generator = ca.CodeGenerator(file, {"with_header": False, "casadi_int": "long long"})
    for function in functions:
        generator.add(function)
    return f"{_QUIET}{generator.dump()}{_LOUD}"


class CompiledFunction:
    """A CasADi function of vectors with one result as machine code, called without copies.

    Args:
        function: CasADi's function.

    Raises:
        OSError: no C compiler.
        subprocess.CalledProcessError: the compiler failed.
    """

    def __init__(self, function: ca.Function) -> None:
        library = compiled({"function.c": c_code("function.c", function)}, "function.c")
        self._function: Any = getattr(library, function.name())
        self._arguments = (ctypes.c_void_p * max(1, function.sz_arg()))()
        self._results = (ctypes.c_void_p * max(1, function.sz_res()))()
        self._integers = (ctypes.c_longlong * max(1, function.sz_iw()))()
        self._doubles = (ctypes.c_double * max(1, function.sz_w()))()
        self._size = function.nnz_out(0)

    def __call__(self, *arguments: FloatArray) -> FloatArray:
        """The result for arguments in the function's order, shape (size of the result,)."""
        kept = [np.ascontiguousarray(argument, dtype=float) for argument in arguments]
        result = np.empty(self._size)
        for number, argument in enumerate(kept):
            self._arguments[number] = argument.ctypes.data
        self._results[0] = result.ctypes.data
        self._function(self._arguments, self._results, self._integers, self._doubles, 0)
        return result
