"""The verdict in sentences: what the fitted data show and how sure that is; apart from it, how held-out runs agree.

The fitted data alone carry the probabilities. Held-out runs are set beside them and never mixed in; where they took
part in the choice of a model, their error is not shown as proof of it.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from lptn.basics.parameters import Parameter
from lptn.diagnose.diagnosis import Diagnosis, Key, Step, Verdict, contradicted, is_small
from lptn.diagnose.evidence import AMPLITUDES
from lptn.diagnose.improvement import History
from lptn.identify.comparison import Errors
from lptn.report.text import few, kelvin, named, number, percent, short_size, unit_text

Probabilities = Sequence[tuple[Key | None, float]]
"""Of effects and places, and of nothing being missing (`None`)."""

# --- what the fitted data show -------------------------------------------------------------------------------


_EVEN = 0.5  # probability from which on something is more likely than not


def nothing_missing(probabilities: Probabilities) -> float:
    """Probability that a model lacks nothing, by the fitted data."""
    return next(probability for key, probability in probabilities if key is None)


def of_given_model(history: History) -> str:
    """What the fitted data show of the model as given, with its probability: one sentence."""
    return of_fitted_data(history.verdict, history.first, history.probabilities, history.steps[0].holdout)


def of_last_model(history: History) -> str:
    """What the fitted data show of the model with all that was added, with its probability: one sentence."""
    return of_fitted_data(history.remaining, history.last, history.last.probabilities, history.best.holdout)


def of_fitted_data(
    verdict: Verdict, diagnosis: Diagnosis, probabilities: Probabilities, holdout: Errors | None = None
) -> str:
    """What the fitted data show of a model, with its probability: one sentence.

    Args:
        verdict: on the model.
        diagnosis: of it.
        probabilities: of what it lacks, and of nothing.
        holdout: its errors on held-out runs, by default those in the steps of the search.
    """
    nothing = nothing_missing(probabilities)
    left = f"what nothing explains is {kelvin(diagnosis.evidence.discrepancy, 2)} at the node where it is largest"
    if verdict == "missing":
        return f"the fitted data show that something is missing (probability {percent(1 - nothing)})"
    if verdict == "adequate" and nothing >= _EVEN:
        return f"the fitted data show nothing missing (probability {percent(nothing)})"
    if verdict == "adequate":
        return (
            f"the fitted data would rather have an effect added (probability {percent(1 - nothing)}), but held-out "
            "runs are predicted no better with it"
        )
    if nothing < _EVEN:
        return (
            f"the fitted data show that something is missing (probability {percent(1 - nothing)}), but no effect of "
            f"the catalogue removes most of the misfit; {left}"
        )
    if not is_small(diagnosis.evidence):
        return (
            f"the fitted data show a misfit (probability {percent(1 - diagnosis.evidence.enough)}) that no effect of "
            f"the catalogue explains; {left}"
        )
    holdout = holdout or diagnosis.holdout
    error = kelvin(holdout.rmse if holdout else None)
    return (
        f"the fitted data show nothing missing (probability {percent(nothing)}), but held-out runs are wrong by "
        f"{error}: they hold something the fitted runs do not; fit on longer runs, or on more like them"
    )


def only_held_out_runs_object(history: History) -> bool:
    """Whether the given model is unexplained by held-out runs alone: the fitted ones have nothing against it."""
    fine = nothing_missing(history.probabilities) >= _EVEN and is_small(history.first.evidence)
    return history.verdict == "unexplained" and fine


# --- how sure an answer is: its probability, and who shares the rest ------------------------------------------


_FEW = 3  # names in a row; all of them stand in the JSON and on the page
_WORTH_NAMING = 0.01  # probability


def certainty(step: Step, probabilities: Probabilities, added: Collection[Key] = ()) -> str:
    """Probability of one effect by the fitted data, and what shares the rest.

    Args:
        step: with the effect.
        probabilities: of all that was tried, and of nothing.
        added: effects that stand beside it in the model, and so not for it.
    """
    shares = dict(probabilities)
    probability = shares.get(step.key, step.probability)
    text = f"probability {percent(probability)}"
    others = {key: share for key, share in shares.items() if key not in {step.key, *added} and share >= _WORTH_NAMING}
    if step.indistinguishable:  # rather than what may be missing beside it
        others = {key: shares.get(key, 0.0) for key in step.indistinguishable if key not in added}
    if not others or probability > 1 - _WORTH_NAMING:
        return f"{text}; nothing else in the catalogue comes near" if not step.indistinguishable else text
    names = [
        f"{named(*key) if key else 'nothing'}{f' ({percent(share)})' if share >= _WORTH_NAMING else ''}"
        for key, share in others.items()
    ]
    return f"{text}, the rest is shared by {few(names, _FEW)}"


def certainties(history: History) -> dict[Key, str]:
    """How sure each effect is that was added."""
    added = {step.key for step in history.steps}
    return {step.key: certainty(step, history.probabilities, added) for step in history.steps if step.effect}


# --- how plausible its size is --------------------------------------------------------------------------------


_WIDE = 1.96  # standard deviations on either side of a 95 % interval
_IMPLAUSIBLE = max(multiple for multiple, _ in AMPLITUDES)  # times what is usual: the largest that priors expect


@dataclass(frozen=True)
class Size:
    """How large an added effect is.

    Args:
        key: effect and place.
        parameter: its amplitude; where that is all or nothing, its time constant or other shape.
        value: the most likely one, in the parameter's unit.
        deviation: its standard deviation; what nothing explains is allowed for, where the evidence was worked out.
    """

    key: Key
    parameter: Parameter
    value: float
    deviation: float

    @property
    def times_usual(self) -> float:
        """The size as a multiple of the usual one."""
        return abs(self.value) / (abs(self.parameter.typical) or 1.0)

    @property
    def may_be_zero(self) -> bool:
        """Whether the 95 % interval of an amplitude holds zero; a time constant near zero says nothing of that."""
        return self.parameter.off is not None and not bool(abs(self.value) > _WIDE * self.deviation)

    @property
    def implausible(self) -> bool:
        """Whether it is larger than priors expect of any."""
        return bool(self.times_usual > _IMPLAUSIBLE)

    def text(self) -> str:
        """Such as `thermal conductance 0.31 ± 0.05 W/K, 0.8 of what is usual`."""
        unit = f" {unit_text(self.parameter.unit)}".removesuffix(" 1")
        name = self.parameter.title or self.parameter.name
        size = f"{name} {number(self.value, 3)} ± {short_size(self.deviation)}{unit}"
        ratio = number(self.times_usual, 2)
        share = f"{ratio} of what is usual" if self.times_usual < 1 else f"{ratio} times what is usual"
        if self.implausible:
            share += ": implausible"
        return f"{size}, {'as is usual' if ratio == '1' else share}{'; not told from zero' if self.may_be_zero else ''}"

    def as_json(self) -> dict[str, object]:
        """The size as other tools read it."""
        return {
            "effect": self.key[0],
            "at": self.key[1],
            "parameter": self.parameter.name,
            "value": self.value,
            "standard_deviation": self.deviation,
            "unit": self.parameter.unit,
            "times_usual": self.times_usual,
            "implausible": self.implausible,
            "not_told_from_zero": self.may_be_zero,
        }


def sizes_of(step: Step) -> dict[Key, Size]:
    """The sizes of the effects in a step's model, by effect and place; those the fit left free.

    An amplitude is as the evidence has it, which allows for what nothing explains; all else as the fit has it.
    """
    network, free = step.fit.model.network, {step.fit.model.parameters[k].name: k for k in step.fit.problem.free}
    known = step.evidence.amplitudes if step.evidence else {}
    sizes = {}
    for declaration in network.effects:
        key = declaration.effect.key, declaration.where
        names = {f"{declaration.name}.{each.name}.{declaration.where}": each for each in declaration.parameters}
        own = {name: each for name, each in names.items() if name in free}
        # Where the amplitude is all or nothing, the first shape says how large the effect is.
        for name, each in sorted(own.items(), key=lambda pair: pair[1].off is None)[:1]:
            fitted = step.fit.point.values[free[name]], step.fit.standard_errors[name]
            sizes[key] = Size(key, each, *known.get(name, fitted))
    return sizes


def sizes_added(history: History) -> dict[Key, Size]:
    """The sizes of all effects that were added, as the last model has them."""
    sizes = sizes_of(history.best)
    return {step.key: sizes[step.key] for step in history.steps if step.key in sizes}


# --- how held-out runs agree ----------------------------------------------------------------------------------


def of_held_out_data(history: History) -> str:
    """How held-out and test runs agree with the last model, apart from what the fitted ones show; empty without any."""
    given, best = history.steps[0], history.steps[-1]
    sentences = []
    if given.holdout and best.holdout:
        text = (
            f"The RMSE on the held-out runs, to which no parameter was fitted, {_change(given.holdout, best.holdout)}"
        )
        if contradicted(best.fit, best.holdout):
            text += f": well above the {kelvin(best.fit.rmse)} on the fitted ones"
        sentences.append(f"{text}.")
    if history.chosen_by_holdout:
        sentences.append(
            "Held-out data took part in the choice of the model, so their error is no proof of it: give one more log "
            "with --test."
        )
    if given.test and best.test:
        sentences.append(f"The RMSE on the test runs, which chose nothing, {_change(given.test, best.test)}.")
    return " ".join(sentences)


_HELPED = 0.99  # share of an error below which it is called smaller


def _change(before: Errors, after: Errors) -> str:
    """An error before and after, with the largest ones."""
    if before == after:
        return f"is {kelvin(after.rmse)} (largest error {kelvin(after.max)})"
    text = f"goes from {kelvin(before.rmse)} to {kelvin(after.rmse)} (largest error {kelvin(before.max)} to "
    text += f"{kelvin(after.max)})"
    return text if after.rmse < _HELPED * before.rmse else f"{text}, and does not get better"
