"""The weighted least-squares problem of a fit: unknowns, residuals (predicted − measured), cost and derivatives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray, IntArray
from lptn.basics.parameters import Transform
from lptn.model.model import Model
from lptn.simulate.bound_run import BoundRun, default_start, excess_at_start, most_in_a_row
from lptn.simulate.simulation import Sensitivities, SimulationError, sensitivity_windows, simulate

AT_REST = 0.5
"""K, standard deviation of a start, of a node's or of a hidden state's, in a robot that begins as warm as its
surroundings: sensors of 1 K steps, and the air's 0.3 K."""
REPEATED = 5.0
"""s; so long at least what a model gets wrong stays the same, while a sensor's noise differs with each reading. Of
readings closer than that several say once what the log was wrong by, and priors count as often: a log of 1 Hz and
its means over 5 s, which effects are sought on, find the same errors of the log."""
_AT_BOUND = 1e-4  # distance to a bound, in the search's coordinates
_NEAR = 1.5  # K; a node starts no further from its first readings, unless an effect of its sensor is modelled


@dataclass(frozen=True)
class Point:
    """A point of the search space.

    Args:
        values: of all parameters, shape (m,).
        starts: initial states of each run [degC], shape (states,) each.
        averaged: whether the search was still on averages of the runs.
    """

    values: FloatArray
    starts: list[FloatArray]
    averaged: bool = False


def weight_of_priors(step: float) -> float:
    """What the residual of a prior is multiplied by beside readings every `step` seconds."""
    return float(np.sqrt(max(1.0, REPEATED / step)))


def rows_of_readings(bound: BoundRun) -> IntArray:
    """Where each reading that counts stands among the residuals of its run, node after node, shape (nodes, n)."""
    return np.cumsum(bound.counted).reshape(bound.counted.shape) - 1


def tolerance_of(traces: FloatArray, precision: float) -> FloatArray:
    """A factor K so that residuals of the precision 1 − K Kᵀ are those that errors of these traces are left out of.

    The errors' sizes have a standard normal distribution, beside independent errors of this precision, and are
    integrated out.

    Args:
        traces: what errors of one standard deviation leave on the residuals, shape (readings, k).
        precision: of an independent error of a reading, in residuals.
    """
    squares, axes = np.linalg.eigh(traces.T @ traces)
    kept = squares > 0
    shares = 1.0 / np.sqrt(squares[kept] + 1.0 / precision)
    return np.asarray(traces @ (axes[:, kept] * shares))


