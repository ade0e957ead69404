"""A model's Runge-Kutta steps, with their derivatives, in machine code that is compiled once for all models.

A model comes to `kernel.c` as data: the operations that CasADi makes of its rates and of their derivatives. So a search
that tries a hundred candidates compiles nothing, and what depends on parameters alone is worked out once a run.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from itertools import accumulate
from subprocess import CalledProcessError
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from lptn.basics.arrays import FloatArray, IntArray
from lptn.basics.c_library import shared_library
from lptn.model.array_function import ArrayFunction
from lptn.model.model import Model

# --- A CasADi function as a list of operations ----------------------------------------------------

OPERATIONS = {
    "ASSIGN": "a",
    "ADD": "a + b",
    "SUB": "a - b",
    "MUL": "a * b",
    "DIV": "a / b",
    "NEG": "-a",
    "EXP": "exp(a)",
    "LOG": "log(a)",
    "POW": "pow(a, b)",
    "CONSTPOW": "pow(a, b)",
    "SQRT": "sqrt(a)",
    "SQ": "a * a",
    "TWICE": "2 * a",
    "INV": "1 / a",
    "SIN": "sin(a)",
    "COS": "cos(a)",
    "TAN": "tan(a)",
    "ASIN": "asin(a)",
    "ACOS": "acos(a)",
    "ATAN": "atan(a)",
    "ATAN2": "atan2(a, b)",
    "SINH": "sinh(a)",
    "COSH": "cosh(a)",
    "TANH": "tanh(a)",
    "ASINH": "asinh(a)",
    "ACOSH": "acosh(a)",
    "ATANH": "atanh(a)",
    "LOG1P": "log1p(a)",
    "EXPM1": "expm1(a)",
    "HYPOT": "hypot(a, b)",
    "ERF": "erf(a)",
    "LT": "a < b",
    "LE": "a <= b",
    "EQ": "a == b",
    "NE": "a != b",
    "NOT": "!a",
    "AND": "a && b",
    "OR": "a || b",
    "IF_ELSE_ZERO": "a ? b : 0",
    "FLOOR": "floor(a)",
    "CEIL": "ceil(a)",
    "FMOD": "fmod(a, b)",
    "REMAINDER": "remainder(a, b)",
    "FABS": "fabs(a)",
    "SIGN": "a < 0 ? -1 : a > 0 ? 1 : a",
    "COPYSIGN": "copysign(a, b)",
    "FMIN": "fmin(a, b)",
    "FMAX": "fmax(a, b)",
}
"""What each of CasADi's operations on one or two numbers is in C; as CasADi's own code generator writes it."""
NUMBERS = {getattr(ca, f"OP_{name}"): name for name in OPERATIONS if hasattr(ca, f"OP_{name}")}
PARAMETERS, INPUTS, STATES, DERIVATIVES = range(4)  # parts of the work: once a run, once a step, in each stage


_DEEPEST = 1 << 32  # operations behind one another
_GIVEN = (-1, 0, 0)  # how an argument or a constant is made


class UnknownOperationError(ValueError):
    """A model has an operation that machine code here does not know."""


class Operations:
    """A function (x, u, p) -> dense column, sorted for `kernel.c`; the same operation on the same values once.

    Values are numbered: arguments, then constants, then operations, each behind its operands.

    Args:
        function: the function.
        rates: how many results come first, and are worked out without the others; all by default.

    Attributes:
        sizes: of x, u and p.
        kinds: CasADi's number of the operation that makes each value; -1 for arguments and constants.
        parts: of the work, to which each operation belongs.
        left, right: its operands; the same value twice where there is one.
        initial: what constants are; 0 for all else.
        results: which values they are.

    Raises:
        UnknownOperationError: the function has an operation that is not in the table above.
    """

    def __init__(self, function: ca.Function, rates: int | None = None) -> None:
        self.sizes: list[int] = [function.numel_in(k) for k in range(3)]
        offsets = [0, *accumulate(self.sizes)]
        # Of each value: its part of the work and its depth there, in one number, and how it is made: the operation and
        # its operands; arguments and constants by none.
        level = (np.repeat([STATES, INPUTS, PARAMETERS], self.sizes) * _DEEPEST).tolist()
        made_by: list[tuple[int, int, int]] = [_GIVEN] * len(level)
        constants: dict[int, float] = {}
        numbers: dict[object, int] = {}
        results = [0] * function.numel_out(0)
        held: dict[int, int] = {}  # which value each place of CasADi's working memory holds
        for k, kind in enumerate(map(function.instruction_id, range(function.n_instructions()))):
            used, made = function.instruction_input(k), function.instruction_output(k)
            if kind in NUMBERS:
                a, b = held[used[0]], held[used[-1]]
                key: object = (new := (kind, a, b))
                deep = max(level[a], level[b]) + 1
            elif kind == ca.OP_OUTPUT:
                results[made[1]] = held[used[0]]
                continue
            elif kind == ca.OP_INPUT:
                held[made[0]] = offsets[used[0]] + used[1]
                continue
            elif kind == ca.OP_CONST:
                constant = function.instruction_constant(k)
                key = repr(constant)  # 0.0 and -0.0 are two
                new, deep = _GIVEN, PARAMETERS * _DEEPEST
                constants[numbers.get(key, len(level))] = constant
            else:
                raise UnknownOperationError(f"operation {kind} of {function.name()}")
            if key not in numbers:
                numbers[key] = len(level)
                level.append(deep)
                made_by.append(new)
            held[made[0]] = numbers[key]

        # Numbered anew: arguments and constants, then operations by part, depth and kind.
        needed = [False] * len(level)
        for result in results[:rates]:
            needed[result] = True
        for value in range(len(level) - 1, offsets[-1] - 1, -1):
            if needed[value]:
                _, a, b = made_by[value]
                needed[a] = needed[b] = True
        kinds, left, right = np.array(made_by).T
        work = np.array([*np.divmod(level, _DEEPEST), kinds])
        work[0, (work[0] == STATES) & ~np.array(needed)] = DERIVATIVES
        work[:, work[2] < 0] = -1
        order = np.lexsort(work[::-1])
        number = np.empty(len(order), dtype=np.int32)
        number[order] = np.arange(len(order))
        self.initial = np.zeros(len(order))
        self.initial[number[list(constants)]] = list(constants.values())
        self.parts, _, self.kinds = work[:, order]
        self.left, self.right = number[left][order], number[right][order]
        self.results = number[results]
        given = int((work[2] < 0).sum())
        sorted_work = work[:, order[given:]]
        same = (np.diff(sorted_work, axis=1) == 0).all(axis=0)
        starts = np.flatnonzero(np.append(True, ~same)[: sorted_work.shape[1]])
        lengths = np.diff(np.append(starts, sorted_work.shape[1]))
        self.groups = np.column_stack([sorted_work[2, starts], lengths]).astype(np.int64)
        self.first = (given + np.searchsorted(sorted_work[0], range(4))).tolist()
        self.bounds = np.searchsorted(sorted_work[0, starts], range(5)).tolist()


# --- What a Runge-Kutta step says of the time within it ---------------------------------------------

MEAN_OF_A_STEP = (1 / 5, 1 / 6, 1 / 10, 1 / 30)
"""The mean of the states over a step of h seconds is its start and h times these shares of its four slopes. A linear
network's mean, (1 - e^-z) / z of a transient in a step of z time constants, comes out to z⁵/720."""


