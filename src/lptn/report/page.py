"""Templates filled in: pictures with their sentence, tables, one page without anything from outside."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.resources import files

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup
from matplotlib.figure import Figure

from lptn.report.svg import inline_svg


@dataclass(frozen=True)
class Picture:
    """Drawings that share one sentence on what to see."""

    drawings: tuple[Markup, ...]
    caption: str


def picture(caption: str, *figures: Figure) -> Picture:
    """Figures and the sentence below them."""
    return Picture(tuple(inline_svg(figure, caption) for figure in figures), caption)


def render(template: str, **content: object) -> str:
    """A template of this folder, filled in; all text is escaped."""
    # The style sheet is ours; as a template it would be read for braces.
    return _environment().get_template(template).render(css=Markup(_text("style.css")), **content)


def _environment() -> Environment:
    return Environment(
        loader=FunctionLoader(_text),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _text(name: str) -> str:
    return files("lptn.report").joinpath(name).read_text(encoding="utf-8")
