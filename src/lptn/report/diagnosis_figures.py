"""Figures of a diagnosis: errors by step, probabilities, what can't be told apart, what could be detected."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from lptn.basics.style import BEST, FAINT, GIVEN, INK, SMALL, TEXT, dress, new_axes, plain
from lptn.basics.words import short_size
from lptn.diagnose.advice import Detectable
from lptn.diagnose.answers import LIKELY, Step
from lptn.diagnose.improvement import History
from lptn.report.shown import noise_alone, reaches, weighed_effects
from lptn.report.text import named, place_of, title_of, unit_text

# --- the history: how the errors fall from step to step -----------------------------------------------------


HISTORY_HEIGHT = 3.2  # inch
_FRAME = 0.75  # inch, around the rows of a figure
_WIDE = 8.0  # ratio of errors above which only a logarithmic axis shows them all
_STYLES: dict[str, dict[str, Any]] = {
    "fit data": {"color": FAINT, "linestyle": "--", "marker": "o"},
    "held-out data": {"color": INK, "linestyle": "-", "marker": "s"},
    "test data": {"color": INK, "linestyle": ":", "marker": "^", "markerfacecolor": "white"},
}


def plot_history(history: History, ax: Axes | None = None) -> Axes:
    """RMSE [K] of each step on fit, held-out and test data, above what the sensors' noise alone would leave.

    Args:
        history: the steps of a forward selection.
        ax: where to draw; by default new axes.
    """
    ax = new_axes(HISTORY_HEIGHT) if ax is None else ax
    noise, best = noise_alone(history.best.fit), len(history.steps) - 1
    shown = [noise]
    for name, style in _STYLES.items():
        points = [(place, rmse) for place, step in enumerate(history.steps) if (rmse := _rmse(step, name)) is not None]
        if not points:
            continue
        ax.plot(*zip(*points, strict=True), label=name, linewidth=1.4, markersize=6, **style)
        # The model as given and the best one in the colours that they have in every other figure.
        for place, rmse in points:
            if best and place in (0, best):
                colour = BEST["color"] if place == best else GIVEN["color"]
                ax.plot(place, rmse, linestyle="", marker=style["marker"], markersize=8, color=colour, zorder=4)
        shown += [rmse for _, rmse in points]
    ax.axhline(noise, color=FAINT, linewidth=0.8)
    across = ax.get_yaxis_transform()
    ax.text(1.0, noise, "sensor noise alone", transform=across, ha="right", va="bottom", size=SMALL)
    if max(shown) > _WIDE * min(shown):
        ax.set_yscale("log")
        _plain_numbers(ax.yaxis, (1.0, 2.0, 5.0))
    else:
        ax.set_ylim(bottom=0.0)
    ax.set_xticks(range(len(history.steps)), [_label(number, step) for number, step in enumerate(history.steps)])
    ax.set_xlim(-0.5, len(history.steps) - 0.5)
    ax.set_ylabel("RMSE [K]", size=TEXT)
    ax.legend(frameon=False, fontsize=SMALL)
    dress(ax)
    return ax


def _rmse(step: Step, data: str) -> float | None:
    if data == "fit data":
        return step.fit.rmse
    errors = step.holdout if data == "held-out data" else step.test
    return None if errors is None else errors.rmse


def _label(number: int, step: Step) -> str:
    if step.effect is None or step.at is None:
        return f"{number}\nas given"
    return f"{number}\n+ {title_of(step.effect)}\n{plain(place_of(step.at))}"


def _plain_numbers(axis: Axis, ticks: Sequence[float]) -> None:
    """A logarithmic axis that says 0.2 and 50, not powers of ten."""
    axis.set_major_locator(LogLocator(subs=ticks))
    axis.set_major_formatter(StrMethodFormatter("{x:g}"))
    axis.set_minor_formatter(NullFormatter())


# --- how probable each effect is ------------------------------------------------------------------------------


_BAR_ROW = 0.2  # inch


def plot_probabilities(history: History, ax: Axes | None = None) -> Axes:
    """How probable each effect is that was added, and each that was fitted beside that and refused.

    Args:
        history: some effect of which was weighed.
        ax: where to draw; by default new axes.
    """
    shown = weighed_effects(history)
    ax = new_axes(_FRAME + _BAR_ROW * len(shown)) if ax is None else ax
    for row, step in enumerate(shown):
        colour = BEST["color"]
        fill = {"color": colour} if step in history.steps else {"facecolor": "white", "edgecolor": colour}
        ax.barh(row, step.probability, height=0.65, linewidth=0.8, **fill)
    ax.axvline(LIKELY, color=INK, linewidth=1.2, linestyle="--")
    ax.set_xlim(0.0, 1.0)
    ax.set_ylim(len(shown) - 0.4, -0.6)
    ax.set_yticks(range(len(shown)), [plain(named(*step.key)) for step in shown])
    ax.set_xlabel("probability [1]", size=TEXT)
    dress(ax)
    ax.tick_params(axis="y", labelsize=SMALL, length=0)
    return ax


# --- what the data could have shown: the smallest size of each effect that they would reveal ----------------


_REACH_ROW = 0.2  # inch
_LEAST_REACH, _MOST_REACH = 1e-3, 1e3  # shares of the typical size beyond which nobody asks for more
_HIDDEN = 1.0  # share of the typical size from which an effect could hide


def detectability_height(sizes: Sequence[Detectable]) -> float:
    """Height of `plot_detectability` [inch]."""
    return _FRAME + _REACH_ROW * len(reaches(sizes))


def plot_detectability(sizes: Sequence[Detectable], ax: Axes | None = None) -> Axes:
    """Smallest size that would show, as a share of the typical one, from the easiest place to the hardest.

    Args:
        sizes: of `lptn.diagnose.advice.smallest`.
        ax: where to draw; by default new axes.
    """
    ax = new_axes(detectability_height(sizes)) if ax is None else ax
    rows = reaches(sizes)
    for row, reach in enumerate(rows):
        low, high = np.clip([reach.easiest.share_of_typical, reach.hardest.share_of_typical], _LEAST_REACH, _MOST_REACH)
        ax.plot([low, high], [row, row], color=FAINT, linewidth=1.2, zorder=1)
        face = INK if reach.easiest.share_of_typical < _HIDDEN else "white"
        ax.plot(low, row, "o", color=INK, markerfacecolor=face, markersize=5, zorder=2)
        ax.plot(high, row, "|", color=FAINT, markersize=7, zorder=2)
        size = f"{short_size(reach.easiest.smallest)} {unit_text(reach.easiest.unit)}".removesuffix(" 1")
        where = plain(f"{size}, {place_of(reach.easiest.at)}")
        ax.text(1.01, row, where, transform=ax.get_yaxis_transform(), va="center", size=SMALL)
    ax.axvline(_HIDDEN, color=INK, linewidth=1.2, linestyle="--")
    ax.set_xscale("log")
    _plain_numbers(ax.xaxis, (1.0,))
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.set_yticks(range(len(rows)), [plain(title_of(reach.easiest.effect)) for reach in rows])
    ax.set_xlabel("smallest size that would show, as a share of the typical size [1]", size=TEXT)
    ax.set_title("smallest, and where", size=SMALL, loc="right", pad=3)
    dress(ax)
    ax.tick_params(axis="y", labelsize=SMALL, length=0)
    return ax
