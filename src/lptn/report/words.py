"""The report in words: what is missing, how sure, which data say so, what to do next; captions of figures."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from lptn.basics.parameters import Parameter
from lptn.basics.words import listed, short_size
from lptn.diagnose.advice import Detectable
from lptn.diagnose.answers import Step
from lptn.diagnose.fit_statistics import Removed
from lptn.diagnose.improvement import History
from lptn.identify.comparison import Comparison, Condition
from lptn.identify.data import DataSplit, Segment
from lptn.identify.fitting import Fit
from lptn.model.network import EffectDeclaration
from lptn.report.heat_story import HeatStory
from lptn.report.outcome import (
    FEW,
    HELPED,
    Kinds,
    answer_in_words,
    certainty,
    finding_in_words,
    left_in_words,
    outcome_of,
    refused_in_words,
    rmse_by_data,
    short_name,
    steps_in_words,
    who_chose,
)
from lptn.report.shown import MOST, NOISE_BAND, initialisation_end, noise_alone, reaches, views
from lptn.report.tables import FAR, worst_condition
from lptn.report.text import (
    bin_text,
    capitalised,
    experiment_for,
    few,
    kelvin,
    named,
    percent,
    place_of,
    size_told,
    title_of,
    unit_text,
    value_in_words,
    window_text,
)

# --- what both the short and the long version say -----------------------------------------------------------


_TOLD = 2.0  # standard errors from which on a size is told from zero


def size_in_words(step: Step, last: Fit) -> str:
    """The size of an added effect against what is usual there, such as `conductance 0.02 ± 0.001 W/K, 0.2 of what is
    usual there`, and its time constant where it has one; of an effect that is there or not, how it is.

    Args:
        step: the effect.
        last: a fit of a model that has it.
    """
    values = {instance.name: instance for instance in last.model.parameters}
    sizes, times, doubt = "", "", ""
    for declaration in step.declarations:
        for parameter in declaration.resolved.values():
            name = declaration.shared_name(parameter.name)
            if name not in last.standard_errors:
                continue
            error, value = last.standard_errors[name], values[name].value
            text = f"{parameter.name.replace('_', ' ')} {value_in_words(value, error, parameter.unit_behind)}"
            if parameter.off is None and parameter.unit == "s":
                times = text + _where_others_have(declaration, parameter, last)
            elif parameter.off is None and not declaration.effect.adds_up():  # of what is there or not: how it is
                sizes = text
            elif parameter.off is not None:
                share = abs(value / values[name].declared.typical)
                times_as_large = f"{short_size(share)} times" if share > 1 else f"{short_size(share)} of"
                beside = " beside what it has in common with others" if declaration.difference else ""
                sizes = f"{text}{beside}, {times_as_large} what is usual there"
                doubt = "" if abs(value - parameter.off) >= _TOLD * error else "; not told from zero"
    return "; ".join(filter(None, (sizes + doubt, times)))


def _where_others_have(declaration: EffectDeclaration, parameter: Parameter, last: Fit) -> str:
    """What the other places have in common, of a place that has its own instead: `, where the others have 8 s`."""
    key, values = declaration.effect.key, last.model.parameters
    common = {instance.parameters[parameter.name] for instance in last.model.network.in_common(key)}
    others = [values[k].value for k in sorted(common) if values[k].name != declaration.shared_name(parameter.name)]
    if declaration.difference or declaration.run or not others:
        return ""
    return f", where the others have {short_size(others[0])} {unit_text(parameter.unit)}"


_MOST = 0.5  # share from which on a node or a run is said to be the one


def removed_in_words(history: History, number: int) -> str:
    """Where a step lowers the error of the fitted runs, such as `It removes 41 % of the squared error that was left of
    the fitted runs, 92 % of that at winding, 70 % in Run5.`; empty where it lowers none.
    """
    removed = Removed.between(history.steps[number - 1].fit, history.steps[number].fit)
    if removed.share <= 0:
        return ""
    left = "of the squared error that was left of the fitted runs"
    if removed.share < 0.01:  # of next to nothing nobody asks where
        return f"It removes less than 1 % {left}."
    text = f"It removes {100 * removed.share:.0f} % {left}"
    for word, shares in (("at", removed.by_node), ("in", removed.by_run)):
        name = max(shares, key=shares.__getitem__)
        if len(shares) > 1 and shares[name] > _MOST:
            text += f", {100 * min(shares[name], 1.0):.0f} % of that {word} {name}"
    return f"{text}."


def next_step(history: History) -> str:
    """What to do next, in a sentence or two."""
    outcome = outcome_of(history)
    if outcome == "adequate":
        return "use the model. Compare it again when the robot works harder, faster or in other air."
    if outcome == "unexplained":
        return (
            "look in section 4 for where and when the error grows, and ask what happened then that the log does not "
            "hold: touch, water, a fan, a moved sensor, a load without a column. Log it, or leave that part out."
        )
    answer = answer_in_words(history) if history.remaining == "missing" else ""
    if outcome == "asked":
        return f"add {answer}, and see whether the error falls."
    if outcome == "tried":
        then = f"add {answer} in its place" if answer else "look in section 4 for where and when the error grows"
        return "take back what did not help" + (
            ". The model as given is enough." if history.verdict == "adequate" else f", and {then}."
        )
    if history.searched_from is None and answer:
        return f"add {answer}, too, and see whether the error falls."
    unseen = rmse_by_data(history.steps[0], history.best)[1:]
    if any(after > before for _, before, after in unseen):
        return (
            "find out what differs in the runs that no fit saw, which the model as given predicts better, and fit on "
            "runs like them as well."
        )
    ambiguous = [step.declaration.effect for step in history.steps if step.indistinguishable and step.declaration]
    if not ambiguous:
        return "use the best model." + ("" if history.remaining == "adequate" else " Section 4 shows the rest.")
    experiments = [f"For {effect.title}: {experiment_for(type(effect)).rstrip('.')}" for effect in ambiguous]
    advice = " ".join(text if text.endswith("?") else f"{text}." for text in experiments)
    return f"one experiment would tell the candidates apart. {advice} Then fit again with that log."


# --- the summary: what is missing, where, how sure, what to do ----------------------------------------------


class Proposal(Protocol):
    """A proposed next experiment."""

    def text(self) -> str:
        """What to do and what it will show, in a few sentences."""


def in_short(history: History, heat: HeatStory, proposal: Proposal | None = None) -> list[tuple[str, str]]:
    """The summary in four parts, each with its heading word.

    Args:
        history: the steps of the forward selection.
        heat: what heat the given model lacks.
        proposal: of an experiment, where one was worked out.
    """
    outcome = outcome_of(history)
    summary = {
        "adequate": _short_adequate,
        "found": _short_found,
        "tried": _short_tried,
        "asked": _short_asked,
        "unexplained": _short_unexplained,
    }
    what, where, sure = summary[outcome](history, heat)
    to_do = next_step(history)
    if proposal:
        first = re.split(r"(?<=[.!?]) (?=[A-Z])", proposal.text(), maxsplit=1)[0]
        to_do = f"{first} Section 7 says what that shows."
    if heat.event and outcome != "adequate":
        to_do = f"Ask what happened {heat.event} that the log does not hold. {capitalised(to_do)}"
    asked = "What was missing" if outcome == "found" else "What is missing"
    return [(asked, what), ("Where", where), ("How sure", sure), ("What to do", capitalised(to_do))]


def _short_adequate(history: History, heat: HeatStory) -> tuple[str, str, str]:
    sure = f"{_short_errors(history)}; noise alone leaves {kelvin(noise_alone(history.steps[0].fit), 2)}."
    sure += " Section 5 shows how large each effect could be without showing."
    where = f"{capitalised(heat.where)}, but too little to matter." if heat.where else f"Nowhere: {heat.hiding}."
    return "Nothing that these data can show.", where, sure


def _short_tried(history: History, heat: HeatStory) -> tuple[str, str, str]:
    what = {
        "adequate": "nothing that these data show",
        "missing": f"still something, first of all {answer_in_words(history)}",
        "unexplained": "something of which the catalogue explains little",
    }["adequate" if history.verdict == "adequate" else history.remaining]
    sure = f"{steps_in_words(history.steps)}. {_short_errors(history)}."
    return f"{capitalised(what)}.", _where("", heat), sure


def _short_asked(history: History, heat: HeatStory) -> tuple[str, str, str]:
    sure = f"{_short_errors(history)}. Nothing was added yet.{_rivals(history.last.steps[:1])}"
    return f"First of all {answer_in_words(history)}.", _where("", heat), sure


def _rivals(steps: Sequence[Step]) -> str:
    """What the data can't tell from any of some steps, as a sentence behind another; empty without any."""
    taken = {step.key for step in steps}
    names = list(dict.fromkeys(named(*key) for step in steps for key in step.indistinguishable if key not in taken))
    return f" These data can't rule out {few(names, FEW)} in its place." if names else ""


