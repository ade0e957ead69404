"""One stack of figures: on a page they take its colours and its font, and no two share a name."""

from __future__ import annotations

import re
from importlib.resources import files

import pytest
from matplotlib.figure import Figure

from lptn.basics.style import BAD, COLOURS, GIVEN, HOT, INK, LIMIT, PAPER, SHADE, inline_svg, new_figure
from lptn.identify.comparison import compare, versus
from lptn.report.pages import comparison_html, story_html, versus_html
from tests.report.two_joints import Told


def _variables(block: str) -> dict[str, str]:
    """The variables of the first rule of the style sheet of colours after `block`, as six hexadecimal digits."""
    style = files("lptn.report").joinpath("page", "colours.css").read_text(encoding="utf-8")
    rule = re.search(r":root \{(.*?)\n *\}", style[style.index(block) :], re.DOTALL)
    assert rule is not None
    return {
        name: "#" + "".join(2 * digit for digit in colour[1:]) if len(colour) == 4 else colour
        for name, colour in re.findall(r"--([\w]+): ([^;]+);", rule[1])
    }


def test_pages_have_each_colour_in_light_and_dark() -> None:
    light, dark = _variables(":root"), _variables("prefers-color-scheme: dark")
    assert set(COLOURS) <= set(light) & set(dark)
    see_through = {"shade", "noise"}  # on a page these are shadows on whatever lies below
    solid = {name: colour for name, colour in COLOURS.items() if name not in see_through}
    assert {name: light[name] for name in solid} == solid


@pytest.mark.parametrize("room", ["report", "workbench"])
def test_no_page_has_colours_of_its_own(room: str) -> None:
    style = files(f"lptn.{room}").joinpath("page", "style.css").read_text(encoding="utf-8")
    assert not re.findall(r"[:,(]\s*#[0-9a-f]{3,8}\b|\brgb\b|\bhsl\b", style)
    known = {*_variables(":root"), *re.findall(r"--(\w+):", style), "share"}  # a tile's share is said where it stands
    assert set(re.findall(r"var\(--(\w+)", style)) <= known


def _figure() -> Figure:
    figure = new_figure(2.0)
    ax = figure.add_subplot()
    ax.plot([0, 1], [0, 3], **GIVEN)
    ax.plot([0.5], [1.0], "o", color=INK, markerfacecolor=PAPER)
    ax.axvspan(0.2, 0.3, color=SHADE)
    ax.axhline(1.0, color=LIMIT)
    ax.bar([0.5], [2.0], 0.1, hatch="///", alpha=0.4, color=BAD)
    ax.fill_between([0, 1], [0, 1], color=HOT, alpha=0.2)
    ax.set_title('#0072b2 id="a" url(#b) style="font-family: x" <b> 1.23456', weight="bold")
    return figure


def test_colours_and_fonts_are_those_of_the_page_and_text_is_left_alone() -> None:
    drawn = inline_svg(_figure(), "a <figure>")
    assert 'aria-label="a &lt;figure&gt;"' in drawn
    tags = "".join(re.findall(r"<[^>]*>", drawn))
    assert not re.search(r"#[0-9a-fA-F]{6}\b|font-family|xlink|<style|<metadata|<!", tags)
    for name in ("given", "ink", "paper", "shade", "limit", "bad", "hot"):
        assert f"var(--{name})" in tags
    assert '#0072b2 id="a" url(#b) style="font-family: x" &lt;b&gt; 1.23456' in drawn
    assert inline_svg(_figure(), "a <figure>") == drawn


def _names(html: str) -> list[str]:
    return re.findall(r' id="([^"]+)"', "".join(re.findall(r"<[^>]*>", html)))


@pytest.mark.long
def test_no_two_things_on_a_page_share_a_name_and_each_reference_is_met(missing: Told) -> None:
    history, data = missing
    given, best = (compare(step.fit.model, data.holdout) for step in (history.steps[0], history.best))
    both = versus(best.model, given.model, data.holdout, data.holdout)
    for html in (story_html(history, data, "story"), comparison_html(best, "one"), versus_html(both, "two")):
        names = _names(html)
        assert len(names) == len(set(names))
        assert set(re.findall(r"(?:url\(|href=\")#([\w-]+)", html)) <= set(names)
        figures = "".join(re.findall(r'<svg class="chart".*?</svg>', html, re.DOTALL))
        assert figures
        assert not re.search(r"#[0-9a-f]{6}\b", "".join(re.findall(r"<[^>]*>", figures)))
