"""Figures of a diagnosis: the history of errors, the ranking, what can't be told apart, what could be detected."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import sqrt
from typing import Any

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from lptn.basics.style import BEST, FAINT, GIVEN, INK, SMALL, TEXT, dress, new_figure, plain
from lptn.diagnose.diagnosis import Diagnosis, Step
from lptn.diagnose.improvement import History
from lptn.diagnose.scores import Confusability, Detectable, Score
from lptn.report.text import named, place_of, short_size, title_of, unit_text

# --- The figure of the ladder: how the errors fall from rung to rung ------------------------------


_WIDE = 8.0  # ratio of errors above which only a logarithmic axis shows them all
_STYLES: dict[str, dict[str, Any]] = {
    "fitted runs": {"color": FAINT, "linestyle": "--", "marker": "o"},
    "held-out runs": {"color": INK, "linestyle": "-", "marker": "s"},
    "proof runs": {"color": INK, "linestyle": ":", "marker": "^", "markerfacecolor": "white"},
}


def ladder_curve(history: History, noise: float) -> Figure:
    """RMSE [K] of each rung on fitted, held-out and proof runs.

    Args:
        ladder: the ladder.
        noise: the RMSE that the sensors' noise alone would leave [K].
    """
    figure = new_figure(3.2)
    ax = figure.add_subplot()
    shown = [noise]
    for name, style in _STYLES.items():
        errors = [_error(step, name) for step in history.steps]
        found = [(place, error) for place, error in enumerate(errors) if error is not None]
        if found:
            ax.plot(*zip(*found, strict=True), label=name, linewidth=1.4, markersize=6, **style)
            _mark_models(ax, found, history.steps.index(history.best), style)
            shown += [error for _, error in found]
    ax.axhline(noise, color=FAINT, linewidth=0.8)
    ax.text(
        1.0,
        noise,
        "sensor noise alone",
        transform=ax.get_yaxis_transform(),
        ha="right",
        va="bottom",
        size=SMALL,
    )
    if max(shown) > _WIDE * min(shown):
        ax.set_yscale("log")
        ax.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        ax.yaxis.set_minor_formatter(NullFormatter())
    else:
        ax.set_ylim(bottom=0.0)
    ax.set_xticks(range(len(history.steps)), [_label(number, step) for number, step in enumerate(history.steps)])
    ax.set_xlim(-0.5, len(history.steps) - 0.5)
    ax.set_ylabel("RMSE [K]", size=TEXT)
    ax.legend(frameon=False, fontsize=SMALL)
    dress(ax)
    return figure


def _mark_models(ax: Axes, found: Sequence[tuple[int, float]], best: int, style: dict[str, Any]) -> None:
    """The model as given and the best one in the colours that they have in every other figure."""
    for place, error in found:
        colour = BEST["color"] if place == best else GIVEN["color"]
        if best and place in (0, best):
            ax.plot(place, error, linestyle="", marker=style["marker"], markersize=8, color=colour, zorder=4)


def _error(step: Step, data: str) -> float | None:
    if data == "fitted runs":
        return step.fit.rmse
    errors = step.holdout if data == "held-out runs" else step.test
    return None if errors is None else errors.rmse


def _label(number: int, step: Step) -> str:
    if step.effect is None or step.at is None:
        return f"{number}\nas given"
    return f"{number}\n+ {title_of(step.effect)}\n{plain(place_of(step.at))}"


# --- The figure of all candidates: how far each scores beyond chance ------------------------------


_MOST = 20
_RANKING_WIDTH = 20.0  # ratio of scores above which only a logarithmic axis shows them all
_LEAST = 0.1  # shares of chance below this are not worth telling apart


def candidates_shown(found: Diagnosis) -> list[Score]:
    """The best candidates that score at all, and every one that was refitted."""
    refitted = {finding.key for finding in found.refits}
    scoring = [each for each in found.scores.ranked if each.gain > 0]
    return [each for place, each in enumerate(scoring) if place < _MOST or each.candidate.key in refitted]


def ranking(found: Diagnosis, added: frozenset[tuple[str, str]] = frozenset()) -> Figure:
    """Score of each candidate as a multiple of what chance alone exceeds once in twenty logs.

    Args:
        found: the diagnosis; some candidate must score (see `candidates_shown`).
        added: effects and places that the ladder took up.
    """
    shown = candidates_shown(found)
    refitted = {finding.key for finding in found.refits}
    shares = [sqrt(each.gain / max(found.scores.threshold, 1e-30)) for each in shown]
    wide = max(shares) > _RANKING_WIDTH * max(min(shares), _LEAST)
    figure = new_figure(0.7 + 0.2 * len(shown))
    ax = figure.add_subplot()
    for row, (each, share) in enumerate(zip(shown, shares, strict=True)):
        key = each.candidate.key
        colour = BEST["color"] if key in added else "0.35"
        fill: dict[str, Any] = {"color": colour} if key in refitted else {"facecolor": "white", "edgecolor": colour}
        ax.barh(row, max(share, _LEAST) if wide else share, height=0.65, linewidth=0.8, **fill)
    ax.axvline(1.0, color=INK, linewidth=1.2, linestyle="--")
    ax.set_ylim(len(shown) - 0.4, -0.6)
    ax.set_yticks(range(len(shown)), [plain(named(*each.candidate.key)) for each in shown])
    if wide:
        ax.set_xscale("log")
        ax.set_xlim(left=0.7 * _LEAST)
        ax.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        ax.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_xlabel("score as a multiple of the chance threshold [1]", size=TEXT)
    dress(ax)
    ax.tick_params(axis="y", labelsize=SMALL, length=0)
    return figure


# --- The figure of candidates that leave the same trace: what these data can't tell apart ---------


_ROW, _FRAME = 0.3, 0.75  # inch
_MAP, _DARK = colormaps["cividis_r"], 0.6  # correlation above which writing must be white


def confusion(found: Confusability) -> Figure:
    """Size of the correlation of the candidates' traces, 1 for two that these data can't tell apart at all."""
    count = len(found.keys)
    figure = new_figure(_FRAME + _ROW * count)
    ax = figure.add_subplot()
    norm = Normalize(0.0, 1.0)
    ax.imshow(found.matrix, cmap=_MAP, norm=norm, aspect="auto", interpolation="nearest")
    for row in range(count):
        for column in range(count):
            value = float(found.matrix[row, column])
            ink = "white" if value > _DARK else "black"
            text = "–" if row == column else f"{value:.2f}"
            ax.text(column, row, text, ha="center", va="center", size=SMALL, color=ink)
    ax.set_xticks(range(count), [str(number) for number in range(1, count + 1)])
    ax.set_yticks(
        range(count),
        [f"{plain(named(*key))}\u2002{number}" for number, key in enumerate(found.keys, start=1)],
    )
    ax.xaxis.tick_top()
    ax.tick_params(length=0, labelsize=SMALL)
    ax.spines[:].set_visible(False)
    bar = figure.colorbar(ScalarMappable(norm, _MAP), ax=ax, fraction=0.025, pad=0.01, aspect=20)
    bar.set_label("likeness of traces [1]", size=TEXT)
    bar.ax.tick_params(labelsize=SMALL)
    return figure


# --- The figure of what the data could have shown: the smallest size of each effect that they would reveal ---


_REACH_ROW, _REACH_FRAME = 0.2, 0.75  # inch
_LEAST_REACH, _MOST_REACH = 1e-3, 1e3  # shares of the typical size beyond which nobody asks for more
_HIDDEN = 1.0  # share of the typical size from which an effect could hide


@dataclass(frozen=True)
class Reach:
    """One effect: the place where it shows most easily, and the place where it hides best."""

    easiest: Detectable
    hardest: Detectable


def reaches(found: Sequence[Detectable]) -> list[Reach]:
    """One for each effect, the easiest to see first."""
    effects: dict[str, list[Detectable]] = {}
    for each in found:
        effects.setdefault(each.effect, []).append(each)
    both = [
        Reach(min(places, key=lambda each: each.share), max(places, key=lambda each: each.share))
        for places in effects.values()
    ]
    return sorted(both, key=lambda each: each.easiest.share)


def detectability(found: Sequence[Detectable]) -> Figure:
    """Smallest size that would be revealed, as a share of the typical one, from the easiest place to the hardest."""
    rows = reaches(found)
    figure = new_figure(_REACH_FRAME + _REACH_ROW * len(rows))
    ax = figure.add_subplot()
    for row, each in enumerate(rows):
        low, high = np.clip([each.easiest.share, each.hardest.share], _LEAST_REACH, _MOST_REACH)
        ax.plot([low, high], [row, row], color=FAINT, linewidth=1.2, zorder=1)
        face = INK if each.easiest.share < _HIDDEN else "white"
        ax.plot(low, row, "o", color=INK, markerfacecolor=face, markersize=5, zorder=2)
        ax.plot(high, row, "|", color=FAINT, markersize=7, zorder=2)
        size = f"{short_size(each.easiest.amplitude)} {unit_text(each.easiest.unit)}".removesuffix(" 1")
        where = f"{size}, {place_of(each.easiest.at)}"
        ax.text(1.01, row, plain(where), transform=ax.get_yaxis_transform(), va="center", size=SMALL)
    ax.axvline(_HIDDEN, color=INK, linewidth=1.2, linestyle="--")
    ax.set_xscale("log")
    ax.xaxis.set_major_locator(LogLocator())
    ax.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.set_ylim(len(rows) - 0.4, -0.6)
    ax.set_yticks(range(len(rows)), [plain(title_of(each.easiest.effect)) for each in rows])
    ax.set_xlabel("smallest size that would show, as a share of the typical size [1]", size=TEXT)
    ax.set_title("smallest, and where", size=SMALL, loc="right", pad=3)
    dress(ax)
    ax.tick_params(axis="y", labelsize=SMALL, length=0)
    return figure
