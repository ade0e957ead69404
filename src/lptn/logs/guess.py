"""Which of other people's columns may be meant: proposed from their names and values, never taken without a word.

For each quantity that a model needs and a log seems to lack, `guess` looks for a column whose name says the place and
the quantity. Where names say less it looks, in this order, at their last words (in a model of one leg), at their
numbers (as many as there are nodes, or driven ones), for the only column of its kind (in a model of one node), and at
what is logged of the joint (for a part of it). Each column is proposed but once, unless a joint is several nodes: how
it moves and what it bears is that of all of them. Speeds, which a model may do without but not the search for what it
lacks, are looked for too.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lptn.basics.errors import InputError
from lptn.logs.channels import Channels
from lptn.logs.columns import (
    AMBIENT,
    ELSEWHERE,
    HEATS,
    UNITS,
    ColumnName,
    ColumnSource,
    map_option,
    place_of,
    quantity_of,
    spelled_words,
    toml_line,
    words_of,
)
from lptn.logs.law import exchanged
from lptn.logs.resampling import raw_keys
from lptn.logs.tables import Table, column_sources
from lptn.logs.units import suspect_unit

_NUMBERED = "number "  # how it begins what speaks for a column of which nothing but a number says whose it is
_MOVES = ("velocity", "speed")
Names = Mapping[str, ColumnName]  # the columns that are left to propose, by their names
Choice = dict[str, tuple[str, str]]  # by quantity the column that may hold it, and what speaks for it


@dataclass(frozen=True)
class Guess:
    """A column that may hold a quantity, its unit, and why: what speaks for it."""

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
    """The raw columns that a model needs, or predicts, and that the log does not seem to hold, in order."""
    there = _logged(table, column_sources(table, columns))
    wanted = ["time", *(key for column in (*inputs, *outputs) for key in raw_keys(column, there))]
    return [key for key in dict.fromkeys(wanted) if key not in there and key not in columns]


def _logged(table: Table, sources: Mapping[str, ColumnSource]) -> dict[str, ColumnSource]:
    """The quantities of which the log has every column, and where."""
    return {key: source for key, source in sources.items() if set(source.columns) <= set(table.names)}


def guess(
    table: Table,
    columns: Mapping[str, ColumnSource],
    inputs: Collection[str],
    outputs: Collection[str],
    optional: Collection[str] = (),
) -> list[Guess]:
    """A column for each quantity that is missing and that a column's name or place in a row of them points to.

    Args:
        table: the log.
        columns: the mapping that there is.
        inputs: `<feature>.<place>` columns that the model is driven by.
        outputs: temperature columns that the model predicts.
        optional: `<feature>.<place>` columns that effects could use; of these the speeds of joints and base count.
    """
    missing, sources = missing_keys(table, columns, inputs, outputs), column_sources(table, columns)
    wanted = {"time", *(key for column in (*inputs, *outputs) for key in raw_keys(column, sources)), *columns}
    taken = {name for key, source in sources.items() if key in wanted for name in source.columns}
    names = {n: ColumnName.of(n) for n, times in Counter(table.names).items() if n not in taken and times == 1}
    places = [place_of(key) for key in (*outputs, *inputs) if key.startswith("temperature.")]
    places = [place for place in dict.fromkeys(places) if place != "ambient"]
    drives = {key for column in inputs for key in raw_keys(column)}
    driven = [place for place in places if any(f"{quantity}.{place}" in drives for quantity in HEATS)]
    moves = {f"{quantity}.{place}" for quantity in _MOVES for place in (*driven, "base")}
    missing += [key for key in missing_keys(table, columns, optional, ()) if key in moves.difference(missing)]
    choice = _time(names) if "time" in missing else {}
    for method, among in (
        (_by_place, places),
        (_by_last_word, places),
        (_by_number, places),
        (_by_number, driven),
        (_by_being_alone, places),
    ):
        rest, chosen = [key for key in missing if key not in {*choice, "time"}], {name for name, _ in choice.values()}
        choice |= method(rest, {name: parts for name, parts in names.items() if name not in chosen}, among)
    there = _logged(table, sources)
    sensors = {key: source for key, source in there.items() if key.startswith("temperature.")}
    asked = [*(column for column, _ in choice.values()), *(name for x in sensors.values() for name in x.columns)]
    numbers = table.some_numbers(asked if choice else ())
    known = {key: x.values(key, numbers) for key, x in sensors.items() if set(x.columns) <= numbers.keys()}
    guesses, of_opensourceleg = list[Guess](), _of_opensourceleg(table)
    for key in (key for key in missing if key in choice):
        (column, why), source = choice[key], ColumnSource((choice[key][0],))
        values = numbers.get(column, np.empty(0))
        if not np.isfinite(values).any():
            continue
        if unit := ColumnName.of(column, table.units.get(column, "")).unit(quantity_of(key)):
            source, why = replace(source, unit=unit), f"{why}, unit and all"
        elif key.startswith("current.") and of_opensourceleg:
            source, why = replace(source, unit="mA"), f"{why}; opensourceleg logs mA"
        else:
            told = Channels(known | {"time": values, key: values}, {key: source}, numbers, table.units)
            for issue in suspect_unit(told, key)[:1]:
                source, why = issue.corrected or source, f"{why}; {issue.problem}"
        guesses.append(Guess(key, source, why))
    of_joints = {key: _of_its_joint(key, places) for key in missing if key not in choice}
    return guesses + [Guess(k, sources[of], f"that of {place_of(of)}") for k, of in of_joints.items() if of in there]


def format_note(table: Table) -> str:
    """What the columns' names say of the program that wrote a log, a sentence; '' where they say nothing."""
    if not _of_opensourceleg(table):
        return ""
    text = "log: columns as opensourceleg logs them: motor current in mA, temperatures in degC"
    if any({"winding", "temperature"} <= set(words_of(name)) for name in table.names):
        text += "; its winding temperature is its own estimate from the current, not a measurement"
    return f"{text}."


