"""A figure as SVG text that can stand inside an HTML page, the same bytes every time."""

from __future__ import annotations

import io
import re
import warnings
from typing import Any

import matplotlib
from markupsafe import Markup, escape
from matplotlib.figure import Figure

_SETTINGS: dict[Any, Any] = {"svg.fonttype": "none", "svg.hashsalt": "lptn"}
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
        figure.savefig(written, format="svg", metadata=_NO_METADATA)
    text = written.getvalue()
    # The prolog names a DTD on another machine; the page has no use for it.
    text = text[text.index("<svg") :]
    text = re.sub(r"<metadata>.*?</metadata>", "", text, flags=re.DOTALL)
    head, body = text[: text.index(">")], text[text.index(">") :]
    head = re.sub(r' (width|height)="[^"]*"', "", head)
    # Several figures share a page: names that nothing refers to would only clash.
    body = re.sub(r'<g id="[^"]*"', "<g", body)
    body = _PATH.sub(_shortened, body)
    return Markup(head + f' role="img" aria-label="{escape(label)}"' + body)


def _shortened(path: re.Match[str]) -> str:
    """A path with two decimals: a hundredth of a point."""
    return _LONG_NUMBER.sub(r"\1", path[0])
