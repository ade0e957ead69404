"""A model stepped along its inputs, with derivatives; in machine code once that pays."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from subprocess import CalledProcessError

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.c_library import shared_library
from lptn.model.model import Model

# --- Derivatives of rates and readings, evaluated at many points of a trajectory at once ----------


class Jacobians:
    """Derivatives of a model's rates and readings.

    Args:
        model: the model to differentiate.
        core: how many leading states count.
        chosen: indices of the parameters to differentiate by.
    """

    def __init__(self, model: Model, core: int, chosen: Sequence[int]) -> None:
        x, u, p, rates, readings = model.symbols
        states, parameters = x[:core], p[list(chosen)]
        self._rates = _Stacked([x, u, p], [(rates[:core], states), (rates[:core], parameters)])
        self._readings = _Stacked([x, p], [(readings, states), (readings, parameters)])

    def rates(self, x: FloatArray, u: FloatArray, p: FloatArray) -> list[FloatArray]:
        """Stacks of d rate/dx, shape (n, core, core), and d rate/dp, shape (n, core, chosen)."""
        return self._rates(x, u, np.repeat(p[:, None], x.shape[1], axis=1))

    def readings(self, x: FloatArray, p: FloatArray) -> list[FloatArray]:
        """Stacks of d reading/dx, shape (n, nodes, core), and d reading/dp, shape (n, nodes, chosen)."""
        return self._readings(x, np.repeat(p[:, None], x.shape[1], axis=1))


class _Stacked:
    """Sparse Jacobians of several expressions, evaluated over columns of arguments into dense stacks."""

    def __init__(self, arguments: list[ca.SX], pairs: list[tuple[ca.SX, ca.SX]]) -> None:
        jacobians = [ca.jacobian(expression, variable) for expression, variable in pairs]
        self._shapes = [jacobian.shape for jacobian in jacobians]
        self._patterns = [
            np.array(jacobian.sparsity().get_triplet(), dtype=int).reshape(2, -1) for jacobian in jacobians
        ]
        entries = [entry for jacobian in jacobians for entry in jacobian.nonzeros()]
        nonzeros = ca.vertcat(*entries)  # type: ignore[call-overload]
        self._function = ca.Function("nonzeros", arguments, [ca.densify(nonzeros)])
        self._maps: dict[int, ca.Function] = {}

    def __call__(self, *arguments: FloatArray) -> list[FloatArray]:
        n = arguments[0].shape[1]
        mapped = self._maps.setdefault(n, self._function.map(n))
        values = mapped(*arguments).full().T.reshape(n, -1)
        stacks, start = [], 0
        for (rows, columns), shape in zip(self._patterns, self._shapes, strict=True):
            stack = np.zeros((n, *shape))
            stack[:, rows, columns] = values[:, start : start + len(rows)]
            start += len(rows)
            stacks.append(stack)
        return stacks


# --- A model's steps and their derivatives as machine code, where a C compiler is there -----------


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
    source = files("lptn.simulate").joinpath("kernel.c").read_text(encoding="utf-8")
    library = ctypes.CDLL(str(shared_library({"kernel.c": source}, "kernel.c", _ONCE)))
    library.working_doubles.restype = ctypes.c_longlong
    library.run.restype = None
    return library


# --- A model stepped along its inputs, with or without derivatives: in machine code once that pays ---


_WORTH = 1_000  # steps with derivatives after which compiling, a fifth of a second, has been worth it
_CHUNK = 256  # internal steps that CasADi's interpreter differentiates at once


class Stepper:
    """Runge-Kutta steps of one model, with derivatives by the same parameters each time.

    CasADi's interpreter takes the first steps. A model that is stepped often gets compiled on the way, if a C
    compiler is there: a fit of a whole robot then runs ten times as fast.

    Args:
        model: the model.
        core: how many leading states to differentiate; those behind them must not act back on these.
        chosen: indices of the parameters to differentiate by.
    """

    def __init__(self, model: Model, core: int, chosen: Sequence[int]) -> None:
        self.model, self.core, self.chosen = model, core, tuple(chosen)
        self.jacobians = Jacobians(model, core, chosen)
        self._steps_before_compiling: float = _WORTH
        self._kernel: Kernel | None = None

    def compile(self) -> bool:
        """Compile now; whether there is machine code to run."""
        self._steps_before_compiling = float("inf")  # where it fails once it would fail again
        try:
            self._kernel = self.model.made_once(
                ("kernel", self.core, self.chosen), lambda: Kernel(self.model, self.core, self.chosen)
            )
        except (OSError, CalledProcessError):
            return False
        self.model.made_once("any kernel", lambda: self._kernel)
        return True

    def follow(
        self, start: FloatArray, moved: FloatArray, inputs: FloatArray, p: FloatArray, step: float, parts: int
    ) -> tuple[FloatArray, FloatArray]:
        """States, and their derivatives, at the n + 1 ends of n steps.

        Args:
            start: initial states, shape (states,).
            moved: their derivatives, shape (core, chosen + core).
            inputs: held over each step, shape (inputs, n).
            p: parameters, shape (m,).
            step: length of a step [s].
            parts: internal Runge-Kutta steps of each.

        Returns:
            Shapes (states, n + 1) and (n + 1, core, chosen + core).
        """
        self._steps_before_compiling -= inputs.shape[1] * parts
        if self._steps_before_compiling < 0:
            self.compile()
        if self._kernel is not None:
            states, followed = self._kernel.run(start, inputs, p, step, parts, moved)
            return states.T, followed
        return self._interpreted(start, moved, np.repeat(inputs, parts, axis=1), p, step / parts, parts)

    def _interpreted(
        self, start: FloatArray, moved: FloatArray, inputs: FloatArray, p: FloatArray, h: float, parts: int
    ) -> tuple[FloatArray, FloatArray]:
        path = self.model.run(inputs.shape[1])(start, inputs, p, h).full()
        states = np.hstack([start[:, None], path])
        followed = np.empty((inputs.shape[1] // parts + 1, *moved.shape))
        followed[0] = moved
        for first in range(0, inputs.shape[1], _CHUNK):
            window = slice(first, min(first + _CHUNK, inputs.shape[1]))
            transition, forcing = self._discrete(states[:, window], inputs[:, window], p, h)
            for k in range(window.stop - window.start):
                moved = transition[k] @ moved
                moved[:, : len(self.chosen)] += forcing[k]
                if (first + k + 1) % parts == 0:
                    followed[(first + k + 1) // parts] = moved
        return states[:, ::parts], followed

    def _discrete(self, x: FloatArray, u: FloatArray, p: FloatArray, h: float) -> tuple[FloatArray, FloatArray]:
        """Derivative of each RK4 step by the state and by the parameters, stacked over the steps."""
        rate = self.model.made_once(("rates", x.shape[1]), lambda: self.model.rhs.map(x.shape[1]))
        repeated = np.repeat(p[:, None], x.shape[1], axis=1)
        point = x
        by_state, by_parameter = self.jacobians.rates(point, u, p)
        state_sum, parameter_sum = by_state.copy(), by_parameter.copy()
        identity = np.eye(by_state.shape[1])
        stage_state, stage_parameter = by_state, by_parameter
        for share, weight in ((h / 2, 2.0), (h / 2, 2.0), (h, 1.0)):
            point = x + share * rate(point, u, repeated).full()
            a, b = self.jacobians.rates(point, u, p)
            stage_parameter = b + share * (a @ stage_parameter)
            stage_state = a @ (identity + share * stage_state)
            state_sum += weight * stage_state
            parameter_sum += weight * stage_parameter
        return identity + h / 6 * state_sum, h / 6 * parameter_sum


def stepper(model: Model, core: int, chosen: Sequence[int]) -> Stepper:
    """The stepper of a model, made once for it and all its copies at other values."""
    return model.made_once(("stepper", core, tuple(chosen)), lambda: Stepper(model, core, chosen))


def states_along(
    model: Model, start: FloatArray, inputs: FloatArray, p: FloatArray, step: float, parts: int
) -> FloatArray:
    """States at the n + 1 ends of n steps, shape (states, n + 1); arguments as for `Stepper.follow`."""
    kernel = model.made.get("any kernel")
    if kernel is not None:
        return np.ascontiguousarray(kernel.run(start, inputs, p, step, parts, None)[0].T)
    fine = np.repeat(inputs, parts, axis=1)
    path = model.run(fine.shape[1])(start, fine, p, step / parts).full()
    return np.hstack([start[:, None], path[:, parts - 1 :: parts]])
