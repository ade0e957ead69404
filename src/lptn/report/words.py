"""The report in words: what is missing, how sure, which data say so, what to do next; captions of figures."""

from __future__ import annotations

import re
from collections.abc import Sequence
from math import sqrt
from typing import Protocol

import numpy as np

from lptn.diagnose.diagnosis import Step
from lptn.diagnose.improvement import History
from lptn.diagnose.scores import INDISTINGUISHABLE, Confusability, Detectable
from lptn.identify.comparison import Comparison, Condition
from lptn.identify.data import DataSplit, Segment
from lptn.identify.fitting import Fit
from lptn.report.diagnosis_figures import candidates_shown, reaches
from lptn.report.figures import MOST, NOISE_BAND, opening_end, views, worst
from lptn.report.heat_figures import HeatStory, hiding
from lptn.report.text import bin_text, experiment_for, kelvin, listed, named, place_of, title_of, window_text

# --- How sure the ladder is: what chance would do, what else fits as well, which data say so ------


_FEW = 4  # names in a row


def how_sure(history: History) -> str:
    """How sure each rung is; empty where none was added, or none explains the misfit."""
    if history.verdict != "missing":
        return ""
    return " ".join(_sure(history, number, step) for number, step in enumerate(history.steps) if step.effect)


def _sure(history: History, number: int, step: Step) -> str:
    found = refit_of(history, step)
    told = f"How sure is rung {number}, {named(step.effect or '', step.at or '')}? "
    if found is not None:
        told += f"Chance alone would score as much in {share_by_chance(history, found)} of logs. "
    if not step.indistinguishable:
        return told + "Nothing else in the catalogue explains the fitted runs about as well."
    verb = "explains" if len(step.indistinguishable) == 1 else "explain"
    others = f"{_few([named(*key) for key in step.indistinguishable])} {verb}"
    if all(effect == step.effect for effect, _ in step.indistinguishable):
        return told + f"The effect is clear, its place is not: {others} the fitted runs about as well."
    chose = "; the held-out runs chose" if step.holdout else ""
    return told + f"The fitted runs alone cannot tell: {others} them about as well{chose}."


def _few(items: Sequence[str]) -> str:
    """A list that nobody has to read to its end."""
    return listed(items) if len(items) <= _FEW else f"{', '.join(items[: _FEW - 1])} and {len(items) - _FEW + 1} others"


def share_by_chance(history: History, found: Step) -> str:
    """How often chance alone scores as much, in percent; the number of simulated logs sets the finest answer."""
    finest = 1.0 / (1 + len(history.first.scores.null_gains))
    at_most = "at most " if found.p_value <= finest * (1 + 1e-9) else ""
    return f"{at_most}{100 * found.p_value:.2g} %"


def refit_of(history: History, step: Step) -> Step | None:
    """What the first diagnosis says of a rung, where it looked at it."""
    if step is not history.steps[1]:
        return None
    return next((each for each in history.first.refits if each.key == (step.effect, step.at)), None)


def which_data(history: History, data: DataSplit) -> str:
    """Which runs fitted, which chose, which proved."""
    told = f"Parameters were fitted, and effects proposed, on {_runs(data.fit)}."
    if not data.holdout:
        told += " No data were held out: the ladder ends where a further effect does not pay for its parameters."
    else:
        among = (
            "" if history.considered == 1 else f"chose among the {history.considered} models that were followed, and "
        )
        told += (
            f" Held out: {_runs(data.holdout)}. No parameter was fitted to it; it {among}says where the ladder ends."
        )
    if data.test:
        return f"{told} Proof: {_runs(data.test)}. It chose nothing, so its error is the one to quote."
    if len(history.steps) == 1:
        return told
    missing = "nothing proves the result" if not data.holdout else "the held-out error is a little flattering"
    return f"{told} There are no proof runs, so {missing}; one more log, given with --proof, would tell."


