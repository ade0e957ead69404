"""The works that the package builds on, and the citations that name them.

A citation stands in square brackets: `[Geyer1992]`, `[Chen2017, eq. 2.6]`, `[QuadrupedLPTN, eq. 7, 8; table 1]`. The
works are in `references.toml` beside this file; adding one there is all it takes to cite it.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from lptn.basics.errors import InputError

FILE = Path(__file__).with_name("references.toml")

_KEY = r"[A-Z][A-Za-z]+(?:\d+(?:-\d+)?)?"
_KIND = r"(?:eq\.|table|fig\.|sec\.|chapter|appendix|application|multi-gait test)"
_CITATION = re.compile(rf"\[(?P<key>{_KEY})(?:,\s+(?P<places>{_KIND}[^\[\]]*))?\]")
_RANGE = re.compile(r"(\d+) to (\d+)")


@dataclass(frozen=True)
class Reference:
    """One work of the bibliography.

    Args:
        key: what citations name it by.
        title: as printed.
        authors: initials and surname each; empty where the work names none.
        year: of publication; `None` where the work names none.
        published: journal, university or publisher.
        called: what stands for the authors where there are none.
        doi: without `https://doi.org/`; empty where none is printed in the source.
        url: empty where none is printed in the source.
        note: what a reader must know to find the cited place.
        places: the equations, tables and sections that may be cited, with what stands there.
        errata: what is printed wrong at a place, and what is right.
    """

    key: str
    title: str
    authors: tuple[str, ...] = ()
    year: int | None = None
    published: str = ""
    called: str = ""
    doi: str = ""
    url: str = ""
    note: str = ""
    places: Mapping[str, str] = field(default_factory=dict)
    errata: Mapping[str, str] = field(default_factory=dict)

    @property
    def short(self) -> str:
        """Authors and year, as a text names the work: `Rao et al. (1998)`."""
        surnames = [author.rsplit(". ", 1)[-1] for author in self.authors]
        many = len(surnames) > 2
        who = f"{surnames[0]} et al." if many else " and ".join(surnames) or self.called
        return who if self.year is None else f"{who} ({self.year})"

    @property
    def full(self) -> str:
        """Authors, year, title and where it was published, as a list of references has it."""
        who = ", ".join(self.authors)
        head = " ".join(part for part in (who, "" if self.year is None else f"({self.year})") if part)
        where = ", ".join(part for part in (self.published, self.doi and f"doi:{self.doi}", self.url) if part)
        return ". ".join(part for part in (head, self.title, where) if part) + "." + (self.note and f" {self.note}")

    def what_stands_at(self, place: str) -> str:
        """What stands at one of its places, and what is printed wrong there."""
        wrong = self.errata.get(place)
        return self.places[place] + (f" (misprint: {wrong})" if wrong else "")


@dataclass(frozen=True)
class Citation:
    """A work and the places in it that a text cites, such as `("eq. 7", "eq. 8")`; no place stands for all of it."""

    reference: Reference
    places: tuple[str, ...] = ()

    def __str__(self) -> str:
        """The work and the places, as a sentence names them: `Chen (2017), eq. 2.4`."""
        return self.reference.short + (f", {'; '.join(self.places)}" if self.places else "")


@cache
def bibliography() -> Mapping[str, Reference]:
    """All works by key, in the order of the file.

    Raises:
        InputError: `references.toml` has an entry that is none.
    """
    entries = tomllib.loads(FILE.read_text(encoding="utf-8"))
    return {key: _reference(key, entry) for key, entry in entries.items()}


def reference(key: str) -> Reference:
    """The work of this key.

    Raises:
        InputError: the bibliography has no such work.
    """
    works = bibliography()
    if key not in works:
        raise InputError(FILE.name, key, "no such work", f"one of {', '.join(works)}")
    return works[key]


def citations(text: str) -> tuple[Citation, ...]:
    """The citations in a text, in its order.

    A bracket is a citation when it names a place, or when its key ends with a year or is in the bibliography:
    `[Wh]` is none, `[Geyer1992]` is.

    Raises:
        InputError: a citation names a work or a place that the bibliography hasn't.
    """
    brackets = (match for match in _CITATION.finditer(text) if match["places"] or _is_work(match["key"]))
    return tuple(map(_citation, brackets))


def cite(text: str, as_said: Callable[[Citation], str] = str) -> str:
    """A text with its citations in words: `[Chen2017, eq. 2.4]` as Chen (2017), eq. 2.4.

    Args:
        text: with any number of citations, none included; those of works that the bibliography hasn't (a plug-in may
            have its own) are left as they are.
        as_said: what stands for a citation; by default its words.

    Raises:
        InputError: a citation names a place that its work hasn't.
    """
    return _CITATION.sub(lambda match: as_said(_citation(match)) if match["key"] in bibliography() else match[0], text)


def works_cited(texts: Iterable[str]) -> tuple[Citation, ...]:
    """The works of the bibliography that texts cite, in its order, each once with all its cited places.

    Raises:
        InputError: a citation names a place that its work hasn't.
    """
    cited: dict[str, set[str]] = {}
    for match in (match for text in texts for match in _CITATION.finditer(text) if match["key"] in bibliography()):
        cited.setdefault(match["key"], set()).update(_citation(match).places)
    return tuple(
        Citation(work, tuple(place for place in work.places if place in cited[key]))
        for key, work in bibliography().items()
        if key in cited
    )


def _is_work(key: str) -> bool:
    return key in bibliography() or bool(re.search(r"[a-z](1[89]|20)\d\d$", key))


def _citation(match: re.Match[str]) -> Citation:
    return Citation(reference(match["key"]), _places(match["key"], match["places"] or ""))


def _places(key: str, text: str) -> tuple[str, ...]:
    """`eq. 7, 8; table 1` as eq. 7, eq. 8, table 1; `eq. 2 to 4` as all three."""
    places = reference(key).places
    named: list[str] = []
    for part in " ".join(text.split()).split("; ") if text else ():
        kind, _, numbers = part.partition(" ")
        spread = _RANGE.sub(lambda ends: ", ".join(map(str, range(int(ends[1]), int(ends[2]) + 1))), numbers)
        named += [part] if part in places else [f"{kind} {number}" for number in re.split(r", (?:and )?| and ", spread)]
    for place in named:
        if place not in places:
            raise InputError(FILE.name, key, f"the cited place '{place}'", f"one of {', '.join(places) or 'none'}")
    return tuple(named)


def _reference(key: str, entry: Mapping[str, Any]) -> Reference:
    values = {**entry, "authors": tuple(entry.get("authors", ()))}
    try:
        work = Reference(key, **values)
    except TypeError as error:  # a key that is no field, or no title
        raise InputError(FILE.name, key, str(error), ", ".join(Reference.__dataclass_fields__)) from None
    if not (work.authors or work.called):
        raise InputError(FILE.name, key, "neither authors nor called", "one of them")
    for place in work.errata:
        if place not in work.places:
            raise InputError(FILE.name, key, f"an erratum of '{place}'", "a place that may be cited")
    return work
