"""The structure of a machine, and the findings that set its parts apart.

1. *Made of*: what every part may have (`Effect.common`) goes into the model at once, everywhere, each size and time
   constant with its prior, and its bound at none. One fit; then what the data don't need is taken out again, the
   weakest first, as long as the evidence rises.
2. *Wrong*: what sets a place, a limb, a sensor or a run apart. All candidates are weighed in closed form at that fit,
   beside what every log and all like parts scatter by anyway; the best few are fitted exactly, and the most probable
   one stays if something is missing more probably than not. Then again, beside it.
   Held-out runs move no parameter, and are weighed all the same: which of two fitted runs is the odd one, only another
   can tell.
3. After each step everything is asked anew whether it is needed: a part that all seemed to have may have stood for one
   that has it. So *made of* and *wrong* are asked twice, the second time beside what was found, or where that is
   nothing, beside the surest of what would set one part apart. Of the two answers the one stays that predicts held-out
   runs better, as they were logged; without any the more probable one.
4. A part of structure may stand for another that heats alike: each is put in its place, the more probable one stays,
   and the probability is shared among those that the data can't tell apart.

The search leaves to errors of runs, of sensors and of like parts what they usually are (`Problem.tolerance`); what it
ends with is fitted by plain least squares, as the file's user does. What is told is there more probably than not, and
not smaller than its standard error in that fit: else what goes with it is unexplained.

Evidence decides throughout (`lptn.diagnose.evidence`).
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from concurrent.futures import Executor
from copy import copy
from dataclasses import dataclass, replace
from itertools import repeat
from math import erf, log, sqrt

import numpy as np
from scipy.special import expit, softmax

from lptn.basics.errors import InputError
from lptn.basics.places import EVERYWHERE
from lptn.basics.processes import one_blas_thread
from lptn.diagnose.answers import LIKELY, Key, Report, Step, is_structure, named
from lptn.diagnose.candidates import NONE, OCCAM, Candidate, in_occams_window, log_priors, possible_effects
from lptn.diagnose.evidence import Allowance, ErrorsOfRuns, Evidence, FirstOrder, allowances, may_deviate, with_runs
from lptn.diagnose.refits import RANKING, as_fitted, continued, unless_interrupted
from lptn.effects import Effect, catalogue
from lptn.identify.data import DataSplit, Segment
from lptn.identify.fitting import ROUGH, Fit, tolerant
from lptn.identify.validation import holdout_errors
from lptn.model.network import EffectDeclaration, Network
from lptn.simulate.simulation import SimulationError

_EXACT = 6  # candidates that are fitted exactly in each round: of traces that are alike closed form mistakes the order
_FEW_DIGITS = 0.03
"""Share of the cost: which effects of a structure end at none is seen by then. The last steps would go to the time
constants of those that the data don't need, at a multiple of the price, since they become stiff."""
_IN_DOUBT = log(OCCAM)
"""Logarithm of odds up to which, in closed form, neither is out of the question: an exact fit decides."""


@dataclass(frozen=True)
class Composition:
    """A model with all that it was found to lack.

    Args:
        fit: of that model.
        findings: what sets a place, a sensor or a run apart, in the order in which it was found.
        structure: what all parts have in common, the most needed first.
        rivals: what the data can't tell from one of the findings, and that itself first; empty where all are told.
        refused: what was fitted exactly in the last round, and is less probable than nothing.
        before, after: evidence of the given model, and of this one.
    """

    fit: Fit
    findings: tuple[Step, ...]
    structure: tuple[Step, ...]
    rivals: tuple[Step, ...]
    refused: tuple[Step, ...]
    before: Evidence
    after: Evidence

    @property
    def steps(self) -> tuple[Step, ...]:
        """All added effects, findings first, except an exchange that one of these effects changes."""
        found = [declared for step in self.findings for declared in step.declarations]

        def later(step: Step) -> bool:
            return step.is_structure and not any(_depends_on(one, own) for one in found for own in step.declarations)

        return tuple(sorted((*self.findings, *self.structure), key=lambda step: (later(step), not step.is_structure)))


