"""The figure of one node's unexplained heat over time, above the inputs that it goes with."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lptn.diagnose.unexplained_heat import Stretch, UnexplainedHeat, largest
from lptn.diagnose.unexplained_heat_inputs import InputLink
from lptn.identify import Fit
from lptn.logs import Run
from lptn.report.decimate import decimated
from lptn.report.style import BEST, FAINT, GIVEN, INK, OPENING, SMALL, TEXT, dress, new_figure, plain, time_axis
from lptn.report.text import for_people

MOST_INPUTS = 3
"""Inputs drawn below the heat."""
_HEAT, _INPUT = 2.3, 0.95  # inch
_UNITS = {
    "torque": "N·m",
    "torque_abs": "N·m",
    "current": "A",
    "current_abs": "A",
    "velocity": "rad/s",
    "velocity_rms": "rad/s",
    "speed": "m/s",
    "power": "W",
    "mechanical_power": "W",
    "temperature": "°C",
    "irradiance": "W/m²",
}


@dataclass(frozen=True)
class Worst:
    """The node and run whose heat is drawn.

    Args:
        run: number of the run.
        node: the node.
        stretch: where its heat is largest, `None` where none is beyond its band.
    """

    run: int
    node: str
    stretch: Stretch | None


def worst_of(found: Sequence[UnexplainedHeat]) -> Worst:
    """Where the heat is clearest, or where it comes nearest to its band."""
    stretch = largest(found)
    if stretch is not None:
        return Worst([each.run for each in found].index(stretch.run), stretch.node, stretch)
    shares = [(np.abs(each.heat) / np.maximum(each.band, 1e-12)).max(axis=1) for each in found]
    run = max(range(len(found)), key=lambda place: float(shares[place].max()))
    return Worst(run, found[run].nodes[int(shares[run].argmax())], None)


def chosen_links(links: Sequence[InputLink], node: str) -> list[InputLink]:
    """The inputs that the node's heat goes with most closely, one of each kind before a second of any."""
    mine = [link for link in links if link.node == node]
    kinds: dict[str, InputLink] = {}
    for link in mine:
        kinds.setdefault(link.column.partition(".")[0], link)
    first = list(kinds.values())
    return [*first, *(link for link in mine if link not in first)][:MOST_INPUTS]


def heat_line(
    fit: Fit, given: UnexplainedHeat, best: UnexplainedHeat | None, worst: Worst, links: Sequence[InputLink]
) -> Figure:
    """Heat [W] with its band at one node, and below it the inputs, in one run.

    Args:
        fit: of the given model.
        given: its unexplained heat in the run.
        best: the best model's in the same run.
        worst: the node.
        links: the inputs to draw, closest first.
    """
    run = fit.problem.drives[worst.run].run
    figure = new_figure(_HEAT + _INPUT * len(links) + 0.3)
    ratios = [_HEAT, *(_INPUT for _ in links)]
    axes = figure.subplots(len(ratios), 1, squeeze=False, sharex=True, height_ratios=ratios)[:, 0]
    minutes = time_axis(given.time)[1].endswith("[min]")
    per_second = 1 / 60 if minutes else 1.0
    if worst.stretch is not None:
        for ax in axes:
            ax.axvspan(worst.stretch.start * per_second, worst.stretch.stop * per_second, color=OPENING, zorder=0)
    for found, style, name in ((given, GIVEN, "model as given" if best else "model"), (best, BEST, "best model")):
        if found is not None and worst.node in found.nodes:
            _band(axes[0], found, worst.node, style, name, per_second)
    axes[0].axhline(0.0, color=FAINT, linewidth=0.8)
    axes[0].set_ylabel("unexplained heat [W]", size=SMALL)
    axes[0].set_title(plain(f"{worst.node}, run {given.run}"), size=TEXT, loc="left", pad=3)
    axes[0].legend(frameon=False, fontsize=SMALL, loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2)
    for ax, link in zip(axes[1:], links, strict=True):
        _input(ax, run, link, per_second)
    for ax in axes:
        dress(ax)
    axes[-1].set_xlabel("time [min]" if minutes else "time [s]", size=SMALL)
    axes[0].set_xlim(given.time[0] * per_second, given.time[-1] * per_second)
    figure.align_ylabels(axes)
    return figure


def _band(ax: Axes, found: UnexplainedHeat, node: str, style: dict[str, Any], name: str, per_second: float) -> None:
    row = found.nodes.index(node)
    heat, band = found.heat[row], found.band[row]
    time = found.time * per_second
    ax.fill_between(time, heat - band, heat + band, color=style["color"], alpha=0.18, linewidth=0)
    ax.plot(time, heat, label=f"{name} with its 95 % band", **style | {"linewidth": 1.4})


def _input(ax: Axes, run: Run, link: InputLink, per_second: float) -> None:
    quantity = link.column.partition(".")[0]
    ax.plot(*decimated(run.time * per_second, run.columns[link.column]), color=INK, linewidth=0.7)
    ax.set_ylabel(f"[{_UNITS.get(quantity, 'as logged')}]", size=SMALL)
    what = f"{link.column}, whose square" if link.squared else f"{link.column}, which"
    title = f"{what} correlates with the heat by {link.correlation:+.2f}"
    ax.set_title(plain(for_people(title)), size=SMALL, loc="left", pad=2)