def _of_opensourceleg(table: Table) -> bool:
    words = [set(words_of(name)) for name in table.names]
    return all(any(both <= own for own in words) for both in ({"case", "temperature"}, {"motor", "current"}))


def joints_in(table: Table) -> tuple[str, list[str], list[Guess]]:
    """The joints that a log's columns name, each by what is left of its temperature's name, and where all is of them.

    A joint has a temperature and a load: torques or currents, whichever more of them have.

    Returns:
        the load's quantity, the joints in the order of their columns, and what `guess` finds of their temperatures,
        loads and speeds, the time and the air; what stands under its own name is not guessed.

    Raises:
        InputError: no joint.
    """
    sources = column_sources(table, {})

    def named(quantity: str) -> dict[str, None]:
        own = [place_of(key) for key in sources if quantity_of(key) == quantity]
        own += [_place_named(name, table.units.get(name, ""), quantity) for name in table.names if name not in sources]
        return dict.fromkeys(place for place in own if place not in ("", "ambient"))

    warm, loads = named("temperature"), {load: named(load) for load in HEATS}
    both = {load: [place for place in warm if place in loads[load]] for load in HEATS}
    load = max(HEATS, key=lambda load: (len(both[load]), len(loads[load])))
    joints = both[load] or list(warm)
    inputs = [AMBIENT, *(f"{load}.{joint}" for joint in joints)]
    moves = ["speed.base", *(f"velocity.{joint}" for joint in joints)]
    guesses = guess(table, {}, inputs, [f"temperature.{joint}" for joint in joints], moves) if joints else []
    there = sources.keys() | {one.key for one in guesses}
    joints = [joint for joint in joints if {f"{load}.{joint}", f"temperature.{joint}"} <= there]
    if not joints:
        expected = "a temperature and a torque or current of each joint, such as knee_temp and knee_current"
        raise InputError(table.path, "columns", f"no joint in: {table.listing}", expected)
    known = {*joints, "base", "ambient", ""}
    return load, joints, [one for one in guesses if place_of(one.key) in known]


_ALONE = "motor"  # what a joint is called whose column says nothing but its quantity