@one_blas_thread
def composition(
    given: Fit,
    data: DataSplit,
    *,
    most: int = 6,
    errors: ErrorsOfRuns | None = None,
    executor: Executor | None = None,
    report: Report = lambda _: None,
) -> Composition:
    """Find the structure of a machine, and the findings that set its parts apart.

    Args:
        given: the fitted model.
        data: the runs it was fitted to.
        most: how many findings to add at most.
        errors: how far a log may be off.
        executor: where exact fits run; here, one after the other, by default.
        report: called with a sentence on what is being done.
    """
    start = _Search(given, data, errors or ErrorsOfRuns(), executor, report)
    search = copy(start)
    search.add_structure()
    search.add_findings(most)
    again = copy(search) if search.findings else start
    if search.structure and not search.findings:
        again.add_findings(1, apart=True)
    if again.findings:
        again.add_structure()
    if not again.findings or again.fit is search.fit:
        return search.with_twins(search.result())
    again.add_findings(most)
    made, other = search.result(), again.result()
    if data.holdout:
        errors_made, errors_other = (holdout_errors(one.fit, data.holdout) for one in (made, other))
        better = bool(errors_made and errors_other and errors_other.rmse < errors_made.rmse)
    else:
        better = search.evidence(other.fit, made.after).log_evidence > made.after.log_evidence
    return again.with_twins(other) if better else search.with_twins(made)


