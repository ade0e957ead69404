"""The pages: each link leads somewhere, each command is one, each script is there."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from compose import PLAYGROUND
from effects_page import effects_page
from lptn.cli.main import app
from lptn.effects import Effect, catalogue
from tests.docs.pages import ROOT, Page, pages

PAGES = pages()
_NAMED = {page.name: page for page in PAGES}
every_page = pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)


def _commands(page: Page, first: str) -> list[list[str]]:
    """What is typed in a page's blocks, without the remark behind it."""
    lines = [line.strip() for block in page.blocks("") for line in block.splitlines()]
    return [shlex.split(line, comments=True) for line in lines if line.startswith(f"{first} ")]


def _built_in() -> dict[str, type[Effect]]:
    """The effects of this package, without plug-ins."""
    return {key: effect for key, effect in catalogue().items() if effect.__module__.startswith("lptn.effects.")}


# The links of the site's own pages lead to pages of the built site; `.ci/docs` looks there.
@pytest.mark.parametrize(
    "page", [page for page in PAGES if not page.name.startswith("src/site/")], ids=lambda page: page.name
)
def test_links_lead_somewhere(page: Page) -> None:
    for link in page.links():
        if link.startswith(("http:", "https:", "mailto:")):
            continue
        name, _, anchor = link.partition("#")
        target = (page.folder / name).resolve() if name else ROOT / page.name
        assert target.exists(), f"{page.name}: {link}"
        if anchor:
            there = _NAMED[str(target.relative_to(ROOT))]
            assert anchor in there.anchors(), f"{page.name}: {link}"


@pytest.mark.parametrize("page", [page for page in PAGES if page.name != "CHANGELOG.md"], ids=lambda page: page.name)
def test_every_file_of_the_project_that_a_page_names_is_there(page: Page) -> None:
    for name in re.findall(r"`((?:src|fmu|planners|tests|examples|\.ci)/[a-z0-9_./-]+)`", page.text):
        assert (ROOT / name).exists(), f"{page.name}: {name}"


@every_page
def test_every_command_of_a_page_is_one(page: Page) -> None:
    for words in _commands(page, "lptn"):
        app.parse_args(_spelt(words[1:]), print_error=False, exit_on_error=False)


@every_page
def test_every_script_of_a_page_is_there(page: Page) -> None:
    for words in _commands(page, "python"):
        script = ROOT / f"{words[2].replace('.', '/')}.py" if words[1] == "-m" else ROOT / words[1]
        if words[1] == "-m" and words[2].startswith("lptn"):
            script = ROOT / "src" / words[2].replace(".", "/") / "__main__.py"
        assert script.is_file(), f"{page.name}: {' '.join(words)}"


def test_the_front_page_keeps_what_a_newcomer_needs() -> None:
    front = _NAMED["README.md"]
    typed = "\n".join(front.blocks(""))
    assert "pip install -e '.[dev]'" in typed
    assert re.search(r"^lptn improve .* --report story.html$", typed, re.MULTILINE)
    assert re.search(r"^pytest$", typed, re.MULTILINE)
    (picture,) = re.findall(r"!\[[^\]]*\]\(([^)]+)\)", front.text)
    assert 0 < (ROOT / picture).stat().st_size < 60_000
    assert len(front.text[: front.text.index("## Install")].splitlines()) < 25
    words = len(front.text.split())
    assert words < 700, (
        f"README.md has {words} words; expected at most 699, which are read in three minutes: shorten it"
    )


@pytest.mark.parametrize("page", [page for page in PAGES if "tutorials/" in page.name], ids=lambda page: page.name)
def test_a_tutorial_tells_to_make_the_folder_that_its_code_is_run_in(page: Page) -> None:
    folder = f"{PLAYGROUND}/{Path(page.name).stem}"
    runs = 'exec="true"' in page.text
    assert (f"mkdir -p {folder} && cd {folder}" in "".join(page.blocks("bash"))) == runs


def test_the_catalogue_page_is_the_catalogue() -> None:
    page = Path(ROOT / "src/lptn/effects/README.md").read_text(encoding="utf-8")
    assert page == effects_page(), "stale: python src/site/effects_page.py"


def test_the_catalogue_page_says_all_of_an_effect() -> None:
    text = effects_page()
    section = text[text.index("## second_mass") : text.index("## shared_mass")]
    said = (
        "```math\nQ = \\frac{C_2}{t_2} (T_2 - T)",
        "$`t_2 = R_2 C_2`$",
        "amplitude, off at 0",
        "| J/K | 0 to ∞ |",
    )
    for phrase in (
        *said,
        "shape, tried at 15, 60, 240, 900",
        "Looks like: fast at first",
        "Source: two-node network",
        ".py)",
    ):
        assert phrase in section
    assert text.count("\n## ") == len(_built_in()) + 1  # and the references


def _spelt(words: list[str]) -> list[str]:
    """`LOG...` is one log, `…` and what a page leaves out stands for nothing."""
    return [word.removesuffix("...") for word in words if word != "…"]
