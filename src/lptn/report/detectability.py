"""The figure of what the data could have shown: the smallest size of each effect that they would reveal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from lptn.diagnose.detectable import Detectable
from lptn.report.style import FAINT, INK, SMALL, TEXT, dress, new_figure, plain
from lptn.report.text import place_of, short_size, title_of, unit_text

_ROW, _FRAME = 0.2, 0.75  # inch
_LEAST, _MOST = 1e-3, 1e3  # shares of the typical size beyond which nobody asks for more
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
    figure = new_figure(_FRAME + _ROW * len(rows))
    ax = figure.add_subplot()
    for row, each in enumerate(rows):
        low, high = np.clip([each.easiest.share, each.hardest.share], _LEAST, _MOST)
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
