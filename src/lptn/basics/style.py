"""The one visual language of all figures, as SVG in a page and below the cell of a notebook."""

from __future__ import annotations

import io
import re
import sys
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

import matplotlib
from markupsafe import Markup, escape
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.backends.backend_svg import FigureCanvasSVG
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure

from lptn.basics.lines import decimated as decimated
from lptn.basics.lines import time_axis as time_axis

# --- The one visual language: which colour and line means what, and how axes look -----------------


WIDTH = 9.0  # inch; fills a laptop's page and still prints legibly on A4
TEXT, SMALL, TINY = 9.0, 8.0, 6.5  # pt
INK, FAINT = "black", "0.55"
SHADE, NOISE = "0.93", "0.85"
ERROR = "error [K]:\npredicted\n− measured"
"""The label of every axis of errors."""
LIMIT = "#CC0000"  # of limits and alarms, and of nothing else
PALETTE = ("#0072B2", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#8C6D31")  # of things that only have to differ
RMSE_MAP: Colormap = colormaps["cividis_r"]  # light is good, dark is bad, on a grey printer too

# Blue and green look alike in grey, so each has a dash pattern of its own.
MEASURED: dict[str, Any] = {"color": INK, "linewidth": 0.8, "zorder": 3}
GIVEN: dict[str, Any] = {"color": "#0072B2", "linewidth": 1.8, "linestyle": (0, (5, 1.5))}
BEST: dict[str, Any] = {"color": "#009E73", "linewidth": 2.4, "linestyle": "-"}


def new_figure(height: float) -> Figure:
    """An empty figure as wide as the page.

    Args:
        height: in inch.
    """
    return Figure(figsize=(WIDTH, height), dpi=150, layout="constrained")


def new_axes(height: float) -> Axes:
    """Axes of their own, as wide as the page, in a figure of `pyplot`, which a notebook or `pyplot.show()` shows.

    Args:
        height: in inch.
    """
    from matplotlib import pyplot  # documents, which may be made in any thread, do without it

    return pyplot.subplots(figsize=(WIDTH, height), layout="constrained")[1]


def dress(ax: Axes) -> None:
    """Give axes the common look: no box, small ticks."""
    ax.spines[["top", "right"]].set_visible(False)
    ax.tick_params(labelsize=SMALL)


def plain(text: str) -> str:
    """A user's text for a figure: dollar signs are not mathematics."""
    return text.replace("$", r"\$")


def rmse_norm(largest: float, noise: float) -> Normalize:
    """The colour scale from no error to the largest error [K] shown; errors like the noise [K] stay light."""
    return Normalize(0.0, max(largest, 5.0 * noise))


# --- A figure as SVG text that can stand inside an HTML page, the same bytes every time -----------


_SETTINGS: dict[Any, Any] = {
    "svg.fonttype": "none",
    "svg.hashsalt": "lptn",
    "figure.autolayout": False,
    "figure.constrained_layout.use": False,
}
_NO_METADATA = {"Date": None, "Creator": None, "Format": None, "Type": None}
_PATH = re.compile(r' d="([^"]*)"')
_LONG_NUMBER = re.compile(r"(\d+\.\d\d)\d+")


def inline_svg(figure: Figure, label: str) -> Markup:
    """The figure as an `<svg>` element.

    Args:
        figure: the figure.
        label: what it shows, for those who can't see it.
    """
    written = io.StringIO()
    with matplotlib.rc_context(_SETTINGS), warnings.catch_warnings():
        # The text stays text, and the reader's machine has fonts that this one may lack.
        warnings.filterwarnings("ignore", message="Glyph .* missing from font")
        with _laid_out(figure):
            figure.savefig(written, format="svg", metadata=_NO_METADATA)
    text = written.getvalue()
    # The prolog names a DTD on another machine; the page has no use for it.
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    head, body = text[: text.index(">")], text[text.index(">") :]
    head = re.sub(r' (width|height)="[^"]*"', "", head)
    # Several figures share a page: names that nothing refers to would only clash.
    body = re.sub(r'<g id="[^"]*"', "<g", body)
    body = _PATH.sub(lambda path: _LONG_NUMBER.sub(r"\1", path[0]), body)  # two decimals: a hundredth of a point
    return Markup(head + f' role="img" aria-label="{escape(label)}"' + body)


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
    if "ipykernel" not in sys.modules:
        return
    display = import_module("IPython.display")
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png")
    display.display(display.Image(drawn.getvalue(), width=figure.get_figwidth() * 100))
