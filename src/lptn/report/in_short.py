"""The opening paragraph: what is missing, where, how sure, what to do."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Protocol

from lptn.ladder import Ladder, Rung
from lptn.report.certainty import finding_of, share_by_chance
from lptn.report.heat_story import HeatStory, hiding
from lptn.report.text import kelvin, listed, named, place_of, title_of
from lptn.report.words import next_step, noise_alone

_FEW = 3  # names in a row


class Proposal(Protocol):
    """A proposed next experiment."""

    def text(self) -> str:
        """What to do and what it will show, in a few sentences."""


def in_short(ladder: Ladder, heat: HeatStory, proposal: Proposal | None = None) -> list[tuple[str, str]]:
    """The paragraph in four parts, each with its heading word.

    Args:
        ladder: the result.
        heat: what heat the given model lacks.
        proposal: of an experiment, where one was worked out.
    """
    told = {"adequate": _adequate, "missing": _missing, "unexplained": _unexplained}[ladder.verdict]
    what, where, sure = told(ladder, heat)
    to_do = f"{_first_sentence(proposal.text())} Section 7 says what that shows." if proposal else next_step(ladder)
    if heat.event and ladder.verdict != "adequate":
        to_do = f"Ask what happened {heat.event} that the log does not hold. {_sentence(to_do)}"
    return [("What is missing", what), ("Where", where), ("How sure", sure), ("What to do", _sentence(to_do))]


def _adequate(ladder: Ladder, heat: HeatStory) -> tuple[str, str, str]:
    only = ladder.rungs[0]
    noise = kelvin(noise_alone(only.fit), 2)
    sure = f"The RMSE on the fitted runs is {kelvin(only.fit.rmse, 2)}, noise alone leaves {noise}. "
    sure += "Section 5 shows how large each effect could be without showing."
    where = f"Nowhere: {hiding(heat)}." if not heat.where else f"{_sentence(heat.where)}, but too little to matter."
    return "Nothing that these data can show.", where, sure


def _missing(ladder: Ladder, heat: HeatStory) -> tuple[str, str, str]:
    added = [rung for rung in ladder.rungs if rung.effect and rung.at]
    if not added:
        what = "An effect of the catalogue explains most of the misfit, but none tried makes the model better."
        return what, _where("", heat), f"{_errors(ladder)}."
    what = f"{_sentence(listed([title_of(rung.effect or '') for rung in added]))}."
    places = _places(added)
    sure = f"{_chance(ladder)}{_errors(ladder)}."
    rivals = list(dict.fromkeys(named(*key) for rung in added for key in rung.alike))
    if rivals:
        some = listed(rivals) if len(rivals) <= _FEW else f"{', '.join(rivals[:_FEW])} and {len(rivals) - _FEW} others"
        sure += f" On the fitted runs alone, {some} would do about as well."
    else:
        sure += " Nothing else in the catalogue explains the fitted runs as well."
    if heat.left:
        sure += f" With the best model {heat.left}"
        sure += ": what was added does not explain that." if heat.event else "."
    elif ladder.remaining == "unexplained":
        sure += " Part of the misfit stays, and the catalogue does not explain that."
    return what, _where(f"{_sentence(places)}.", heat), sure


def _places(added: Sequence[Rung]) -> str:
    """Each place once, with what is missing there where there are several."""
    at: dict[str, list[str]] = {}
    for rung in added:
        at.setdefault(place_of(rung.at or ""), []).append(title_of(rung.effect or ""))
    return next(iter(at)) if len(at) == 1 else "; ".join(f"{place} ({listed(what)})" for place, what in at.items())


def _unexplained(ladder: Ladder, heat: HeatStory) -> tuple[str, str, str]:
    noise = kelvin(noise_alone(ladder.best.fit), 2)
    sure = f"{_errors(ladder)}; noise alone leaves {noise}. No effect of the catalogue, nor a few together, remove it."
    what = "Something that the catalogue does not hold."
    return what, _where("", heat) or "No one node and stretch stands out.", sure


def _where(places: str, heat: HeatStory) -> str:
    """Places in the model, then where and when heat lacks."""
    told = f"On the fitted runs {heat.where}." if heat.where else ""
    return f"{places} {told}".strip() or "No one node and stretch stands out."


def _chance(ladder: Ladder) -> str:
    """How often chance alone would score as the first rung does, where the diagnosis looked at it."""
    found = finding_of(ladder, ladder.rungs[1])
    if found is None:
        return ""
    as_much = "as much" if len(ladder.rungs) == 2 else "as the first of them"
    return f"Chance alone would score {as_much} in {share_by_chance(ladder, found)} of logs. "


def _errors(ladder: Ladder) -> str:
    """The error before and after, on the data that tell most."""
    given, best = ladder.rungs[0], ladder.best
    for which in ("proof", "holdout"):
        before, after = getattr(given, which), getattr(best, which)
        if before is not None and after is not None:
            return _change("proof" if which == "proof" else "held-out", before.rmse, after.rmse)
    return _change("fitted", given.fit.rmse, best.fit.rmse)


def _change(runs: str, before: float, after: float) -> str:
    if before == after:
        return f"The RMSE on the {runs} runs is {kelvin(before)}"
    return f"The RMSE on the {runs} runs goes from {kelvin(before)} to {kelvin(after)}"


def _first_sentence(text: str) -> str:
    return re.split(r"(?<=[.!?]) (?=[A-Z])", text, maxsplit=1)[0]


def _sentence(text: str) -> str:
    return text[:1].upper() + text[1:]