class Problem:
    """Residuals of free-running simulations, with priors on initial states and parameters, and a left-right symmetry
    penalty.

    A residual is predicted − measured, over σ: positive where the model is too hot.

    The unknowns are the coordinates of the free parameters, then for each run the initial temperatures of
    the nodes and how far each hidden state lies from its node's temperature, or the mean of its nodes. A state
    that belongs to a prescribed temperature stands as it is.

    Args:
        model: the model to fit; its values are used for the parameters that stay fixed.
        bound_runs: the runs.
        sigma: standard deviation that weighs each node's residuals [K], shape (nodes,).
        symmetry_penalty: λ of the penalty that pulls the logarithms of left and right parameters
            together ([QuadrupedLPTN, eq. 14], on logarithms so that λ has no unit).
        free: indices of the parameters to fit; the model's own free ones by default.
        tolerance: what the cost and its derivatives leave out of account, as a factor K of the residuals' precision
            1 − K Kᵀ, shape (readings, k); see `tolerance_of`.
    """

    def __init__(
        self,
        model: Model,
        bound_runs: Sequence[BoundRun],
        sigma: FloatArray,
        symmetry_penalty: float = 0.0,
        free: Sequence[int] | None = None,
        tolerance: FloatArray | None = None,
    ) -> None:
        self.model, self.bound_runs, self.sigma = model, list(bound_runs), sigma
        self.tolerance = tolerance
        self.symmetry_penalty = symmetry_penalty
        self.free = list(model.free if free is None else free)
        self._transform = Transform([model.parameters[index] for index in self.free])
        self._shares = model.resting_shares
        step = max((bound.run.step for bound in self.bound_runs), default=REPEATED)
        self.weight_of_priors = weight_of_priors(step)
        """What residuals of priors are multiplied by."""
        self._guesses = [default_start(model, bound) for bound in self.bound_runs]
        self._spreads = [self._spread(bound) / self.weight_of_priors for bound in self.bound_runs]
        self._penalties = self._penalties_on_parameters(symmetry_penalty)
        declared = [model.parameters[index].declared for index in self.free]
        self._with_prior = [row for row, parameter in enumerate(declared) if parameter.prior is not None]
        priors = np.array(
            [parameter.prior for parameter in declared if parameter.prior is not None], dtype=float
        ).reshape(-1, 2)
        self._means, self._deviations = priors[:, 0], priors[:, 1]
        off = [parameter.off for parameter in declared if parameter.prior is not None]
        self._about_none = np.array(
            [none is not None and none == mean for none, mean in zip(off, priors[:, 0], strict=True)], bool
        )
        """Which priors say that an effect is mostly none: what isn't may be of any size, so these have long tails."""
        self.readings = sum(int(bound.counted.sum()) for bound in self.bound_runs)
        """Number of readings that count."""

    @property
    def rows(self) -> int:
        """Number of residuals: of readings, priors and penalties."""
        return self.readings + len(self._prior_jacobian(self.model.values))

    @property
    def size(self) -> int:
        """Number of unknowns."""
        return len(self.free) + len(self.bound_runs) * len(self.model.states)

    def guess(self, values: FloatArray, starts: Sequence[FloatArray] | None = None) -> FloatArray:
        """The unknowns, shape (size,), at given parameter values and initial states."""
        starts = self._guesses if starts is None else starts
        return np.concatenate([self._transform.forward(values[self.free]), *(self._relative(x) for x in starts)])

    def point(self, z: FloatArray) -> Point:
        """Parameter values and initial states at the unknowns z."""
        values = self.model.values
        values[self.free] = self._transform.backward(z[: len(self.free)])
        count = len(self.model.states)
        return Point(values, [self._absolute(start) for start in z[len(self.free) :].reshape(-1, count)])

    @cached_property
    def bounds(self) -> tuple[FloatArray, FloatArray]:
        """Least and largest admissible unknowns, shape (size,) each."""
        parameters = self.model.parameters
        admissible = np.array([parameters[index].declared.bounds for index in self.free]).reshape(-1, 2)
        lower, upper = np.full(self.size, -np.inf), np.full(self.size, np.inf)
        lower[: len(self.free)] = self._transform.forward(admissible[:, 0])
        upper[: len(self.free)] = self._transform.forward(admissible[:, 1])
        count = len(self.model.states)
        for number, bound in enumerate(self.bound_runs):
            near = slice(len(self.free) + number * count, len(self.free) + number * count + len(self.model.nodes))
            trusted = np.isfinite(bound.start) & ~self._sensor_modelled
            farthest = _NEAR + most_in_a_row(bound)
            lower[near] = np.where(trusted, bound.start - farthest, -np.inf)
            upper[near] = np.where(trusted, bound.start + farthest, np.inf)
        return lower, upper

    def at_bounds(self, z: FloatArray) -> tuple[BoolArray, BoolArray]:
        """Which unknowns stand at their lower bound, and which at their upper, shape (size,) each."""
        lower, upper = self.bounds
        return z - lower < _AT_BOUND, upper - z < _AT_BOUND

    def slope(self, values: FloatArray) -> FloatArray:
        """d value / d unknown of the free parameters."""
        return self._transform.slope(values[self.free])

    def residuals(self, z: FloatArray) -> FloatArray:
        """Weighted residuals, (predicted − measured) / σ, shape (rows,).

        Run after run, node after node, the readings that count; then the penalties of the initial states and of the
        parameters. A simulation without derivatives: a tenth of the time of `jacobian`.

        Raises:
            SimulationError: the point makes the model too stiff, or it runs away.
        """
        point, rows = self.point(z), []
        for bound, start in zip(self.bound_runs, point.starts, strict=True):
            off = simulate(self.model, bound, point.values, start).readings - bound.measured
            rows.append((off / self.sigma[:, None])[bound.counted])
        return np.concatenate([*rows, self._prior_residuals(z, point)])

    def cost(self, z: FloatArray) -> float:
        """Half the sum of squared residuals; infinite where the model can't be simulated, or the squares overflow."""
        try:
            with np.errstate(over="ignore"):
                residuals = self.residuals(z)
                squares = float(np.sum(residuals**2))
                if self.tolerance is not None:
                    squares -= float(np.sum((self.tolerance.T @ residuals[: self.readings]) ** 2))
                return 0.5 * squares
        except SimulationError:
            return float("inf")

    def jacobian(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Residuals (rows,) and their Jacobian (rows, size).

        Raises:
            SimulationError: the point makes the model too stiff, or it runs away.
        """
        point = self.point(z)
        weighted, slopes = np.zeros(self.rows), np.zeros((self.rows, self.size))
        first = 0
        for number, bound in enumerate(self.bound_runs):
            columns, row_of = self._columns(number), rows_of_readings(bound) + first
            for places, residuals, derivatives in self._windows(number, point):
                rows = row_of.ravel()[places]
                weighted[rows], slopes[rows[:, None], columns] = residuals, derivatives
            first += int(bound.counted.sum())
        weighted[first:], slopes[first:] = self._prior_residuals(z, point), self._prior_jacobian(point.values)
        return weighted, slopes

    def normal(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Gradient (size,) and Gauss-Newton Hessian (size, size) of the cost, added up window by window to save memory.

        Raises:
            SimulationError: the point makes the model too stiff, or it runs away.
        """
        point = self.point(z)
        prior = self._prior_jacobian(point.values)
        gradient, hessian = prior.T @ self._prior_residuals(z, point), prior.T @ prior
        count = 0 if self.tolerance is None else self.tolerance.shape[1]
        pull, shared = np.zeros(count), np.zeros((count, self.size))
        for number, bound in enumerate(self.bound_runs):
            columns, chain, seen = self._columns(number), self._chain(number, point.values), self._seen[number]
            for window, predicted in self._sensitivities(number, point):
                # Step after step as they were worked out, readings that don't count with no weight: a search is mostly
                # here, and every copy of the derivatives takes as long as the product with themselves.
                counted = bound.counted[seen, window]
                weights = (counted / self.sigma[seen, None]).T
                errors = np.where(counted, predicted.readings - bound.measured[seen, window], 0.0).T * weights
                rows = np.moveaxis(predicted.derivatives, 1, 0)  # nobody needs the window's any more
                rows *= weights[:, :, None]
                rows = rows.reshape(-1, len(columns))
                gradient[columns] += chain.T @ (rows.T @ errors.ravel())
                hessian[np.ix_(columns, columns)] += chain.T @ (rows.T @ rows) @ chain
                if count:
                    tolerated = self._tolerated[number][window].reshape(-1, count)
                    pull += errors.ravel() @ tolerated
                    shared[:, columns] += (tolerated.T @ rows) @ chain
        return gradient - pull @ shared, hessian - shared.T @ shared

    @cached_property
    def _tolerated(self) -> list[FloatArray]:
        """The tolerance step after step of each run, shape (n, seen nodes, k); 0 where no reading counts."""
        assert self.tolerance is not None
        ordered, first = [], 0
        for bound, seen in zip(self.bound_runs, self._seen, strict=True):
            rows = int(bound.counted.sum())
            whole = np.zeros((*bound.counted.shape, self.tolerance.shape[1]))
            whole[bound.counted] = self.tolerance[first : first + rows]
            ordered.append(np.ascontiguousarray(np.moveaxis(whole[seen], 0, 1)))
            first += rows
        return ordered

    @property
    def rows_of_priors(self) -> slice:
        """Where the residuals of the parameters' priors stand."""
        return slice(self.rows - len(self._with_prior), self.rows)

    def information_of_priors(self, z: FloatArray) -> FloatArray:
        """What the priors add to the Hessian of the free parameters, shape (free, free)."""
        slopes = self._slopes_of_priors(self.point(z).values)
        return slopes.T @ slopes

    def block_gradients(self, z: FloatArray, seconds: float) -> FloatArray:
        """The cost's gradient from each node's readings in each block of `seconds` of a run, shape (blocks, size).

        Raises:
            SimulationError: the point makes the model too stiff, or it runs away.
        """
        point, gradients = self.point(z), []
        for number, bound in enumerate(self.bound_runs):
            columns, n = self._columns(number), len(bound)
            per_block = max(1, round(seconds / bound.run.step))
            for places, residuals, derivatives in self._windows(number, point):
                block = (places // n) * n + (places % n) // per_block
                first = np.flatnonzero(np.diff(block, prepend=-1))
                rows = np.zeros((len(first), self.size))
                rows[:, columns] = np.add.reduceat(derivatives * residuals[:, None], first, axis=0)
                gradients.append(rows)
        return np.vstack(gradients)

    def _columns(self, number: int) -> IntArray:
        """The unknowns that a run's readings depend on: the parameters that act in it and its own initial states."""
        count = len(self.model.states)
        first = len(self.free) + number * count
        return np.concatenate([self._acting[number], np.arange(first, first + count)])

    @cached_property
    def _acting(self) -> list[IntArray]:
        """For each run the places in `free` of the parameters that act in it: none of other runs' own effects."""
        acting = [self.model.acting_in(bound.run.name) for bound in self.bound_runs]
        return [np.flatnonzero([index in indices for index in self.free]) for indices in acting]

    def _sensitivities(self, number: int, point: Point) -> Iterator[tuple[slice, Sensitivities]]:
        """Window by window of a run: its steps, readings, and their derivatives by parameters and initial states.

        Of the nodes that `_seen` lists.
        """
        chosen = [self.free[place] for place in self._acting[number]]
        bound, start = self.bound_runs[number], point.starts[number]
        return sensitivity_windows(self.model, bound, point.values, chosen, start, nodes=self._seen[number])

    @cached_property
    def measured(self) -> BoolArray:
        """Of which nodes a reading counts in any run, shape (nodes,)."""
        return np.asarray(np.any([bound.counted.any(axis=1) for bound in self.bound_runs], axis=0))

    @cached_property
    def _seen(self) -> list[slice | IntArray]:
        """For each run the nodes of which a reading counts, by number; a slice copies nothing."""
        seen = [np.flatnonzero(bound.counted.any(axis=1)) for bound in self.bound_runs]
        return [slice(own[0], own[-1] + 1) if own.size and np.ptp(own) == own.size - 1 else own for own in seen]

    def _chain(self, number: int, values: FloatArray) -> FloatArray:
        """Derivative of a run's parameters and initial states by its unknowns, which `_columns` lists; square."""
        acting, nodes = self._acting[number], len(self.model.nodes)
        chain = np.eye(len(acting) + len(self.model.states))
        chain[range(len(acting)), range(len(acting))] = self.slope(values)[acting]
        # A node's initial temperature takes its hidden states along.
        chain[len(acting) + nodes :, len(acting) : len(acting) + nodes] = self._shares
        return chain

    def _windows(self, number: int, point: Point) -> Iterator[tuple[IntArray, FloatArray, FloatArray]]:
        """Window by window of a run: where its readings stand in the run, residuals, derivatives by `_columns`."""
        bound, chain, seen = self.bound_runs[number], self._chain(number, point.values), self._seen[number]
        places = np.arange(bound.counted.size).reshape(bound.counted.shape)
        for window, predicted in self._sensitivities(number, point):
            counted = bound.counted[seen, window]
            residuals = (predicted.readings - bound.measured[seen, window]) / self.sigma[seen, None]
            derivatives = predicted.derivatives[counted] @ chain
            derivatives *= 1.0 / np.repeat(self.sigma[seen], counted.sum(axis=1))[:, None]
            yield places[seen, window][counted], residuals[counted], derivatives

    @cached_property
    def _sensor_modelled(self) -> BoolArray:
        """Which nodes' sensors have an effect in the model, so that they may start away from their first readings."""
        nodes = {
            instance.ends[0]
            for instance in self.model.network.effect_instances
            if instance.effect.changes_reading or instance.effect.delays_readings
        }
        return np.array([node in nodes for node in self.model.nodes], dtype=bool)

    # --- initial states ---------------------------------------------------------------------------

    def _relative(self, states: FloatArray) -> FloatArray:
        nodes = len(self.model.nodes)
        relative = states.copy()
        relative[nodes:] -= self._shares @ states[:nodes]
        return relative

    def _absolute(self, relative: FloatArray) -> FloatArray:
        nodes = len(self.model.nodes)
        states = relative.copy()
        states[nodes:] += self._shares @ relative[:nodes]
        return states

    # --- priors -----------------------------------------------------------------------------------

    def starts_off(self, starts: Sequence[FloatArray]) -> tuple[FloatArray, FloatArray]:
        """How far initial states [degC] are from what is expected of them, in standard deviations; and those [K].

        Of hidden states it is their distance from their nodes. Shapes (runs, states).
        """
        relative = np.array(
            [self._relative(start) - self._relative(guess) for start, guess in zip(starts, self._guesses, strict=True)]
        )
        spreads = np.array(self._spreads)
        return relative / spreads, spreads

    def _spread(self, bound: BoundRun) -> FloatArray:
        """Standard deviations of a run's initial states [K], shape (states,).

        A hidden mass may be as far from its node as the node is from its surroundings, for heat passes one resistance
        on its way to each: in a robot that begins cold nothing is warm, whatever its first minutes seem to ask for.
        """
        hidden_spread = 5.0  # K, of a state that no sensor sees: narrower, since nothing else holds it
        hidden = np.fmin(AT_REST + excess_at_start(self.model, bound), hidden_spread)
        # K, of a measured node, so much as none: its readings hold it, and a prior about its first reading would speak
        # against an offset of its sensor; and of a node without a sensor.
        seen_spread, node_spread = 1000.0, 10.0
        seen = np.where(bound.counted.any(axis=1), seen_spread, node_spread)
        return np.concatenate([seen, hidden])

    def off_priors(self, z: FloatArray) -> FloatArray:
        """The residuals of what is known of parameters: of left-right pairs, then of priors."""
        residuals = self.weight_of_priors * self._from_priors(self.point(z).values)[0]
        return np.concatenate([self._penalties @ z[: len(self.free)], residuals])

    def _from_priors(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Half of its square is minus the logarithm of a prior's density, a normal or Cauchy's; and its slope by how
        many deviations the value is off. Shapes (priors,).
        """
        off = (values[self.free][self._with_prior] - self._means) / self._deviations
        long = np.sign(off) * np.sqrt(2.0 * np.log1p(off**2))
        slope = np.full(off.shape, np.sqrt(2.0))
        close = 1e-4  # deviations from where an effect is none, up to which Cauchy's density is a normal one
        np.divide(2.0 * off / (1.0 + off**2), long, out=slope, where=np.abs(off) > close)
        return np.where(self._about_none, long, off), np.where(self._about_none, slope, 1.0)

    def _prior_residuals(self, z: FloatArray, point: Point) -> FloatArray:
        return np.concatenate([self.starts_off(point.starts)[0].ravel(), self.off_priors(z)])

    def _prior_jacobian(self, values: FloatArray) -> FloatArray:
        starts = np.diag(1.0 / np.concatenate(self._spreads)) if self._spreads else np.zeros((0, 0))
        of_parameters = np.vstack([self._penalties, self._slopes_of_priors(values)])
        jacobian = np.zeros((len(starts) + len(of_parameters), self.size))
        jacobian[: len(starts), len(self.free) :] = starts
        jacobian[len(starts) :, : len(self.free)] = of_parameters
        return jacobian

    def _slopes_of_priors(self, values: FloatArray) -> FloatArray:
        """Derivatives of the priors' residuals by the free parameters' coordinates, shape (priors, free)."""
        slopes = np.zeros((len(self._with_prior), len(self.free)))
        own = self.slope(values)[self._with_prior] / self._deviations
        own *= self.weight_of_priors * self._from_priors(values)[1]
        slopes[np.arange(len(own)), self._with_prior] = own
        return slopes

    def _penalties_on_parameters(self, weight: float) -> FloatArray:
        """A row for each left-right pair of free parameters, sqrt(λ) times their difference."""
        where = {self.model.parameters[index].name: row for row, index in enumerate(self.free)}
        rows = []
        for index in self.free:
            parameter = self.model.parameters[index]
            if weight > 0 and parameter.mirror in where and parameter.name < parameter.mirror:
                row = np.zeros(len(self.free))
                row[where[parameter.name]], row[where[parameter.mirror]] = np.sqrt(weight), -np.sqrt(weight)
                rows.append(row)
        return np.array(rows, dtype=float).reshape(len(rows), len(self.free))
