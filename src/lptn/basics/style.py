"""The one visual language of all figures, as SVG in a page and below the cell of a notebook."""

from __future__ import annotations

import hashlib
import io
import re
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import matplotlib
import numpy as np
from markupsafe import Markup, escape
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.figure import Figure, FigureBase
from matplotlib.ticker import AutoLocator, MaxNLocator

from lptn.basics.arrays import FloatArray
from lptn.basics.lines import thinned, time_unit
from lptn.basics.progress import in_notebook

# --- The one visual language: which colour and line means what, and how axes look -----------------


WIDTH = 9.0  # inch; fills a laptop's page and still prints legibly on A4
TEXT, SMALL, TINY = 9.0, 8.0, 6.5  # pt

COLOURS = {
    "ink": "#141413", "soft": "#56564f", "paper": "#ffffff", "rule": "#cfcfca", "shade": "#ededed", "noise": "#d4d4d4",
    "given": "#0072b2", "best": "#00795a", "heat": "#c2500a", "limit": "#cc0000",
    "bad": "#12355b", "hot": "#c8480a", "cold": "#0a64ad",
    "colour2": "#b0568f", "colour3": "#b86e00", "colour4": "#2f8fc0", "colour5": "#7a5a20", "colour6": "#555555",
    "colour7": "#7b4fc4",
}  # fmt: skip
"""Each colour of a figure by the name of the pages' CSS variable, which has another value in the dark."""

INK, FAINT, PAPER, RULE = COLOURS["ink"], COLOURS["soft"], COLOURS["paper"], COLOURS["rule"]
SHADE, NOISE = COLOURS["shade"], COLOURS["noise"]
HOT, COLD = COLOURS["hot"], COLOURS["cold"]  # of what is too much, and of what is too little
BAD = COLOURS["bad"]  # of sizes: the stronger, the larger
LIMIT = COLOURS["limit"]  # of limits and alarms, and of nothing else
PALETTE = (COLOURS["given"], COLOURS["best"], *(COLOURS[f"colour{number}"] for number in range(2, 8)))
"""Colours of things that only have to differ."""
ERROR = "error [K]"
"""The label of every axis of errors; error = predicted − measured."""

# Blue and green look alike in grey, so each has a dash pattern of its own.
MEASURED: dict[str, Any] = {"color": INK, "linewidth": 0.8, "zorder": 3}
GIVEN: dict[str, Any] = {"color": COLOURS["given"], "linewidth": 1.8, "linestyle": (0, (5, 1.5))}
BEST: dict[str, Any] = {"color": COLOURS["best"], "linewidth": 2.0, "linestyle": "-"}


def new_figure(height: float) -> Figure:
    """An empty figure as wide as the page.

    Args:
        height: in inch.
    """
    return Figure(figsize=(WIDTH, height), dpi=150, layout="constrained")


def single(height: float, plot: Callable[[Axes], Axes]) -> Figure:
    """What is plotted on one pair of axes, for a document.

    Args:
        height: in inch.
        plot: draws on them.
    """
    figure = new_figure(height)
    plot(figure.add_subplot())
    return figure


