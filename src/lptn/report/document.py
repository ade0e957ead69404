"""Templates filled in: pictures with their sentence, tables, charts with their script; nothing from outside."""

from __future__ import annotations

import json
import platform
import re
from datetime import date
from functools import cache
from importlib.metadata import version
from importlib.resources import files

from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup

from lptn.basics.words import BOUND, UNIT_BEHIND

_VERSIONS = ("lptn", "numpy", "scipy", "casadi")


class Picture:
    """Drawings, and below them the sentence on what to see."""

    def __init__(self, caption: str, *drawings: Markup) -> None:
        self.caption, self.drawings = caption, drawings


def render(template: str, **content: object) -> str:
    """A template of `page/`, filled in; all text is escaped, and no line ends between a number and its unit.

    The page contains the script only if it has charts.
    """
    pages = environment().overlay(finalize=lambda value: UNIT_BEHIND.sub(BOUND, value) if type(value) is str else value)
    # Style sheet and script contain braces, and must not be parsed as templates.
    style = Markup("".join(map(_text, ("uplot/uPlot.css", "colours.css", "style.css"))))
    # uPlot and our charts as one module, as a page without other files needs it.
    modules = map(_text, ("uplot/uPlot.esm.js", "zoom.js", "charts.js"))
    script = Markup(re.sub(r"^export (\{.*\};)?", "", "".join(modules), flags=re.MULTILINE))
    made = f"{date.today().isoformat()} with {', '.join(f'{name} {version(name)}' for name in _VERSIONS)}"
    made += f", Python {platform.python_version()}"
    return pages.get_template(template).render(css=style, script=script, made=made, **content)


@cache
def environment() -> Environment:
    """The templates of `page/`; `px` writes a length, `json` a list for an attribute."""
    made = Environment(
        loader=FunctionLoader(_text), autoescape=True, undefined=StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    made.filters |= {"px": "{:.1f}".format, "json": lambda names: json.dumps(names, ensure_ascii=False)}
    return made


def _text(name: str) -> str:
    return files("lptn.report").joinpath("page", name).read_text(encoding="utf-8")