class _Search:
    """A model on its way; arguments as for `composition`. Nothing that it holds is changed in place: a copy goes on."""

    def __init__(
        self,
        given: Fit,
        data: DataSplit,
        errors: ErrorsOfRuns,
        executor: Executor | None,
        report: Report,
    ) -> None:
        self.given, self.errors, self.report = given, errors, report
        self.map = executor.map if executor else map
        self.data = data
        self.columns = set.intersection(*(set(segment.run.columns) for segment in data.fit))
        self.runs = [segment.run.name for segment in data.fit]
        self.added: tuple[EffectDeclaration, ...] = ()
        self.findings: dict[Key, tuple[Step, tuple[Step, ...], float]] = {}
        """Of what was added, with rivals and log odds before any log; the rest is structure."""
        self.refused: tuple[Step, ...] = ()
        self.needed: dict[Key, float] = {}  # log odds, by exact fits, of what was tried to be left out
        self.exchanged = frozenset[frozenset[Key]]()
        """Names of which one gave way to the other; once, for each model has its own count of independent errors."""
        self._refits: dict[tuple[tuple[EffectDeclaration, ...], float], tuple[Fit, Fit | None]] = {}
        """By the added effects and the precision: the fit that a refit last started from, and the refit."""
        self._known: Evidence | None = None
        self.fit = self._tolerant(given)
        self.before = self.evidence(self.fit)

    @property
    def structure(self) -> list[EffectDeclaration]:
        return [one for one in self.added if _key(one) not in self.findings]

    # --- made of ------------------------------------------------------------------------------------

    def add_structure(self) -> None:
        """Where anything is lacking, all that every part may have, in one fit; what isn't needed is taken out."""
        network, was = self.fit.model.network, self.evidence(self.fit)
        more = [one.declaration() for one in self._common(self.fit)] if was.is_lacking() else []
        if not more:
            return
        self.report(f"fitting {len(more)} effects of all parts at once")
        before = self.fit, self.added, self.findings
        fit = self._continued(network.with_effects(more), precision=_FEW_DIGITS)
        if fit is not None:
            self.fit, self.added = fit, (*self.added, *more)
            self._take_out_none(_FEW_DIGITS)  # most of them, and their states
            self.fit = self._tolerant(self.fit)
            self._take_out()
            if self.evidence(self.fit, was).log_evidence > was.log_evidence:
                return
        self.fit, self.added, self.findings = before

    def _common(self, fit: Fit) -> list[Candidate]:
        """What a fit's parts may all have: of each common effect the candidate at the most places; of those between two
        nodes each class of pairs."""
        widest: dict[str, list[Candidate]] = {}
        for one in self._possible(fit, {effect for effect in catalogue().values() if effect.common}):
            if one.run or one.difference:
                continue
            # Like pairs of like limbs are structure, and each pair where no two are alike; all pairs at once never are.
            between = one.effect.site == "edge"
            if between and one.at == EVERYWHERE:
                continue
            others = widest.setdefault(one.effect.key, [])
            most = max((len(other.places) for other in others), default=0)
            if between and min(len(one.places), 2) == min(most, 2):
                others.append(one)
            elif len(one.places) > most or (one.effect.one_place_a_pattern and one.at == EVERYWHERE):
                widest[one.effect.key] = [one]
        return [one for group in widest.values() for one in group]

    # --- wrong --------------------------------------------------------------------------------------

    def add_findings(self, most: int, *, apart: bool = False) -> None:
        """Candidate after candidate, as long as something is missing more probably than not.

        Args:
            most: of findings.
            apart: of nothing that all parts may have, but of what sets a place, a sensor or a run apart.
        """
        tried: set[Key] = set()  # what was taken out again is not added again
        while len(self.findings) < most:
            self.fit = self._tolerant(self.fit)
            every = self._possible(self.fit)
            possible = [one for one in every if not one.run or one.run in self.runs]
            if apart:
                possible = [one for one in possible if not is_structure(one.declaration())]
            base = Evidence(self.fit, allowances(self.fit, every, self.errors), possible, held_out=self.data.holdout)
            priors = log_priors(possible)
            odds = dict(zip((one.key for one in possible), priors.tolist(), strict=True))
            ranked = [one for one in base.first_order(priors) if one.candidate.key not in tried]
            self.report(f"{len(ranked)} candidates weighed, fitting the best of them")
            steps = self._fitted([one for one in ranked[:_EXACT] if one.log_odds > -_IN_DOUBT], base, odds)
            if not steps:
                return
            judged, none, freed = _judged(steps, 0.0), 0.0, None
            if _surest(judged).at_its_place >= LIKELY:
                # Any effect is a way out of a local minimum, and would seem to explain what it frees.
                freed = self._continued(self.fit.model.network, _surest(judged).fit)
            if freed is not None:
                none = max(0.0, self.evidence(freed, base).log_evidence - base.log_evidence)
                judged = _judged(steps, none)
            best = _surest(judged)
            self.refused = tuple(judged)
            if best.at_its_place < LIKELY:
                if freed is None or none == 0.0:
                    return
                self.fit = freed
                continue
            assert best.declaration is not None
            self.report(f"{named(best.key)}, {100 * best.probability:.0f} % probable")
            self.refused, self.fit = (), best.fit
            tried.add(best.key)
            self.added = (*self.added, best.declaration)
            if not best.is_structure:
                rivals = tuple(step for step in judged if step.key in best.indistinguishable)
                self.findings = self.findings | {best.key: (best, rivals, odds[best.key])}
            self._take_out()

    def _fitted(self, shortlist: Sequence[FirstOrder], base: Evidence, odds: dict[Key, float]) -> list[Step]:
        """Each candidate fitted exactly, the most probable first; `log_odds` are those to the model without it."""
        steps = []
        declared = [one.declaration() for one in shortlist]
        networks = [self.fit.model.network.with_effects([declaration]) for declaration in declared]
        fits = self.map(_continued, repeat(self.fit), networks, repeat(self.data.holdout))
        for entry, declaration, fit in zip(shortlist, declared, fits, strict=True):
            if fit is None or is_at_chosen_bound(fit, declaration):
                continue  # no size was found
            evidence = self.evidence(fit, base)
            # What it makes needless goes: the one that stood for it in all places, for one.
            needless = [self._log_odds_of_none(evidence, own) for own in self.added]
            gone = sum(one for one in needless if 0.0 < one < np.inf)
            log_odds = evidence.log_evidence + gone - base.log_evidence + odds[entry.candidate.key]
            steps.append(Step(fit, declaration, log_odds=log_odds))
        return sorted(steps, key=lambda step: -step.log_odds)

    def evidence(self, fit: Fit, beside: Evidence | None = None) -> Evidence:
        if beside is None and self._known is not None and self._known.fitted is fit:
            return self._known
        evidence = Evidence(fit, self._allowed(fit), beside=beside, held_out=self.data.holdout)
        self._known = evidence if beside is None else self._known
        return evidence

    def _allowed(self, fit: Fit) -> list[Allowance]:
        """What a fit may be off by."""
        return allowances(fit, self._possible(fit, may_deviate(fit), single=True), self.errors)

    def _possible(
        self, fit: Fit, effects: Collection[type[Effect]] | None = None, single: bool = False
    ) -> list[Candidate]:
        """All that a fit may lack, in held-out runs as well; of all effects by default."""
        names = [*self.runs, *(one.run.name for one in self.data.holdout)]
        return possible_effects(fit, self.columns, names, effects, single)

    def _continued(self, network: Network, fit: Fit | None = None, precision: float = RANKING) -> Fit | None:
        return _continued(fit or self.fit, network, self.data.holdout, precision)

    def _tolerant(self, fit: Fit) -> Fit:
        """A fit that leaves to errors of runs, of sensors and of like parts what they usually are."""
        done = unless_interrupted(tolerant(fit, self.evidence(fit).tolerance, precision=RANKING))
        return done if _is_simulable(done, self.data.holdout) else fit

    # --- needed? ------------------------------------------------------------------------------------

    def _take_out(self) -> None:
        """Remove effects of size zero, then those without which the evidence is higher, the least needed first."""
        asked: set[Key] = set()
        now: Evidence | None = None
        while True:
            self._take_out_none()
            if now is None or now.fitted is not self.fit:
                now = self.evidence(self.fit)
            needless = {declared: self._log_odds_of_none(now, declared) for declared in self.added}
            left = [d for d in needless if _name(d) not in asked and needless[d] > -_IN_DOUBT]
            if not left:
                return
            declared = max(left, key=needless.__getitem__)
            asked.add(_name(declared))
            without = self._without([declared])
            if without is None:
                continue
            other = self.evidence(without[0], now)
            needed = now.log_evidence - other.log_evidence
            self.needed = self.needed | {_name(declared): needed}
            if needed <= 0:
                self._take(*without)
                now = other

    def _log_odds_of_none(self, evidence: Evidence, declared: EffectDeclaration) -> float:
        """To first order; of an effect that is either present or not, or stands in place of what others have, by the
        last fit without it, infinite before there was one."""
        amplitude = declared.effect.amplitude()
        if amplitude is None or amplitude.on is not None or evidence.fitted.model.network.instead_of(declared):
            return -self.needed.get(_name(declared), -np.inf)
        return evidence.log_odds_of_none(declared.shared_name(amplitude.name))

    def _take_out_none(self, precision: float = RANKING) -> None:
        """Remove effects of size zero, whatever the rounding errors of the evidence."""
        while gone := [declared for declared in self.added if _is_none(self.fit, declared)]:
            without = self._without(gone, precision)
            if without is None:
                return
            self._take(*without)

    def _without(
        self, gone: Sequence[EffectDeclaration], precision: float = RANKING
    ) -> tuple[Fit, tuple[EffectDeclaration, ...]] | None:
        """The model without some effects, and what then is added; what a place had beside them becomes its own."""
        gone = [one for one in self.added if one in gone or any(_depends_on(one, other) for other in gone)]
        rest = []
        for one in self.added:
            if one not in gone:
                common = next((own for own in gone if one.difference and one.effect.key == own.effect.key), None)
                rest.append(one if common is None else _as_its_own(one, self.fit, common))
        key = tuple(rest), precision
        base, fit = self._refits.get(key, (None, None))
        if base is not self.fit:
            fit = self._continued(self.given.model.network.with_effects(rest), precision=precision)
            self._refits = self._refits | {key: (self.fit, fit)}
        return None if fit is None else (fit, tuple(rest))

    def _take(self, fit: Fit, rest: tuple[EffectDeclaration, ...]) -> None:
        self.fit, self.added = fit, rest
        self.findings = {key: self.findings[key] for key in map(_key, rest) if key in self.findings}

    def result(self) -> Composition:
        """The model as it is now, fitted as far as its sizes and errors have digits on averages."""
        self.report("fitting the effects found")
        while True:
            plain = unless_interrupted(tolerant(self.fit, None, precision=ROUGH))
            before = self.fit = plain if _is_simulable(plain, self.data.holdout) else self.fit
            self._take_out()
            if self.fit is not before:
                continue
            evidence = self.evidence(self.fit)
            told = [self._as_told(own, evidence) for own in self.added]
            untold = [step for step in told if not step.likely or self._size_in_errors(step) < 1.0]
            least = min(untold, key=lambda step: step.probability, default=None)
            if least is None or (without := self._without(least.declarations)) is None:
                break
            self.refused = self.refused if least.is_structure else (*self.refused, least)
            self._take(*without)
        findings = tuple(step for step in told if step.key in self.findings)
        structure = sorted((step for step in told if step.key not in self.findings), key=lambda step: -step.log_odds)
        rivals = next(((step, *others) for step, others, _ in self.findings.values() if others), ())
        return Composition(self.fit, findings, tuple(structure), rivals, self.refused, self.before, evidence)

    def with_twins(self, made: Composition) -> Composition:
        """The same, each part of structure by the most probable of the names that may stand for it.

        Where another name is the more probable by an exact fit, it takes its place. Where the data can't tell the names
        apart, the probability is shared among them.
        """
        while (shares := self._shares()) is None:
            made = self.result()
        structure = []
        for step in made.structure:
            own, *others = shares.get(_name(step.declarations[0]), [(step.key, 1.0)])
            twins = tuple(key for key, _ in others)
            structure.append(replace(step, probability=own[1] * step.probability, indistinguishable=twins))
        return replace(made, structure=tuple(structure))

    def _shares(self) -> dict[Key, list[tuple[Key, float]]] | None:
        """Of each part of structure its own share of the probability, then those of what may stand for it; `None` where
        one gave way to another."""
        common, told = self._common(self.given), {own.effect.key for own in self.added}
        odds = dict(zip((one.effect.key for one in common), log_priors(common).tolist(), strict=True))
        others = [one for one in common if one.effect.key not in told]
        evidence = Evidence(self.fit, self._allowed(self.fit), others, held_out=self.data.holdout)
        shares = {}
        for own in self.structure:
            amplitude, name = own.effect.amplitude(), _name(own)
            if amplitude is None or own.effect.key not in odds:
                continue
            names, gains = [_key(own)], [0.0]
            for entry in evidence.exchanges(own.shared_name(amplitude.name)):
                one, gain = entry.candidate, entry.log_odds
                prior = odds[one.effect.key] - odds[own.effect.key]
                if gain + prior > -_IN_DOUBT:
                    rest, declared = [other for other in self.added if other is not own], entry.declaration()
                    fit = self._continued(self.given.model.network.with_effects([*rest, declared]))
                    gain = -np.inf  # no size was found
                    if fit and not is_at_chosen_bound(fit, declared):
                        gain = self.evidence(fit, evidence).log_evidence - evidence.log_evidence
                        pair = frozenset((name, one.key))
                        if gain + prior > 0.0 and pair not in self.exchanged:
                            self._take(fit, (*rest, declared))
                            self.exchanged = self.exchanged | {pair}
                            return None
                names, gains = [*names, one.key], [*gains, gain + prior]
            probable = softmax(gains)
            window = [number for number in in_occams_window(probable) if number]
            shares[name] = [(names[number], float(probable[number])) for number in (0, *window)]
        return shares

    def _as_told(self, declared: EffectDeclaration, evidence: Evidence) -> Step:
        """An effect as it is in the fit that is used, and how probable it is, with a size that is told from none."""
        odds = -self._log_odds_of_none(evidence, declared)
        if odds < _IN_DOUBT:  # unsure to first order, or there or not: by the fit without it
            odds = self.needed.get(_name(declared), max(odds, 0.0))
        found, _, prior = self.findings.get(_key(declared), (None, (), 0.0))
        share = float(expit(odds + prior))
        step = Step(self.fit, declared, odds, share, at_its_place=share)
        if found:  # what was sure when it was found may have got a rival in what was found since
            shares = min(found.probability, share), min(found.at_its_place, share)
            step = replace(found, fit=self.fit, declaration=declared, probability=shares[0], at_its_place=shares[1])
        sure = erf(self._size_in_errors(step) / sqrt(2.0))
        return replace(step, probability=sure * step.probability, at_its_place=sure * step.at_its_place)

    def _size_in_errors(self, step: Step) -> float:
        """The size of an effect in its standard errors; infinite where it has none, or is held.

        Of a part of structure the rest of it is taken as it is: where parts can stand for each other, some are there.
        """
        size, errors = step.size_parameter, self.fit.standard_errors
        if size is None or step.declaration is None or not errors.get(size.name):
            return np.inf
        none, unsure, parameter = size.declared.off or 0.0, 0.0, step.declaration.effect.size()
        if parameter and (common := self.fit.model.network.instead_of(step.declaration)):
            shared = common.shared_name(parameter.name)
            none, unsure = self.fit.model.named[shared].value, errors.get(shared, 0.0)
        beside = [] if step.key in self.findings else self.structure
        held = {own.shared_name(parameter) for own in beside for parameter in own.resolved} - {size.name}
        names, correlations = list(errors), self.fit.uncertainty.correlations
        rows = [row for row, name in enumerate(names) if name in held]
        along = correlations[names.index(size.name), rows]
        own = 1.0 - float(along @ np.linalg.lstsq(correlations[np.ix_(rows, rows)], along)[0])
        return abs(size.value - none) / float(np.hypot(errors[size.name] * sqrt(max(own, np.finfo(float).eps)), unsure))