def stacked_axes(figure: FigureBase, count: int, columns: int) -> list[tuple[Axes, Axes]]:
    """So many axes side by side in rows, of temperatures, each with axes of errors over the same time below it."""
    rows = -(-count // columns)
    grid = figure.subplots(2 * rows, columns, squeeze=False, gridspec_kw={"height_ratios": [2, 1.15] * rows})
    pairs = [(upper, lower) for row in range(rows) for upper, lower in grid[2 * row : 2 * row + 2].T]
    for upper, lower in pairs:
        lower.sharex(upper)
        upper.tick_params(labelbottom=False)
    for pair in pairs[count:]:
        for ax in pair:
            ax.set_axis_off()
    return pairs[:count]


def legend_above(figure: FigureBase, handles: Sequence[Any]) -> None:
    """One legend for all axes of a figure."""
    figure.legend(handles=handles, loc="outside upper center", ncols=5, frameon=False, fontsize=SMALL)


def new_axes(height: float) -> Axes:
    """Axes of their own, as wide as the page, in a figure of `pyplot`, which a notebook or `pyplot.show()` shows.

    Args:
        height: in inch.
    """
    return new_panels(height)[0]


def new_panels(*heights: float) -> list[Axes]:
    """Axes above each other, as wide as the page, in a figure of `pyplot`.

    Args:
        heights: in inch, one for each.
    """
    from matplotlib import pyplot  # documents, which may be made in any thread, do without it

    size = WIDTH, sum(heights)
    _, axes = pyplot.subplots(
        len(heights), figsize=size, height_ratios=heights, sharex=True, squeeze=False, layout="constrained"
    )
    return list(axes[:, 0])


def dress(ax: Axes) -> None:
    """Give axes the common look: no box, few small ticks."""
    for axis in (ax.xaxis, ax.yaxis):
        if isinstance(axis.get_major_locator(), AutoLocator):
            axis.set_major_locator(MaxNLocator(6, steps=[1, 2, 3, 5, 10]))
    ax.spines[["top", "right"]].set_visible(False)
    ax.spines[["left", "bottom"]].set_color(FAINT)
    ax.tick_params(labelsize=SMALL, color=FAINT)


_POINTS = 900  # of a line; a panel is some 300 pt wide


def draw_over_time(
    ax: Axes,
    time: FloatArray,
    lines: Sequence[tuple[FloatArray, Mapping[str, Any]]] = (),
    ends: tuple[float, float] | None = None,
) -> float:
    """Draw lines over time on axes that get their unit, label and look; long lines keep their peaks.

    Args:
        ax: where to draw.
        time: s, (n,).
        lines: values, (n,) each, NaN where missing, with their looks.
        ends: of the axis [s]; by default those of the time.

    Returns:
        The unit of the axis across [s].
    """
    start, stop = ends or (float(time[0]), float(time[-1]))
    unit, label = time_unit(stop - start)
    if lines:
        at, drawn = thinned(time, np.array([values for values, _ in lines]), _POINTS)
        for values, (_, look) in zip(drawn, lines, strict=True):
            ax.plot(at / unit, values, **look)
    ax.set_xlabel(label, size=SMALL)
    if stop > start:
        ax.set_xlim(start / unit, stop / unit)
    dress(ax)
    return unit


def plain(text: str) -> str:
    """A user's text for a figure: dollar signs are not mathematics."""
    return text.replace("$", r"\$")


_STRENGTHS = 20  # that are told apart in a map


def strength(share: float) -> float:
    """How opaque a colour is drawn for a share of the scale's end, so that few different ones are in a map."""
    return round(min(max(share, 0.0), 1.0) * _STRENGTHS) / _STRENGTHS


# --- A figure as SVG text that can stand inside an HTML page, the same bytes every time -----------


_SETTINGS: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "lptn",
    "figure.autolayout": False,
    "figure.constrained_layout.use": False,
}
_NO_METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}
_NOT_FOR_PAGES = re.compile(r"<metadata>.*?</metadata>|<style[^>]*>.*?</style>", re.DOTALL)
_BETWEEN = re.compile(r">\s*\n\s*<")
_TAG = re.compile(r"<[^>]*>")  # text of users stands between tags, and no tag has a bracket in it
_NAME = re.compile(r'(?<=id=")[^"]+|(?<=href="#)[^"]+|(?<=url\(#)[^)]+')
_LONG_NUMBER = re.compile(r"(\d+\.\d\d)\d+")
_NOT_SAID = re.compile(r"""(?<=<g) id="[^"]*"|xlink:|font-family:[^;"]*;? ?| transform="rotate\(-0 [^"]*"|\n""")
_VARIABLES = {colour: f"var(--{name})" for name, colour in COLOURS.items()} | {"#000000": "var(--ink)"}
_COLOUR = re.compile("|".join(_VARIABLES))


def inline_svg(figure: Figure, label: str) -> Markup:
    """The figure as an `<svg>` element for a page, whose style sheet gives its font and each of `COLOURS`.

    Text stays text. No name in it is that of something in another figure, and nothing in it changes from day to day.

    Args:
        figure: the figure.
        label: what it shows, for those who can't see it.
    """
    written = io.StringIO()
    with matplotlib.rc_context(_SETTINGS), warnings.catch_warnings():
        # The text stays text, and the reader's machine has fonts that this one may lack.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        with _laid_out(figure):
            figure.savefig(written, format="svg", metadata=_NO_METADATA, transparent=True)
    # The prolog names a DTD on another machine; a style element would hold for the whole page.
    text = _BETWEEN.sub("><", _NOT_FOR_PAGES.sub("", written.getvalue()))
    body = text[text.index(">", text.index("<svg")) + 1 :]
    own = hashlib.sha256(f"{label}{body}".encode()).hexdigest()[:6]
    names: dict[str, str] = {}

    def for_page(tag: re.Match[str]) -> str:
        said = _NOT_SAID.sub("", tag[0])
        said = _NAME.sub(lambda name: names.setdefault(name[0], f"f{own}-{len(names)}"), said)
        said = _LONG_NUMBER.sub(r"\1", said)  # two decimals: a hundredth of a point
        return _COLOUR.sub(lambda colour: _VARIABLES[colour[0]], said)

    wide, high = (72 * size for size in figure.get_size_inches())  # pt, the unit of SVG files
    head = f'viewBox="0 0 {wide:g} {high:g}" role="img" aria-label="{escape(label)}"'
    return Markup(f'<svg class="chart" {head}>{_TAG.sub(for_page, body)}')


@contextmanager
def _laid_out(figure: Figure) -> Iterator[None]:
    """Within it the axes stand where the layout engine puts them, without the engine.

    `savefig` would draw a figure that has an engine twice, the first time for nothing.
    """
    engine, canvas, dpi = figure.get_layout_engine(), figure.canvas, figure.dpi
    if engine is not None:
        FigureCanvasSVG(figure)  # texts are as wide as SVG will have them
        figure.dpi = 72.0  # the unit of SVG files
        engine.execute(figure)
        figure.dpi = dpi
        figure.set_canvas(canvas)
        figure.set_layout_engine(None)
    try:
        yield
    finally:
        figure.set_layout_engine(engine)


# --- Figures where somebody looks: below the cell of a notebook -----------------------------------


def show(figure: Figure) -> None:
    """Show a figure in a notebook; in a script do nothing.

    Args:
        figure: any figure, such as those of this package, which no window belongs to.
    """
    if not in_notebook():
        return
    display = import_module("IPython.display")
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png")
    display.display(display.Image(drawn.getvalue(), width=figure.get_figwidth() * 100))
