"""A page on two models and the same logs: who is better, by class of joints and by condition."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lptn.evidence import Evidence
from lptn.report import captions
from lptn.report.page import Picture, picture, render
from lptn.report.style import BEST, GIVEN, SMALL, TEXT, dress, new_figure, plain
from lptn.report.tables import Table, data_table
from lptn.report.text import kelvin
from lptn.report.timeseries import predictions_figure
from lptn.versus import Pair, Versus


def versus_figure(result: Versus) -> Figure:
    """Mean absolute error by class and largest error by run, both models side by side."""
    figure = new_figure(1.9 + 0.32 * max(len(result.classes), len(result.runs)))
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.5))
    _bars(left, result.classes, [pair.mean for pair in result.classes], result.names)
    _bars(right, result.runs, [pair.max for pair in result.runs], result.names)
    left.set_xlabel("mean absolute error [K]", size=TEXT)
    right.set_xlabel("largest error [K]", size=TEXT)
    bars, names = left.get_legend_handles_labels()
    figure.legend(bars, names, frameon=False, fontsize=SMALL, loc="outside upper center", ncols=2)
    return figure


def versus_html(result: Versus, title: str) -> str:
    """One self-contained HTML page on a model against another.

    Args:
        result: of `lptn.versus.versus`.
        title: heads the page.
    """
    whole = result.classes[-1]
    return render(
        "versus.html.j2",
        title=title,
        names=result.names,
        means=tuple(kelvin(value) for value in whole.mean),
        largest=tuple(kelvin(value) for value in whole.max),
        bars=picture(_bar_caption(result), versus_figure(result)),
        predictions=_predictions(result),
        classes=_table("joints", result.classes),
        runs=_table("run", result.runs),
        data=data_table({"compared": tuple(each.part for each in result.model.predictions)}),
    )


def _predictions(result: Versus) -> Picture:
    """The other model's worst nodes and runs, with the model's own lines where it has those nodes too."""
    both = set(result.other.model.nodes) <= set(result.model.model.nodes)
    given, best = (result.other, result.model) if both else (result.model, None)
    caption = captions.of_predictions(given, best, Evidence(()), "compared")
    if both:
        caption = caption.replace("the model as given", result.names[1]).replace("the best model", result.names[0])
    return picture(caption, predictions_figure(given, best, names=(result.names[1], result.names[0])))


def _bars(ax: Axes, pairs: Sequence[Pair], sizes: Sequence[tuple[float, float]], names: tuple[str, str]) -> None:
    places = np.arange(len(pairs))[::-1]
    # Hatching tells the two apart on a grey printer.
    styles = ((BEST["color"], "", 0.2), (GIVEN["color"], "////", -0.2))
    for which, (colour, hatch, shift) in enumerate(styles):
        values = [size[which] for size in sizes]
        drawn = ax.barh(
            places + shift, values, 0.38, color=colour, hatch=hatch, edgecolor="white", label=plain(names[which])
        )
        ax.bar_label(drawn, fmt="%.2f", padding=2, fontsize=SMALL)
    ax.set_yticks(places, [plain(pair.what) for pair in pairs], fontsize=SMALL)
    ax.margins(x=0.14)
    dress(ax)


def _table(what: str, pairs: Sequence[Pair]) -> Table:
    both = ("of the other", "less")
    heads = (what, "mean error", both[0], "largest", *both, "mean square [K²]", *both)
    rows = tuple(
        (
            pair.what,
            *(kelvin(value) for value in pair.mean),
            *(kelvin(value) for value in pair.max),
            f"{pair.reduction:.0%}",
            *(f"{value:.2f}" for value in pair.square),
            f"{pair.square_reduction:.0%}",
        )
        for pair in pairs
    )
    return Table(heads, rows, tuple(range(1, len(heads))))


def _bar_caption(result: Versus) -> str:
    better = sum(pair.max[0] < pair.max[1] for pair in result.runs)
    return (
        "Mean absolute error by class of joints (left) and largest error by run (right): "
        f"{result.names[0]} (green, plain) beside {result.names[1]} (blue, hatched). "
        f"Its largest error is the smaller one in {better} of {len(result.runs)} runs."
    )
