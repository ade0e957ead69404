"""A fitted model with one effect more, or less, fitted again from the previous solution."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lptn.identify.fitting import Fit, fit
from lptn.identify.problem import Point
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network
from lptn.simulate.bound_run import bind, default_start, start_from

RANKING = 3e-4  # share of the cost below which ranks don't change


def refit(base: Fit, declaration: EffectDeclaration) -> Fit:
    """The baseline and one more effect, started from the baseline's solution; arguments as for `continued`."""
    return continued(base, base.model.network.with_effects([declaration]))


def continued(base: Fit, network: Network, precision: float = RANKING) -> Fit:
    """Fit a network that differs from a fitted one by some effects, started from its solution; as far as ranking needs.

    What that fit held stays held, and what it fitted is fitted.

    Args:
        base: the fit to start from.
        network: the network to fit, to the same readings.
        precision: share of the cost that is not worth another step.

    Raises:
        KeyboardInterrupt: Ctrl-C ended the fit.
    """
    model, problem = Model(network), base.problem
    bound_runs = [replace(bind(model, bound.run), counted=bound.counted) for bound in problem.bound_runs]
    old_values = {parameter.name: parameter.value for parameter in base.model.parameters}
    values = np.array([old_values.get(parameter.name, parameter.value) for parameter in model.parameters])
    fitted = {base.model.parameters[index].name for index in problem.free}
    held = {base.model.parameters[index].name for index in base.model.free} - fitted
    starts = []  # the old model's states by name, new hidden ones in equilibrium
    for start, bound in zip(base.point.starts, bound_runs, strict=True):
        nodes = dict(zip(model.nodes, default_start(model, bound).tolist(), strict=False))
        starts.append(start_from(model, bound, nodes | dict(zip(base.model.states, start.tolist(), strict=True))))
    return unless_interrupted(
        fit(
            model,
            bound_runs,
            symmetry_penalty=problem.symmetry_penalty,
            sigma=problem.sigma,
            guess=Point(values, starts),
            precision=precision,
            free=[
                index
                for index, parameter in enumerate(model.parameters)
                if parameter.name in fitted or (parameter.free and parameter.name not in held)
            ],
            tolerance=problem.tolerance,
        )
    )


def as_fitted(declared: EffectDeclaration, fit: Fit) -> EffectDeclaration:
    """An effect with the values that a fit gave it."""
    found = [(own, fit.model.named.get(declared.shared_name(own.name))) for own in declared.parameters]
    values = (replace(own, value=instance.value) if instance else own for own, instance in found)
    return replace(declared, parameters=tuple(values))


def unless_interrupted(done: Fit) -> Fit:
    """A fit as it is; a search of many fits stops where one was stopped, since a half-done one decides nothing.

    Raises:
        KeyboardInterrupt: Ctrl-C ended the fit.
    """
    if done.status == "interrupted":
        raise KeyboardInterrupt
    return done
