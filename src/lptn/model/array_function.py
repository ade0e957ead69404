"""CasADi's functions called on NumPy's arrays where they lie, and Python's functions called by CasADi."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np
import numpy.typing as npt

from lptn.basics.arrays import FloatArray


class ArrayFunction:
    """A CasADi function with one dense result.

    CasADi copies each argument into a matrix of its own, and the result back, number by number: of a small function
    called thousands of times that is four fifths of the time. Here it works in NumPy's memory.

    Args:
        function: all its arguments and its result must be dense.
        points: columns of the arguments at which it is evaluated at once, side by side in the result; `None` for the
            function as it is.
        common: numbers of the arguments that are one column for all points.
    """

    def __init__(self, function: ca.Function, points: int | None = None, common: tuple[int, ...] = ()) -> None:
        self._function = function if points is None else function.map("points", "serial", points, list(common), [])
        patterns = [self._function.sparsity_in(k) for k in range(self._function.n_in())]
        if not all(pattern.is_dense() for pattern in [*patterns, self._function.sparsity_out(0)]):
            raise ValueError(f"{function.name()}: an argument or the result is sparse")
        self._sizes = [pattern.numel() for pattern in patterns]
        self._rows, self._columns = self._function.size_out(0)

    def __call__(self, *arguments: npt.ArrayLike) -> FloatArray:
        """The result, shape (rows, columns).

        Raises:
            ValueError: an argument has not the size that the function takes.
        """
        # A buffer of its own for each call: models are shared between threads.
        buffer, evaluate = self._function.buffer()
        # CasADi's matrices lie column by column; the list keeps the memory alive.
        held = [np.ascontiguousarray(np.transpose(argument), dtype=np.float64).reshape(-1) for argument in arguments]
        if [column.size for column in held] != self._sizes:
            raise ValueError(f"arguments of {[column.size for column in held]} numbers in place of {self._sizes}")
        for k, column in enumerate(held):
            buffer.set_arg(k, column.data)  # type: ignore[call-arg]  # CasADi's stubs know pointers only
        result = np.empty((self._columns, self._rows))
        buffer.set_res(0, result.reshape(-1).data)  # type: ignore[call-arg]
        evaluate()
        return result.T


class PythonFunction(ca.Callback):
    """A Python function as a CasADi function.

    What it raises the solver that calls it would swallow: it is kept as `failure`, and the results are NaN.

    Args:
        name: of the function.
        inputs, outputs: patterns of its arguments and results.
        evaluate: the arguments -> the results.
    """

    def __init__(
        self,
        name: str,
        inputs: Sequence[ca.Sparsity],
        outputs: Sequence[ca.Sparsity],
        evaluate: Callable[[list[ca.DM]], list[Any]],
    ) -> None:
        super().__init__()
        self._inputs, self._outputs, self._evaluate = inputs, outputs, evaluate
        self.failure: Exception | None = None
        self.construct(name, {})

    def get_n_in(self) -> int:
        return len(self._inputs)

    def get_n_out(self) -> int:
        return len(self._outputs)

    def get_sparsity_in(self, index: int) -> ca.Sparsity:
        return self._inputs[index]

    def get_sparsity_out(self, index: int) -> ca.Sparsity:
        return self._outputs[index]

    def eval(self, arguments: Sequence[ca.DM]) -> list[Any]:
        try:
            return self._evaluate(list(arguments))
        except Exception as error:
            self.failure = error
            return [ca.DM(pattern, np.nan) for pattern in self._outputs]


def solver_watch(problem: Mapping[str, Any], stops: Callable[[dict[str, ca.DM]], bool]) -> PythonFunction:
    """CasADi's `iteration_callback` for a nonlinear program: `stops` gets what its solver has by name, such as `lam_x`,
    after each iteration, and says whether it ends there."""
    unknowns, rows, given = (problem[name].numel() if name in problem else 0 for name in ("x", "g", "p"))
    sizes = {"x": unknowns, "f": 1, "g": rows, "lam_x": unknowns, "lam_g": rows, "lam_p": given}
    names = [ca.nlpsol_out(number) for number in range(ca.nlpsol_n_out())]
    patterns = [ca.Sparsity.dense(sizes[name], 1) for name in names]
    return PythonFunction(
        "watch", patterns, [ca.Sparsity.scalar()], lambda given: [int(stops(dict(zip(names, given, strict=True))))]
    )
