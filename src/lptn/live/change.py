"""A robot that is not its model any more: what its last hours say of parameters, and of effects that it lacks."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lptn.basics.parameters import Transform
from lptn.diagnose.answers import named
from lptn.diagnose.diagnosis import diagnose
from lptn.identify.data import split_data
from lptn.identify.fitting import Fit
from lptn.identify.noise import estimate_noise
from lptn.identify.validation import fit_segments
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.tables import FitTable
from lptn.online.present import ModelUncertainty
from lptn.simulate.bound_run import bind

_MOVED = 3.0
"""Standard deviations of a prior from its mean, further than which one parameter in 400 is by chance."""

_SURE = 0.99  # a probability above which its digits say nothing


def held_by_fit(model: Model, table: FitTable, runs: Sequence[Run]) -> Model:
    """The model whose parameters are held where its fit left them, by twice their standard errors.

    Without a fit, or by one that plainly misses its readings, they are held by what data sheets are off.
    """
    floor = estimate_noise([bind(model, run) for run in runs], model.nodes).floor
    free = [model.parameters[index] for index in model.free]
    values = model.values[model.free]
    covariance = ModelUncertainty.of_table(model, table, floor).covariance
    deviations = np.sqrt(np.diag(covariance)) * np.abs(Transform(free).slope(values))
    pairs = zip(values.tolist(), deviations.tolist(), strict=True)
    priors = {one.name: pair for one, pair in zip(free, pairs, strict=True) if pair[1] > 0}
    return Model(replace(model.network, priors=priors), model.standard_errors)


def moved(fit: Fit) -> list[str]:
    """The parameters that data have moved further than by chance from what they were held by, the furthest first."""
    found = []
    for one in (fit.model.parameters[index] for index in fit.free):
        if one.declared.prior is not None:
            before, spread = one.declared.prior
            words = f"{one.name} {before:.3g} → {one.value:.3g} {one.declared.unit}"
            found.append((abs(one.value - before) / spread, words))
    return [words for away, words in sorted(found, reverse=True) if away > _MOVED]


def what_changed(model: Model, table: FitTable, runs: Sequence[Run]) -> list[str]:
    """What runs say is likely: what sets a place or a sensor apart, or, where nothing does, parameters that have moved.

    What all parts have is none of it: they had it before, and the model's fit made up for it.
    """
    found = diagnose(held_by_fit(model, table, runs), split_data(runs))
    words = []
    for step in found.steps:
        if not step.is_structure:
            share = f"{100 * step.probability:.0f} %" if step.probability < _SURE else "> 99 %"
            words.append(f"{named(step.key)}, {share} probable")
    return words or moved(found.fit)


def learnt(model: Model, table: FitTable, runs: Sequence[Run]) -> Fit:
    """The model fitted to the last hours' runs, its parameters held by its fit."""
    return fit_segments(held_by_fit(model, table, runs), split_data(runs).fit)