def _place_named(name: str, unit: str, quantity: str) -> str:
    """Where a column of a quantity is measured, as its name spells it: all other words; '' of another quantity."""
    words = ColumnName.of(name, unit).words
    strange = ELSEWHERE.union(_PLACES["ambient"])
    if (
        len(words) > _MOST_WORDS
        or not _measures(quantity, words)
        or not strange.isdisjoint(words)
        or name_of_time([name])
    ):
        return ""
    idle = {*_QUANTITIES[quantity], *_NEUTRAL, *_DEVICES, *_PARTS, *UNITS.get(quantity, ())}
    rest = [word for word in spelled_words(name) if word.lower() not in idle and word.isalnum()]
    if rest and all(word.isdigit() for word in rest):
        rest = ["joint", *rest]
    return "".join(word if word.isdigit() else f"_{word}" for word in rest).strip("_") or _ALONE


# --- What words in a column's name say -------------------------------------------------------------


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


_QUANTITIES: Mapping[str, frozenset[str]] = {
    "time": _set("time t timestamp stamp ts clock elapsed"),
    "temperature": _set("temperature temperatures temp temps tmp t thermistor ntc pt therm thermocouple"),
    "torque": _set("torque torques tau effort trq tq moment"),
    "current": _set("current currents i cur curr iq amps amp"),
    "velocity": _set("velocity velocities vel omega speed dq qd qdot rpm erpm w"),
    "speed": _set("speed velocity vel v vx"),
    "power": _set("power watt watts p"),
    "powered": _set("powered enabled enable"),
    "fan": _set("fan duty"),
    "irradiance": _set("irradiance sun solar"),
}
"""Words that say which quantity a column holds."""
_PLACES: Mapping[str, frozenset[str]] = {
    "ambient": _set("ambient amb room air env environment lab surroundings"),
    "base": _set("base body trunk robot com"),
    "battery": _set("battery batt bat"),
    "pc": _set("pc computer cpu onboard"),
    "winding": _set("winding windings coil copper"),
    "housing": _set("housing case casing body shell"),
    "calf": _set("calf knee shank"),
}
"""Words that say which place, where it is not called by its own name."""
_PARTS = _PLACES["winding"] | _PLACES["housing"] | _set("stator rotor gearbox gear gears driver board")
"""Words that say which part of a joint."""
_NOT_MEASURED = _set(
    "cmd command commanded des desired target ref reference goal limit max min set setpoint error err status flag "
    "count fault warning id mode"
)
"""Words of columns that hold what was wanted, or something about a quantity, and not the quantity."""
_NEUTRAL = _set("joint joints motor actuator leg sensor measured state states q est deg")
"""Words that say nothing of place or quantity."""
_DEVICES = _set(
    "lowstate status data value values msg esc drive drives axis servo vesc odrive moteus actpack bldc output"
)
"""Words for a robot's motors and their messages, which say nothing more."""
_MOST_WORDS = 24  # of a name; a line of a million characters is none
_SHORT = 2  # letters: a word such as t, i or vx may stand for anything


def _words_besides(name: ColumnName, quantity: str, spellings: set[str]) -> int | None:
    """How many words a name has besides place, quantity and unit; `None` where it lacks one or is no measurement."""
    words = list(name.words)
    if len(words) > _MOST_WORDS or _NOT_MEASURED.intersection(words):
        return None
    joined = "".join(words)
    if not any(spelling in joined for spelling in spellings):  # most of many thousand names
        return None
    ends = [(i, j) for i in range(len(words)) for j in range(i + 1, len(words) + 1)]
    i, j = max(
        ((i, j) for i, j in ends if "".join(words[i:j]) in spellings), key=lambda at: at[1] - at[0], default=(0, 0)
    )
    rest = words[:i] + words[j:]
    if i == j:
        return None
    if quantity == "temperature" and spellings >= _PLACES["ambient"] and set(rest) <= _NEUTRAL:
        return len(rest)  # a room has nothing else that is logged
    own = _QUANTITIES.get(quantity, frozenset())
    unit_says_it = name.unit(quantity) and 0 < len(rest) <= 2
    if not unit_says_it and not any(word in (own or {quantity}) for word in rest):
        return None
    others = {w for other, words in _QUANTITIES.items() if other != quantity for w in words if len(w) > _SHORT}
    if not own.intersection(rest) and others.intersection(rest):
        return None
    return sum(word not in _NEUTRAL and word not in own for word in rest)


