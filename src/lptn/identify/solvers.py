"""Least-squares minimisers: Levenberg-Marquardt within bounds, and IPOPT with the Gauss-Newton Hessian to rescue it.

Sources: [Marquardt1963], here with bounds; [DennisGayWelsch1981].
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from math import log
from typing import Literal

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.identify.bounded_minimum import bounded_minimum
from lptn.identify.problem import Problem
from lptn.model.array_function import PythonFunction, solver_watch
from lptn.simulate.simulation import SimulationError

# --- Cost, gradient and Gauss-Newton Hessian of a problem, each point worked out once -------------


_DAMPING = 1e-10  # relative; keeps the Hessian positive where the data say nothing


class Evaluator:
    """A problem's cost and derivatives, scaled to a mean over the readings; the best point is kept."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        self.scale = 1.0 / max(problem.readings, 1)
        self.best = (float("inf"), np.zeros(problem.size))
        """The least cost seen, scaled, and where."""
        self._costs: dict[bytes, float] = {}
        self._key: bytes = b""
        self._derivatives: tuple[FloatArray, FloatArray] = (np.zeros(0), np.zeros(0))

    def cost(self, z: FloatArray) -> float:
        """Scaled cost; infinite where the model can't be simulated."""
        key = z.tobytes()
        remembered = 4  # points whose costs are kept: a line search comes back to the last few
        if key not in self._costs:
            if len(self._costs) >= remembered:
                self._costs.pop(next(iter(self._costs)))
            self._costs[key] = self.problem.cost(z) * self.scale
            if self._costs[key] < self.best[0]:
                self.best = (self._costs[key], z.copy())
        return self._costs[key]

    def derivatives(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Scaled gradient (size,) and Hessian (size, size); NaN where the model can't be simulated."""
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


# --- The last steps to an optimum that is near: Levenberg-Marquardt, each step the exact optimum within the bounds ---


Ending = Literal["converged", "stopped"]

PRECISION = 3e-8  # of the cost: where the model misses much, so little is beyond all meaning
_REACH = log(10.0)
"""In the search's coordinates, of a parameter: beyond a factor of ten the quadratic model is no guide. What vanishes to
first order, such as the time constant of a mass without capacitance, would be sent to infinity and stay there."""
_FIRST_DAMPING, _LEAST_DAMPING, _MOST_DAMPING = 1e-3, 1e-7, 1e3  # relative to the Hessian's diagonal
_POOR, _GOOD = 0.1, 0.7  # actual over predicted gain: below, damping grows; above, it shrinks
_PATIENCE = 5  # steps; where so many together gain less than is worth one, no more are taken
_RIGHT, _HALF = 0.05, 0.5
"""Of the predicted gain. Where the quadratic model is so near the truth, and twice the step gains less than half by it,
twice the step is not tried: of 850 such trials in four diagnoses of an exoskeleton none gained anything."""


def polish(
    evaluator: Evaluator,
    z: FloatArray,
    most: int,
    stopped: Callable[[], bool],
    step_taken: Callable[[], None],
    precision: float = PRECISION,
) -> Ending:
    """Step from `z` until nothing is left to gain; the evaluator keeps the best point.

    An interior-point search shrinks its barrier to the last digit, at a full evaluation each time. Near the optimum
    the quadratic model is good and its bounded optimum takes milliseconds: a few steps do. Where the valley is
    curved, damping keeps them short.

    Args:
        evaluator: of the problem.
        z: where to start, within the bounds.
        most: how many steps to take at most.
        stopped: asked before each step.
        step_taken: called after each step.
        precision: share of the cost that is not worth another step.

    Returns:
        `"converged"`: the optimum was reached; `"stopped"` before that.
    """
    damping, costs, curvature = 0.0, [evaluator.cost(z)], _Curvature(len(z))
    gain = 1e-6  # of the cost, a log-likelihood: some thousandth of a standard error away from the optimum
    for _ in range(most):
        if stopped():
            return "stopped"
        gradient, hessian = evaluator.derivatives(z)
        if not np.isfinite(hessian).all():
            return "stopped"
        hessian = curvature.added_to(hessian, z, gradient, costs[-1])
        enough = max(gain * evaluator.scale, precision * evaluator.cost(z))
        free = bounded_minimum(gradient, hessian, *_room(evaluator.problem, z))
        predicted = _predicted_gain(gradient, hessian, free)
        if predicted < enough:
            return "converged"
        # A step that ends where the model is no guide any more says nothing of what lies beyond.
        trusted = bool(np.all(np.abs(free[: len(evaluator.problem.free)]) < _REACH))
        following, damping = _downhill(evaluator, z, (gradient, hessian), free, damping)
        if following is None:  # rounding in the simulation hides what is left, or the model is no guide here
            return "converged" if predicted < 100 * enough else "stopped"
        step_taken()
        costs.append(evaluator.cost(following))
        gained = costs[-2] - costs[-1]
        # Where all is as the quadratic model says, its optimum, if a step reaches it, is the problem's: that takes no
        # derivatives to see.
        as_predicted = trusted and abs(gained - predicted) < enough and np.array_equal(following, z + free)
        # In a curved valley every step promises what the next ones don't keep.
        spent = len(costs) > _PATIENCE and costs[-1 - _PATIENCE] - costs[-1] < enough
        if as_predicted or spent or gained < 0.01 * enough:
            return "converged"
        z = following
    return "stopped"


class _Curvature:
    """What the Gauss-Newton Hessian leaves out: the residuals times their second derivatives, as steps tell it.

    Where a model lacks something, residuals are large, and this is what bends its valleys: without it each step
    overshoots, or goes a tenth of the way. It is updated by the change of the gradient along each step, and used while
    it predicts gains better than Gauss-Newton alone [DennisGayWelsch1981].
    """

    def __init__(self, size: int) -> None:
        self._learnt = np.zeros((size, size))
        self._before: tuple[FloatArray, FloatArray, FloatArray, float] | None = None

    def added_to(self, hessian: FloatArray, z: FloatArray, gradient: FloatArray, cost: float) -> FloatArray:
        """The Hessian at the next point, positive definite; arguments are the Gauss-Newton one there, and the rest."""
        before, self._before = self._before, (z, gradient, hessian, cost)
        if before is None:
            return hessian
        step, change, gained = z - before[0], gradient - before[1], before[3] - cost
        plain = abs(_predicted_gain(before[1], before[2], step) - gained)
        better = abs(_predicted_gain(before[1], before[2] + self._learnt, step) - gained) <= plain
        along, own = float(change @ step), float(step @ self._learnt @ step)
        if along > np.finfo(float).eps * float(step @ hessian @ step):
            beyond = change - hessian @ step
            self._learnt *= min(1.0, abs(float(step @ beyond)) / abs(own)) if own else 1.0
            off = beyond - self._learnt @ step
            pair = np.outer(off, change) / along
            self._learnt += pair + pair.T - float(step @ off) / along**2 * np.outer(change, change)
        if not better:
            return hessian
        scale = np.sqrt(np.diag(hessian))
        sizes, axes = np.linalg.eigh((hessian + self._learnt) / np.outer(scale, scale))
        # Where a valley bends away, a step of the same size the other way round is as far as the model can be trusted.
        whole = (axes * np.maximum(np.abs(sizes), _LEAST_DAMPING)) @ axes.T
        return np.asarray(whole * np.outer(scale, scale))


def _downhill(
    evaluator: Evaluator, z: FloatArray, model: tuple[FloatArray, FloatArray], free: FloatArray, damping: float
) -> tuple[FloatArray | None, float]:
    """A point that keeps a fair share of the gain predicted, and the damping to go on with; `None` if there is none."""
    gradient, hessian = model
    room = _room(evaluator.problem, z)
    before, diagonal = evaluator.cost(z), np.diag(np.diag(hessian))
    while damping <= _MOST_DAMPING:
        step = free if damping == 0 else bounded_minimum(gradient, hessian + damping * diagonal, *room)
        predicted = max(_predicted_gain(gradient, hessian, step), 1e-300)
        kept = (before - evaluator.cost(z + step)) / predicted
        if kept > _POOR:
            if kept > _GOOD:
                damping = 0.0 if damping < _LEAST_DAMPING else damping / 10
                if abs(kept - 1) > _RIGHT or _predicted_gain(gradient, hessian, 2 * step) > _HALF * predicted:
                    step = _further(evaluator, z, step)
            return z + step, damping
        damping = max(4 * damping, _FIRST_DAMPING)
    return None, damping


def _room(problem: Problem, z: FloatArray) -> tuple[FloatArray, FloatArray]:
    """How far each unknown may move in one step, down and up, shape (size,) each."""
    lower, upper = problem.bounds
    far = 1e6  # no start of a run is moved as far, in K
    reach = np.full(len(z), far)
    reach[: len(problem.free)] = _REACH
    return np.maximum(lower - z, -reach), np.minimum(upper - z, reach)


def _further(evaluator: Evaluator, z: FloatArray, step: FloatArray) -> FloatArray:
    """The step, doubled as long as that gains: simulations cost a tenth of derivatives."""
    lower, upper = evaluator.problem.bounds
    while True:
        longer = np.clip(z + 2 * step, lower, upper) - z
        if not evaluator.cost(z + longer) < evaluator.cost(z + step):
            return step
        step = longer


def _predicted_gain(gradient: FloatArray, hessian: FloatArray, step: FloatArray) -> float:
    """What the quadratic model says that a step gains."""
    return -float(gradient @ step + 0.5 * step @ hessian @ step)


# --- IPOPT on a least-squares problem, with the Gauss-Newton Hessian ------------------------------


Progress = Callable[[int, float], None]
"""Called after each iteration with its number and the RMS of the weighted residuals."""
Keep = Callable[[FloatArray], None]
"""Called after each iteration with the best unknowns so far, shape (size,)."""

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
_STOPPED = "User_Requested_Stop"


@dataclass(frozen=True)
class Solution:
    """Where the search ended: the best point seen, its cost, iterations, and how it ended."""

    z: FloatArray
    cost: float
    iterations: int
    status: str  # "converged", "not converged" or "interrupted"


class _Watcher:
    """Counts iterations and reports them; tells IPOPT to stop near the optimum, and once Ctrl-C was pressed."""

    def __init__(self, evaluator: Evaluator, progress: Progress | None, keep: Keep | None) -> None:
        self.evaluator, self.progress, self.keep = evaluator, progress, keep
        self.iterations = 0
        self.interrupted = False
        self.patient = False  # whether IPOPT is to go on to its own end
        self._before = float("inf")

    def __call__(self, _results: dict[str, ca.DM]) -> bool:
        """Whether IPOPT is to stop."""
        cost, first = self.evaluator.best[0], not np.isfinite(self._before)
        nearly = 1e-3  # relative change of the cost in an iteration, below which polishing takes over
        near = 0 < self._before - cost < nearly * cost
        self._before = cost
        if not first:
            self.count()
        return self.interrupted or (near and not self.patient)

    def count(self) -> None:
        """One more iteration."""
        self.iterations += 1
        self.say()

    def say(self) -> None:
        """Hand on the best point, and report how far the search is."""
        if self.keep is not None:
            self.keep(self.evaluator.best[1])
        if self.progress is not None:
            self.progress(self.iterations, float(np.sqrt(2 * self.evaluator.best[0])))


def minimise(
    problem: Problem,
    guess: FloatArray,
    progress: Progress | None = None,
    iterations: int = 80,
    *,
    keep: Keep | None = None,
    precision: float = PRECISION,
    rescued: bool = True,
) -> Solution:
    """The least weighted sum of squares, from `guess`, within the problem's bounds.

    By bounded Gauss-Newton steps; where they come to no end IPOPT goes most of the way. Ctrl-C ends the search at the
    best point so far, with status `"interrupted"`.

    Args:
        problem: the problem.
        guess: unknowns to start from, shape (size,).
        progress: called after each iteration.
        iterations: how many to take at most.
        keep: called after each iteration with the best unknowns so far.
        precision: share of the cost that is not worth another step.
        rescued: whether IPOPT goes on where these steps fail. From a solution it was seen to gain a thousandth
            of the cost, for more time than all else.
    """
    evaluator = Evaluator(problem)
    watcher = _Watcher(evaluator, progress, keep)
    lower, upper = problem.bounds
    evaluator.cost(np.clip(guess, lower, upper))
    watcher.say()
    with _interrupt(watcher):
        ended = _search(evaluator, watcher, iterations, precision, rescued)
    best, z = evaluator.best
    status = "interrupted" if watcher.interrupted else ended
    return Solution(np.clip(z, lower, upper), best / evaluator.scale, watcher.iterations, status)


def _search(evaluator: Evaluator, watcher: _Watcher, iterations: int, precision: float, rescued: bool) -> str:
    """Polish; where that fails IPOPT, then polish again; IPOPT to its end where that fails, too."""

    def left() -> int:
        return max(0, iterations - watcher.iterations)

    def polished() -> Ending:
        start, stopped = evaluator.best[1].copy(), lambda: watcher.interrupted
        return polish(evaluator, start, left(), stopped, watcher.count, precision)

    if (ending := polished()) != "stopped":
        return ending
    if not rescued:
        return "not converged"
    ended = _interior_point(evaluator, watcher, left())
    if ended != _STOPPED:
        return _STATUS.get(ended, "not converged")
    if (ending := polished()) != "stopped":
        return ending
    watcher.patient = True
    return _STATUS.get(_interior_point(evaluator, watcher, left()), "not converged")


def _interior_point(evaluator: Evaluator, watcher: _Watcher, iterations: int) -> str:
    """IPOPT from the best point so far; how it ended, in its own word."""
    n = evaluator.problem.size
    column, empty, scalar = ca.Sparsity.dense(n, 1), ca.Sparsity(0, 0), ca.Sparsity.dense(1, 1)
    cost = PythonFunction("nlp_f", [column], [scalar], lambda a: [evaluator.cost(_array(a[0]))])
    gradient = PythonFunction(
        "nlp_grad_f",
        [column, empty],
        [scalar, column],
        lambda a: [evaluator.cost(_array(a[0])), evaluator.derivatives(_array(a[0]))[0]],
    )
    hessian = PythonFunction(
        "nlp_hess_lag",
        [column, empty, scalar, ca.Sparsity(0, 1)],
        [ca.Sparsity.upper(n)],
        lambda a: [ca.triu(ca.DM(evaluator.derivatives(_array(a[0]))[1] * float(a[2])))],
    )
    x = ca.MX.sym("x", n)
    problem = {"x": x, "f": cost(x)}
    watch = solver_watch(problem, watcher)
    options = {"grad_f": gradient, "hess_lag": hessian, "iteration_callback": watch, "ipopt.max_iter": iterations}
    solver = ca.nlpsol("fit", "ipopt", problem, _IPOPT | options)  # type: ignore[arg-type]
    lower, upper = evaluator.problem.bounds
    solver(x0=evaluator.best[1], lbx=lower, ubx=upper)
    for function in (cost, gradient, hessian, watch):
        if function.failure is not None:
            raise function.failure
    return str(solver.stats()["return_status"])


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
        watcher.interrupted = True

    before = signal.signal(signal.SIGINT, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