def is_at_chosen_bound(fit: Fit, declared: EffectDeclaration) -> bool:
    """Whether a free parameter of an effect ended at a bound that is not nature's: its size is none that was found."""
    fitted = (fit.model.named.get(declared.shared_name(name)) for name in declared.resolved)
    return any(
        abs(one.value - end) <= 1e-3 * abs(end)
        for one in fitted
        if one and one.free
        for end in set(one.declared.bounds).difference(one.declared.ends_by_nature)
    )


def _judged(steps: Sequence[Step], none: float) -> list[Step]:
    """The steps with their probabilities, those of their places, and the effects they can't be distinguished from.

    Args:
        steps: all that may be missing, the most probable first.
        none: logarithm of the odds that none of them is.
    """
    shares = softmax([*(step.log_odds for step in steps), none])[:-1]
    window = [steps[number].key for number in in_occams_window(shares)]
    judged = []
    for step, share in zip(steps, shares.tolist(), strict=True):
        at = step.declaration.at if step.declaration else ""
        same = [other for other, one in zip(shares, steps, strict=True) if one.declaration and one.declaration.at == at]
        others = tuple(key for key in window if key != step.key) if step.key in window else ()
        judged.append(replace(step, probability=share, at_its_place=float(sum(same)), indistinguishable=others))
    return judged