@dataclass(frozen=True)
class Steps:
    """A model stepped through n rows of inputs.

    Args:
        ends: states at the ends of rows, shape (states, n + 1).
        held: states as rows hold them, means or those at their starts, shape (states, n).
        derivatives: of the core states as rows hold them, shape (n, core, chosen + core); empty without any.
        last: of the core states at the end, shape (core, chosen + core); empty without any.
    """

    ends: FloatArray
    held: FloatArray
    derivatives: FloatArray
    last: FloatArray


# --- Machine code that evaluates and steps any model ----------------------------------------------

_FLAGS = ("-O3",)
_OF_MEAN = np.array(MEAN_OF_A_STEP)
_NONE = np.zeros((2, 0), dtype=np.int64)


class _CModel(ctypes.Structure):
    """The struct `model` of kernel.c."""

    _fields_ = [
        *((name, ctypes.c_longlong) for name in ("states", "inputs", "parameters", "values", "results")),
        ("bounds", ctypes.c_longlong * 5),
        ("first", ctypes.c_longlong * 4),
        *((name, ctypes.c_void_p) for name in ("group", "left", "right", "result", "initial")),
        *((name, ctypes.c_longlong) for name in ("core", "chosen", "nonzeros_a", "nonzeros_b")),
        ("pattern", ctypes.c_void_p),
    ]


def _addresses(*arrays: npt.NDArray[Any]) -> list[ctypes.c_void_p]:
    return [ctypes.c_void_p(array.ctypes.data) for array in arrays]


