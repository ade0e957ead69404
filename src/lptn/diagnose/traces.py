"""Traces: what effects that are switched off would do to the residuals of a fit, to first order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.places import EVERYWHERE, is_of_run
from lptn.identify.fitting import Fit
from lptn.identify.problem import rows_of_readings
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration
from lptn.simulate.bound_run import bind, start_from
from lptn.simulate.simulation import sensitivity_windows

_ANY_RUN = "?*"  # a glob of all runs that no model file writes


def derivatives(fit: Fit, sites: Sequence[EffectDeclaration]) -> FloatArray:
    """Weighted derivatives of the residuals by the amplitudes of `Candidate.sites`, shape (rows, sites), by columns.

    All sites are switched off in one model, which equals the fitted one to the last bit: one pass of sensitivities
    gives the whole catalogue. What acts in one run alone does there what it does in every run.
    """
    problem, in_any = fit.problem, [replace(site, run=_ANY_RUN) if site.run else site for site in sites]
    names = [site.shared_name(amplitude.name) for site in in_any if (amplitude := site.effect.amplitude())]
    distinct = dict(zip(names, in_any, strict=True))
    number_of = {name: number for number, name in enumerate(distinct)}
    full = fit.model.made_once(
        ("sites", tuple(distinct)), lambda: Model(fit.model.network.with_effects(distinct.values()))
    )
    values, index = full.values, {parameter.name: number for number, parameter in enumerate(full.parameters)}
    values[[index[parameter.name] for parameter in fit.model.parameters]] = fit.model.values
    amplitudes = [index[name] for name in distinct]
    core = len(fit.model.states)  # effects are added behind the network's own, and so are their states
    numbers = [number_of[name] for name in names]
    # By columns, as candidates sum them up; the penalties' rows stay zero, for no site enters them.
    by_site = np.zeros((problem.rows, len(sites)), order="F")
    first = 0
    for bound, start in zip(problem.bound_runs, fit.point.starts, strict=True):
        wide = bind(full, bound.run)
        states = start_from(full, wide, dict(zip(fit.model.states, start.tolist(), strict=True)))
        row_of = rows_of_readings(bound) + first
        acting = np.array([is_of_run(bound.run.name, site.run or EVERYWHERE) for site in sites])
        for window, moved in sensitivity_windows(full, wide, values, amplitudes, states, core):
            counted = bound.counted[:, window]
            scale = 1.0 / np.repeat(problem.sigma, counted.sum(axis=1))[:, None]
            by_site[row_of[:, window][counted]] = (moved.by_parameter[counted] * scale)[:, numbers] * acting
        first += int(bound.counted.sum())
    return by_site


def pushed_beyond_bounds(fit: Fit, gradient: FloatArray) -> BoolArray:
    """Which unknowns are pushed beyond bounds that hold, shape (size,): they can't follow what a candidate would do.

    So are an effect where it vanishes (no friction cools a joint in place of air that is cooler than the log says), and
    a whole share. (Other parameters at a bound could follow, if it were moved: it is a user's guess.)
    """
    problem, holds = fit.problem, np.zeros((2, len(fit.z)), dtype=bool)
    for row, index in enumerate(problem.free):
        own = fit.model.parameters[index].declared
        for side, end in enumerate(own.bounds):
            holds[side, row] = end in own.ends_by_nature
    below, above = problem.at_bounds(fit.z)
    return np.asarray((holds[0] & below & (gradient > 0)) | (holds[1] & above & (gradient < 0)))