def _runs(parts: Sequence[Segment]) -> str:
    """Runs by name, and which stretch of them counts where it is not all."""
    stretches = [(part.run.name, window_text(part.evaluation, part)) for part in parts]
    return _few([name if stretch == "all" else f"{name} ({stretch})" for name, stretch in stretches])


# --- The story in words: what is missing, how sure, which data say so; and what to do next --------


_FAR = 2.0  # multiples of the noise from which an error is no longer called noise
_HELPED = 0.99  # the share of the error below which an error is called smaller


def story_in_words(history: History, data: DataSplit) -> list[str]:
    """The story, a few sentences to each of: what is missing, how sure, which data say so."""
    told = {"adequate": _adequate, "missing": _missing, "unexplained": _unexplained}[history.verdict]
    return [told(history, data), *filter(None, [how_sure(history)]), which_data(history, data)]


def noise_alone(fit: Fit) -> float:
    """The RMSE that the noise of the measured nodes' sensors alone would leave [K]."""
    measured = np.any([bound.counted.any(axis=1) for bound in fit.problem.bound_runs], axis=0)
    return sqrt(float(np.mean(fit.noise.floor[measured] ** 2)))


def _adequate(history: History, data: DataSplit) -> str:
    only = history.steps[0]
    told = (
        "Nothing is missing that these data can show: on the fitted runs the model as given is wrong by no more than "
        f"the sensors' noise. {_errors(only)}; noise alone leaves about {kelvin(noise_alone(only.fit), 2)}."
    )
    if only.holdout is not None and only.holdout.rmse > _FAR * noise_alone(only.fit):
        told += (
            " On the held-out runs the error is well above the noise. They hold something that the fitted runs "
            "do not: fit on runs like them as well."
        )
    return f"{told} This holds for what the fitted runs cover: {_covered(history, data)}."


def _missing(history: History, data: DataSplit) -> str:
    given, best = history.steps[0], history.best
    if best is given:
        return (
            f"The model as given is wrong by more than noise. {_errors(given)}. On the fitted runs an effect of the "
            "catalogue explains most of it, but none that was tried makes the model better by the rule that ends the "
            "ladder, so none was added. Section 5 lists what was tried."
        )
    return f"Missing: {_added(history)}. {_fall(given, best)} {_rest(history)}"


def _unexplained(history: History, data: DataSplit) -> str:
    given, best = history.steps[0], history.best
    told = (
        "The model as given is wrong by more than the sensors' noise, and the catalogue does not explain it. "
        f"{_errors(given)}; noise alone leaves about {kelvin(noise_alone(given.fit), 2)}."
    )
    if best is given:
        return f"{told} No effect of the catalogue was worth adding."
    return (
        f"{told} The best that could be done is to add {_added(history)}. {_fall(given, best)} "
        "Most of the misfit on the fitted runs stays. Do not read what was added as physics."
    )


def _added(history: History) -> str:
    return listed([named(step.effect, step.at) for step in history.steps if step.effect and step.at])


def _errors(step: Step) -> str:
    told = f"Its RMSE is {kelvin(step.fit.rmse)} on the fitted runs"
    if step.holdout is not None:
        told += f" and {kelvin(step.holdout.rmse)} on the held-out ones (largest error {kelvin(step.holdout.max)})"
    if step.test is not None:
        told += f", {kelvin(step.test.rmse)} on the proof runs"
    return told


def _fall(given: Step, best: Step) -> str:
    pairs = [("on the fitted runs", given.fit.rmse, best.fit.rmse)]
    if given.holdout and best.holdout:
        pairs.append(("on the held-out runs", given.holdout.rmse, best.holdout.rmse))
    if given.test and best.test:
        pairs.append(("on the proof runs", given.test.rmse, best.test.rmse))
    changes = [f"from {kelvin(before)} to {kelvin(after)} {where}" for where, before, after in pairs]
    told = f"With that the RMSE goes {listed(changes)}."
    worse = [where for where, before, after in pairs if after > _HELPED * before]
    return f"{told} It does not get better {listed(worse, 'or')}." if worse else told


