"""A model's steps and their derivatives as machine code, where a C compiler is there."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache
from importlib.resources import files

import casadi as ca
import numpy as np

from lptn.arrays import FloatArray
from lptn.c_library import shared_library
from lptn.model import Model

_ONCE = ("-O3",)
# A model's own functions are a small part of the work, and there are many models in a search.
_EACH = ("-O1",)


class _Shape(ctypes.Structure):
    """The struct `shape` of kernel.c."""

    _fields_ = [
        ("rates", ctypes.c_void_p),
        ("slopes", ctypes.c_void_p),
        *((name, ctypes.c_longlong) for name in ("states", "core", "chosen", "nonzeros_a", "nonzeros_b")),
        ("pattern", ctypes.c_void_p),
        *((name, ctypes.c_longlong) for name in ("arguments", "results", "integers", "doubles")),
    ]


class Kernel:
    """Compiled steps of one model.

    Args:
        model: the model.
        core: how many leading states to differentiate; those behind them must not act back on these.
        chosen: indices of the parameters to differentiate by.

    Raises:
        OSError: no compiler, or its result can't be loaded.
        subprocess.CalledProcessError: the compiler failed.
    """

    def __init__(self, model: Model, core: int, chosen: Sequence[int]) -> None:
        x, u, p, rates, _ = model.symbols
        by_state, by_parameter = ca.jacobian(rates[:core], x[:core]), ca.jacobian(rates[:core], p[list(chosen)])
        nonzeros = [ca.densify(rates), *by_state.nonzeros(), *by_parameter.nonzeros()]
        functions = [
            ca.Function("rates", [x, u, p], [ca.densify(rates)]),
            ca.Function("slopes", [x, u, p], [ca.cse(ca.densify(ca.vertcat(*nonzeros)))]),  # type: ignore[call-overload]
        ]
        self._functions = ctypes.CDLL(str(shared_library({"model.c": _source(functions)}, "model.c", _EACH)))
        self._library = _stepping()
        triplets = [np.array(each.sparsity().get_triplet(), dtype=np.int64) for each in (by_state, by_parameter)]
        self._pattern = np.concatenate([each.ravel() for each in triplets])
        sizes = ((each.sz_arg(), each.sz_res(), each.sz_iw(), each.sz_w()) for each in functions)
        needed = [max(size) for size in zip(*sizes, strict=True)]
        self._shape = _Shape(
            ctypes.cast(self._functions.rates, ctypes.c_void_p),
            ctypes.cast(self._functions.slopes, ctypes.c_void_p),
            x.numel(),
            core,
            len(chosen),
            by_state.nnz(),
            by_parameter.nnz(),
            self._pattern.ctypes.data,
            *needed,
        )

    def run(
        self, start: FloatArray, inputs: FloatArray, p: FloatArray, step: float, parts: int, moved: FloatArray | None
    ) -> tuple[FloatArray, FloatArray]:
        """States, and their derivatives, at the n + 1 ends of n steps.

        Args:
            start: initial states, shape (states,).
            inputs: held over each step, shape (inputs, n).
            p: parameters, shape (m,).
            step: length of a step [s].
            parts: internal Runge-Kutta steps of each step.
            moved: derivatives at the start, shape (core, chosen + core); `None` for the states alone.

        Returns:
            States, shape (n + 1, states), and derivatives, shape (n + 1, core, chosen + core), empty without `moved`.
        """
        shape, n = self._shape, inputs.shape[1]
        states = np.empty((n + 1, shape.states))
        states[0] = start
        followed = np.empty((0 if moved is None else n + 1, shape.core, shape.chosen + shape.core))
        if moved is not None:
            followed[0] = moved
        held, parameters = np.ascontiguousarray(inputs.T), np.ascontiguousarray(p)
        work = np.empty(int(self._library.working_doubles(ctypes.byref(shape))))
        pointers = [(ctypes.c_void_p * max(size, 1))() for size in (shape.arguments, shape.results)]
        integers = (ctypes.c_longlong * max(shape.integers, 1))()
        self._library.run(
            ctypes.byref(shape),
            ctypes.c_longlong(n),
            ctypes.c_longlong(parts),
            ctypes.c_double(step / parts),
            ctypes.c_longlong(inputs.shape[0]),
            _address(held),
            _address(parameters),
            _address(states),
            None if moved is None else _address(followed),
            *pointers,
            integers,
            _address(work),
        )
        return states, followed


def _address(array: FloatArray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)


def _source(functions: list[ca.Function]) -> str:
    generator = ca.CodeGenerator("model", {"with_header": False, "casadi_int": "long long"})
    for function in functions:
        generator.add(function)
    return str(generator.dump())


@cache
def _stepping() -> ctypes.CDLL:
    """The steps of kernel.c."""
    source = files("lptn").joinpath("kernel.c").read_text(encoding="utf-8")
    library = ctypes.CDLL(str(shared_library({"kernel.c": source}, "kernel.c", _ONCE)))
    library.working_doubles.restype = ctypes.c_longlong
    library.run.restype = None
    return library
