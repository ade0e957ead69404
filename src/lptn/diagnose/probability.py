"""How probable each of several fitted models is, by the fitted data and by what is known of effects beforehand.

The data speak by Schwarz's criterion, counted in independent residuals. What a model gets wrong varies from minute to
minute, from sensor to sensor, from run to run, so that of two models now one and now the other is ahead: the Bayesian
bootstrap weighs blocks of time, nodes and runs anew a thousand times [Owen2007], and a model's probability is its mean
over those draws (pseudo-BMA+, [Yao2018]).

Beforehand an effect is as probable as such things are met where it may stand, a size as usual there
(`lptn.diagnose.plausibility`), and a start as robots begin: at rest, or warm.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import combinations
from math import log, pi, sqrt
from typing import Literal

import numpy as np
from scipy.special import logsumexp, ndtr, softmax

from lptn.basics.arrays import BoolArray, FloatArray, IntArray
from lptn.basics.parameters import Parameter
from lptn.basics.places import EVERYWHERE, is_of_run, is_pattern
from lptn.diagnose.candidates import Candidate
from lptn.diagnose.fit_statistics import (
    RunErrors,
    block_misfits,
    fitted_errors,
    independent_readings,
    predicted_errors,
)
from lptn.diagnose.plausibility import (
    BELIEVED,
    LEAST_SHARE,
    is_at,
    is_beyond_belief,
    is_beyond_calibration,
    is_error,
    log_prior_of_size,
)
from lptn.diagnose.refits import kept_beside
from lptn.diagnose.scores import Score
from lptn.effects import Effect
from lptn.identify.comparison import Prediction
from lptn.identify.fitting import Fit
from lptn.identify.problem import AT_REST
from lptn.model.network import EffectDeclaration
from lptn.simulate.bound_run import start_from
from lptn.simulate.dynamics import slopes_at_points
from lptn.simulate.simulation import simulate

_DRAWS = 1000  # of the weights: a probability of a half is met within 0.016
OCCAM = 20.0
"""Times less probable than the best, from which on a model is out of Occam's window [MadiganRaftery1994]."""


def probabilities(
    fits: Sequence[Fit], log_priors: FloatArray, predicted: Sequence[Sequence[Prediction]] = ()
) -> FloatArray:
    """Probability of each of several fits to the same runs, given that one of them is right, shape (fits,).

    Args:
        fits: to compare.
        log_priors: logarithm of what is thought of each beforehand, up to a common constant, shape (fits,).
        predicted: held-out runs as each fit predicts them; with them it is the probability by all runs.
    """
    return _Fits(fits, log_priors, predicted).probabilities(np.arange(len(fits)))


def open_pairs(fits: Sequence[Fit], log_priors: FloatArray) -> BoolArray:
    """Which two of several fits to the same runs do not rule each other out, shape (fits, fits); no fit its own.

    Arguments as for `probabilities`.
    """
    compared, open_ = _Fits(fits, log_priors), np.zeros((len(fits), len(fits)), dtype=bool)
    for one, other in combinations(range(len(fits)), 2):
        both = len(in_occams_window(compared.probabilities(np.array([one, other])))) == 2
        open_[one, other] = open_[other, one] = both
    return open_


class _Fits:
    """Fits to the same runs, each with all that is asked of it whenever some of them are compared.

    Arguments as for `probabilities`.
    """

    def __init__(
        self, fits: Sequence[Fit], log_priors: FloatArray, predicted: Sequence[Sequence[Prediction]] = ()
    ) -> None:
        sigma = fits[0].problem.sigma
        self.free = np.array([len(fit.free) for fit in fits])
        self.log_priors, self.of_parameters = log_priors, np.array(list(map(_log_prior_of, fits)))
        self.fitted = _Misfits([fitted_errors(fit) for fit in fits], sigma)
        self.predicted = _Misfits([predicted_errors(runs) for runs in predicted], sigma) if predicted else None

    def probabilities(self, chosen: IntArray) -> FloatArray:
        """Of the chosen fits, given that one of them is right, shape (chosen,)."""
        logarithms = self.fitted.log_likelihoods(chosen, self.free[chosen]) + self.log_priors[chosen]
        logarithms += max(map(self.fitted.independent_share, chosen)) * self.of_parameters[chosen]
        if self.predicted is not None:
            logarithms += self.predicted.log_likelihoods(chosen)
        return np.asarray(softmax(logarithms, axis=1).mean(axis=0))


