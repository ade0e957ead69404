"""How a history of steps ended: what headline, summary, story, terminal and workbench agree on.

First what is wrong (findings: what sets a place, a sensor, a limb or a run apart), then what the machine is made of
(structure: what all parts have in common), then what somebody added, then the errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Literal

from lptn.basics.words import listed
from lptn.diagnose.answers import LIKELY, Step
from lptn.diagnose.diagnosis import Diagnosis, is_met
from lptn.diagnose.fit_statistics import criterion_difference
from lptn.diagnose.improvement import History
from lptn.effects.learned_heat import UNNAMED, LearnedHeat, goes_with
from lptn.identify.fitting import Fit
from lptn.report.shown import noise_alone
from lptn.report.tables import FAR
from lptn.report.text import few, kelvin, named, percent, place_of, significant, size_told

Outcome = Literal["adequate", "found", "tried", "asked", "unexplained"]

WORTH = 0.05
"""Share by which held-out errors must differ to speak for a step that somebody chose: the RMSE of some 200 independent
residuals, an hour or two of a few nodes, is itself known to 1/√400."""
HELPED = 0.99
"""The share of the error below which an error is called smaller."""
FEW = 3
"""Names in a row that a sentence carries."""


# --- what the steps are -------------------------------------------------------------------------------------


@dataclass
class Kinds:
    """The steps that added an effect, by what is said of them.

    Args:
        findings: what sets a place, a sensor, a limb or a run apart, by a diagnosis.
        structure: what all parts have in common, by a diagnosis.
        helped: what somebody chose, and lowers the errors.
        fitted: what somebody chose, and lowers those of the fitted runs alone.
        idle: what somebody chose, and lowers none.
        learned: what somebody chose that helped and has no name: it explains nothing.
    """

    findings: list[Step] = field(default_factory=list)
    structure: list[Step] = field(default_factory=list)
    helped: list[Step] = field(default_factory=list)
    fitted: list[Step] = field(default_factory=list)
    idle: list[Step] = field(default_factory=list)
    learned: list[Step] = field(default_factory=list)

    @classmethod
    def of(cls, steps: Sequence[Step]) -> Kinds:
        """Sort the steps of a history, the model as given first.

        What a diagnosis answered, it weighed; of what somebody chose the errors tell.
        """
        kinds = cls()
        for before, step in pairwise(steps):
            if step.probability:
                (kinds.structure if step.is_structure else kinds.findings).append(step)
            elif step.effect == LearnedHeat.key and _lowered(before, step):
                kinds.learned.append(step)
            else:
                {"all": kinds.helped, "fitted": kinds.fitted, "": kinds.idle}[_lowered(before, step)].append(step)
        return kinds

    @property
    def good(self) -> list[Step]:
        """What was found, and what else helped."""
        return [*self.findings, *self.structure, *self.helped, *self.learned]


def _lowered(before: Step, after: Step) -> Literal["", "fitted", "all"]:
    """Which errors a step lowered: those of held-out data, `"fitted"` where those of the fitted ones alone, or none.

    Fitted errors are lower where Schwarz's criterion says so, which decides where nothing is held out. Held-out ones
    are lower by so much that no scatter explains it, or by less where the fitted ones agree.
    """
    pays = criterion_difference(before.fit, after.fit) > 0
    if before.holdout is None or after.holdout is None:
        return "all" if pays else ""
    share = after.holdout.rmse / before.holdout.rmse
    if share < 1 - WORTH or (pays and share < HELPED):
        return "all"
    return "fitted" if pays else ""


def outcome_of(history: History) -> Outcome:
    """How it ended, by its last step; the verdict on the model as given alone would contradict what was found.

    `"found"`: effects were added, and explain what was missing or most of it. `"tried"`: somebody added effects, and
    none helped, or on the fitted runs alone. `"asked"`: something of the catalogue is missing, and nothing was added
    yet. `"unexplained"`: most of the misfit stays.
    """
    if len(history.steps) == 1:
        return "asked" if history.verdict == "missing" else history.verdict
    if not Kinds.of(history.steps).good and (history.verdict == "adequate" or history.remaining != "adequate"):
        return "tried"
    return "unexplained" if history.verdict == history.remaining == "unexplained" else "found"


# --- names, sizes, certainty --------------------------------------------------------------------------------


def short_name(step: Step) -> str:
    """An effect by its key, and where it acts, such as `conduction heater1–heater2`; no place for everywhere."""
    key, at = step.key
    place = "" if at == "*" else f"{'' if '~' in at else ' at'} {place_of(at)}".replace(" at everywhere", " everywhere")
    return f"{key.replace('_', ' ')}{place}".replace("~", "–")


def certainty(step: Step) -> str:
    """How probable an answer is; of one name among several at its place, that something is missing there as well."""
    text = f"{percent(step.probability)} probable"
    if step.probability < LIKELY <= step.at_its_place:
        text += f", that something is missing there {percent(step.at_its_place)}"
    return text


def finding_in_words(step: Step, last: Fit) -> str:
    """A finding with its size and certainty, such as `fan at knee (0.3 ± 0.02 W/K, 98 % probable)`."""
    return f"{short_name(step)} ({', '.join(filter(None, (size_told(step, last), certainty(step))))})"


def steps_in_words(steps: Sequence[Step], found: str = "found") -> str:
    """What is wrong, what the machine is made of, and what somebody added, without a full stop; empty for the model as
    given.

    Args:
        steps: the model as given first.
        found: what findings are said to be.
    """
    kinds, last = Kinds.of(steps), steps[-1].fit
    helped, fitted, idle = ([short_name(step) for step in kind] for kind in (kinds.helped, kinds.fitted, kinds.idle))
    parts = []
    if kinds.findings:
        parts.append(f"{found}: {listed([finding_in_words(step, last) for step in kinds.findings])}")
    if kinds.structure:
        parts.append(f"structure: {few([short_name(step) for step in kinds.structure], FEW)}")
    if helped:
        parts.append(f"added: {listed(helped)}")
    if fitted:
        parts.append(f"{listed(fitted)} {'helps' if len(fitted) == 1 else 'help'} on the fitted runs alone")
    for declared in (declared for step in kinds.learned for declared in step.declarations):
        column = goes_with(declared.effect, declared.driven_by or declared.at)
        parts.append(f"heat at {declared.at} {UNNAMED}{column}: learned, without a name")
    if idle:
        parts.append(f"{listed(idle)}, added{' as well' if parts else ''}, did not help")
    text = "; ".join(parts)
    return f"{text[:1].upper()}{text[1:]}"


# --- sentences ----------------------------------------------------------------------------------------------


def headline(history: History) -> str:
    """What is wrong, what the machine is made of, and by how much the error fell, in one sentence."""
    runs, before, after = rmse_by_data(history.steps[0], history.best)[-1]
    runs = {"fitted": "RMSE", "held-out": "held out", "test": "test"}[runs]
    errors = f"{kelvin(after)}" if len(history.steps) == 1 else f"{significant(before, 3)} → {kelvin(after)}"
    numbers = f"{runs} {errors}, floor {kelvin(noise_alone(history.best.fit), 2)}."
    outcome = outcome_of(history)
    if len(history.steps) > 1 and outcome != "unexplained":
        return f"{steps_in_words(history.steps)}; {numbers}"
    if len(history.steps) > 1:
        text = steps_in_words(history.steps, "the best that the catalogue offers")
        return f"Not explained; {text[:1].lower()}{text[1:]}; {numbers}"
    sentences = {
        "adequate": "Adequate: nothing is missing that these data can show",
        "asked": f"Something is missing{_first_answer(history)}; nothing was added yet",
        "unexplained": "Not explained: the held-out runs hold something that the fitted ones do not"
        if history.first.only_held_out_runs_object
        else "Not explained: wrong by more than noise, and the catalogue does not explain it",
    }
    return f"{sentences[outcome]}; {numbers}"


def answer_in_words(history: History) -> str:
    """The first answer to what the last step lacks, such as `fan at knee (80 % probable)`; empty without any."""
    best = history.last.best
    return f"{named(*best.key)} ({certainty(best)})" if best else ""


def _first_answer(history: History) -> str:
    answer = answer_in_words(history)
    return f", first of all {answer}" if answer else ""


def log_errors_in_words(diagnosis: Diagnosis) -> str:
    """What an adequate model leaves."""
    beside = "" if is_met(diagnosis.lack_of_fit) else " and what air, torques and surfaces are usually off by"
    return f"the sensors' noise{beside}"


def left_in_words(history: History) -> str:
    """What is left with the last step, in one sentence or two that hold for fitted and held-out runs alike."""
    best, noise = history.best, noise_alone(history.best.fit)
    if history.remaining == "adequate":
        return f"What is left is no more than {log_errors_in_words(history.last)}."
    if is_met(history.last.lack_of_fit) and best.holdout is not None and best.holdout.rmse > FAR * noise:
        text = "What is left on the fitted runs is no more than the sensors' noise, but the held-out ones are off by "
        text += f"{kelvin(best.holdout.rmse)}: they hold something that the "
        return text + "fitted runs do not. Fit on runs like them as well."
    text = f"The model is still wrong by more than noise, which alone would leave about {kelvin(noise, 2)}; "
    answer = answer_in_words(history) if history.remaining == "missing" else ""
    return text + (f"next to add would be {answer}." if answer else "the catalogue explains little of the rest.")


def refused_in_words(history: History) -> str:
    """What was fitted beside all that was added, and is less probable than not; empty where nothing was."""
    names = [f"{named(*step.key)} ({percent(step.probability)})" for step in history.last.refused]
    if not names:
        return ""
    return f"Fitted beside that, and refused as less probable than not: {few(names, FEW)}."


def who_chose(history: History) -> str:
    """Which data decided on what is missing, in a sentence."""
    if history.searched_from is None and len(history.steps) > 1:
        return "Which effects were added, somebody chose."
    if history.steps[0].holdout:
        return "What is missing is decided by the fitted runs, and by how the held-out ones are predicted."
    return "What is missing is decided by the fitted runs alone."


def rmse_by_data(given: Step, best: Step) -> list[tuple[str, float, float]]:
    """What each kind of data is called, and the RMSE [K] on it with the model as given and with the best one."""
    pairs = [("fitted", given.fit.rmse, best.fit.rmse)]
    for runs, before, after in (("held-out", given.holdout, best.holdout), ("test", given.test, best.test)):
        if before and after:
            pairs.append((runs, before.rmse, after.rmse))
    return pairs
