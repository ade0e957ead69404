"""Figures of a diagnosis: errors by step, what is predicted without and with the answers, what the data could show."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullLocator

from lptn.basics import style
from lptn.basics.words import short_size
from lptn.diagnose.advice import Detectable
from lptn.diagnose.answers import Step
from lptn.diagnose.diagnosis import Diagnosis
from lptn.diagnose.unexplained_heat import unexplained_heat
from lptn.identify.comparison import compare
from lptn.identify.data import Segment
from lptn.report.comparison_figures import draw_predictions, predictions_height
from lptn.report.heat_figures import draw_fields, field_height
from lptn.report.shown import heat_fields, noise_alone, reaches, worst_views
from lptn.report.text import kelvin, place_of, title_of, unit_text

# --- the history: how the errors fall from step to step -----------------------------------------------------


HISTORY = 3.2
"""Height of a history [inch]."""
_FRAME, _ROW = 0.75, 0.2  # inch: around the rows of a figure, and a row
_LETTERS = 140  # that fit below the axes side by side
_WIDE = 8.0  # ratio of errors above which only a logarithmic axis shows them all
_STYLES: dict[str, dict[str, Any]] = {  # by what has the errors in a step
    "fit": {"label": "fit data", "color": style.FAINT, "linestyle": "--", "marker": "o"},
    "holdout": {"label": "held-out data", "color": style.INK, "linestyle": "-", "marker": "s"},
    "test": {"label": "test data", "color": style.INK, "linestyle": ":", "marker": "^", "markerfacecolor": style.PAPER},
}


def plot_history(steps: Sequence[Step], ax: Axes | None = None) -> Axes:
    """RMSE [K] of each step on fit, held-out and test data, above what the sensors' noise alone would leave.

    Args:
        steps: of a history, the model as given first.
        ax: where to draw; by default new axes.
    """
    ax = ax or style.new_axes(HISTORY)
    noise, best = noise_alone(steps[-1].fit), len(steps) - 1
    shown = [noise]
    for name, look in _STYLES.items():
        points = [
            (place, errors.rmse) for place, step in enumerate(steps) if (errors := getattr(step, name)) is not None
        ]
        if not points:
            continue
        ax.plot(*zip(*points, strict=True), linewidth=1.4, markersize=6, **look)
        # The model as given and the best one in the colours that they have in every other figure.
        for place, rmse in points:
            if best and place in (0, best):
                colour = style.BEST["color"] if place == best else style.GIVEN["color"]
                ax.plot(place, rmse, linestyle="", marker=look["marker"], markersize=8, color=colour, zorder=4)
        shown += [rmse for _, rmse in points]
    ax.axhline(noise, color=style.FAINT, linewidth=0.8)
    across = ax.get_yaxis_transform()
    said = f" sensor noise alone, {kelvin(noise, 2)}"
    ax.text(0.0, noise, said, transform=across, ha="left", va="bottom", size=style.SMALL)
    if max(shown) > _WIDE * min(shown):
        ax.set_yscale("log")
        _plain_numbers(ax.yaxis, (1.0, 2.0, 5.0))
    else:
        ax.set_ylim(bottom=0.0)
    letters = max(_LETTERS // len(steps), 8)
    ax.set_xticks(range(len(steps)), [_label(number, step, letters) for number, step in enumerate(steps)])
    ax.set_xlim(-0.5, len(steps) - 0.5)
    ax.set_ylabel("RMSE [K]", size=style.TEXT)
    ax.legend(frameon=False, fontsize=style.SMALL)
    style.dress(ax)
    return ax


def _label(number: int, step: Step, letters: int) -> str:
    if step.effect is None or step.at is None:
        return f"{number}\nas given"
    lines = [str(number), *wrap(f"+ {title_of(step.effect)}", letters), *wrap(place_of(step.at), letters)]
    return style.plain("\n".join(lines))


def _plain_numbers(axis: Axis, ticks: Sequence[float]) -> None:
    """A logarithmic axis that says 0.2 and 50, not powers of ten."""
    axis.set_major_locator(LogLocator(subs=ticks))
    axis.set_major_formatter("{x:g}")
    axis.set_minor_locator(NullLocator())


# --- a diagnosis: what the model predicts without and with the answers, and the heat that it lacks ------------


_WORST = 3  # nodes and runs
_ANSWERED = ("model as given", "with the effects found")


def diagnosis_figure(diagnosis: Diagnosis, segments: Sequence[Segment]) -> Figure:
    """Temperatures [°C] and errors [K] of the worst nodes and runs, and the heat [W] that the worst fitted run lacks.

    Args:
        diagnosis: of a fitted model; with answers, the model that has all of them is drawn beside it.
        segments: of the runs whose temperatures are drawn.
    """
    answered = diagnosis.steps[-1].fit if diagnosis.steps else None
    given = compare(diagnosis.fit.model, segments)
    best = compare(answered.model, segments) if answered else None
    chosen, heat = worst_views(given, _WORST), unexplained_heat(diagnosis.fit)
    fields = heat_fields(heat)
    worst = max(range(len(fields)), key=lambda run: float(np.mean(fields[run].values ** 2)))
    heights = [predictions_height(len(chosen)), field_height(fields[worst]) + 2 * _FRAME]
    if not fields[worst].values.any():  # no heat beyond chance
        heights.pop()
    figure = style.new_figure(sum(heights))
    upper, *lower = figure.subfigures(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
    draw_predictions(upper, chosen, given, best, _ANSWERED)
    for below in lower:
        left = heat_fields(unexplained_heat(answered))[worst : worst + 1] if answered else []
        below.suptitle("Heat that the model lacks (red) or has too much of (blue), by node and time", size=style.TEXT)
        draw_fields([below], [fields[worst]], left, "W", float(np.median(heat[worst].sure_band)), _ANSWERED)
    return figure


# --- what the data could have shown: the smallest size of each effect that they would reveal ----------------


_LEAST_REACH, _MOST_REACH = 1e-3, 1e3  # shares of the typical size beyond which nobody asks for more
_HIDDEN = 1.0  # share of the typical size from which an effect could hide


def reach_height(sizes: Sequence[Detectable]) -> float:
    """How high `plot_detectability` is [inch]."""
    return _FRAME + _ROW * len(reaches(sizes))


def plot_detectability(sizes: Sequence[Detectable], ax: Axes | None = None) -> Axes:
    """Smallest size that would show, as a share of the typical one, from the easiest place to the hardest.

    Args:
        sizes: of `lptn.diagnose.advice.smallest`.
        ax: where to draw; by default new axes.
    """
    rows = reaches(sizes)
    ax = ax or style.new_axes(reach_height(sizes))
    ends = [(reach.easiest.share_of_typical, reach.hardest.share_of_typical) for reach in rows]
    low, high = np.clip(np.array(ends), _LEAST_REACH, _MOST_REACH).T
    places, seen = np.arange(len(rows)), low < _HIDDEN
    ax.hlines(places, low, high, color=style.FAINT, linewidth=1.2, zorder=1)
    ax.plot(high, places, "|", color=style.FAINT, markersize=7, zorder=2)
    for these, face in ((seen, style.INK), (~seen, style.PAPER)):
        ax.plot(low[these], places[these], "o", color=style.INK, markerfacecolor=face, markersize=5, zorder=2)
    for row, reach in enumerate(rows):
        size = f"{short_size(reach.easiest.smallest)} {unit_text(reach.easiest.unit)}".removesuffix(" 1")
        where = style.plain(f"{size}, {place_of(reach.easiest.at)}")
        ax.text(1.01, row, where, transform=ax.get_yaxis_transform(), va="center", size=style.SMALL)
    ax.axvline(_HIDDEN, color=style.INK, linewidth=1.2, linestyle="--")
    ax.set_xscale("log")
    _plain_numbers(ax.xaxis, (1.0,))
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.set_yticks(range(len(rows)), [style.plain(title_of(reach.easiest.effect)) for reach in rows])
    ax.set_xlabel("smallest size that would show, as a share of the typical size [1]", size=style.TEXT)
    ax.set_title("smallest, and where", size=style.SMALL, loc="right", pad=3)
    style.dress(ax)
    ax.tick_params(axis="y", labelsize=style.SMALL, length=0)
    return ax