class _Program:
    """A list of operations as `kernel.c` takes it.

    Args:
        library: kernel.c.
        operations: of a function (x, u, p) -> dense column.
        results: which of its results are asked for; all by default.
        core: how many leading states its results are differentiated by.
        chosen: by how many parameters.
        of_state, of_parameter: rows and columns of the derivatives among the results, shape (2, nonzeros) each: of the
            core states' rates by these, and by the parameters.
    """

    def __init__(
        self,
        library: ctypes.CDLL,
        operations: Operations,
        results: IntArray | None = None,
        core: int = 0,
        chosen: int = 0,
        of_state: IntArray = _NONE,
        of_parameter: IntArray = _NONE,
    ) -> None:
        self.library, self._operations = library, operations
        self._results = operations.results if results is None else operations.results[results]
        self._pattern = np.concatenate([pattern.ravel() for pattern in (of_state, of_parameter)]).astype(np.int64)
        self.struct = _CModel(
            *operations.sizes,
            len(operations.initial),
            len(self._results),
            (ctypes.c_longlong * 5)(*operations.bounds),
            (ctypes.c_longlong * 4)(*operations.first),
            *_addresses(operations.groups, operations.left, operations.right, self._results, operations.initial),
            core,
            chosen,
            of_state.shape[1],
            of_parameter.shape[1],
            *_addresses(self._pattern),
        )

    def at(self, x: FloatArray, u: FloatArray, p: FloatArray) -> FloatArray:
        """Results at n points, shape (n, results), of x (states, n), u (inputs, n) and p (m,)."""
        model, n = self.struct, x.shape[1]
        arguments = [np.ascontiguousarray(argument, dtype=np.float64) for argument in (x.T, u.T, p)]
        expected = [(n, model.states), (n, model.inputs), (model.parameters,)]
        if (shapes := [argument.shape for argument in arguments]) != expected:
            raise ValueError(f"arguments of shapes {shapes} in place of {expected}")
        results, work = np.empty((n, model.results)), np.empty(model.values)
        self.library.at_points(ctypes.byref(model), ctypes.c_longlong(n), *_addresses(*arguments, results, work))
        return results


class Rates:
    """A model's rates and their derivatives as operations, which serve whatever of these derivatives is wanted.

    Args:
        model: the model.
        core: how many leading states to differentiate; those behind them must not act back on these.
        parameters: indices of the parameters to differentiate by.

    Raises:
        UnknownOperationError: the model has an operation that machine code here does not know.
    """

    def __init__(self, model: Model, core: int, parameters: Sequence[int]) -> None:
        x, u, p, rates, _ = model.symbols
        by_state, by_parameter = ca.jacobian(rates[:core], x[:core]), ca.jacobian(rates[:core], p[list(parameters)])
        nonzeros = ca.vertcat(ca.densify(rates), *by_state.nonzeros(), *by_parameter.nonzeros())  # type: ignore[call-overload]
        self.states, self.core, self.parameters = rates.numel(), core, list(parameters)
        self.of_state, self.of_parameter = _places(by_state), _places(by_parameter)
        self.operations = Operations(ca.Function("rates", [x, u, p], [nonzeros]), self.states)


def _places(matrix: ca.SX) -> IntArray:
    """Rows and columns of what is not zero everywhere, shape (2, nonzeros)."""
    return np.array(matrix.sparsity().get_triplet(), dtype=np.int64).reshape(2, -1)


class Kernel:
    """Compiled steps of one model.

    Args:
        library: kernel.c.
        rates: of the model.
        chosen: indices of the parameters to differentiate by, among those that the rates are differentiated by.
    """

    def __init__(self, library: ctypes.CDLL, rates: Rates, chosen: Sequence[int] = ()) -> None:
        rows, columns = rates.of_parameter
        number = np.full(len(rates.parameters), -1)
        number[[rates.parameters.index(index) for index in chosen]] = range(len(chosen))
        wanted = np.flatnonzero(number[columns] >= 0)
        self._of_state, before = rates.of_state, rates.states + rates.of_state.shape[1]
        results = np.concatenate([np.arange(before), before + wanted])
        of_parameter = np.array([rows[wanted], number[columns[wanted]]])
        self._program = _Program(
            library, rates.operations, results, rates.core, len(chosen), rates.of_state, of_parameter
        )

    def run(
        self,
        start: FloatArray,
        inputs: FloatArray,
        p: FloatArray,
        step: float,
        substeps: int,
        averaged: bool,
        derivative: FloatArray | None = None,
    ) -> Steps:
        """Runge-Kutta steps through n rows.

        Args:
            start: initial states, shape (states,).
            inputs: held over each row, shape (inputs, n).
            p: parameters, shape (m,).
            step: length of a row [s].
            substeps: Runge-Kutta steps in each row.
            averaged: whether rows hold means.
            derivative: of the initial core states, shape (core, chosen + core); `None` for the states alone.
        """
        program, model, n = self._program, self._program.struct, inputs.shape[1]
        ends, means = np.empty((n + 1, model.states)), np.empty((n if averaged else 0, model.states))
        ends[0] = start
        width = model.chosen + model.core
        derivatives = np.empty((n if derivative is not None else 0, model.core, width))
        last = np.empty((0, width)) if derivative is None else np.array(derivative, dtype=float, order="C")
        held, parameters = np.ascontiguousarray(inputs.T), np.ascontiguousarray(p)
        work = np.empty(int(program.library.working_doubles(ctypes.byref(model))))
        to_ends, to_means, to_last, to_derivatives, to_work = _addresses(ends, means, last, derivatives, work)
        program.library.run(
            ctypes.byref(model),
            ctypes.c_longlong(n),
            ctypes.c_longlong(substeps),
            ctypes.c_double(step / substeps),
            *_addresses(_OF_MEAN, held, parameters),
            to_ends,
            to_means if averaged else None,
            None if derivative is None else to_last,
            to_derivatives,
            to_work,
        )
        return Steps(ends.T, means.T if averaged else ends[:-1].T, derivatives, last)

    def slopes(self, x: FloatArray, u: FloatArray, p: FloatArray) -> FloatArray:
        """Derivatives of the core states' rates by these at n points [1/s], shape (n, core, core).

        Args:
            x: shape (states, n).
            u: shape (inputs, n).
            p: shape (m,).
        """
        model = self._program.struct
        stack = np.zeros((x.shape[1], model.core, model.core))
        rows, columns = self._of_state
        nonzeros = self._program.at(x, u, p)[:, model.states : model.states + model.nonzeros_a]
        stack[:, rows, columns] = nonzeros
        return stack


