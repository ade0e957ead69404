"""An extended Kalman filter on a model: temperatures of all nodes, and how sure they are, sample by sample."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal, get_args

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from lptn.arrays import FloatArray
from lptn.errors import InputError
from lptn.model import Model
from lptn.online.cells import as_gaussian
from lptn.online.dynamics import Dynamics
from lptn.online.estimate import Correction, Estimate
from lptn.online.flicker import coarse_noise
from lptn.online.incoming import inputs_of, readings_of, refuse_negative, refuse_unknown, sizes_of
from lptn.online.model_error import ModelError, by_node
from lptn.parameters import Transform

if TYPE_CHECKING:
    from lptn.identify import Fit

Rounding = Literal["cell", "white", "ignored"]
"""How the steps of a coarse sensor enter: as cells, as white noise of variance step²/12, or not at all."""

_UNMEASURED = 5.0  # K; standard deviation at the start of a node without a reading
_UNREAD = 15.0  # K; of all nodes where nothing is read at the start
_HIDDEN = 2.0  # K; of a hidden state about its node
_UNKNOWN = 0.3  # standard deviation of a learnt parameter's coordinate: some 30 %
_WALK = 0.05  # how far a learnt parameter's coordinate walks in an hour
_HOUR, _DAY = 3600.0, 86400.0  # s; what was known a day ago is worth no more than a new start
_LEAST_NOISE = 0.02  # K


class Estimator:
    r"""Extended Kalman filter on the model's RK4 step and its exact derivative.

    The state is the model's own, enlarged by what `error` allows and by the parameters in doubt. The covariance
    is corrected in Joseph's form, :math:`(I-KH)P(I-KH)^\top + KRK^\top`, which keeps it positive for any gain.

    Args:
        model: the model, at the values to start from.
        noise: standard deviation of the white noise of a reading, before rounding [K], for all nodes or by node.
            For a coarse sensor rather too large than too small: `from_fit` finds it.
        step: step of the sensors [K], 0 for fine ones, for all nodes or by node.
        error: what may be wrong with the model.
        learn: parameters to learn while running; a mapping gives how far each may walk in an hour, as a share
            of its value (of its typical size where zero is admissible). Slow walks: 0.05 by default.
        covariance: of the fit's coordinates of the model's free parameters, shape (free, free): doubt about
            parameters that aren't learnt widens the temperatures' uncertainty and is never narrowed.
        start: temperatures to start from [degC] by node; by default the first readings.
        rounding: how the steps enter; the default is best, the others are there to be compared.

    Raises:
        InputError: an unknown node, parameter or column; a start that is infinite.
        ValueError: a size that is negative or not finite, or a covariance of the wrong shape.
    """

    def __init__(
        self,
        model: Model,
        *,
        noise: float | Mapping[str, float] = 0.15,
        step: float | Mapping[str, float] = 0.0,
        error: ModelError | None = None,
        learn: Sequence[str] | Mapping[str, float] = (),
        covariance: FloatArray | None = None,
        start: Mapping[str, float] | None = None,
        rounding: Rounding = "cell",
    ) -> None:
        if rounding not in get_args(Rounding):
            raise ValueError(f"rounding: found {rounding!r}; expected one of {', '.join(get_args(Rounding))}")
        self.model, self.error = model, error or ModelError()
        self._rounding = rounding
        self._noise = sizes_of(model, noise, "noise") ** 2
        self._step = sizes_of(model, step, "step") * (rounding != "ignored")
        self._change = by_node(self.error.change, model.nodes)
        refuse_unknown(self.error.inputs, model.inputs, model, "error.inputs")
        given = readings_of(model, start or {}, "start")
        walks = dict(learn) if isinstance(learn, Mapping) else dict.fromkeys(learn, _WALK)
        self._doubt(walks, covariance)
        self._given_start = given
        self._resting = np.full(1, math.nan)
        self._last_inputs = np.full(len(model.inputs), math.nan)
        self._z = np.full(self._dynamics.layout.size, np.nan)
        self._covariance = np.zeros((len(self._z), len(self._z)))
        self._moved = np.eye(len(self._z))
        self.last: Correction | None = None
        """The linear algebra of the last update's correction; `None` where nothing was read."""

    @classmethod
    def from_fit(
        cls, fit: Fit, *, error: ModelError | None = None, learn: Sequence[str] | Mapping[str, float] = ()
    ) -> Estimator:
        """An estimator on a fitted model, with the noise, sensor steps and parameter covariance of the fit."""
        nodes = fit.model.nodes
        drives, steps = fit.problem.drives, fit.noise.step
        coarse = [coarse_noise(drives, row, step) if step > 0 else _LEAST_NOISE for row, step in enumerate(steps)]
        white = np.maximum(fit.noise.white, coarse)
        return cls(
            fit.model,
            noise=dict(zip(nodes, white.tolist(), strict=True)),
            step=dict(zip(nodes, steps.tolist(), strict=True)),
            error=error,
            learn=learn,
            covariance=fit.uncertainty.covariance,
        )

    # --- use --------------------------------------------------------------------------------------

    def update(self, inputs: Mapping[str, float], readings: Mapping[str, float | None], dt: float) -> Estimate:
        """Advance by `dt` with the inputs held, then take in the readings.

        Args:
            inputs: a value for each of the model's input columns; others are left aside.
            readings: temperatures [degC] by node; NaN, `None` or no entry for a missing one.
            dt: time since the last update [s]; 0 at the first one.

        Raises:
            InputError: an input that is missing or not finite, a reading that is infinite or of no node, a
                time step that is negative, not finite or longer than a day. The estimator stays as it was.
        """
        u, y = inputs_of(self.model, inputs), readings_of(self.model, readings)
        self._refuse_time(dt)
        if not self.running:
            self._begin(y, u)
        self._advance(u, dt)
        return self._correct(y)

    def advance(self, inputs: Mapping[str, float], dt: float) -> None:
        """Advance by `dt` seconds without any reading.

        Raises:
            InputError: as `update`.
        """
        u = inputs_of(self.model, inputs)
        self._refuse_time(dt)
        if not self.running:
            self._begin(np.full(len(self.model.nodes), math.nan), u)
        self._advance(u, dt)

    @property
    def running(self) -> bool:
        """Whether a first update was made, or a state restored."""
        return bool(np.isfinite(self._z).all())

    @property
    def size(self) -> int:
        """Number of the filter's states."""
        return self._dynamics.layout.size

    @property
    def estimate(self) -> Estimate:
        """What is known now, without any new reading."""
        missing = np.full(len(self.model.nodes), np.nan)
        return self._told(missing, missing)

    def state(self) -> dict[str, FloatArray]:
        """All that the estimator remembers, as plain arrays: `numpy.savez(file, **estimator.state())`."""
        return {
            "mean": self._z.copy(),
            "covariance": self._covariance.copy(),
            "resting": self._resting.copy(),
            "inputs": self._last_inputs.copy(),
        }

    def restore(self, state: Mapping[str, FloatArray]) -> None:
        """Go on from what `state` returned, by an estimator of the same model and options.

        Raises:
            InputError: an array is absent, or of another shape.
        """
        own = self.state()
        for name, array in own.items():
            shape = np.shape(state[name]) if name in state else None
            if shape != array.shape:
                found = "no such array" if shape is None else f"shape {shape}"
                raise InputError(self.model.network.origin, f"state {name}", found, f"an array of shape {array.shape}")
        self._z = np.array(state["mean"], dtype=float)
        self._covariance = np.array(state["covariance"], dtype=float)
        self._resting = np.array(state["resting"], dtype=float)
        self._last_inputs = np.array(state["inputs"], dtype=float)

    # --- what is doubted --------------------------------------------------------------------------

    def _doubt(self, walks: Mapping[str, float], covariance: FloatArray | None) -> None:
        model = self.model
        names = [unknown.name for unknown in model.unknowns]
        refuse_unknown(walks, names, model, "learn")
        refuse_negative(walks)
        free = model.free if covariance is not None else []
        if covariance is not None and np.shape(covariance) != (len(free), len(free)):
            raise ValueError(f"covariance: found shape {np.shape(covariance)}; expected {(len(free), len(free))}")
        learnt = [names.index(name) for name in walks]
        doubted = [*free, *(index for index in learnt if index not in free)]
        self._learnt = np.array([index in learnt for index in doubted], dtype=bool)
        self._doubted = [model.unknowns[index] for index in doubted]
        self._transform = Transform(self._doubted)
        self._prior = np.diag(np.full(len(doubted), _UNKNOWN**2))
        if covariance is not None:
            self._prior[: len(free), : len(free)] = covariance
        hourly = np.array([walks.get(unknown.name, 0.0) for unknown in self._doubted])
        self._dynamics = Dynamics(model, self.error, doubted, hourly**2 / _HOUR)
        declared = np.array([unknown.declared.bounds for unknown in self._doubted]).reshape(-1, 2)
        self._bounds = [self._transform.forward(bound) for bound in declared.T]

    # --- the filter -------------------------------------------------------------------------------

    def _begin(self, y: FloatArray, u: FloatArray) -> None:
        """Start at the first readings, or where the caller said; without either at the ambient, far from sure."""
        model, layout = self.model, self._dynamics.layout
        known = np.where(np.isfinite(self._given_start), self._given_start, y)
        seen = np.isfinite(known)
        air = u[[column.startswith("temperature.") for column in model.inputs]]
        near = known[seen] if seen.any() else air[np.isfinite(air)]
        if near.size == 0:
            expected = "one reading at least, or start = {...}"
            raise InputError(model.network.origin, "first update", "no reading of any node", expected)
        nodes = np.where(seen, known, near.mean())
        elsewhere = _UNMEASURED if seen.any() else _UNREAD
        scatter = np.where(seen, self._noise + self._step**2 / 12, elsewhere**2)
        owners = np.array(model.owners)
        z, spread = np.zeros(layout.size), self._dynamics.errors.copy()
        z[layout.states], spread[layout.states] = nodes[owners], scatter[owners]
        spread[len(model.nodes) : layout.states.stop] += _HIDDEN**2
        z[layout.parameters] = self._transform.forward(np.array([unknown.value for unknown in self._doubted]))
        self._covariance = np.diag(spread)
        self._covariance[layout.parameters, layout.parameters] = self._prior
        self._resting = np.array([nodes.mean()])
        self._z = z

    def _advance(self, u: FloatArray, dt: float) -> None:
        if dt == 0:
            return
        u = np.where(np.isnan(u), self._resting, u)
        if self._change.any():
            self._unsettle(u)
        moved = self._dynamics.step(self._z, u, dt)
        self._z = moved.states
        self._covariance = moved.transition @ self._covariance @ moved.transition.T + moved.gained
        self._moved = moved.transition @ self._moved

    def _unsettle(self, u: FloatArray) -> None:
        """What was learnt of the missing heat counts for less after a change of load.

        Before the first update the robot is taken to have been in balance, so that all of its imbalance is new.
        """
        change = self._dynamics.heat_flow(self._z, u)
        if np.isfinite(self._last_inputs).all():
            change = change - self._dynamics.heat_flow(self._z, self._last_inputs)
        where = np.arange(self.size)[self._dynamics.layout.heat]
        self._covariance[where, where] += (self._change * change) ** 2
        self._last_inputs = u

    def _correct(self, y: FloatArray) -> Estimate:
        self.last = None
        predicted, by_state = self._dynamics.readings(self._z)
        innovation, spreads = y - predicted, np.full(len(y), math.nan)
        seen = np.isfinite(innovation)
        h, noise, step = by_state[seen], self._noise[seen], self._step[seen]
        cross = self._covariance @ h.T
        prior = h @ cross
        spreads[seen] = np.sqrt(np.diag(prior) + noise + step**2 / 12)
        moved, variance = innovation[seen], noise + step**2 / 12
        if self._rounding == "cell" and step.any():
            moved, variance = as_gaussian(moved, np.diag(prior), noise, step)
        if seen.any():
            self._take_in(h, cross, prior + np.diag(variance), moved, variance)
        return self._told(innovation, spreads)

    def _take_in(
        self, by_state: FloatArray, cross: FloatArray, covariance: FloatArray, moved: FloatArray, variance: FloatArray
    ) -> None:
        factor = cho_factor(covariance, lower=True, check_finite=False)
        gain = cho_solve(factor, cross.T, check_finite=False).T
        # What is only doubted, not learnt, keeps its value; Joseph's form holds for that gain too.
        gain[self._dynamics.layout.parameters][~self._learnt] = 0.0
        self._z = self._z + gain @ moved
        kept = np.eye(len(self._z)) - gain @ by_state
        after = kept @ self._covariance @ kept.T + (gain * variance) @ gain.T
        self._covariance = 0.5 * (after + after.T)
        self._keep_in_bounds()
        self.last = Correction(self._moved, by_state, gain, covariance, moved)
        self._moved = np.eye(len(self._z))

    def _keep_in_bounds(self) -> None:
        where = self._dynamics.layout.parameters
        self._z[where] = np.clip(self._z[where], *self._bounds)

    def _told(self, innovation: FloatArray, spreads: FloatArray) -> Estimate:
        nodes, where = len(self.model.nodes), self._dynamics.layout.parameters
        deviations = np.sqrt(np.maximum(np.diag(self._covariance), 0.0))  # rounding may go below 0
        coordinates = self._z[where]
        values = self._transform.backward(coordinates)
        errors = deviations[where] * np.abs(self._transform.slope(values))
        learnt = {
            unknown.name: (float(value), float(error))
            for unknown, value, error, chosen in zip(self._doubted, values, errors, self._learnt, strict=True)
            if chosen
        }
        return Estimate(
            tuple(self.model.nodes), self._z[:nodes].copy(), deviations[:nodes], innovation, spreads, learnt
        )

    def _refuse_time(self, dt: float) -> None:
        if not 0 <= dt <= _DAY:
            raise InputError(self.model.network.origin, "time step", f"{dt:g} s", f"a time from 0 to {_DAY:g} s")
