"""Which of other people's columns may be meant: proposed from their names and values, never taken without a word."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from lptn.basics.errors import InputError
from lptn.logs.columns import (
    NOT_MEASURED,
    PLACES,
    QUANTITIES,
    ColumnSource,
    NameParts,
    map_option,
    parts_of,
    toml_line,
    words_of,
)
from lptn.logs.quality import suspect_time, suspect_units
from lptn.logs.resampling import raw_keys
from lptn.logs.tables import Table, known_columns

_OSL = ({"case", "temperature"}, {"motor", "current"})  # words of columns that opensourceleg's examples log
_MOST_WORDS = 24  # of a name; a line of a million characters is none
_FREE = {"joint", "joints", "motor", "actuator", "leg", "sensor", "measured", "state", "states", "q", "est", "deg"}


@dataclass(frozen=True)
class Guess:
    """A column that may hold a quantity.

    Args:
        key: the quantity, `temperature.FR_calf`.
        source: the column, and its unit.
        why: what speaks for it.
    """

    key: str
    source: ColumnSource
    why: str

    @property
    def line(self) -> str:
        """The line of `[columns]` that confirms it."""
        return toml_line(self.key, self.source)

    @property
    def option(self) -> str:
        """The option `--map` that confirms it."""
        return map_option(self.key, self.source)


def missing_keys(
    table: Table, columns: Mapping[str, ColumnSource], inputs: Collection[str], outputs: Collection[str]
) -> list[str]:
    """The raw columns that a model needs, or predicts, and that nothing in the log is known to hold, in order."""
    known = known_columns(table, columns)
    there = {key for key, source in known.items() if set(source.columns) <= set(table.names)}
    wanted = ["time", *(key for column in (*inputs, *outputs) for key in raw_keys(column, there))]
    return [key for key in dict.fromkeys(wanted) if key not in there and key not in columns]


def guess(
    table: Table, columns: Mapping[str, ColumnSource], inputs: Collection[str], outputs: Collection[str]
) -> list[Guess]:
    """A column for each quantity that is missing and that a column's name or place in a row of them points to.

    Args:
        table: the log.
        columns: the mapping that there is.
        inputs: `<feature>.<place>` columns that the model is driven by.
        outputs: temperature columns that the model predicts.
    """
    missing = missing_keys(table, columns, inputs, outputs)
    known = known_columns(table, columns)
    wanted = {"time", *(key for column in (*inputs, *outputs) for key in raw_keys(column, known)), *columns}
    used = {name for key, source in known.items() if key in wanted for name in source.columns}
    names = [name for name in table.names if name not in used and table.names.count(name) == 1]
    parts = {name: parts_of(name) for name in names}
    places = [key.partition(".")[2] for key in (*outputs, *inputs) if key.startswith("temperature.")]
    places = [place for place in dict.fromkeys(places) if place != "ambient"]
    chosen: dict[str, tuple[str, str]] = {}  # column and reason, by key
    if "time" in missing and (name := _time(parts)):
        chosen["time"] = name, "its name"
    for key in missing:
        if key != "time" and (name := _by_place(key, parts, places)):
            chosen[key] = name, "its name"
    for method in (_by_last_word, _by_number, _by_being_alone):
        rest = [key for key in missing if key not in chosen and key != "time"]
        taken = {column for column, _ in chosen.values()}
        chosen |= method(rest, {name: words for name, words in parts.items() if name not in taken}, places)
    guesses = (_with_unit(table, key, *chosen[key]) for key in missing if key in chosen)
    return [guess for guess in guesses if guess is not None]


def recognised(table: Table) -> str:
    """What is known of a log by its columns' names, a sentence; '' where nothing is."""
    if not _of_opensourceleg(table):
        return ""
    text = "log: columns as opensourceleg logs them: motor current in mA, temperatures in degC"
    if any({"winding", "temperature"} <= set(words_of(name)) for name in table.names):
        text += "; its winding temperature is its own estimate from the current, not a measurement"
    return f"{text}."