def _measures(quantity: str, words: Sequence[str]) -> bool:
    """Whether words of a name are of the quantity, and of a reading of it."""
    return not _QUANTITIES.get(quantity, frozenset()).isdisjoint(words) and _NOT_MEASURED.isdisjoint(words)


# --- The ways in which a column may be meant -------------------------------------------------------


def name_of_time(columns: Iterable[str]) -> str | None:
    """The first of some columns whose name, behind its last point, says time, perhaps with a unit, and nothing else.

    A t may be a time's, a T is a temperature's.
    """
    for column in columns:
        own = column.rpartition(".")[2]
        name = ColumnName.of(own)
        is_temperature = "t" in name.words and "t" not in own
        if _besides_time(name.words, name) == 0 and not is_temperature:
            return column
    return None


def _besides_time(words: Sequence[str], name: ColumnName) -> int | None:
    """How many words there are besides one for time, at their begin or end, and a unit of it; `None` without one."""
    for_time, unit = [word for word in words if word in _QUANTITIES["time"]], bool(name.unit("time"))
    if not for_time or not (words[0] in for_time or words[-1] in for_time or unit):
        return None
    return max(len(words) - len(for_time) - unit, 0)


def _time(names: Names) -> Choice:
    """The column whose name says time with the fewest words besides; a t alone may be a temperature's."""
    ranked: list[tuple[int, int, str]] = []
    for column, name in names.items():
        words = [word for word in name.words if word not in _NOT_MEASURED]
        if (count := _besides_time(words, name)) is not None:
            only_t = {word for word in words if word in _QUANTITIES["time"]} == {"t"}
            if not only_t or "t" in spelled_words(column):  # a T is a temperature's
                ranked.append((count + only_t, len(ranked), column))
    return {"time": (min(ranked)[2], "its name")} if ranked else {}


def _by_place(
    missing: Sequence[str], names: Names, places: Sequence[str], spelled: Mapping[str, set[str]] | None = None
) -> Choice:
    """The column that names the place and the quantity with the fewest words besides, if no other has as few.

    Places are `spelled` as they are called, and as people call them.
    """
    if spelled is None:
        of_all = (*map(place_of, missing), *places)
        spelled = {place: {"".join(words_of(place)), *_PLACES.get(place, ())} for place in of_all}
    choice: Choice = {}
    for key in (key for key in missing if place_of(key) in spelled):
        quantity, mine = quantity_of(key), spelled[place_of(key)]
        # `FR_calf_upper` is another place where the model has one of that name.
        others = (spelled[place] for place in places if place in spelled)
        longer = [own for own in others if own != mine and len(min(own)) > len(min(mine))]
        ranked = sorted(
            (besides, column)
            for column, name in names.items()
            if (besides := _words_besides(name, quantity, mine)) is not None
            and all(_words_besides(name, quantity, other) is None for other in longer)
        )
        if ranked and (len(ranked) == 1 or ranked[0][0] < ranked[1][0]):
            choice[key] = ranked[0][1], "its name"
    return choice


def _by_last_word(missing: Sequence[str], names: Names, places: Sequence[str]) -> Choice:
    """`hip temp` for FR_hip, in a model of one leg: names of a last word alone, if there is one for each node."""
    last = {place: "".join(words_of(place)[-1:]) for place in places}  # of a name such as "/" nothing
    if not 1 < len(places) == len(set(last.values())) or list(last.values()) == places:
        return {}
    ends = _by_place(missing, names, places, {place: {word, *_PLACES.get(word, ())} for place, word in last.items()})
    whole = {q for q in map(quantity_of, ends) if all(f"{q}.{place}" in ends for place in places)}
    why = "the end of its name: check that"
    return {key: (column, why) for key, (column, _) in ends.items() if quantity_of(key) in whole}


def _of_its_joint(key: str, places: Sequence[str]) -> str:
    """For `velocity.L_hip_case` that of `L_hip`, where both are nodes: a joint turns as one, and bears one load."""
    words = words_of(place_of(key))
    for joint in places if quantity_of(key) in (*HEATS, *_MOVES) else ():
        own = words_of(joint)
        # Its name is the joint's and that of one of its parts; `L_hip_pitch` is another joint.
        if words[: len(own)] == own and " ".join(words[len(own) :]) in _PARTS:
            return f"{quantity_of(key)}.{joint}"
    return ""


