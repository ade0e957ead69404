"""Unexplained heat as the page tells it: where it is clearest, a map, and one node's line above its inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from lptn.basics.style import inline_svg, single
from lptn.basics.words import listed
from lptn.diagnose.improvement import History
from lptn.diagnose.learned_heat import LearnedCurve
from lptn.diagnose.unexplained_heat import HeatPeak, UnexplainedHeat, largest, unexplained_heat
from lptn.identify.fitting import Fit
from lptn.logs.columns import quantity_of
from lptn.report.document import Picture
from lptn.report.heat_figures import HEAT, field_figures, heat_figure, plot_learned
from lptn.report.shown import MOST_INPUTS, MOST_RUNS, InputLink, heat_fields, input_links
from lptn.report.text import for_people, number

_CLOSE = 0.5  # correlation from which an input is worth a word
_PALE = 2.0  # the colour scale reaches so many times the usual band at least


@dataclass(frozen=True)
class HeatStory:
    """The heat that the given model lacks on the fitted runs, and the best one still.

    Args:
        fit: of the given model.
        given: its unexplained heat, one a run.
        best: the best model's; empty where no effect was added.
        run: number of the run whose heat is drawn.
        node: the node whose heat is drawn: where it is clearest, or comes nearest to its band.
        peak: where its heat is largest, `None` where none is beyond its band.
        links: inputs that the node's heat goes with, closest first; none where it is none beyond chance.
    """

    fit: Fit
    given: list[UnexplainedHeat]
    best: list[UnexplainedHeat]
    run: int
    node: str
    peak: HeatPeak | None
    links: list[InputLink]

    @classmethod
    def of(cls, history: History) -> HeatStory:
        """Work it out for the first and the last step."""
        fit = history.steps[0].fit
        given = unexplained_heat(fit)
        best = unexplained_heat(history.best.fit) if len(history.steps) > 1 else []
        peak = largest(given)
        if peak is not None:
            run, node = [estimate.run for estimate in given].index(peak.run), peak.node
        else:
            shares = [(np.abs(one.heat) / np.maximum(one.sure_band, 1e-12)).max(axis=1) for one in given]
            run = max(range(len(given)), key=lambda place: float(shares[place].max()))
            node = given[run].nodes[int(shares[run].argmax())]
        links = chosen_links(input_links(fit, given, node)) if peak else []  # heat by chance goes with inputs by chance
        return cls(fit, given, best, run, node, peak, links)

    @property
    def hiding(self) -> str:
        """How much heat could hide in the bands, in words."""
        widest = max(float(np.median(row)) for estimate in self.given for row in estimate.sure_band)
        band = f"the 95 % band over all nodes and times is ±{number(widest, 2)} W where it is widest"
        return f"no node lacks heat beyond chance; {band}"

    def where(self, peak: HeatPeak | None) -> str:
        """Where and when heat is missing, in words; empty where none is beyond chance."""
        if peak is None:
            return ""
        what = "heat is missing" if peak.heat > 0 else "there is too much heat"
        place = f"{peak.place} of run {peak.run}" if len(self.given) > 1 else peak.place
        about = replace(peak, heat=abs(peak.heat)).text().removeprefix(peak.place)
        return for_people(f"{what} most clearly {place}{about}")


def chosen_links(links: Sequence[InputLink]) -> list[InputLink]:
    """The inputs that a node's heat goes with most closely, one of each kind before a second of any."""
    kinds: dict[str, InputLink] = {}
    for link in links:
        kinds.setdefault(quantity_of(link.column), link)
    first = list(kinds.values())
    return [*first, *(link for link in links if link not in first)][:MOST_INPUTS]


def heat_map_picture(story: HeatStory) -> Picture | None:
    """The map of nodes by time; none where no heat is beyond chance."""
    if story.peak is None:
        return None
    least = _PALE * float(np.median(np.concatenate([estimate.sure_band.ravel() for estimate in story.given])))
    figures = field_figures(heat_fields(story.given), heat_fields(story.best), "W", least)
    drawings = [inline_svg(figure, "unexplained heat by node and time") for figure in figures]
    text = "Heat that the model lacks (red) or has too much of (blue, hatched); blank where zero lies within the 95 % "
    text += f"band over all nodes and times. With the model as given {story.where(story.peak)}"
    text += f"; with the best one {story.where(largest(story.best)) or 'none stands out'}." if story.best else "."
    text += " Place and time are more reliable than the watts: the fitted parameters absorb part."
    if len(story.given) > MOST_RUNS:
        text += f" Shown are the {MOST_RUNS} of {len(story.given)} runs that lack most."
    return Picture(text, *drawings)


def heat_line_picture(story: HeatStory) -> Picture:
    """The worst node's heat in its run, above the inputs that it goes with."""
    best = story.best[story.run] if story.best else None
    run = story.fit.problem.bound_runs[story.run].run
    figure = heat_figure(run, story.given[story.run], story.node, best, story.peak, story.links)
    drawing = inline_svg(figure, f"unexplained heat of {story.node} over time, and inputs")
    text = f"The heat that {story.node} lacks over time, with its 95 % band over all nodes and times; "
    text += "shaded where it is clearest."
    if story.peak is None:
        return Picture(f"No node lacks heat beyond chance; {story.node} comes nearest to it.", drawing)
    return Picture(f"{text} {_inputs(story.links)}", drawing)


def learned_picture(curve: LearnedCurve | None) -> Picture | None:
    """The curve over the input that unexplained heat goes with; none where it goes with none that can be learned."""
    if not curve or not curve.step:
        return None
    drawing = inline_svg(single(HEAT, partial(plot_learned, curve)), f"unexplained heat over {curve.inputs[0].column}")
    return Picture(for_people(curve.text()), drawing)


def _inputs(links: Sequence[InputLink]) -> str:
    close = [link for link in links if abs(link.correlation) >= _CLOSE]
    if not links:
        return "The log holds no input that varies."
    if not close:
        return f"It follows no input closely: the closest, {links[0].what}, correlates by {links[0].correlation:+.2f}."
    inputs = listed([f"{link.what} ({link.correlation:+.2f})" for link in close])
    return for_people(f"It goes with {inputs}, which suggests a cause but does not prove it.")