def _short_found(history: History, heat: HeatStory) -> tuple[str, str, str]:
    kinds, last = Kinds.of(history.steps), history.best.fit
    whats = []
    if kinds.findings:
        whats.append(f"{capitalised(listed([finding_in_words(step, last) for step in kinds.findings]))}.")
    if kinds.structure:
        parts = few([_with_size(step, last) for step in kinds.structure], FEW)
        whats.append(f"What all parts have in common: {parts}.")
    if kinds.helped:
        whats.append(f"Added: {listed([_with_size(step, last) for step in kinds.helped])}.")
    places: dict[str, list[str]] = {}
    for step in [*kinds.findings, *kinds.helped] or kinds.structure:
        places.setdefault(place_of(step.at or ""), []).append(title_of(step.effect or ""))
    where = "; ".join(f"{place} ({listed(effects)})" if len(places) > 1 else place for place, effects in places.items())
    sure = f"{_short_errors(history)}.{_rivals(kinds.findings)}"
    if useless := [*kinds.fitted, *kinds.idle]:
        sure += f" Added as well, without help: {listed([named(*step.key) for step in useless])}."
    sure += f" {left_in_words(history)}"
    if heat.left:
        stays = ": what was added does not explain that" if heat.event else ""
        sure += f" {'Even so, with' if history.remaining == 'adequate' else 'With'} the best model {heat.left}{stays}."
    place = f"{capitalised(where)}{'' if kinds.findings or kinds.helped else '; nothing sets one part apart'}."
    return " ".join(whats), f"{place} On the fitted runs, as given, {heat.where}." if heat.where else place, sure