def _rest(history: History) -> str:
    if history.remaining == "adequate":
        return "What is left on the fitted runs is no more than the sensors' noise."
    noise = kelvin(noise_alone(history.best.fit), 2)
    told = f"The best model is still wrong by more than noise, which alone would leave about {noise}; "
    if history.remaining == "unexplained":
        return told + "the catalogue explains little of the rest."
    where = "did not help on the held-out ones" if history.best.holdout else "did not pay for their parameters"
    return told + f"further effects lowered the error on the fitted runs but {where}."


def fitted_in_words(history: History) -> str:
    """What was fitted at first, and how well it follows the runs that it was fitted to."""
    given = history.steps[0]
    free = given.parameters
    told = f"{free} free parameter{'s' if free != 1 else ''}, fitted by weighted least squares. {_errors(given)}; "
    return f"{told}the sensors' noise alone would leave about {kelvin(noise_alone(given.fit), 2)}."


def next_step(history: History) -> str:
    """What to do next, in a sentence or two."""
    if history.verdict == "adequate":
        return "use the model. Compare it again when the robot works harder, faster or in other air."
    open_ = [step for step in history.steps if step.indistinguishable and step.declaration]
    if history.verdict == "unexplained":
        return (
            "look in section 4 for where and when the error grows, and ask what happened then that the log does "
            "not hold: touch, water, a fan, a moved sensor, a load without a column. Log it, or leave that stretch out."
        )
    if history.best is history.steps[0]:
        return "measure a longer run with more contrast (rest, load, speed), and diagnose again."
    if not open_:
        return "use the best model." + ("" if history.remaining == "adequate" else " Section 4 shows the rest.")
    advice = " ".join(f"For {title_of(step.effect or '')}: {_ended(_experiment(step))}" for step in open_)
    return f"one experiment would tell the candidates apart. {advice} Then fit again with that log."


def _ended(text: str) -> str:
    return text if text.endswith(("?", ".")) else f"{text}."


def _experiment(step: Step) -> str:
    return "" if step.declaration is None else experiment_for(type(step.declaration.effect))


def _covered(history: History, data: DataSplit) -> str:
    bound_runs = history.steps[0].fit.problem.bound_runs
    readings = np.concatenate([bound.measured[bound.counted] for bound in bound_runs])
    seconds = sum(len(bound) * bound.run.step for bound in bound_runs)
    return f"{seconds / 60:.3g} min at {readings.min():.0f} to {readings.max():.0f} °C"


# --- The opening paragraph: what is missing, where, how sure, what to do --------------------------


_FEW_PLACES = 3  # names in a row


class Proposal(Protocol):
    """A proposed next experiment."""

    def text(self) -> str:
        """What to do and what it will show, in a few sentences."""


def in_short(history: History, heat: HeatStory, proposal: Proposal | None = None) -> list[tuple[str, str]]:
    """The paragraph in four parts, each with its heading word.

    Args:
        ladder: the result.
        heat: what heat the given model lacks.
        proposal: of an experiment, where one was worked out.
    """
    told = {"adequate": _short_adequate, "missing": _short_missing, "unexplained": _short_unexplained}[history.verdict]
    what, where, sure = told(history, heat)
    to_do = f"{_first_sentence(proposal.text())} Section 7 says what that shows." if proposal else next_step(history)
    if heat.event and history.verdict != "adequate":
        to_do = f"Ask what happened {heat.event} that the log does not hold. {_sentence(to_do)}"
    return [("What is missing", what), ("Where", where), ("How sure", sure), ("What to do", _sentence(to_do))]


def _short_adequate(history: History, heat: HeatStory) -> tuple[str, str, str]:
    only = history.steps[0]
    noise = kelvin(noise_alone(only.fit), 2)
    sure = f"The RMSE on the fitted runs is {kelvin(only.fit.rmse, 2)}, noise alone leaves {noise}. "
    sure += "Section 5 shows how large each effect could be without showing."
    where = f"Nowhere: {hiding(heat)}." if not heat.where else f"{_sentence(heat.where)}, but too little to matter."
    return "Nothing that these data can show.", where, sure