def _surest(judged: Sequence[Step]) -> Step:
    """Where something is missing is surer than what."""
    return max(judged, key=lambda step: (step.at_its_place, step.probability))


def _continued(base: Fit, network: Network, holdout: Sequence[Segment], precision: float = RANKING) -> Fit | None:
    """The fit of another network from where one stands; `None` where it can't be simulated there, held-out runs too."""
    try:
        fit = continued(base, network, precision)
    except (SimulationError, InputError):  # too stiff; an effect on an edge that another one made
        return None
    return fit if _is_simulable(fit, holdout) else None


def _is_simulable(fit: Fit, holdout: Sequence[Segment]) -> bool:
    """Whether a model is not too stiff for any run."""
    wide = with_runs(fit, holdout)
    return bool(np.isfinite(wide.problem.cost(wide.z)))


def _is_none(fit: Fit, declared: EffectDeclaration) -> bool:
    amplitude, shape = declared.effect.amplitude(), declared.effect.shape()
    values = fit.model.named
    if amplitude is None or fit.model.network.instead_of(declared):
        return False
    size = values[declared.shared_name(amplitude.name)]
    if amplitude.on is not None:  # there or not: none where it acts within a step
        own = values.get(declared.shared_name(shape.name)) if shape else None
        return own is not None and own.value <= (1.0 + NONE) * own.declared.bounds[0]
    return abs(size.value - (amplitude.off or 0.0)) < NONE * abs(size.declared.typical)