class _Misfits:
    """What several models leave of the same runs, in each draw of weights.

    Args:
        models: for each the runs with its errors.
        sigma: standard deviation that weighs each node's errors [K], shape (nodes,).
    """

    def __init__(self, models: Sequence[Sequence[RunErrors]], sigma: FloatArray) -> None:
        by_block = [block_misfits(runs, sigma) for runs in models]
        misfits, runs = np.array([misfit for misfit, _ in by_block]), by_block[0][1]
        self._models = models
        self._squares = misfits.sum(axis=(1, 2))
        self._independent: dict[int, float] = {}
        rng = np.random.default_rng(0)
        of_blocks, of_nodes, of_runs = (
            rng.dirichlet(np.ones(count), _DRAWS) * count for count in (*misfits.shape[1:], len(models[0]))
        )
        weighted = np.einsum("db,dn,fbn->df", of_blocks * of_runs[:, runs], of_nodes, misfits)
        self._logarithms = np.log(np.maximum(weighted, 1e-300))

    def independent(self, model: int) -> float:
        """How many readings are as good as independent, by one model's errors; worked out once."""
        if model not in self._independent:
            self._independent[model] = independent_readings(self._models[model])
        return self._independent[model]

    def independent_share(self, model: int) -> float:
        """As `_independent_share` says it of one model's errors."""
        return _share(self.independent(model), self._squares[model])

    def log_likelihoods(self, chosen: IntArray, free: FloatArray | float = 0.0) -> FloatArray:
        """Schwarz's criterion of each chosen model in each draw, as a logarithm, shape (draws, chosen).

        Args:
            chosen: numbers of models.
            free: the number of parameters that each was fitted with.
        """
        independent = self.independent(int(chosen[np.argmin(self._squares[chosen])]))
        penalties = 0.5 * free * np.log(independent)
        return np.asarray(-0.5 * independent * self._logarithms[:, chosen] - penalties)


def _independent_share(errors: Sequence[RunErrors], sigma: FloatArray) -> float:
    """How much a squared weighted error counts, 1 at most: less where errors repeat, or are larger than their weights.

    Fits follow what a model lacks with all that may move, so that this holds for what parameters are off their priors
    as well. Errors that are smaller than their weights make nothing surer than it was beforehand.
    """
    return _share(independent_readings(errors), float(block_misfits(errors, sigma)[0].sum()))


def _share(independent: float, squares: float) -> float:
    return min(1.0, independent / max(squares, 1e-300))


def _log_prior_of(fit: Fit) -> float:
    """How far the fitted parameters are off their priors, and mirrored pairs off each other, as a logarithm."""
    off = fit.problem.off_priors(fit.z) / fit.problem.weight_of_priors
    return -0.5 * float(off @ off)


def probabilities_by_score(fit: Fit, scores: Sequence[Score], matters: float) -> FloatArray:
    """Probability of each candidate to be missing where none was worth a refit, shape (scores,); the rest is nothing's.

    A candidate counts by its evidence to first order: its size is normal about none, with the usual size as standard
    deviation, and what the residuals say of it is normal, too. What is too small to matter is as good as nothing, and
    that nothing is missing is as probable beforehand as that something is, however many candidates there are
    [ScottBerger2010].

    Args:
        fit: the model as it stands.
        scores: of all candidates.
        matters: the gain from which on an effect matters.
    """
    independent = _independent_share(fitted_errors(fit), fit.problem.sigma)
    estimate = np.sqrt([independent * score.gain for score in scores])
    usual = np.array([independent * (score.candidate.typical * score.per_unit) ** 2 for score in scores])
    least = np.sqrt(independent * matters)
    shrinkage = usual / (1.0 + usual)
    size, deviation = estimate * shrinkage, np.sqrt(np.maximum(shrinkage, LEAST_SHARE))
    above = ndtr((size - least) / deviation)
    below = np.where([score.candidate.one_sided for score in scores], above, ndtr((-size - least) / deviation))
    beforehand = log_priors([score.candidate for score in scores])
    evidence = beforehand - logsumexp(beforehand) - 0.5 * np.log1p(usual) + 0.5 * estimate**2 * shrinkage
    odds = np.exp(evidence) * (above + below)
    return np.asarray(odds / (1.0 + odds.sum()))