def _of_opensourceleg(table: Table) -> bool:
    words = [set(words_of(name)) for name in table.names]
    return all(any(wanted <= each for each in words) for wanted in _OSL)


def _with_unit(table: Table, key: str, column: str, why: str) -> Guess | None:
    """The guess with its unit, from the name or else from the values; `None` for a column without numbers."""
    quantity = key.partition(".")[0]
    source = ColumnSource((column,))
    try:
        values = table.numbers([column])[column]
    except InputError:
        return None
    if not np.isfinite(values).any():
        return None
    if unit := parts_of(column).unit(quantity):
        return Guess(key, replace(source, unit=unit), f"{why}, unit and all")
    if quantity == "current" and _of_opensourceleg(table):
        return Guess(key, replace(source, unit="mA"), f"{why}; opensourceleg logs mA")
    doubts = suspect_time(source, values) if key == "time" else suspect_units(key, source, values)
    mended = next((doubt.mended for doubt in doubts if doubt.mended), None)
    return Guess(key, mended, f"{why}; {doubts[0].found}") if mended else Guess(key, source, why)


def _time(parts: Mapping[str, NameParts]) -> str:
    """The column whose name begins or ends with a word for time, and has no more than a unit besides."""
    ranked: list[tuple[int, int, str]] = []
    for name, each in parts.items():
        words = [word for word in each.words if not NOT_MEASURED.intersection([word])]
        hits = [word for word in words if word in QUANTITIES["time"]]
        if hits and (words[0] in hits or words[-1] in hits or each.unit("time")):
            ranked.append((len(words) - len(hits) - bool(each.unit("time")) + (hits == ["t"]), len(ranked), name))
    return min(ranked)[2] if ranked else ""


def _by_place(key: str, parts: Mapping[str, NameParts], places: Sequence[str]) -> str:
    """The column that names the place and the quantity with the fewest words besides; '' if two are as good."""
    quantity, _, place = key.partition(".")
    others = [_spellings(other) for other in places if other != place]
    mine = _spellings(place)
    ranked: list[tuple[int, str]] = []
    for name, each in parts.items():
        extra = _words_besides(each, quantity, mine)
        # `FR_calf_upper` is another place where the model has one of that name.
        longer = any(_words_besides(each, quantity, spelling) is not None and len(min(spelling)) > len(min(mine))
                     for spelling in others)  # fmt: skip
        if extra is not None and not longer:
            ranked.append((extra, name))
    ranked.sort()
    if len(ranked) > 1 and ranked[0][0] == ranked[1][0]:
        return ""
    return ranked[0][1] if ranked else ""


def _spellings(place: str) -> set[str]:
    """A place's name without its separators, and other words for it."""
    return {"".join(words_of(place)), *PLACES.get(place, ())}


def _words_besides(parts: NameParts, quantity: str, spellings: set[str]) -> int | None:
    """How many words a name has besides place, quantity and unit; `None` where it lacks one or is no measurement."""
    words = list(parts.words)
    if len(words) > _MOST_WORDS or NOT_MEASURED.intersection(words):
        return None
    spans = [
        (i, j) for i in range(len(words)) for j in range(i + 1, len(words) + 1) if "".join(words[i:j]) in spellings
    ]
    if not spans:
        return None
    i, j = max(spans, key=lambda span: span[1] - span[0])
    rest = words[:i] + words[j:]
    unit = bool(parts.unit(quantity))
    if quantity == "temperature" and spellings >= PLACES["ambient"] and set(rest) <= _FREE:
        return len(rest)  # a room has nothing else that is logged
    if not any(word in QUANTITIES.get(quantity, {quantity}) for word in rest) and not (
        unit and len(rest) <= 2 and rest
    ):
        return None
    others = {word for name, known in QUANTITIES.items() if name != quantity for word in known if len(word) > 2}
    if not QUANTITIES.get(quantity, frozenset()).intersection(rest) and others.intersection(rest):
        return None
    return sum(word not in _FREE and word not in QUANTITIES.get(quantity, ()) for word in rest)


