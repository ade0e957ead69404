"""How a history of steps ended: what headline, summary, story, terminal and workbench agree on."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

from lptn.basics.words import listed
from lptn.diagnose.answers import LIKELY, Step
from lptn.diagnose.fit_statistics import criterion_difference
from lptn.diagnose.improvement import History
from lptn.report.shown import noise_alone
from lptn.report.tables import FAR
from lptn.report.text import either, kelvin, named, percent, place_of, significant

Outcome = Literal["adequate", "found", "tried", "asked", "unhelped", "unexplained"]

WORTH = 0.05
"""Share by which held-out errors must differ to speak for a step: the RMSE of some 200 independent residuals, an hour
or two of a few nodes, is itself known to 1/√400."""
HELPED = 0.99
"""The share of the error below which an error is called smaller."""


def outcome_of(history: History) -> Outcome:
    """How it ended, by its last step; the verdict on the model as given alone would contradict what was found.

    `"found"`: effects were added, and explain what was missing or most of it. `"tried"`: effects were added, and none
    helped, or on the fitted runs alone. `"asked"`: something of the catalogue is missing, and nothing was added yet.
    `"unhelped"`: something of the catalogue is missing, but nothing that a search tried makes the model better.
    `"unexplained"`: most of the misfit stays.
    """
    if len(history.steps) == 1:
        if history.verdict == "missing":
            return "asked" if history.searched_from is None else "unhelped"
        return history.verdict
    helped = any(help_of(history.steps, number) == "all" for number in range(1, len(history.steps)))
    if not helped and (history.verdict == "adequate" or history.remaining != "adequate"):
        return "tried"
    return "unexplained" if history.verdict == history.remaining == "unexplained" else "found"


Help = Literal["", "fitted", "all"]


def help_of(steps: Sequence[Step], number: int) -> Help:
    """Which errors a step lowered: those of held-out data, `"fitted"` where those of the fitted ones alone, or none.

    Fitted errors are lower where Schwarz's criterion says so, which decides where nothing is held out. Held-out ones
    are lower by so much that no scatter explains it, or by less where the fitted ones agree.

    Args:
        steps: the model as given first.
        number: of the step.
    """
    before, after = steps[number - 1], steps[number]
    pays = criterion_difference(before.fit, after.fit) > 0
    if before.holdout is None or after.holdout is None:
        return "all" if pays else ""
    share = after.holdout.rmse / before.holdout.rmse
    if share < 1 - WORTH or (pays and share < HELPED):
        return "all"
    return "fitted" if pays else ""


def sorted_steps(steps: Sequence[Step], searched_from: int | None) -> dict[Help, list[Step]]:
    """The steps that added an effect, by what they lowered.

    A search takes out again what is not needed beside the others: of a pair that helps together, it found both.

    Args:
        steps: the model as given first.
        searched_from: as `History` says it.
    """
    helps = {number: help_of(steps, number) for number in range(1, len(steps))}
    last = max((number for number, lowered in helps.items() if lowered == "all"), default=0)
    for number in range(len(steps) if searched_from is None else searched_from + 1, last):
        helps[number] = "all"
    kinds: tuple[Help, ...] = ("all", "fitted", "")
    return {kind: [steps[number] for number, lowered in helps.items() if lowered == kind] for kind in kinds}


def _is_improbable(step: Step) -> bool:
    """Whether it is less probable than not that anything is missing at a step's place; of one added by hand it isn't
    known.
    """
    return 0.0 < step.at_its_place < LIKELY


def tried_in_words(steps: Sequence[Step], searched_from: int | None, found: str = "") -> str:
    """What was found, and what was tried besides and did not help, without a full stop; empty for the model as given.

    Args:
        steps: the model as given first.
        searched_from: as `History` says it.
        found: what something that helped is said to be; by default found, where a diagnosis proposed it and the
            fitted data alone make it more probable than not.
    """
    by_help = sorted_steps(steps, searched_from)
    # Without a better one, an improbable explanation is the best.
    good_steps = [step for step in by_help["all"] if not _is_improbable(step)] or by_help["all"]
    if not found and all(step.probability for step in good_steps):
        found = "Found" if all(step.likely for step in good_steps) else "Best explanation, not certain"
    unnamed = [short_name(step) for step in by_help["all"] if step not in good_steps]
    good, fitted, idle = ([short_name(step) for step in kind] for kind in (good_steps, by_help["fitted"], by_help[""]))
    parts = [f"{found or 'Added'}: {listed(good)}"] if good else []
    if unnamed:
        stands = "stands" if len(unnamed) == 1 else "stand"
        parts.append(f"{listed(unnamed)} {stands} for something that these data don't name")
    if fitted:
        parts.append(f"{listed(fitted)} {'helps' if len(fitted) == 1 else 'help'} on the fitted runs alone")
    if idle:
        parts.append(f"{listed(idle)}, added{' as well' if parts else ''}, did not help")
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}"


def headline(history: History) -> str:
    """What was found, and by how much the error fell, in one sentence."""
    runs, before, after = rmse_by_data(history.steps[0], history.best)[-1]
    runs = {"fitted": "RMSE", "held-out": "held out", "test": "test"}[runs]
    errors = f"{kelvin(after)}" if len(history.steps) == 1 else f"{significant(before, 3)} → {kelvin(after)}"
    numbers = f"{runs} {errors}, floor {kelvin(noise_alone(history.best.fit), 2)}."
    outcome = outcome_of(history)
    if len(history.steps) > 1:
        word = "Added" if history.verdict == "adequate" else ""
        if outcome == "unexplained" and history.searched_from == 0:
            effects = listed([short_name(step) for step in history.steps[1:]])
            return f"Not explained; the best that the catalogue offers is {effects}; {numbers}"
        if outcome == "unexplained":
            word = "Not explained; what helps"
        return f"{tried_in_words(history.steps, history.searched_from, word)}; {numbers}"
    sentences = {
        "adequate": "Adequate: nothing is missing that these data can show",
        "asked": f"Something is missing{_first_answer(history)}; nothing was added yet",
        "unhelped": "Something is missing, but no effect that was tried makes the model better",
        "unexplained": "Not explained: wrong by more than noise, and the catalogue does not explain it",
    }
    return f"{sentences[outcome]}; {numbers}"


def answer_in_words(history: History) -> str:
    """The first answer to what the last step lacks, such as `fan at knee (80 % probable)`; empty without any."""
    best = history.last.best
    return f"{named(*best.key)} ({percent(best.probability)} probable)" if best else ""


def _first_answer(history: History) -> str:
    answer = answer_in_words(history)
    return f", first of all {answer}" if answer else ", but no single effect helps"


def short_name(step: Step) -> str:
    """An effect by its key, and where it acts, such as `conduction heater1–heater2`; no place for everywhere.

    With the other places where the data can't tell it from: `surface scale at L_knee (or R_knee)`.
    """
    key, at = step.key
    place = f"{'' if '~' in at else ' at'} {place_of(at)}".replace(" at everywhere", " everywhere")
    if len(step.places) > 1:
        place += f" (or {either([place_of(other) for other in step.places[1:]])})"
    else:
        place = place.removeprefix(" everywhere")
    return f"{key.replace('_', ' ')}{place}".replace("~", "–")


def left_in_words(history: History) -> str:
    """What is left with the last step, in one sentence or two that hold for fitted and held-out runs alike."""
    best, noise = history.best, noise_alone(history.best.fit)
    if history.remaining == "adequate":
        text = "What is left on the fitted runs is no more than the sensors' noise"
        if best.holdout is not None and best.holdout.rmse > FAR * noise:
            text += f", but the held-out ones are off by {kelvin(best.holdout.rmse)}: they hold something that the "
            return text + "fitted runs do not. Fit on runs like them as well."
        return f"{text}."
    text = f"The model is still wrong by more than noise, which alone would leave about {kelvin(noise, 2)}; "
    if history.remaining == "unexplained":
        return text + "the catalogue explains little of the rest."
    if history.searched_from is None:
        return text + (
            f"next to add would be {answer}." if (answer := answer_in_words(history)) else "no single effect helps."
        )
    if len(history.steps) == 1:
        return text + "no effect that was tried makes it better."
    where = "did not help on the held-out ones" if best.holdout else "did not pay for their parameters"
    return text + f"further effects lowered the error on the fitted runs but {where}."


def rmse_by_data(given: Step, best: Step) -> list[tuple[str, float, float]]:
    """What each kind of data is called, and the RMSE [K] on it with the model as given and with the best one."""
    pairs = [("fitted", given.fit.rmse, best.fit.rmse)]
    for runs, before, after in (("held-out", given.holdout, best.holdout), ("test", given.test, best.test)):
        if before and after:
            pairs.append((runs, before.rmse, after.rmse))
    return pairs
