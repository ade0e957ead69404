"""The bibliography: every citation in the repository resolves, and works are named as a list of references has them."""

from __future__ import annotations

import re
import subprocess
from pathlib import Path

import pytest

from lptn.basics.errors import InputError
from lptn.references import bibliography, citations, cite, reference, works_cited

ROOT = Path(__file__).parents[2]
_TEXT = {".py", ".pyi", ".md", ".toml", ".c", ".h", ".j2"}
_PRIVATE = re.compile(r"\bsource S\d|\bS\d-[A-Z]\w*\d|\brows? [ETNMX]\d")
_HERE = "tests/references/test_references.py"


def texts() -> dict[str, str]:
    """Every text file that is in the repository, or about to be, without the FMUs made from it."""
    words = ["git", "ls-files", "--cached", "--others", "--exclude-standard"]
    listed = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=True)
    names = [name for name in listed.stdout.splitlines() if Path(name).suffix in _TEXT and name != _HERE]
    paths = {name: ROOT / name for name in names if not name.startswith("fmu/reference/")}
    return {name: path.read_text(encoding="utf-8") for name, path in paths.items() if path.exists()}


def test_every_citation_in_the_repository_resolves() -> None:
    cited = {name: citations(text) for name, text in texts().items()}
    assert sum(map(len, cited.values())) > 150


def test_no_work_stands_in_the_list_uncited() -> None:
    cited = {citation.reference.key for citation in works_cited(texts().values())}
    assert set(bibliography()) == cited


def test_nothing_is_cited_by_a_private_name() -> None:
    """But for the table of the sources' rows, whose page says what its ids mean."""
    others = {name: text for name, text in texts().items() if not name.startswith("tests/sources/")}
    matches = {name: match[0] for name, text in others.items() if (match := _PRIVATE.search(text))}
    assert not matches


@pytest.mark.parametrize(
    ("key", "short", "full"),
    [
        (
            "Geyer1992",
            "Geyer (1992)",
            "C. J. Geyer (1992). Practical Markov chain Monte Carlo. Statistical Science 7, 473–483.",
        ),
        ("Rao1998", "Rao et al. (1998)", "C. V. Rao, S. J. Wright, J. B. Rawlings (1998). "),
        ("NeweyWest1987", "Newey and West (1987)", "W. K. Newey, K. D. West (1987). "),
        ("BlockLPTN", "“Improving Accuracy in the LPTN Method (2/2)”", "Improving Accuracy in the Lumped-Parameter"),
        ("Tyrovolas2024", "Tyrovolas et al. (2024)", "Tyrovolas, Aliev, Antonelli, Stylios (2024). "),
    ],
)
def test_a_work_is_named_as_people_name_it(key: str, short: str, full: str) -> None:
    assert reference(key).short == short
    assert reference(key).full.startswith(full)


def test_a_doi_stands_where_the_source_prints_one() -> None:
    assert reference("Tyrovolas2024").full.endswith("doi:10.24432/C5J891.")


def test_citations_are_put_in_words() -> None:
    assert cite("Loss [Chen2017, eq. 2.4], see [Geyer1992].") == "Loss Chen (2017), eq. 2.4, see Geyer (1992)."
    assert cite("per hour [Wh], list[Run], [K], [T, n]") == "per hour [Wh], list[Run], [K], [T, n]"
    (cited,) = citations("[QuadrupedLPTN, eq. 7, 8;\n table 2 and 3; application 2]")
    assert cited.places == ("eq. 7", "eq. 8", "table 2", "table 3", "application 2")
    (cited,) = citations("[BlockLPTN, eq. 2 to 4]")
    assert cited.places == ("eq. 2", "eq. 3", "eq. 4")
    (cited,) = citations("[QuadrupedLPTN, multi-gait test]")
    assert cited.places == ("multi-gait test",)


def test_a_plug_in_may_cite_works_of_its_own() -> None:
    assert cite("after [Smith2020, eq. 1] and [Geyer1992]") == "after [Smith2020, eq. 1] and Geyer (1992)"
    assert [citation.reference.key for citation in works_cited(["after [Smith2020, eq. 1] and [Geyer1992]"])] == [
        "Geyer1992"
    ]


def test_a_misprint_is_said_where_the_place_is() -> None:
    assert reference("BlockLPTN").what_stands_at("eq. 5").startswith("place of the maximum (misprint: right is L/2")


def test_works_are_listed_once_with_all_their_places() -> None:
    one, other = works_cited(["[Geyer1992] [Chen2017, eq. 2.6]", "[Chen2017, eq. 2.4; eq. 2.6]"])
    assert (one.reference.key, one.places) == ("Chen2017", ("eq. 2.4", "eq. 2.6"))
    assert other.reference.key == "Geyer1992"


@pytest.mark.parametrize("text", ["[Geyer1993]", "[Chen2017, eq. 9.9]", "[Nobody, table 1]", "[Geyer1992, eq. 1]"])
def test_a_citation_of_what_is_not_there_is_refused(text: str) -> None:
    with pytest.raises(InputError, match=r"references\.toml"):
        citations(text)
