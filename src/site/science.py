"""What the site's Markdown knows besides: formulas as MathML, citations as links, printed text, docstrings' examples.

A block of code that is run and fails ends the build.
"""

from __future__ import annotations

import re
from html import escape
from typing import Any
from xml.etree.ElementTree import Element

from latex2mathml.converter import convert
from markdown import Extension, Markdown
from markdown.inlinepatterns import InlineProcessor
from markdown.preprocessors import Preprocessor
from markdown_exec import patch_loggers
from pymdownx.superfences import SuperFencesException

from lptn.references import citations


def formula(latex: str) -> str:
    """A displayed formula as MathML, which browsers draw without any script."""
    return f'<div class="formula">{convert(latex.strip(), display="block")}</div>'


def math_fence(source: str, *_: object, **__: object) -> str:
    """A code block of the language `math`, as the rooms' pages have it."""
    return formula(source)


def text_fence(source: str, *_: object, **__: object) -> str:
    """A code block of the language `text`, what was printed: rows of a table stay whole and scroll, sentences wrap."""
    spans = (f'<span class="{_kind_of(line)}">{escape(line)}\n</span>' for line in source.rstrip("\n").split("\n"))
    return f'<div class="language-text highlight"><pre><code>{"".join(spans)}</code></pre></div>'


def _kind_of(line: str) -> str:
    return "row" if re.search(r"\S {2,}\S", line) else "sentence"  # columns stand two spaces apart or more


class _DisplayedFormula(Preprocessor):
    """`.. math:: Q = R I^2` of docstrings."""

    _BLOCK = re.compile(r"^\.\. math::((?:.*\n)(?:[ \t]+.*\n|\n(?=[ \t]+\S))*)", re.MULTILINE)

    def run(self, lines: list[str]) -> list[str]:
        def shown(block: re.Match[str]) -> str:
            return f"\n{self.md.htmlStash.store(formula(block[1]))}\n\n"

        return self._BLOCK.sub(shown, "\n".join(lines) + "\n").split("\n")


class _InlineFormula(InlineProcessor):
    """:math:`x` of docstrings, $`x`$ of pages."""

    def handleMatch(self, m: re.Match[str], data: str) -> tuple[str, int, int]:  # type: ignore[override]  # noqa: N802
        return self.md.htmlStash.store(convert(m[1] or m[2])), m.start(0), m.end(0)


class _Cited(InlineProcessor):
    """`[Chen2017, eq. 2.4]` leads to the work."""

    def handleMatch(self, m: re.Match[str], data: str) -> tuple[Any, int | None, int | None]:  # type: ignore[override]  # noqa: N802
        found = citations(m[0])
        if len(found) != 1:
            return None, None, None
        element = Element("autoref", {"identifier": f"work-{found[0].reference.key}"})
        element.text = str(found[0])
        return element, m.start(0), m.end(0)


class _Doctest(Preprocessor):
    """Lines that begin with >>>, and what they print, are code."""

    _BLOCK = re.compile(r"^>>> .*\n(?:.+\n)*", re.MULTILINE)

    def run(self, lines: list[str]) -> list[str]:
        return self._BLOCK.sub(r"```pycon\n\g<0>```\n", "\n".join(lines) + "\n").split("\n")


class _FailedBlock:
    """Where `markdown_exec` says that a block of code failed, which it goes on after by itself."""

    def __init__(self, name: str) -> None:
        self.name = name

    def warning(self, message: str, *_: object) -> None:
        raise SuperFencesException(message)  # any other would leave the block as it stands

    def debug(self, *_: object) -> None:
        pass


class Science(Extension):
    """Formulas, citations and examples of docstrings and pages."""

    def extendMarkdown(self, md: Markdown) -> None:  # noqa: N802
        patch_loggers(_FailedBlock)
        md.preprocessors.register(_Doctest(md), "doctest", 28)  # before code blocks
        md.preprocessors.register(_DisplayedFormula(md), "displayed_formula", 20)  # after code blocks
        md.inlinePatterns.register(
            _InlineFormula(r":math:`([^`]+)`|\$`([^`]+)`\$", md), "inline_formula", 195
        )  # before inline code
        md.inlinePatterns.register(
            _Cited(r"\[[A-Z][A-Za-z]+\d*[^\[\]]*\](?![\[(:])", md), "citation", 175
        )  # before links


def makeExtension(**_: object) -> Science:  # noqa: N802
    """The extension, by the name that Markdown looks for."""
    return Science()