def _with_size(step: Step, last: Fit) -> str:
    """An effect, its place and its size, such as `sensor lag (8 ± 1 s)`, by the name that the headline has."""
    size = size_told(step, last)
    return f"{short_name(step)} ({size})" if size else short_name(step)


def _short_unexplained(history: History, heat: HeatStory) -> tuple[str, str, str]:
    noise = kelvin(noise_alone(history.best.fit), 2)
    sure = f"{_short_errors(history)}; noise alone leaves {noise}. What the catalogue offers does not remove it."
    what = "Something that the catalogue does not hold"
    if len(history.steps) > 1:
        what += f"; {steps_in_words(history.steps, 'the best that it offers')}"
    return f"{what}.", _where("", heat), sure


def _where(places: str, heat: HeatStory) -> str:
    """Places in the model, then where and when heat lacks."""
    text = f"{places} On the fitted runs {heat.where}." if heat.where else places
    return text.strip() or "No one node and time stands out."


def _short_errors(history: History) -> str:
    """The error before and after, on the data that tell most."""
    runs, before, after = rmse_by_data(history.steps[0], history.best)[-1]
    if kelvin(before) == kelvin(after):
        return f"The RMSE on the {runs} runs is {kelvin(before)}{'' if before == after else ', as before'}"
    return f"The RMSE on the {runs} runs goes from {kelvin(before)} to {kelvin(after)}"


# --- in more detail -----------------------------------------------------------------------------------------


def story_in_words(history: History, data: DataSplit) -> list[str]:
    """The story, a few sentences to each of: what is missing, how sure, which data say so."""
    stories = {
        "adequate": _adequate,
        "found": _found,
        "tried": _tried,
        "asked": _asked,
        "unexplained": _unexplained,
    }
    what = stories[outcome_of(history)]
    return [what(history, data), *filter(None, [_how_sure(history)]), _which_data(history, data)]


def fitted_in_words(history: History) -> str:
    """What was fitted at first, and how well it follows the runs that it was fitted to."""
    given = history.steps[0]
    text = f"{given.parameters} free parameter{'s' if given.parameters != 1 else ''}, fitted by weighted least squares."
    return f"{text} {_errors(given)}; the sensors' noise alone would leave about {kelvin(noise_alone(given.fit), 2)}."


def _adequate(history: History, data: DataSplit) -> str:
    given = history.steps[0]
    noise = noise_alone(given.fit)
    text = "Nothing is missing that these data can show: on the fitted runs the model as given is wrong by no more "
    text += f"than the sensors' noise. {_errors(given)}; noise alone leaves about {kelvin(noise, 2)}."
    if given.holdout is not None and given.holdout.rmse > FAR * noise:
        text += " On the held-out runs the error is well above the noise. They hold something that the fitted runs do "
        text += "not: fit on runs like them as well."
    bound_runs = given.fit.problem.bound_runs
    readings = np.concatenate([bound.measured[bound.counted] for bound in bound_runs])
    minutes = sum(len(bound) * bound.run.step for bound in bound_runs) / 60
    covered = f"{minutes:.3g} min at {readings.min():.0f} to {readings.max():.0f} °C"
    return f"{text} This holds for what the fitted runs cover: {covered}."


