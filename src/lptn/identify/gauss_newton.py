"""IPOPT on a least-squares problem, with the Gauss-Newton Hessian handed to it."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from lptn.arrays import FloatArray
from lptn.identify.problem import Problem
from lptn.simulate import SimulationError

Progress = Callable[[int, float], None]
"""Called after each iteration with its number and the RMS of the weighted residuals."""

_IPOPT = {
    "ipopt.print_level": 0,
    "ipopt.sb": "yes",
    "ipopt.tol": 1e-7,
    "ipopt.acceptable_tol": 1e-5,
    "ipopt.acceptable_iter": 3,
    "ipopt.acceptable_obj_change_tol": 1e-7,
    "ipopt.mu_strategy": "adaptive",  # with a fixed schedule, curved valleys take three times the iterations
    "ipopt.bound_push": 1e-6,
    "ipopt.bound_frac": 1e-6,
    "ipopt.nlp_scaling_method": "none",
    "no_nlp_grad": True,
    "calc_lam_p": False,
    "print_time": False,
    "error_on_fail": False,
    "show_eval_warnings": False,
}
_STATUS = {"Solve_Succeeded": "converged", "Solved_To_Acceptable_Level": "converged"}
_DAMPING = 1e-10  # relative; keeps the Hessian positive where the data say nothing


@dataclass(frozen=True)
class Solution:
    """Where the search ended: the best point seen, its cost, iterations, and how it ended."""

    z: FloatArray
    cost: float
    iterations: int
    status: str  # "converged", "not converged" or "interrupted"


class _Evaluator:
    """Cost, gradient and Gauss-Newton Hessian at a point, computed once, scaled to a mean over the readings."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.scale = 1.0 / max(problem.readings, 1)
        self.best = (float("inf"), np.zeros(problem.size))
        self._costs: dict[bytes, float] = {}
        self._key: bytes = b""
        self._derivatives: tuple[FloatArray, FloatArray] = (np.zeros(0), np.zeros(0))

    def cost(self, z: FloatArray) -> float:
        key = z.tobytes()
        if key not in self._costs:
            self._costs = {key: self.problem.cost(z) * self.scale}
            if self._costs[key] < self.best[0]:
                self.best = (self._costs[key], z.copy())
        return self._costs[key]

    def derivatives(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        if z.tobytes() != self._key:
            try:
                gradient, hessian = self.problem.normal(z)
            except SimulationError:
                gradient = np.full(len(z), np.nan)
                hessian = np.full((len(z), len(z)), np.nan)
            damping = _DAMPING * max(float(np.trace(hessian)), 1e-12) * np.eye(len(z))
            self._derivatives = gradient * self.scale, (hessian + damping) * self.scale
            self._key = z.tobytes()
        return self._derivatives


class _Function(ca.Callback):
    """A Python function of dense columns as a CasADi function."""

    def __init__(
        self,
        name: str,
        inputs: list[ca.Sparsity],
        outputs: list[ca.Sparsity],
        evaluate: Callable[[list[ca.DM]], list[Any]],
    ) -> None:
        ca.Callback.__init__(self)
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
        # The solver would swallow an exception: it is kept, and raised once the solver has returned.
        try:
            return self._evaluate(list(arguments))
        except Exception as error:
            self.failure = error
            return [ca.DM(pattern, np.nan) for pattern in self._outputs]


class _Watcher:
    """Reports progress after each iteration, and tells IPOPT to stop once Ctrl-C was pressed."""

    def __init__(self, evaluator: _Evaluator, progress: Progress | None) -> None:
        self.evaluator, self.progress = evaluator, progress
        self.iterations = -1
        self.stopped = False

    def __call__(self, _arguments: list[ca.DM]) -> list[Any]:
        self.iterations += 1
        if self.progress is not None:
            self.progress(self.iterations, float(np.sqrt(2 * self.evaluator.best[0])))
        return [int(self.stopped)]


def minimise(problem: Problem, guess: FloatArray, progress: Progress | None = None, iterations: int = 80) -> Solution:
    """The least weighted sum of squares, from `guess`, within the problem's bounds.

    Ctrl-C ends the search at the best point so far, with status `"interrupted"`.

    Args:
        problem: the problem.
        guess: unknowns to start from, shape (size,).
        progress: called after each iteration.
        iterations: how many to take at most.
    """
    evaluator = _Evaluator(problem)
    watcher = _Watcher(evaluator, progress)
    n = problem.size
    column, empty, scalar = ca.Sparsity.dense(n, 1), ca.Sparsity(0, 0), ca.Sparsity.dense(1, 1)
    nothing = ca.Sparsity(0, 1)
    functions = [
        _Function("nlp_f", [column], [scalar], lambda a: [evaluator.cost(_array(a[0]))]),
        _Function(
            "nlp_grad_f",
            [column, empty],
            [scalar, column],
            lambda a: [evaluator.cost(_array(a[0])), evaluator.derivatives(_array(a[0]))[0]],
        ),
        _Function(
            "nlp_hess_lag",
            [column, empty, scalar, nothing],
            [ca.Sparsity.upper(n)],
            lambda a: [ca.triu(ca.DM(evaluator.derivatives(_array(a[0]))[1] * float(a[2])))],
        ),
        _Function(
            "watch",
            [_solver_output(i, n) for i in range(ca.nlpsol_n_out())],
            [scalar],
            watcher,
        ),
    ]
    cost, gradient, hessian, watch = functions
    x = ca.MX.sym("x", n)
    options = {
        **_IPOPT,
        "ipopt.max_iter": iterations,
        "grad_f": gradient,
        "hess_lag": hessian,
        "iteration_callback": watch,
    }
    solver = ca.nlpsol("fit", "ipopt", {"x": x, "f": cost(x)}, options)  # type: ignore[dict-item, arg-type]
    lower, upper = problem.bounds()
    guess = np.clip(guess, lower, upper)
    evaluator.cost(guess)
    with _interrupt(watcher):
        solver(x0=guess, lbx=lower, ubx=upper)
    for function in functions:
        if function.failure is not None:
            raise function.failure
    status = "interrupted" if watcher.stopped else _STATUS.get(solver.stats()["return_status"], "not converged")
    best, z = evaluator.best
    return Solution(np.clip(z, lower, upper), best / evaluator.scale, max(watcher.iterations, 0), status)


def _solver_output(index: int, n: int) -> ca.Sparsity:
    name = ca.nlpsol_out(index)
    if name == "f":
        return ca.Sparsity.scalar()
    return ca.Sparsity.dense(n) if name in ("x", "lam_x") else ca.Sparsity(0, 0)


def _array(column: ca.DM) -> FloatArray:
    return np.asarray(column.full(), dtype=float).ravel()


@contextmanager
def _interrupt(watcher: _Watcher) -> Iterator[None]:
    """Turn Ctrl-C into a polite stop while the solver runs; only the main thread receives signals."""
    ignored = signal.getsignal(signal.SIGINT) is signal.SIG_IGN  # a job put in the background
    if ignored or threading.current_thread() is not threading.main_thread():
        yield
        return

    def stop(_number: int, _frame: object) -> None:
        watcher.stopped = True

    before = signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