def _short_missing(history: History, heat: HeatStory) -> tuple[str, str, str]:
    added = [step for step in history.steps if step.effect and step.at]
    if not added:
        what = "An effect of the catalogue explains most of the misfit, but none tried makes the model better."
        return what, _where("", heat), f"{_short_errors(history)}."
    what = f"{_sentence(listed([title_of(step.effect or '') for step in added]))}."
    places = _places(added)
    sure = f"{_chance(history)}{_short_errors(history)}."
    rivals = list(dict.fromkeys(named(*key) for step in added for key in step.indistinguishable))
    if rivals:
        some = (
            listed(rivals)
            if len(rivals) <= _FEW_PLACES
            else f"{', '.join(rivals[:_FEW_PLACES])} and {len(rivals) - _FEW_PLACES} others"
        )
        sure += f" On the fitted runs alone, {some} would do about as well."
    else:
        sure += " Nothing else in the catalogue explains the fitted runs as well."
    if heat.left:
        sure += f" With the best model {heat.left}"
        sure += ": what was added does not explain that." if heat.event else "."
    elif history.remaining == "unexplained":
        sure += " Part of the misfit stays, and the catalogue does not explain that."
    return what, _where(f"{_sentence(places)}.", heat), sure


def _places(added: Sequence[Step]) -> str:
    """Each place once, with what is missing there where there are several."""
    at: dict[str, list[str]] = {}
    for step in added:
        at.setdefault(place_of(step.at or ""), []).append(title_of(step.effect or ""))
    return next(iter(at)) if len(at) == 1 else "; ".join(f"{place} ({listed(what)})" for place, what in at.items())


def _short_unexplained(history: History, heat: HeatStory) -> tuple[str, str, str]:
    noise = kelvin(noise_alone(history.best.fit), 2)
    sure = f"{_short_errors(history)}; noise alone leaves {noise}. No effect of the catalogue, nor a few together, remove it."
    what = "Something that the catalogue does not hold."
    return what, _where("", heat) or "No one node and stretch stands out.", sure


def _where(places: str, heat: HeatStory) -> str:
    """Places in the model, then where and when heat lacks."""
    told = f"On the fitted runs {heat.where}." if heat.where else ""
    return f"{places} {told}".strip() or "No one node and stretch stands out."


def _chance(history: History) -> str:
    """How often chance alone would score as the first rung does, where the diagnosis looked at it."""
    found = refit_of(history, history.steps[1])
    if found is None:
        return ""
    as_much = "as much" if len(history.steps) == 2 else "as the first of them"
    return f"Chance alone would score {as_much} in {share_by_chance(history, found)} of logs. "


def _short_errors(history: History) -> str:
    """The error before and after, on the data that tell most."""
    given, best = history.steps[0], history.best
    for which in ("test", "holdout"):
        before, after = getattr(given, which), getattr(best, which)
        if before is not None and after is not None:
            return _change("proof" if which == "test" else "held-out", before.rmse, after.rmse)
    return _change("fitted", given.fit.rmse, best.fit.rmse)


def _change(runs: str, before: float, after: float) -> str:
    if before == after:
        return f"The RMSE on the {runs} runs is {kelvin(before)}"
    return f"The RMSE on the {runs} runs goes from {kelvin(before)} to {kelvin(after)}"


def _first_sentence(text: str) -> str:
    return re.split(r"(?<=[.!?]) (?=[A-Z])", text, maxsplit=1)[0]


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]


# --- One plain sentence under each figure: what to see in it --------------------------------------


_PLAIN = 0.5  # share of the RMSE from which its mean is worth a word


def caption_of_ladder(history: History) -> str:
    """Under the falling errors."""
    last = len(history.steps) - 1
    held = "the held-out errors say where it ends" if history.best.holdout else "no held-out errors check it"
    return f"RMSE from the model as given (rung 0) to the best model (rung {last}), blue and green; {held}."