def _tried(history: History, data: DataSplit) -> str:
    text = f"{steps_in_words(history.steps)}. {_fall(history.steps[0], history.best)}"
    if history.verdict == "adequate":
        return (
            f"{text} The model as given is wrong by no more than noise on the fitted runs, so nothing had to be added."
        )
    return f"{text} {left_in_words(history)}"


def _asked(history: History, data: DataSplit) -> str:
    return (
        f"The model as given is wrong by more than noise. {_errors(history.steps[0])}. First of all it may be "
        f"{answer_in_words(history)}. Nothing was added yet."
    )


def _found(history: History, data: DataSplit) -> str:
    text = f"{steps_in_words(history.steps, 'missing')}. {_fall(history.steps[0], history.best)}"
    return " ".join(filter(None, (text, left_in_words(history), refused_in_words(history))))


def _unexplained(history: History, data: DataSplit) -> str:
    given, best = history.steps[0], history.best
    if given.holdout and history.first.only_held_out_runs_object:
        return (
            "The fitted runs show nothing that is missing, but the model is wrong by "
            f"{kelvin(given.holdout.rmse)} on the held-out ones: they hold something that the fitted runs do not. "
            f"Fit on longer runs, or on runs more like them. {_errors(given)}."
        )
    text = "The model as given is wrong by more than the sensors' noise, and the catalogue does not explain it. "
    text += f"{_errors(given)}; noise alone leaves about {kelvin(noise_alone(given.fit), 2)}."
    if best is given:
        return f"{text} No effect of the catalogue was worth adding. {refused_in_words(history)}".strip()
    return (
        f"{text} The best that could be done is to add {listed([named(*step.key) for step in history.steps[1:]])}. "
        f"{_fall(given, best)} "
        "More than noise stays. Do not read what was added as physics."
    )


def _errors(step: Step) -> str:
    text = f"Its RMSE is {kelvin(step.fit.rmse)} on the fitted runs"
    if step.holdout is not None:
        text += f" and {kelvin(step.holdout.rmse)} on the held-out ones (largest error {kelvin(step.holdout.max)})"
    if step.test is not None:
        text += f", {kelvin(step.test.rmse)} on the test runs"
    return text


def _fall(given: Step, best: Step) -> str:
    pairs = rmse_by_data(given, best)
    alike = [
        f"at {kelvin(before)} on the {runs} runs" for runs, before, after in pairs if kelvin(before) == kelvin(after)
    ]
    other = [pair for pair in pairs if kelvin(pair[1]) != kelvin(pair[2])]
    changes = [f"goes from {kelvin(before)} to {kelvin(after)} on the {runs} runs" for runs, before, after in other]
    changes = [*changes, *(f"stays {phrase}" for phrase in alike)]
    text = f"With that the RMSE {listed(changes)}."
    worse = [f"on the {runs} runs" for runs, before, after in other if after > HELPED * before]
    return f"{text} It does not get better {listed(worse, 'or')}." if worse else text


def _how_sure(history: History) -> str:
    """How sure each step is; empty where none was added, or none explains the misfit."""
    if outcome_of(history) != "found":
        return ""
    return " ".join(_sure(history, number) for number in range(1, len(history.steps)))


def _sure(history: History, number: int) -> str:
    step = history.steps[number]
    parts = [f"How sure is step {number}, {named(*step.key)}? {capitalised(sure_in_words(step))}."]
    if size := size_in_words(step, history.best.fit):
        parts.append(f"Its size: {size}.")
    return " ".join(filter(None, (*parts, removed_in_words(history, number))))


def sure_in_words(step: Step) -> str:
    """How sure a step is, and what else it might be, without a full stop."""
    if not step.probability:
        return "chosen by hand, and not compared with others"
    if step.is_structure:
        return f"the data need it with a probability of {percent(step.probability)}, beside all else in the model"
    others = [named(*key) for key in step.indistinguishable]
    beside = f"; these data can't rule out {few(others, FEW)} in its place" if others else ""
    return f"{certainty(step)}, beside all else in the model{beside}"


