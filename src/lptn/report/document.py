"""Templates filled in: pictures with their sentence, tables, one page without anything from outside."""

from __future__ import annotations

import re
from dataclasses import dataclass
from importlib.resources import files

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lptn.basics.style import inline_svg

_UNIT_BEHIND = re.compile(r"(?<=\d) (?=(?:K|W|s|min|h|m/s|°C|N·m|%)\b)")


@dataclass(frozen=True)
class Picture:
    """Drawings that share one sentence on what to see."""

    drawings: tuple[Markup, ...]
    caption: str


def picture(caption: str, *drawn: Figure | Axes) -> Picture:
    """Figures, or the figures of axes, and the sentence below them."""
    figures = (each.figure if isinstance(each, Axes) else each for each in drawn)
    return Picture(tuple(inline_svg(figure, caption) for figure in figures if isinstance(figure, Figure)), caption)


def render(template: str, **content: object) -> str:
    """A template of this folder, filled in; all text is escaped, and no line ends between a number and its unit."""
    environment = Environment(
        loader=FunctionLoader(_text),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=lambda value: _UNIT_BEHIND.sub("\u00a0", value) if type(value) is str else value,
    )
    # The style sheet is ours; as a template it would be read for braces.
    return environment.get_template(template).render(css=Markup(_text("style.css")), **content)


def _text(name: str) -> str:
    return files("lptn.report").joinpath(name).read_text(encoding="utf-8")
