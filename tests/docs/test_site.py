"""The site: what its builder includes and checks. That it builds, with every tutorial run, is `.ci/docs`."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path

import pytest

from check import faults
from compose import compose, run_in_its_folder, section
from figure import notebook
from lptn.basics.errors import InputError
from science import text_fence

SOUND = {
    "index.html": '<a href="a/b.html#there">on</a><img src="p.svg">',
    "a/b.html": '<h2 id="there">x</h2>',
    "p.svg": "<svg/>",
}


def _site(folder: Path, files: dict[str, str]) -> Path:
    for name, text in files.items():
        (folder / name).parent.mkdir(exist_ok=True)
        (folder / name).write_text(text)
    return folder


def test_a_sound_site_has_no_faults(tmp_path: Path) -> None:
    assert faults(_site(tmp_path, SOUND)) == []


@pytest.mark.parametrize(
    ("file", "text", "said"),
    [
        ("index.html", '<a href="a/c.html">on</a>', "index.html: a/c.html leads nowhere"),
        ("index.html", '<a href="a/b.html#here">on</a>', "index.html: a/b.html#here leads nowhere"),
        ("a/b.html", '<img src="p.svg">', "a/b.html: p.svg leads nowhere"),
        ("a/b.html", '<a href="/index.html">on</a>', "a/b.html: /index.html leads nowhere"),
        ("c.html", '<script src="https://cdn.org/x.js"></script>', "c.html: fetches https://cdn.org/x.js"),
        ("c.html", '<link rel="stylesheet" href="//cdn.org/x.css">', "c.html: fetches //cdn.org/x.css"),
        ("c.css", '@import "https://fonts.org/x"; a { color: red }', "c.css: fetches https://fonts.org/x"),
        ("c.css", "a { background: url(https://img.org/x.png) }", "c.css: fetches https://img.org/x.png"),
    ],
)
def test_what_is_wrong_is_said(tmp_path: Path, file: str, text: str, said: str) -> None:
    assert said in faults(_site(tmp_path, SOUND | {file: text}))


def test_links_may_leave_the_site(tmp_path: Path) -> None:
    assert faults(_site(tmp_path, SOUND | {"c.html": '<a href="https://fmi-standard.org">FMI</a>'})) == []


def test_an_empty_folder_is_no_site(tmp_path: Path) -> None:
    assert faults(tmp_path) == [f"{tmp_path}: no page"]


def test_what_is_included_leads_where_it_should() -> None:
    own = {
        "one.md": "# One\n\n{{ src/lptn/README.md#a-model-file }}\n",
        "deep/two.md": "{{ examples/README.md }}\n\n[log](repo:examples/tclab/log.csv) and `[no](link)`\n",
    }
    pages, files = compose(own)
    assert 'name = "leg"' in pages["one.md"]
    assert "## Python" not in pages["one.md"]
    assert "[log](../files/examples/tclab/log.csv) and `[no](link)`" in pages["deep/two.md"]
    assert "[planners](../files/planners/README.md)" in pages["deep/two.md"]  # a page that nobody includes gets one
    assert "files/planners/README.md" in pages
    assert "examples/tclab/log.csv" in files


def test_no_page_is_there_twice() -> None:
    """What a page includes has no copy, whoever links to it: a search would find both."""
    own = {
        "logs.md": "{{ src/lptn/logs/README.md }}\n",
        "two.md": "[a section](repo:src/lptn/logs/README.md#formats)\n",
    }
    pages, _ = compose(own)
    assert "[a section](logs.md#formats)" in pages["two.md"]
    assert "files/src/lptn/logs/README.md" not in pages


def test_a_script_is_run_as_a_notebook(tmp_path: Path) -> None:
    script = tmp_path / "script.py"
    script.write_text(
        "# %% [markdown]\n# # Title\n# Words.\n\n# %% One\nx = 2\nprint(x + 1)\n\n# %% Two\nassert x == 2\n"
    )
    made = notebook(str(script))
    assert "Words." in made
    assert "Title" not in made
    assert "One\n\n```python\nx = 2\nprint(x + 1)\n```\n\n```text\n3\n```" in made
    script.write_text("# %% Wrong\nassert False\n")
    with pytest.raises(AssertionError):
        notebook(str(script))


def test_a_page_works_in_a_folder_of_its_own() -> None:
    page = '```bash exec="true" source="above"\nls\n```\n\n```\nmkdir first_hour/limit\n```\n'
    made = run_in_its_folder(page, "tutorials/limit.md")
    assert made == page.replace('exec="true"', 'exec="true" workdir="first_hour/limit"')


def test_a_link_to_what_is_not_there_is_an_error() -> None:
    with pytest.raises(InputError, match="no such file in the project"):
        compose({"one.md": "[x](repo:examples/none.csv)"})


def test_a_section_ends_with_the_next_heading_of_its_level() -> None:
    text = "# A\n\n## B c\n\nbody\n\n```\n## no heading\n```\n\n### D\n\nmore\n\n## E\n"
    assert section(text, "b-c").split() == ["body", "```", "##", "no", "heading", "```", "##", "D", "more"]
    with pytest.raises(InputError, match="no heading"):
        section(text, "f")


def test_of_what_is_printed_tables_scroll_and_sentences_wrap() -> None:
    """A copy has every line as it was printed."""
    printed = "node      RMSE\nheater1  <1 K\n\nIt fails worst where:\n  heater1, 5 s: RMSE 1 K"
    html = text_fence(printed)
    kinds = re.findall(r'<span class="(\w+)">', html)
    assert kinds == ["row", "row", "sentence", "sentence", "sentence"]
    assert unescape(re.sub(r"<[^>]+>", "", html)) == printed + "\n"