_LIKELY = "parameters that derivatives are made by"


def kernel(model: Model, core: int | None = None, chosen: Sequence[int] = ()) -> Kernel | None:
    """Compiled steps of a model, made once for it and all its copies at other values.

    Args:
        core: how many leading states to differentiate; those behind them must not act back on these. All by default.
        chosen: indices of the parameters to differentiate by.

    Returns:
        `None` where no C compiler works, or the model has an operation that is not known here.
    """
    core = len(model.states) if core is None else core
    return model.made_once(("kernel", core, tuple(chosen)), lambda: _kernel(model, core, chosen))


def _kernel(model: Model, core: int, chosen: Sequence[int]) -> Kernel | None:
    compiled, parameters = library(), differentiated_with(model, chosen)
    try:
        if compiled is None:
            return None
        rates = model.made_once(("rates", core, tuple(parameters)), lambda: Rates(model, core, parameters))
        return Kernel(compiled, rates, chosen)
    except UnknownOperationError:
        return None


def differentiated_with(model: Model, chosen: Sequence[int]) -> list[int]:
    """The parameters that derivatives are made by: all that a fit or a prediction may ask for.

    Making derivatives takes as long as some fits do; those of a fit are made once. Steps without them skip their
    operations. Of a model that is asked once, see `asked_once`, those that are wanted.
    """
    likely = model.made_once(_LIKELY, lambda: [k for k, parameter in enumerate(model.parameters) if parameter.free])
    return likely if set(chosen).issubset(likely) else list(chosen)


def asked_once(model: Model) -> Model:
    """The model, of which no derivatives are made but those that are wanted."""
    model.made_once(_LIKELY, list)
    return model


class AtPoints:
    """A function of (x, u, p) at many points at once; by CasADi's interpreter where there is no machine code.

    Args:
        function: (x, u, p) -> a dense matrix.
    """

    def __init__(self, function: ca.Function) -> None:
        compiled = library()
        self._function, self._maps = function, dict[int, ArrayFunction]()
        try:
            self._program = None if compiled is None else _Program(compiled, Operations(function))
        except UnknownOperationError:
            self._program = None

    def __call__(self, x: FloatArray, u: FloatArray, p: FloatArray) -> FloatArray:
        """The results at n points, shape (n, rows, columns).

        Args:
            x: shape (states, n).
            u: shape (inputs, n).
            p: common to all points, shape (m,).
        """
        n, (rows, columns) = x.shape[1], self._function.size_out(0)
        if self._program is not None:
            return np.swapaxes(self._program.at(x, u, p).reshape(n, columns, rows), 1, 2)
        if n not in self._maps:
            self._maps[n] = ArrayFunction(self._function, n, common=(2,))
        return np.moveaxis(self._maps[n](x, u, p).reshape(rows, n, columns), 1, 0)


@cache
def library() -> ctypes.CDLL | None:
    """kernel.c, compiled and loaded; `None` where that fails."""
    source = files("lptn.simulate").joinpath("kernel.c").read_text(encoding="utf-8")
    operations = "".join(f"OPERATION({number}, {OPERATIONS[name]})\n" for number, name in NUMBERS.items())
    try:
        path = shared_library({"kernel.c": source, "operations.h": operations}, "kernel.c", _FLAGS)
        compiled = ctypes.CDLL(str(path))
    except (OSError, CalledProcessError):
        return None
    compiled.working_doubles.restype = ctypes.c_longlong
    compiled.run.restype = compiled.at_points.restype = None
    return compiled
