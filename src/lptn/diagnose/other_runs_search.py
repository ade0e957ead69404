"""The size that one effect would need in one run to explain it, everything else of a fitted model held."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares

from lptn.arrays import BoolArray, FloatArray
from lptn.compare import predict
from lptn.diagnose.candidates import Candidate, candidates
from lptn.diagnose.differing import short
from lptn.evidence import Part
from lptn.model import Model
from lptn.network import Network
from lptn.parameters import Parameter
from lptn.places import EVERYWHERE, in_run
from lptn.simulate import SimulationError, drive

_STEP = 0.05  # of the typical size, for the slope by the amplitude
_TRIES = 25
_EDGE = 1e-3  # relative; so near a bound, the size is only a limit
_PLAIN = "in {run}{at}: {title}, {amplitude}"
_HOPELESS = 1e3  # weighted residual of an amplitude at which the model can't be simulated


@dataclass(frozen=True)
class Search:
    """A candidate in the model, switched off: which of the model's parameters is its amplitude, and what moves.

    Args:
        candidate: effect, place and run.
        model: the fitted model and the candidate.
        index: of the amplitude among the model's parameters.
        part: the run.
        sigma: standard deviation that weighs each node [K], shape (nodes,).
    """

    candidate: Candidate
    model: Model
    index: int
    part: Part
    sigma: FloatArray

    @property
    def declared(self) -> Parameter:
        """The amplitude."""
        return self.model.unknowns[self.index].declared

    @cached_property
    def counted(self) -> BoolArray:
        """All readings of the run, shape (nodes, n)."""
        return np.isfinite(drive(self.model, self.part.run).measured)

    def at(self, value: float) -> Model:
        """The model at an amplitude."""
        values = self.model.values
        values[self.index] = value
        return self.model.with_values(values)

    def residuals(self, value: float) -> FloatArray:
        """Weighted errors of the whole run at an amplitude, shape (readings,), its start found in the opening."""
        try:
            found = predict(self.at(value), self.part, self.sigma)
        except SimulationError:
            return np.full(int(self.counted.sum()), _HOPELESS)
        return np.asarray(((found.readings - found.drive.measured) / self.sigma[:, None])[self.counted])

    def slope(self, value: float, residuals: FloatArray) -> FloatArray:
        """Derivative by the amplitude, over a step large against what is unsure about the start, shape (readings,)."""
        step = _STEP * abs(self.declared.typical)
        step = step if value + step < self.declared.bounds[1] else -step
        return np.asarray((self.residuals(value + step) - residuals) / step)

    @cached_property
    def likeness(self) -> float:
        """Squared cosine between the error and what a small amplitude removes; 0 where that has the wrong sign."""
        off = self.declared.off or 0.0
        error = self.residuals(off)
        slope = self.slope(off, error)
        along, length = float(error @ slope), float(np.linalg.norm(error) * np.linalg.norm(slope))
        one_sided = self.declared.bounds[0] == off
        return 0.0 if length == 0 or (one_sided and along > 0) else (along / length) ** 2

    def best(self) -> float:
        """The amplitude with the least misfit over the whole run."""
        typical = abs(self.declared.typical)
        lower, upper = (bound / typical for bound in self.declared.bounds)

        def residuals(share: FloatArray) -> FloatArray:
            return self.residuals(typical * float(share[0]))

        def jacobian(share: FloatArray) -> FloatArray:
            slope = self.slope(typical * float(share[0]), residuals(share))
            return np.asarray(typical * slope)[:, None]

        begun = [max(_STEP, lower)]  # a one-sided amplitude can't be searched from its bound
        solved = least_squares(residuals, begun, jac=jacobian, bounds=([lower], [upper]), max_nfev=_TRIES)
        return float(typical * solved.x[0])

    def in_words(self, size: float) -> str:
        """What an amplitude in this run means, by the effect's own sentence."""
        at, effect = self.candidate.pattern, self.candidate.effect
        lower, upper = self.declared.bounds
        most, least = (abs(size - bound) <= _EDGE * abs(bound) for bound in (upper, lower))
        more, less = effect.in_one_run
        return ((more if size >= 0 else less) or _PLAIN).format(
            run=self.part.run.name,
            title=effect.title,
            at="" if at == EVERYWHERE else f" at {at}",
            of="every sensor" if at == EVERYWHERE else f"the sensor of {at}",
            into="every node" if at == EVERYWHERE else at,
            place=at,
            size=("at least " if most or least else "") + short(abs(size)),
            factor=("at least " if most else "at most " if least else "") + short(1 + size),
            amplitude=f"{size:.3g} {self.declared.unit}",
        )


def possible(network: Network, part: Part) -> list[Candidate]:
    """Every effect that may differ from run to run, at each of its places, in this run alone."""
    run = part.run.name.partition("#")[0]
    return [each for each in candidates(network, part.run.columns, ["", run]) if each.run == run]


def search_of(fitted: Model, part: Part, candidate: Candidate, sigma: FloatArray) -> Search:
    """The search for a candidate's amplitude, every parameter of a fitted model held."""
    declaration = candidate.declaration(0.0, candidate.shapes[0])
    model = Model(fitted.network.with_effects([declaration]))
    amplitude = candidate.effect.amplitude()
    called = "" if amplitude is None else amplitude.name
    name = in_run(f"{declaration.name}.{called}.{candidate.pattern}", candidate.run)
    index = next(number for number, each in enumerate(model.unknowns) if each.name == name)
    return Search(candidate, model, index, part, sigma)
