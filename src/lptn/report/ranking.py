"""The figure of all candidates: how far each scores beyond chance."""

from __future__ import annotations

from math import sqrt
from typing import Any

from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from lptn.diagnose import Diagnosis, Score
from lptn.report.style import BEST, INK, SMALL, TEXT, dress, new_figure, plain
from lptn.report.text import named

_MOST = 20
_WIDE = 20.0  # ratio of scores above which only a logarithmic axis shows them all
_LEAST = 0.1  # shares of chance below this are not worth telling apart


def candidates_shown(found: Diagnosis) -> list[Score]:
    """The best candidates that score at all, and every one that was refitted."""
    refitted = {finding.key for finding in found.findings}
    scoring = [each for each in found.scores.ranked if each.gain > 0]
    return [each for place, each in enumerate(scoring) if place < _MOST or each.candidate.key in refitted]


def ranking(found: Diagnosis, added: frozenset[tuple[str, str]] = frozenset()) -> Figure:
    """Score of each candidate as a multiple of what chance alone exceeds once in twenty logs.

    Args:
        found: the diagnosis; some candidate must score (see `candidates_shown`).
        added: effects and places that the ladder took up.
    """
    shown = candidates_shown(found)
    refitted = {finding.key for finding in found.findings}
    shares = [sqrt(each.gain / max(found.scores.threshold, 1e-30)) for each in shown]
    wide = max(shares) > _WIDE * max(min(shares), _LEAST)
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
