"""Unexplained heat as the page shows it: a map, one node's line above its inputs, and a sentence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from lptn.diagnose.unexplained_heat import Stretch, UnexplainedHeat, largest, unexplained_heat
from lptn.diagnose.unexplained_heat_inputs import InputLink, input_links
from lptn.identify import Fit
from lptn.ladder import Ladder
from lptn.report.heat_line import Worst, chosen_links, heat_line, worst_of
from lptn.report.node_time import MOST_RUNS, heat_fields, node_time_map
from lptn.report.page import Picture, picture
from lptn.report.text import for_people, listed, number

_STAYS = 0.5  # share of the heat from which it is called unexplained by what was added
_CLOSE = 0.5  # correlation from which an input is worth a word
_PALE = 2.0  # the colour scale reaches so many times the usual band at least


@dataclass(frozen=True)
class HeatStory:
    """The heat that the given model lacks on the fitted runs, and the best one still.

    Args:
        fit: of the given model.
        given: its unexplained heat, one a run.
        best: the best model's; empty where no effect was added.
        worst: where the given model lacks heat most clearly.
        links: inputs that the worst node's heat goes with, closest first.
    """

    fit: Fit
    given: list[UnexplainedHeat]
    best: list[UnexplainedHeat]
    worst: Worst
    links: list[InputLink]

    @property
    def widest(self) -> float:
        """The widest of all nodes' usual bands [W]: less heat than that can hide."""
        return max(float(np.median(row)) for each in self.given for row in each.band)

    @property
    def where(self) -> str:
        """Where and when heat is missing, in words; empty where none is beyond chance."""
        return self._in_words(self.worst.stretch)

    @property
    def left(self) -> str:
        """Where and when the best model still lacks heat; empty where none is beyond chance."""
        return self._in_words(largest(self.best))

    @property
    def event(self) -> str:
        """Run, node and time at which most of the heat stays missing with the best model, too; empty without one."""
        before, after = self.worst.stretch, largest(self.best)
        if not self.best:
            return self._place(before) if before else ""
        stays = before is not None and after is not None and abs(after.heat) > _STAYS * abs(before.heat)
        return self._place(after) if after is not None and stays else ""

    def _in_words(self, stretch: Stretch | None) -> str:
        if stretch is None:
            return ""
        missing = "heat is missing" if stretch.heat > 0 else "there is too much heat"
        about = replace(stretch, heat=abs(stretch.heat)).text().removeprefix(stretch.place)
        return for_people(f"{missing} most clearly {self._place(stretch)}{about}")

    def _place(self, stretch: Stretch) -> str:
        return f"{stretch.place} of run {stretch.run}" if len(self.given) > 1 else stretch.place


def heat_story(ladder: Ladder) -> HeatStory:
    """Work out what the page shows of unexplained heat."""
    fit = ladder.rungs[0].fit
    given = unexplained_heat(fit)
    best = unexplained_heat(ladder.best.fit) if len(ladder.rungs) > 1 else []
    worst = worst_of(given)
    return HeatStory(fit, given, best, worst, chosen_links(input_links(fit, given), worst.node))


def heat_map_picture(story: HeatStory) -> Picture | None:
    """The map of nodes by time; none where no heat is beyond chance."""
    if story.worst.stretch is None:
        return None
    least = _PALE * float(np.median(np.concatenate([each.band.ravel() for each in story.given])))
    figure = node_time_map(heat_fields(story.given), heat_fields(story.best), "heat [W]", least)
    told = "Heat that the model lacks (red) or has too much of (blue, hatched); white where zero lies within"
    told += " the 95 % band."
    told += f" With the model as given {story.where}"
    told += f"; with the best one {story.left or 'none stands out'}." if story.best else "."
    told += " Trust where and when more than the watts: the fitted parameters absorb part."
    if len(story.given) > MOST_RUNS:
        told += f" Shown are the {MOST_RUNS} of {len(story.given)} runs that lack most."
    return picture(told, figure)


def heat_line_picture(story: HeatStory) -> Picture:
    """The worst node's heat in its run, above the inputs that it goes with."""
    place = story.worst.run
    best = story.best[place] if story.best else None
    figure = heat_line(story.fit, story.given[place], best, story.worst, story.links)
    if story.worst.stretch is None:
        told = f"No node asks for heat beyond chance; {story.worst.node} comes nearest to it."
    else:
        told = f"The heat that {story.worst.node} asks for; the stretch where it is clearest is shaded."
    return picture(f"{told} {_inputs(story.links)}", figure)


def _inputs(links: Sequence[InputLink]) -> str:
    close = [link for link in links if abs(link.correlation) >= _CLOSE]
    if not links:
        return "The log holds no input that varies."
    if not close:
        return f"It follows no input closely: the closest, {links[0].what}, correlates by {links[0].correlation:+.2f}."
    named = listed([f"{link.what} ({link.correlation:+.2f})" for link in close])
    return for_people(f"It goes with {named}, which suggests a cause and proves none.")


def hiding(story: HeatStory) -> str:
    """How much heat could hide in the bands, in words."""
    return f"no node asks for heat beyond chance; its 95 % band is ±{number(story.widest, 2)} W where it is widest"