def log_odds_by_score(fit: Fit, scores: Sequence[Score], log_priors: FloatArray) -> FloatArray:
    """How probable first order makes each candidate beside the others, as a logarithm, shape (scores,): what to refit.

    By Schwarz's criterion and by what is thought beforehand of it and of its size. First order says little of how large
    a large effect is, so that a size counts against it no more than one that is barely believed.

    Args:
        fit: the model as it stands.
        scores: of candidates.
        log_priors: logarithm of the odds of each beforehand, shape (scores,).
    """
    errors = fitted_errors(fit)
    squares = float(block_misfits(errors, fit.problem.sigma)[0].sum())
    left = np.array([max(1.0 - score.gain / squares, LEAST_SHARE) for score in scores])
    sizes = [log_prior_of_size(score.candidate.amplitude, score.amplitude) for score in scores]
    return np.asarray(-0.5 * independent_readings(errors) * np.log(left) + log_priors + np.maximum(sizes, -BELIEVED))


def in_occams_window(probabilities: FloatArray) -> list[int]:
    """Numbers of the models that the most probable one does not rule out, the most probable first."""
    order = np.argsort(-probabilities, kind="stable")
    return [int(number) for number in order if probabilities[number] * OCCAM >= probabilities[order[0]]]


# --- What is thought beforehand of an effect at a place, and of its size ------------------------------------


_WARMER = 10.0
"""K, by which a robot's node is usually warmer than its surroundings while it works, or another room than this one."""
_AS_BEFORE = 60.0
"""s, for which a robot mostly goes on as before when its log begins: what forgets in less is then in equilibrium."""
_FAR, _ROOMS = 10.0, 400  # K beyond the nodes; temperatures of the other room over which is summed
_ERRORS_ALIKE = 0.1
"""How usual the same error of several sensors is beside an error of one. A defect befalls single sensors; to drift
alike, or to be off alike, they need a cause in common, such as the supply of all their bridges."""
_ONE_OF_LIKES = 0.3
"""How usual it is of one place alone, beside others like it, to have what follows from how it is built: as other rare
things are (`Effect.prior_odds`). Like parts are painted alike, and all windings are copper: a joint that loses more
heat than its likes is in a draught rather than the only one that radiates."""


Level = Literal["all", "class", "one", "one of likes"]


def log_priors(candidates: Sequence[Candidate]) -> FloatArray:
    """Logarithms of the odds, beforehand, that it is this candidate that is missing, shape (candidates,).

    An effect's odds are split over its levels (everywhere, a class of nodes, one node), evenly but for errors of
    sensors and for what like places have alike; then evenly over the places of a level. Those of single runs likewise.
    """
    weights = np.zeros(len(candidates))
    for effect in {candidate.effect: None for candidate in candidates}:
        own = [k for k, candidate in enumerate(candidates) if candidate.effect is effect]
        most = max(len(candidates[k].places) for k in own)
        levels = [(bool(candidates[k].run), _level(candidates[k], most)) for k in own]
        for k, level in zip(own, levels, strict=True):
            shares = {other: _share_of_level(effect, other[1]) for other in levels if other[0] == level[0]}
            weights[k] = candidates[k].prior_odds * shares[level] / sum(shares.values()) / levels.count(level)
    return np.asarray(np.log(weights))


def _share_of_level(effect: type[Effect], level: Level) -> float:
    if effect.errs and level != "one":
        return _ERRORS_ALIKE
    return _ONE_OF_LIKES if level == "one of likes" else 1.0


def _level(candidate: Candidate, most: int) -> Level:
    if len(candidate.places) == 1:
        return "one of likes" if candidate.one_of_likes else "one"
    return "all" if candidate.pattern == EVERYWHERE or len(candidate.places) == most else "class"


def log_prior_of_sizes(fit: Fit, declarations: Iterable[EffectDeclaration]) -> float:
    """How usual the fitted sizes of added effects are, as a logarithm: 0 for what is usual, less for what is not.

    Sensors that are alike off by more than calibration leaves have a cause in common, so that as many are no less usual
    than one (`log_priors` has them off by as little as it leaves).
    """
    total = 0.0
    for declaration in declarations:
        for parameter in _free_parameters(fit, [declaration]):
            total += log_prior_of_size(parameter, parameter.value)
            if is_pattern(declaration.at) and is_beyond_calibration(parameter, parameter.value):
                total -= log(_ERRORS_ALIKE)
    return total


