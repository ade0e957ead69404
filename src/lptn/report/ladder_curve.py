"""The figure of the ladder: how the errors fall from rung to rung."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from lptn.ladder import Ladder, Rung
from lptn.report.style import BEST, FAINT, GIVEN, INK, SMALL, TEXT, dress, new_figure, plain
from lptn.report.text import place_of, title_of

_WIDE = 8.0  # ratio of errors above which only a logarithmic axis shows them all
_STYLES: dict[str, dict[str, Any]] = {
    "fitted runs": {"color": FAINT, "linestyle": "--", "marker": "o"},
    "held-out runs": {"color": INK, "linestyle": "-", "marker": "s"},
    "proof runs": {"color": INK, "linestyle": ":", "marker": "^", "markerfacecolor": "white"},
}


def ladder_curve(ladder: Ladder, noise: float) -> Figure:
    """RMSE [K] of each rung on fitted, held-out and proof runs.

    Args:
        ladder: the ladder.
        noise: the RMSE that the sensors' noise alone would leave [K].
    """
    figure = new_figure(3.2)
    ax = figure.add_subplot()
    shown = [noise]
    for name, style in _STYLES.items():
        errors = [_error(rung, name) for rung in ladder.rungs]
        found = [(place, error) for place, error in enumerate(errors) if error is not None]
        if found:
            ax.plot(*zip(*found, strict=True), label=name, linewidth=1.4, markersize=6, **style)
            _mark_models(ax, found, ladder.rungs.index(ladder.best), style)
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
    ax.set_xticks(range(len(ladder.rungs)), [_label(number, rung) for number, rung in enumerate(ladder.rungs)])
    ax.set_xlim(-0.5, len(ladder.rungs) - 0.5)
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


def _error(rung: Rung, data: str) -> float | None:
    if data == "fitted runs":
        return rung.fit.rmse
    errors = rung.holdout if data == "held-out runs" else rung.proof
    return None if errors is None else errors.rmse


def _label(number: int, rung: Rung) -> str:
    if rung.effect is None or rung.at is None:
        return f"{number}\nas given"
    return f"{number}\n+ {title_of(rung.effect)}\n{plain(place_of(rung.at))}"