def caption_of_maps(given: Comparison, best: Comparison | None, which: str) -> str:
    """Under the maps of where a model fails."""
    told = f"RMSE in K on the {which} runs by node and operating condition; the small numbers are each bin's range."
    place = worst(given)
    if place is not None:
        model = "The model as given" if best else "The model"
        told += f" {model} fails worst at {_where_in_caption(place)}."
    left = worst(best) if best else None
    return told if left is None else f"{told} The best model's worst is {_where_in_caption(left)}."


def caption_of_predictions(given: Comparison, best: Comparison | None, data: DataSplit, which: str) -> str:
    """Under measured and predicted temperatures."""
    lines = (
        "The blue line is the model as given, the green one the best model" if best else "The blue line is the model"
    )
    below = f"below, predicted minus measured, and ±{NOISE_BAND:g} times the sensor noise in grey"
    told = f"Temperatures on the {which} runs. {lines}; {below}."
    if any(opening_end(prediction) is not None for prediction in given.predictions):
        fitted = {part.run.name for part in data.fit}
        same = all(prediction.segment.run.name in fitted for prediction in given.predictions)
        found = "the shaded stretch, which was fitted," if same else "the shaded opening"
        told += f" Readings in {found} only set the start; what follows is predicted freely."
    else:
        told += " The start was fitted along with these readings, so this is no proof."
    count = len(views(given))
    return f"{told} {_chosen(count)}"


def caption_of_error_map(which: str) -> str:
    """Under the map of errors by node and time."""
    told = f"Predicted minus measured on the {which} runs: red where the model is too hot, blue where too cold"
    return f"{told} (hatched where clearly so)."


def caption_of_confusion(found: Confusability) -> str:
    """Under the likeness of candidates' traces."""
    told = "How alike the traces are that candidates leave on the fitted runs, once the parameters have adapted."
    if not found.groups():
        return (
            f"{told} No two of the best reach {INDISTINGUISHABLE:g}, so these data tell them apart if the effects are large enough."
        )
    numbers = {key: str(number) for number, key in enumerate(found.keys, start=1)}
    groups = "; ".join(
        "all of them" if len(group) == len(numbers) else listed([numbers[key] for key in group])
        for group in found.groups()
    )
    return f"{told} Linked by {INDISTINGUISHABLE:g} or more, so to first order one answer with several names: {groups}."


def caption_of_detectability(found: Sequence[Detectable]) -> str:
    """Under what the data could have shown."""
    rows = reaches(found)
    hidden = sum(each.easiest.share >= 1 for each in rows)
    told = "The dot is the place where an effect shows most easily, the end of the line where it hides best."
    told += " An effect that was not found is smaller than that, or absent; right of the dashed line even one of"
    told += f" typical size could hide ({hidden} of {len(rows)} effects wherever they are)."
    return told


def caption_of_ranking(history: History) -> str:
    """Under the ranking of candidates."""
    shown, whole = len(candidates_shown(history.first)), len(history.first.scores.ranked)
    told = "How far each candidate scores beyond chance; chance alone passes the dashed line once in twenty logs."
    if history.first.refits:
        told += " Filled bars were refitted."
    if len(history.steps) > 1:
        told += " Green ones stand on the ladder."
    return told if shown == whole else f"{told} The {whole - shown} not shown score lower or nothing."


def _chosen(count: int) -> str:
    return f"Shown are the worst {MOST} of {count} nodes and runs." if count > MOST else "All measured nodes are shown."


def _where_in_caption(cell: Condition) -> str:
    """A condition, its error, and to which side."""
    told = f"{cell.node}, {bin_text(cell.quantity, cell.lower, cell.upper)}, with {kelvin(cell.errors.rmse, 2)}"
    if abs(cell.errors.mean) < _PLAIN * cell.errors.rmse:
        return told
    return f"{told}, predicted too {'hot' if cell.errors.mean > 0 else 'cold'}"