def _which_data(history: History, data: DataSplit) -> str:
    """Which runs were fitted, which chose, which only test the result."""
    text = f"Parameters were fitted on {_runs(data.fit)}."
    text += "" if data.holdout else " No data were held out."
    if data.holdout:
        text += f" Held out: {_runs(data.holdout)}. Nothing but its start was fitted to it."
    text += f" {who_chose(history)}"
    if data.test:
        return f"{text} Test: {_runs(data.test)}. It chose nothing, so its error is the one to quote."
    if len(history.steps) == 1:
        return text
    flaw = "the held-out error is a little flattering" if data.holdout else "nothing tests the result"
    return f"{text} There are no test runs, so {flaw}; one more log, given with --test, would tell."


def _runs(segments: Sequence[Segment]) -> str:
    """Runs by name, and which part of them counts where it is not all."""
    parts = [(segment.run.name, window_text(segment.evaluation, segment)) for segment in segments]
    return few([name if part == "all" else f"{name} ({part})" for name, part in parts], FEW)


# --- one plain sentence under each figure: what to see in it --------------------------------------------------


_PLAIN = 0.5  # share of the RMSE from which its mean is worth a word


def caption_of_history(history: History) -> str:
    """Under the falling errors."""
    last = len(history.steps) - 1
    held = "the held-out errors say how good it is" if history.best.holdout else "no held-out errors check it"
    return f"RMSE from the model as given (step 0, blue) to the best model (step {last}, green); {held}."


def caption_of_conditions(given: Comparison, best: Comparison | None, which: str) -> str:
    """Under the maps of where a model fails."""
    text = f"RMSE in K on the {which} runs by node and operating condition; the small numbers are each bin's range."
    for model, comparison in (("model as given" if best else "model", given), ("best model", best)):
        if comparison is not None and (worst := worst_in_words(comparison)):
            text += f" The {model} {worst}."
    return text


def worst_in_words(comparison: Comparison) -> str:
    """Where a model errs most, such as `fails worst at ...`; an error like noise is none. Empty without bins."""
    worst = worst_condition(comparison)
    if worst is None:
        return ""
    cell, is_far = worst
    if not is_far:
        noise = kelvin(comparison.floor(cell.node), 2)
        return f"errs nowhere by much more than noise ({noise} there), most at {_where_it_fails(cell)}"
    return f"fails worst at {_where_it_fails(cell)}"


def caption_of_predictions(
    given: Comparison,
    best: Comparison | None,
    data: DataSplit,
    which: str,
    names: tuple[str, str] = ("the model as given", "the best model"),
) -> str:
    """Under measured and predicted temperatures."""
    lines = f"The blue line is {names[0]}, the green one {names[1]}" if best else "The blue line is the model"
    below = f"below, the error (predicted − measured), and ±{NOISE_BAND:g} times the sensor noise in grey"
    text = f"Temperatures on the {which} runs. {lines}; {below}."
    if any(initialisation_end(prediction) is not None for prediction in given.predictions):
        fitted = {segment.run.name for segment in data.fit}
        same = all(prediction.segment.run.name in fitted for prediction in given.predictions)
        shaded = "the shaded time, which was fitted," if same else "the shaded time"
        text += f" Readings in {shaded} only set the start; what follows is predicted freely."
    else:
        text += " The start was fitted along with these readings, so this is no test."
    count = len(views(given))
    chosen = f"the worst {MOST} of {count}" if count > MOST else "all measured"
    return f"{text} Shown are {chosen} nodes and runs."


def caption_of_errors(which: str) -> str:
    """Under the map of errors by node and time."""
    text = f"Error (predicted − measured) on the {which} runs: red where the model is too hot, blue where too cold"
    return f"{text} (hatched where clearly so)."


def caption_of_detectability(sizes: Sequence[Detectable]) -> str:
    """Under what the data could have shown."""
    rows = reaches(sizes)
    hidden = sum(reach.easiest.share >= 1 for reach in rows)
    return (
        "The dot is the place where an effect shows most easily, the end of the line where it hides best. An effect "
        "that was not found is smaller than that, or absent; right of the dashed line even one of typical size could "
        f"hide ({hidden} of {len(rows)} effects wherever they are)."
    )


CAPTION_OF_PROBABILITIES = (
    "How probable each effect is, beside all else in the model; green ones were added, hollow ones were not. Right of "
    "the dashed line one is missing more probably than not."
)


def _where_it_fails(cell: Condition) -> str:
    """A condition, its error, and to which side."""
    text = f"{cell.node}, {bin_text(cell.quantity, cell.lower, cell.upper)}, with {kelvin(cell.errors.rmse, 2)}"
    if abs(cell.errors.mean) < _PLAIN * cell.errors.rmse:
        return text
    return f"{text}, predicted too {'hot' if cell.errors.mean > 0 else 'cold'}"