def log_prior_of_starts(fit: Fit) -> float:
    """How usual it is that the measured nodes start each run where the fit has them, as a logarithm.

    A robot that rested is as warm as what surrounds it, or as another room that it was carried from. Of its nodes each
    may be warmer than that, from what it did before or from its electronics, but none is colder. So the error of a
    sensor that reads off the air before anything runs is likely, and one that reads as it should, because its node was
    colder by as much, is not. Either is as probable beforehand; how much warmer has long tails (Cauchy's).
    """
    model, total = fit.model, 0.0
    if not model.network.prescribed:
        return total
    for bound, start in zip(fit.problem.bound_runs, fit.point.starts, strict=True):
        values = model.in_run(bound.run.name, fit.point.values)
        felt = model.surroundings(start, bound.inputs[:, 0], values).full().ravel()
        nodes = start[: len(model.nodes)][np.isfinite(bound.start)]
        off = nodes - np.clip(nodes, felt.min(), felt.max())
        rooms = np.linspace(off.min(initial=0.0) - _FAR, off.max(initial=0.0) + _FAR, _ROOMS)
        of_rooms = np.append(_log_cauchy(rooms) + log(rooms[1] - rooms[0]), 0.0)
        total += float(logsumexp(of_rooms + _log_density_of_starts(off, np.append(rooms, 0.0)))) - log(2.0)
    return total


def _log_density_of_starts(off: FloatArray, rooms: FloatArray) -> FloatArray:
    """Of nodes that start so much off their surroundings [K], in a robot that rested in each of some rooms."""
    above = off - rooms[:, None]
    at_rest = -0.5 * (above / AT_REST) ** 2 - log(AT_REST * sqrt(2 * pi))
    warmer = np.where(above > 0, log(2.0) + _log_cauchy(above), -np.inf)
    return np.asarray(np.sum(np.logaddexp(at_rest, warmer) - log(2.0), axis=1))


def _log_cauchy(kelvin: FloatArray) -> FloatArray:
    return np.asarray(-np.log1p((kelvin / _WARMER) ** 2) - log(pi * _WARMER))


def log_evidence_of_starts(fit: Fit) -> float:
    """What it costs a model, as a logarithm, that its hidden states start each run where the data like; 0 without any.

    A second mass that starts a short run some kelvins off its node may explain all that is left of that run. Each
    state may have begun in equilibrium, or as far off as it is in use: of a slow one either is as probable, of one that
    forgets within seconds the second hardly is, except behind a gap, where the robot was at work. In the first case the
    model loses what the fitted start explains. In the second the start is an unknown, which is paid for by how far it
    is from equilibrium and by how much narrower the data make it (Laplace's method [MacKay1992]). Beforehand it is as
    wide as the state is off equilibrium in use, and no wider than in a robot that begins so warm. Nobody knows what
    went on before a log began, so that what is expected has long tails (Cauchy's). Readings count as often as they are
    independent.
    """
    problem, nodes, states = fit.problem, len(fit.model.nodes), len(fit.model.states)
    if states == nodes:
        return 0.0
    errors, start = fitted_errors(fit), len(problem.free)
    off, spreads = problem.starts_off(fit.point.starts)
    precision = 1.0 / spreads.ravel() ** 2
    independent = independent_readings(errors) / block_misfits(errors, problem.sigma)[0].sum()
    by_data = independent * (problem.normal(fit.z)[1][start:, start:] - np.diag(precision))
    in_use, total = _off_in_use(fit), 0.0
    for run, (bound, first) in enumerate(zip(problem.bound_runs, range(0, len(precision), states), strict=True)):
        seen, hidden = slice(first, first + nodes), slice(first + nodes, first + states)
        of_seen = by_data[seen, seen] + np.diag(precision[seen])
        information = by_data[hidden, hidden] - by_data[hidden, seen] @ np.linalg.solve(of_seen, by_data[seen, hidden])
        of_data, distance = np.maximum(np.diag(information), 0.0), off[run, nodes:] * spreads[run, nodes:]
        in_equilibrium = -0.5 * distance**2 * of_data
        usual = np.fmin(in_use, spreads[run, nodes:] * problem.weight_of_priors)
        wider = 1.0 + of_data * usual**2
        usual_sizes = distance * of_data * usual / wider  # of the start that so narrow a prior leaves
        as_in_use = -np.log1p(usual_sizes**2) - 0.5 * of_data * (distance / wider) ** 2 - 0.5 * np.log(wider)
        values = fit.model.in_run(bound.run.name, fit.point.values)
        at_start = fit.point.starts[run][:, None], bound.inputs[:, :1], values
        rates = np.diag(slopes_at_points(fit.model, *at_start)[0])[nodes:]
        as_before = max(_AS_BEFORE - bound.run.late, 0.0)
        moved = 0.5 / (1.0 + as_before * np.maximum(-rates, 0.0))
        total += float(np.sum(np.logaddexp(np.log(1.0 - moved) + in_equilibrium, np.log(moved) + as_in_use)))
    return total


