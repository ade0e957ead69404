"""The story: one page, whole, safe, the same every time, and true to the verdict."""

from __future__ import annotations

import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from lptn.identify.comparison import compare
from lptn.identify.data import DataSplit, holdout_segment
from lptn.report.narrative import details, narrative
from lptn.report.pages import comparison_html, story_html
from tests.report.two_joints import NODES, Told, make_run, robot

_VOID = {"meta", "br", "hr", "img", "link", "input"}
_NAMESPACES = {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}


class Page(HTMLParser):
    """Reads a page: tags that don't balance, all text, the caption of each figure."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.wrong: list[str] = []
        self.tags: list[str] = []
        self.captions: list[str] = []
        self.text = ""
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag not in _VOID:
            self.open.append(tag)
        if tag == "figcaption":
            self.captions.append("")

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)

    def handle_endtag(self, tag: str) -> None:
        if not self.open or self.open.pop() != tag:
            self.wrong.append(tag)

    def handle_data(self, data: str) -> None:
        self.text += data
        if "figcaption" in self.open:
            self.captions[-1] += data


@pytest.fixture(scope="module")
def html(missing: Told) -> str:
    return story_html(*missing, "Legs & <script>alert(1)</script>", ("lptn report a.toml 'b <c>.csv'",))


def pages(missing: Told) -> list[str]:
    comparison = compare(missing[0].best.fit.model, missing[1].holdout)
    return [story_html(*missing, "story"), comparison_html(comparison, "<comparison>")]


@pytest.mark.long
def test_nothing_is_loaded_from_elsewhere(missing: Told) -> None:
    for html in pages(missing):
        written = re.sub(r"<script type=\"module\">.*?</script>", "", html, flags=re.DOTALL)  # its comments cite
        assert set(re.findall(r"https?://[^\s\"'<]+", written)) <= _NAMESPACES
        assert "@import" not in html
        assert not re.search(r"\bfetch\(|XMLHttpRequest|WebSocket|\bimport\(", html)
        assert {"link", "img", "iframe"}.isdisjoint(Page(html).tags)
        targets = re.findall(r'(?:src|href)="([^"]*)"', html)
        assert all(target.startswith(("#", "data:image/png;base64,")) for target in targets)


@pytest.mark.long
def test_well_formed_and_small(missing: Told) -> None:
    for html in pages(missing):
        page = Page(html)
        assert not page.wrong
        assert not page.open
        assert html.startswith("<!DOCTYPE html>")
        assert len(html.encode()) < 2_000_000


@pytest.mark.long
def test_every_figure_has_its_sentence(html: str, missing: Told) -> None:
    for text in (html, *pages(missing)):
        page = Page(text)
        assert page.tags.count("figure") == len(page.captions) > 0
        assert all(caption.strip().endswith(".") for caption in page.captions)
    assert Page(html).tags.count("figure") == 9
    headings = re.findall(r'<h2 id="s\d">(\d)\. ([^<]*)</h2>', html)
    assert [number for number, _ in headings] == [str(number) for number in range(1, 10)]
    story = ["The log", "The model", "Where the model fails", "What was missing", "Test", "What to do next"]
    assert all(title.startswith(start) for (_, title), start in zip(headings[1:], story, strict=False))


def test_the_effects_named_have_their_references(html: str) -> None:
    section = html[html.index("9. References") :]
    assert "A. E. Chen (2017). Effectiveness of Active Cooling" in section
    assert "“Thermal Modeling … for Quadruped Robots”, eq. 3" in section
    assert "[QuadrupedLPTN" not in html


def test_user_text_is_escaped(html: str) -> None:
    assert re.findall(r"<script[^>]*>", html) == [
        '<script type="application/json" id="story-data">',
        '<script type="module">',
    ]
    for text in ("alert(1)</script>", "<b>&", "<gap>"):
        assert text not in html
    page = Page(html)
    assert all(node in page.text for node in NODES)
    assert "b <c>.csv" in page.text


@pytest.mark.long
def test_same_input_same_bytes(missing: Told) -> None:
    assert pages(missing) == pages(missing)


@pytest.mark.long
def test_long_logs_stay_small() -> None:
    model = robot()
    run = make_run(model, 5, "long", count=18_000)  # 10 h
    assert len(comparison_html(compare(model, [holdout_segment(run)]), "long").encode()) < 1_000_000


@pytest.mark.parametrize("told", ["missing", "adequate"])
def test_the_page_has_the_narrative_word_for_word(told: str, request: pytest.FixtureRequest) -> None:
    history, data = request.getfixturevalue(told)
    text = Page(story_html(history, data, told)).text.replace("\N{NO-BREAK SPACE}", " ")
    for sentence in narrative(history.steps, history.last):
        assert str(sentence) in text
    for paragraph in details(history, data):
        assert paragraph in text


@pytest.mark.long
def test_without_held_out_data_the_page_says_so(missing: Told) -> None:
    history, data = missing
    steps = tuple(replace(step, holdout=None, test=None) for step in history.steps)
    html = story_html(replace(history, steps=steps), DataSplit(data.fit), "fit only")
    page = Page(html)
    assert "nothing tests the result" in page.text
    assert "so this is no test" in page.text
    assert not page.wrong


@pytest.mark.long
def test_many_parameters_wait_until_the_story_is_told(missing: Told, monkeypatch: pytest.MonkeyPatch) -> None:
    few = story_html(*missing, "few")
    assert few.index("capacity.") < few.index("4. Where the model fails")
    monkeypatch.setattr("lptn.report.pages._FEW", 0)
    many = story_html(*missing, "many")
    assert "parameters are in section 8." in many
    assert many.index("<td>capacity.") > many.index("8. Parameters")