def _by_last_word(
    missing: Sequence[str], parts: Mapping[str, NameParts], places: Sequence[str]
) -> dict[str, tuple[str, str]]:
    """`hip temp` for FR_hip, in a model of one leg: names of a last word alone, if there is one for each node."""
    last = {place: words_of(place)[-1] for place in places if len(words_of(place)) > 1}
    if len(places) < 2 or len(set(last.values())) < len(places):
        return {}
    found: dict[str, tuple[str, str]] = {}
    for quantity in dict.fromkeys(key.partition(".")[0] for key in missing):
        fitting = {}
        for place, word in last.items():
            spelt = {word, *PLACES.get(word, ())}
            fitting[place] = [name for name, each in parts.items() if _words_besides(each, quantity, spelt) == 0]
        keys = {place: f"{quantity}.{place}" for place in places}
        if all(len(names) == 1 for names in fitting.values()) and set(keys.values()) <= set(missing):
            found |= {keys[place]: (names[0], "the end of its name: check that") for place, names in fitting.items()}
    return found


def _by_number(
    missing: Sequence[str], parts: Mapping[str, NameParts], places: Sequence[str]
) -> dict[str, tuple[str, str]]:
    """Numbered columns, `motor_temperature[3]`, taken in the order of the model's nodes if there are as many."""
    found: dict[str, tuple[str, str]] = {}
    for quantity in dict.fromkeys(key.partition(".")[0] for key in missing):
        wanted = [f"{quantity}.{place}" for place in places]
        families = _families(quantity, parts, places)
        fitting = [family for family in families if len(family) == len(wanted) > 1]
        if len(fitting) == 1 and set(wanted) <= set(missing):
            for key, number in zip(wanted, sorted(fitting[0]), strict=True):
                found[key] = fitting[0][number], f"number {number}, in the order of the model's nodes: check that"
    return found


def _families(quantity: str, parts: Mapping[str, NameParts], places: Sequence[str]) -> list[dict[int, str]]:
    """Columns of one quantity that differ in their number alone, and name none of the places."""
    families: dict[tuple[str, ...], dict[int, str]] = {}
    for name, each in parts.items():
        numbers = [word for word in each.words if word.isdigit()]
        rest = tuple(word for word in each.words if not word.isdigit())
        of_quantity = QUANTITIES.get(quantity, frozenset()).intersection(rest) and not NOT_MEASURED.intersection(rest)
        if len(numbers) == 1 and of_quantity:
            families.setdefault(rest, {})[int(numbers[0])] = name
    spelled = {"".join(words_of(place)) for place in places}
    return [family for rest, family in families.items() if not any(place in "".join(rest) for place in spelled)]


def _by_being_alone(
    missing: Sequence[str], parts: Mapping[str, NameParts], places: Sequence[str]
) -> dict[str, tuple[str, str]]:
    """For a model of one node the one column of a quantity that names no other place."""
    if len(places) != 1:
        return {}
    elsewhere: Callable[[NameParts], bool] = lambda each: any(  # noqa: E731
        PLACES[place].intersection(each.words) for place in ("ambient", "battery", "pc", "base")
    )
    found = {}
    for key in missing:
        quantity, _, place = key.partition(".")
        if place != places[0]:
            continue
        fitting = [
            name
            for name, each in parts.items()
            if QUANTITIES.get(quantity, frozenset()).intersection(each.words)
            and not NOT_MEASURED.intersection(each.words)
            and not elsewhere(each)
        ]
        # Of opensourceleg's two the case's is measured.
        measured = [name for name in fitting if "winding" not in words_of(name)]
        chosen = fitting if len(fitting) == 1 else measured
        if len(chosen) == 1:
            found[key] = chosen[0], "the only one of its kind"
    return found