def _by_number(missing: Sequence[str], names: Names, places: Sequence[str]) -> Choice:
    """Numbered columns, `motor_temperature[3]`, taken in the order of the model's nodes if there are as many."""
    choice: Choice = {}
    spelled = {"".join(words_of(place)) for place in places}
    for quantity in dict.fromkeys(map(quantity_of, missing)):
        wanted = [f"{quantity}.{place}" for place in places]
        rows: dict[tuple[str, ...], dict[int, str]] = {}  # columns that differ in their number alone
        for column, name in names.items():
            numbers = [word for word in name.words if word.isdigit()]
            rest = tuple(word for word in name.words if not word.isdigit())
            if len(numbers) == 1 and _measures(quantity, rest) and ELSEWHERE.isdisjoint(rest):
                rows.setdefault(rest, {})[int(numbers[0])] = column
        unnamed = [row for rest, row in rows.items() if not any(place in "".join(rest) for place in spelled)]
        families = [row for row in unnamed if len(row) == len(wanted) > 1]
        if len(families) == 1 and set(wanted) <= set(missing):
            for key, (number, column) in zip(wanted, sorted(families[0].items()), strict=True):
                choice[key] = column, f"{_NUMBERED}{number}, in the order of the model's nodes: check that"
    return choice


def _by_being_alone(missing: Sequence[str], names: Names, places: Sequence[str]) -> Choice:
    """For a model of one node the one column of a quantity that names no other place, and nothing that nobody knows."""
    elsewhere = frozenset[str]().union(*(_PLACES[place] for place in ("ambient", "battery", "pc", "base")))
    choice: Choice = {}
    for key in missing if len(places) == 1 else ():
        quantity = quantity_of(key)
        known = {*_QUANTITIES.get(quantity, ()), *_NEUTRAL, *_DEVICES, *_PARTS} - elsewhere
        fitting = []
        for column, name in names.items():
            units = (k for k in (1, 2, 3) if ColumnName(("", *name.words[-k:]), "").unit(quantity))
            words = name.words[: -next(units)] if name.unit(quantity) and not name.bracket else name.words
            if _measures(quantity, name.words) and all(word.isdigit() or word in known for word in words):
                fitting.append(column)
        if len(fitting) > 1:  # of opensourceleg's two temperatures the case's is measured
            fitting = [column for column in fitting if "winding" not in words_of(column)]
        if len(fitting) == 1 and place_of(key) == places[0]:
            choice[key] = fitting[0], "the only one of its kind"
    return choice


# --- Whether the data contradict an order that was guessed ---------------------------------------------


def refuse_exchanged(
    path: Path, guesses: Collection[Guess], sources: Mapping[str, ColumnSource], log: Channels
) -> None:
    """Refuse numbered guesses by which temperatures follow other joints' torques clearly better than their own.

    Raises:
        InputError: they do; it has the lines by which each would follow its own.
    """
    numbered = {guess.key for guess in guesses if guess.why.startswith(_NUMBERED)}
    for quantity in HEATS if numbered else ():
        followed, gain = exchanged(log, quantity)
        moved = [place for place, of in followed.items() if place != of]
        if numbered.isdisjoint(f"{name}.{place}" for place in moved for name in (quantity, "temperature")):
            continue
        if any(f"{quantity}.{place}" in numbered for place in moved):
            lines = {f"{quantity}.{place}": f"{quantity}.{of}" for place, of in followed.items()}
        else:
            lines = {f"temperature.{of}": f"temperature.{place}" for place, of in followed.items()}
        problem = f"numbered columns by which {len(moved)} temperatures follow the {quantity} of another joint better "
        problem += f"than that of their own (squared error × {np.exp(-gain):.2g})"
        written = "; ".join(toml_line(key, sources[of]) for key, of in lines.items())
        raise InputError(path, "guess", problem, f"lines under [columns] that say whose they are, perhaps {written}")