def _key(declared: EffectDeclaration) -> Key:
    return declared.effect.key, declared.where


def _name(declared: EffectDeclaration) -> Key:
    """As `_key`, of a difference another than of an effect of its own."""
    return declared.name, declared.where


def _depends_on(one: EffectDeclaration, other: EffectDeclaration) -> bool:
    """Whether an effect is about an exchange between two places that another one made."""
    return other.effect.site == "edge" and "~" in one.at and set(one.at.split("~")) == set(other.at.split("~"))


def _as_its_own(difference: EffectDeclaration, fit: Fit, common: EffectDeclaration) -> EffectDeclaration:
    """What a place had beside a common effect, as an effect of its own that starts from both."""
    own = {parameter.name: parameter for parameter in as_fitted(difference, fit).parameters}
    amplitude, parameters = difference.effect.amplitude(), []
    for stated in difference.effect.stated():
        one, (lower, upper) = own.get(stated.name, stated), stated.bounds
        value = one.value
        if amplitude is not None and one.name == amplitude.name:
            value += fit.model.named[common.shared_name(one.name)].value - (stated.off or 0.0)
        parameters.append(replace(one, bounds=stated.bounds, value=min(max(value, lower), upper)))
    return replace(difference, parameters=tuple(parameters), difference=False)