def _off_in_use(fit: Fit) -> FloatArray:
    """Root mean square of how far each hidden state is from its nodes in use [K], shape (hidden,).

    Over the fitted runs in which it acts, begun in equilibrium, so that no start speaks for itself; infinite for a
    state that rests with no node.
    """
    model, nodes = fit.model, len(fit.model.nodes)
    shares, own_runs = model.resting_shares, [instance.declaration.run for instance in model.balance.hidden]
    squares, counts = np.zeros(len(shares)), np.zeros(len(shares))
    for bound, start in zip(fit.problem.bound_runs, fit.point.starts, strict=True):
        begun = start_from(model, bound, dict(zip(model.nodes, start[:nodes].tolist(), strict=True)))
        states = simulate(model, bound, fit.point.values, begun).states
        acting = [not own or is_of_run(bound.run.name, own) for own in own_runs]
        acts = np.array([True] * (len(shares) - len(acting)) + acting)
        squares += acts * np.sum((states[nodes:] - shares @ states[:nodes]) ** 2, axis=1)
        counts += acts * states.shape[1]
    known = (counts > 0) & (shares.sum(axis=1) > 0)
    return np.asarray(np.sqrt(np.divide(squares, counts, out=np.full(len(shares), np.inf), where=known)))


def is_implausible(fit: Fit, declarations: Iterable[EffectDeclaration], given: Fit) -> bool:
    """Whether an added effect's size is none that anyone would believe.

    It is much larger than usual, or went as far as nature lets it, or takes more off a place than that has in common
    with others, or in place of a link, a capacity or a winding's loss that the model was given with, which vanishes; or
    it is finer than the log: a row may be stamped where its interval begins or where it ends, so that a clock is known
    to half a step.

    Args:
        fit: with the effects.
        declarations: of these.
        given: the model that they were added to, fitted.
    """
    step, declared = max(bound.run.step for bound in fit.problem.bound_runs), list(declarations)
    if kept_beside(fit, given):
        return True
    return _takes_more_than_there_is(fit, declared) or any(
        is_beyond_belief(parameter, parameter.value)
        or _is_at_its_end(parameter)
        or (is_error(parameter) and parameter.unit == "s" and abs(parameter.value) < 0.5 * step)
        for parameter in _free_parameters(fit, declared)
    )


def _takes_more_than_there_is(fit: Fit, declarations: Sequence[EffectDeclaration]) -> bool:
    """Whether a difference is more negative than what it adds to: conduction would carry heat from cold to warm.

    What multiplies has bounds of its own for that.
    """
    network, values = fit.model.network, fit.model.values
    for difference in (declaration for declaration in declarations if declaration.difference):
        effect, amplitude = difference.effect, difference.effect.amplitude()
        one_sided = amplitude is not None and amplitude.off == amplitude.bounds[0]
        if amplitude is None or not one_sided or effect.changes_link or effect.scales_heat:
            continue
        total: dict[str, float] = {}
        for instance in network.effect_instances:
            if instance.effect.key == effect.key and not instance.declaration.run:
                total[instance.place] = total.get(instance.place, 0.0) + values[instance.parameters[amplitude.name]]
        if any(total[place] < 0.0 for place, _ in network.places_for(difference)):
            return True
    return False


def _free_parameters(fit: Fit, declarations: Iterable[EffectDeclaration]) -> list[Parameter]:
    """Each free parameter of added effects, at its fitted value."""
    free = {fit.model.parameters[index].name: fit.model.parameters[index].declared for index in fit.problem.free}
    names = (
        declaration.shared_name(parameter.name) for declaration in declarations for parameter in declaration.parameters
    )
    return [free[name] for name in names if name in free]


def _is_at_its_end(parameter: Parameter) -> bool:
    """Whether an amplitude stands at a bound that is not nature's, and would go on: it explains what it is not."""
    chosen = [end for end in parameter.bounds if end not in parameter.ends_by_nature]
    return parameter.off is not None and any(is_at(parameter.value, end) for end in chosen)
