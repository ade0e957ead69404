"""A fitted model with one effect more, or less, fitted again from where it stood."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from math import log

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.diagnose.plausibility import FACTOR
from lptn.identify.fitting import Fit, fit
from lptn.identify.problem import Point
from lptn.identify.uncertainty import rows_at_bounds
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network
from lptn.simulate.bound_run import BoundRun, bind, default_start, start_from

_ITERATIONS, _PRECISION = 25, 3e-4  # of the cost: enough to rank; the step that is kept is fitted to the end


def refit(base: Fit, declaration: EffectDeclaration, rival: float = np.inf) -> Fit:
    """The baseline and one more effect, started from the baseline's solution; `rival` as for `identify.fit`.

    What would vanish beside the effect is kept, see `kept_beside`: an effect that only stands in for it then explains
    little, and one that explains more is not lost for what else is still wrong.
    """
    network, within = base.model.network.with_effects([declaration]), dict[str, Bounds]()
    while True:
        done = continued(base, network, rival, within)
        kept = kept_beside(done, base)
        if not kept or done.status == "given up":
            return done
        within |= kept


Bounds = tuple[float, float]
"""The least and the largest value of a parameter, in its unit."""


def kept_beside(fit: Fit, given: Fit) -> dict[str, Bounds]:
    """Bounds, by name, of what vanishes in a fit though a given one tells it: links, capacities and windings' losses.

    They end at a bound, a factor of three off. No effect stands for a link that may as well be none, or for a capacity
    that nothing tells: within these bounds they are no farther off. What is nearer to its own bound, the right effect
    may bring there: bounds are a user's guess.
    """
    before = {parameter.name: parameter.value for parameter in given.model.parameters}
    after = {parameter.name: parameter for parameter in fit.model.parameters}
    kept = {}
    for name, side in fit.vanished.items():
        told = name in before and name not in given.vanished and not given.may_be_at_bound(name, side)
        if told and abs(log(after[name].value / before[name])) > log(FACTOR):
            lower, upper = after[name].declared.bounds
            kept[name] = (lower, FACTOR * before[name]) if side else (before[name] / FACTOR, upper)
    return kept


def holds_up(fit: Fit) -> bool:
    """Whether only the bounds that it is kept within hold up something that the given model tells."""
    ended = {fit.model.parameters[fit.problem.free[row]].name for row in rows_at_bounds(fit.problem, fit.z)}
    return not ended.isdisjoint(fit.problem.within)


def continued(base: Fit, network: Network, rival: float = np.inf, within: Mapping[str, Bounds] | None = None) -> Fit:
    """Fit a network that differs from a fitted one by some effects, started from its solution; as far as ranking needs.

    What that fit held stays held, what it fitted is fitted, and what it kept within bounds stays within them.

    Args:
        base: the fit to start from.
        network: the network to fit, to the same readings.
        rival: a cost to beat; a fit that has no hope of it ends, with status `"given up"`.
        within: as for `Problem`.

    Raises:
        KeyboardInterrupt: Ctrl-C ended the fit.
    """
    model, problem = Model(network), base.problem
    bound_runs = [replace(bind(model, bound.run), counted=bound.counted) for bound in problem.bound_runs]
    old_values = {parameter.name: parameter.value for parameter in base.model.parameters}
    values = np.array([old_values.get(parameter.name, parameter.value) for parameter in model.parameters])
    fitted = {base.model.parameters[index].name for index in problem.free}
    held = {base.model.parameters[index].name for index in base.model.free} - fitted
    starts = [
        _carried_over(base.model, model, start, bound)
        for start, bound in zip(base.point.starts, bound_runs, strict=True)
    ]
    return unless_interrupted(
        fit(
            model,
            bound_runs,
            symmetry_penalty=problem.symmetry_penalty,
            sigma=problem.sigma,
            guess=Point(values, starts),
            iterations=_ITERATIONS,
            rival=rival,
            precision=_PRECISION,
            free=[
                index
                for index, parameter in enumerate(model.parameters)
                if parameter.name in fitted or (parameter.free and parameter.name not in held)
            ],
            within={**problem.within, **(within or {})},
        )
    )


def _carried_over(old: Model, new: Model, states: FloatArray, bound: BoundRun) -> FloatArray:
    """Initial states of the new model: those of the old one by name, new hidden states in equilibrium."""
    nodes = dict(zip(new.nodes, default_start(new, bound).tolist(), strict=False))
    return start_from(new, bound, nodes | dict(zip(old.states, states.tolist(), strict=True)))


def unless_interrupted(done: Fit) -> Fit:
    """A fit as it is; a search of many fits stops where one was stopped, since a half-done one decides nothing.

    Raises:
        KeyboardInterrupt: Ctrl-C ended the fit.
    """
    if done.status == "interrupted":
        raise KeyboardInterrupt
    return done
