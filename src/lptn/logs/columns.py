"""Columns of other people's logs: where a quantity stands, in which unit, how that is written, and what names say."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, NoReturn

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError, shown
from lptn.basics.units import registry

# --- Units that people write, turned into SI (temperatures into degC) -----------------------------

AMBIENT = "temperature.ambient"
START = "start"
"""In place of a temperature: that which all nodes have at the start of a log that begins at rest."""
HEATS = ("torque", "current")
INPUTS = (*HEATS, "velocity")
"""Quantities that drive a joint's heat."""
SI_UNITS = {
    "time": "s",
    "temperature": "degC",
    "torque": "N*m",
    **dict.fromkeys(("current", "current_abs"), "A"),
    **dict.fromkeys(("velocity", "velocity_rms"), "rad/s"),
    "speed": "m/s",
    **dict.fromkeys(("power", "mechanical_power"), "W"),
    "voltage": "V",
    "resistance": "ohm",
    "torque_abs": "N*m",
    "irradiance": "W/m^2",
    **dict.fromkeys(("powered", "fan"), "1"),
}
"""What each quantity is in; degC for temperatures."""


def column_unit(column: str) -> str:
    """The unit that a log column of lptn's has by its quantity, empty where the quantity has none."""
    return SI_UNITS.get(quantity_of(column), "")


# pint reads Nm as "number metre" and does not know rev; 1/s is rad/s to it, while of a shaft it means turns.
_SPELLINGS = {"Nm": "N*m", "mNm": "mN*m", "kNm": "kN*m", "rev/min": "turn/min", "rev/s": "turn/s"}
_TURNS = {"Hz": "turn/s", "1/min": "turn/min", "min^-1": "turn/min"}


def to_si(values: FloatArray, quantity: str, unit: str | None) -> FloatArray:
    """`values` in `unit` converted to the SI unit of `quantity`, degC for temperatures.

    No unit: unchanged. A quantity that is not in the list is converted to SI base units.
    """
    if unit is None:
        return values
    name = (_SPELLINGS | (_TURNS if quantity.startswith("velocity") else {})).get(unit, unit)
    if quantity in SI_UNITS and name == SI_UNITS[quantity]:  # the usual case, and pint takes half a second to begin
        return np.asarray(values, dtype=np.float64)
    measured = registry().Quantity(values, registry().parse_units(name))
    converted = measured.to(SI_UNITS[quantity]) if quantity in SI_UNITS else measured.to_base_units()
    return np.asarray(converted.magnitude, dtype=np.float64)


# --- Where a quantity stands in a log --------------------------------------------------------------

_KEY = re.compile(r"time|[A-Za-z_]\w*\.[^\s.*?{}\[\]]+")  # of one place: a column is not that of several


def is_key(name: str) -> bool:
    """Whether `name` is `time` or `<quantity>.<place>`."""
    return _KEY.fullmatch(name) is not None


def quantity_of(key: str) -> str:
    """What is measured, of `<quantity>.<place>`."""
    return key.partition(".")[0]


def place_of(key: str) -> str:
    """Where it is measured, of `<quantity>.<place>`."""
    return key.partition(".")[2]


Combined = Literal["norm", "product", "mean", "ratio"]
_LEAST_SHARE = 0.1
"""Of the largest current of a log: below it a measured resistance has over ten times the error that it has there."""


def _ratio(columns: Sequence[FloatArray]) -> FloatArray:
    """The first over the second, NaN where the second is too small to tell."""
    above, below = columns
    enough = np.abs(below) > _LEAST_SHARE * np.nanmax(np.abs(below), initial=0.0)
    return np.asarray(np.divide(above, below, out=np.full(below.shape, np.nan), where=enough))


_COMBINED: Mapping[str, Callable[[Sequence[FloatArray]], FloatArray]] = {
    "norm": lambda columns: np.sqrt(np.sum(np.square(columns), axis=0)),
    "product": lambda columns: np.prod(columns, axis=0),
    "mean": lambda columns: np.mean(columns, axis=0),  # where one is missing, the others' mean would be another one's
    "ratio": _ratio,
}


@dataclass(frozen=True)
class ColumnSource:
    """Where a quantity stands in a log: `scale * x + offset` in `unit`, x a column or made of several.

    Attributes:
        columns: names in the file; none of a time that is counted from the rows.
        unit: what `scale * x + offset` is in; None for SI (degC for temperatures).
        scale: factor on x.
        offset: added after scaling, in `unit`.
        how: several columns are one: the root of the sum of their squares, their product (voltage and current), their
            mean (two sensors on one housing), or the first over the second where that is above a tenth of its largest
            (a resistance: voltage over current).
        wrap: what a counter of few bits jumps by, 65536 for one of 16 bit; 0 for none. Times and temperatures begin
            with what they say; of all else the middle value is taken to lie between -wrap/2 and wrap/2.
        invalid: numbers in the file that stand for no reading, such as 850.
        valid: least and greatest number in the file that is a reading.
        afterwards: in `unit`, what holds behind the last reading: 0 where a log ends because all was switched off.
        hold: a value stands until the next one, as of what is logged on change, or once; rows before the first have it.
        value: what holds throughout, in place of a column; "start" for the temperature that all nodes have at first.
        rate: rows a second, of a log without a time column.
        rows: of `time`, over what the other columns of a row are means, one of `MEANS`, or `SAMPLES`; "" where nobody
            said, for samples.
    """

    columns: tuple[str, ...] = ()
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0
    how: Combined = "norm"
    wrap: float = 0.0
    invalid: tuple[float, ...] = ()
    valid: tuple[float, float] = (-math.inf, math.inf)
    rate: float = 0.0
    afterwards: float | None = None
    hold: bool = False
    value: float | Literal["start"] | None = None
    rows: str = ""

    @property
    def counted(self) -> str:
        """A note on a time that is counted from the rows; empty for others."""
        return f"time: counted from its rows, {self.rate:g} a second, as given." if self.rate else ""

    def parts(self) -> tuple[ColumnSource, ...]:
        """What a mean is taken of, each as a source of its own; this one itself of all else."""
        if self.how != "mean":
            return (self,)
        return tuple(replace(self, columns=(name,), how="norm") for name in self.columns)

    def values(self, key: str, raw: Mapping[str, FloatArray]) -> FloatArray:
        """The quantity `key` in SI (degC), (n,), from the file's columns `raw`, (n,) each; NaN where invalid."""
        if self.rate:  # of a log whose rows are its clock
            return np.arange(next(iter(raw.values())).size) / self.rate
        quantity = key.partition(".")[0]
        columns = [self._unwrapped(self._readings(raw[name]), quantity) for name in self.columns]
        x = columns[0]
        if len(columns) > 1:
            x = _COMBINED[self.how](columns)
        if self.scale != 1 or self.offset:  # a copy of millions of rows only where it says something else
            with np.errstate(over="ignore", invalid="ignore"):  # what it gives is refused
                x = self.scale * x + self.offset
        if self.afterwards is not None and (there := np.flatnonzero(np.isfinite(x))).size:
            x = np.where(np.arange(x.size) > there[-1], self.afterwards, x)
        return to_si(x, quantity, self.unit)

    def missing(self, raw: Mapping[str, FloatArray]) -> int:
        """How many numbers in the file `invalid` and `valid` take for no reading."""
        marked = replace(self, hold=False)
        return sum(int((np.isnan(marked._readings(raw[name])) & ~np.isnan(raw[name])).sum()) for name in self.columns)

    def _readings(self, x: FloatArray) -> FloatArray:
        if self.invalid or self.valid != ColumnSource.valid:
            x = np.where(np.isin(x, self.invalid) | (x < self.valid[0]) | (x > self.valid[1]), np.nan, x)
        there = np.isfinite(x)
        if self.hold and there.any() and not there.all():
            last = np.maximum.accumulate(np.where(there, np.arange(x.size), there.argmax()))
            x = x[last]
        return x

    def _unwrapped(self, x: FloatArray, quantity: str) -> FloatArray:
        finite = np.isfinite(x)
        if not self.wrap or not finite.any():
            return x
        whole = x.copy()
        whole[finite] = np.unwrap(x[finite], period=self.wrap)
        turns = 0.0 if quantity in ("time", "temperature") else np.round(np.median(whole[finite]) / self.wrap)
        return np.asarray(whole - turns * self.wrap)


# --- Where it stands, read: the `[columns]` table and the option `--map` ---------------------------

_OPTION = re.compile(r"(?P<key>[^=]+)=(?P<column>.*?)(?:\[(?P<unit>[^\[\]]*)\])?")
MEANS = {"means after": 0.0, "means around": 0.5, "means before": 1.0}
"""What a row may be the mean over, and the share of this interval that lies before the row's time."""
SAMPLES = "samples"
_COPPER = {"at": 25.0, "alpha": 0.0039}  # degC, 1/K: of a thermometer that says nothing else


def _is_finite(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _numbers(value: object) -> tuple[float, ...]:
    """A finite number, or those of a list of such numbers; of all else none."""
    listed = value if isinstance(value, Sequence) and not isinstance(value, str) else [value]
    return tuple(map(float, listed)) if all(map(_is_finite, listed)) else ()


def _are_names(value: object) -> bool:
    listed = value if isinstance(value, Sequence) and not isinstance(value, str) else ()
    return len(listed) > 1 and all(isinstance(name, str) and name for name in listed)


def _is_thermometer(value: object) -> bool:
    numbers = {**_COPPER, **value} if isinstance(value, Mapping) else {}
    known = numbers.keys() == {"resistance", "at", "alpha"} and all(map(_is_finite, numbers.values()))
    return known and numbers["resistance"] > 0 and numbers["alpha"] > 0


_PLACES = ("column", *_COMBINED, "rate", "value")
"""How an entry says where its values stand, of which it has one."""
_ENTRIES: Mapping[str, tuple[Callable[[Any], bool], str, Callable[[Any], Any]]] = {
    "column": (lambda x: isinstance(x, str) and x != "", "the name of a column", lambda x: (x,)),
    "norm": (_are_names, 'two or more column names, such as ["i_d", "i_q"]', tuple),
    "product": (_are_names, 'two or more column names, such as ["u_dc", "i_dc"]', tuple),
    "mean": (_are_names, 'two or more column names, such as ["T1", "T2"]', tuple),
    "ratio": (lambda x: _are_names(x) and len(x) == 2, 'two column names, such as ["u_dc", "i_dc"]', tuple),
    "rate": (lambda x: _is_finite(x) and x > 0, "the rows of the log a second, such as 50", float),
    "value": (lambda x: _is_finite(x) or x == START, f'a finite number, or "{START}"', lambda x: x),
    "unit": (lambda x: isinstance(x, str) and x.strip() != "", 'the name of a unit, such as "degC"', str.strip),
    "scale": (lambda x: _is_finite(x) and x != 0, "a finite number but 0", float),
    "offset": (_is_finite, "a finite number", float),
    "wrap": (lambda x: _is_finite(x) and x > 0, "a finite number above 0", float),
    "invalid": (lambda x: _numbers(x) != (), "numbers, such as [850, -127]", _numbers),
    "valid": (lambda x: len(n := _numbers(x)) == 2 and n[0] < n[1], "least and greatest, such as [-40, 200]", _numbers),
    "afterwards": (_is_finite, "a finite number", float),
    "hold": (lambda x: x in (True, False, "true", "false"), "true or false", lambda x: x in (True, "true")),
    "thermometer": (_is_thermometer, "{ resistance = 0.186, at = 25, alpha = 0.0039 }, above 0: ohm, degC, 1/K", dict),
    "rows": (lambda x: x in (*MEANS, SAMPLES), f"of time: one of {', '.join(map(shown, (*MEANS, SAMPLES)))}", str),
}
"""What an entry may say: whether its value can be used, what can, and how it is kept."""
_OF_KEYS = {  # settings of some quantities alone, and those that can't stand beside them
    "rate": (re.compile(r"time(\.2)?"), "time alone: time = { rate = 50 }", set(_ENTRIES) - {"rate", "rows"}),
    "rows": (re.compile("time"), _ENTRIES["rows"][1], set[str]()),
    "thermometer": (re.compile(r"temperature\..*"), "a temperature alone", {"unit", "scale", "offset"}),
    "value": (re.compile(r"(?!time).*"), "anything but the time", set(_ENTRIES) - {"value", "unit"}),
}


def parse_columns(table: Mapping[str, object], file: str | Path, place: str) -> dict[str, ColumnSource]:
    """Read a `[columns]` table.

    An entry is a name, `{ column = "T1" }`, `{ norm = ["i_d", "i_q"] }`, `{ product = ["u_dc", "i_dc"] }`,
    `{ mean = ["T1", "T2"] }` or `{ ratio = ["u_dc", "i_dc"] }`, with unit, scale, offset, wrap, invalid, valid,
    afterwards and hold; `{ value = 22 }` where no column says it; or, of `time`, `{ rate = 50 }`, and rows where these
    are means. With `thermometer = { resistance = 0.186, at = 25, alpha = 0.0039 }` a resistance [ohm] becomes the
    temperature at which a winding has it ([QuadrupedLPTN, eq. 6]). A key `temperature.ambient@monday` is for one
    log, or those that a glob means, and goes before the key without.

    Args:
        table: the table as it was read from TOML.
        file: the file that holds it.
        place: what the table is called there, such as `[columns]`.

    Raises:
        InputError: a key, name, unit or number that can't be used.
    """
    return {str(key): _source(str(key), entry, file, f"{place} {key}") for key, entry in table.items()}


def parse_map_option(text: str, option: str = "--map") -> tuple[str, ColumnSource]:
    """Read `temperature.a=T1`, `temperature.a=T1[degF]` or `temperature.a=T1[degC; invalid=850,-127]`.

    Behind the unit may stand scale, offset, wrap, invalid, valid, afterwards, hold=true, and of time rows. Without a
    column one of `mean=T1,T2`, `norm=…`, `product=…` stands there, or of time `rate=50`:
    `temperature.a=[degC; mean=T1,T2]`. A name that ends in a bracket is written with another one behind it: `T[x][]`.

    Raises:
        InputError: the text or its unit can't be used.
    """
    match = _OPTION.fullmatch(text.strip())
    if match is None:
        raise InputError(option, "its value", f"'{text}'", "<quantity>.<place>=COLUMN or …=COLUMN[UNIT]")
    entry: dict[str, object] = {}
    for number, setting in enumerate(word.strip() for word in (match["unit"] or "").split(";")):
        name, equals, value = (word.strip() for word in setting.partition("="))
        words = [word.strip() for word in value.split(",")]
        numbers = [float(word) if is_number(word) else word for word in words]
        if number == 0 and name and not equals:
            entry["unit"] = name
        elif name in _COMBINED:
            entry[name] = words
        elif setting:
            entry[name] = numbers if name in {"invalid", "valid"} else numbers[0] if len(numbers) == 1 else value
    column, key = match["column"].strip(), match["key"].strip()
    if column or entry.keys().isdisjoint(_PLACES):
        entry["column"] = column
    return key, _source(key, entry, option, key)


def is_number(text: str) -> bool:
    """Whether a text is a number as Python writes it."""
    try:
        float(text)
    except ValueError:
        return False
    return True


def _source(key: str, entry: object, file: str | Path, place: str) -> ColumnSource:
    """What an entry of `[columns]` says: a name, or a table."""
    if not is_key(key.partition("@")[0]):
        raise InputError(file, place, f"key '{key}'", "time or <quantity>.<place>, such as torque.FR_calf")
    said: Any = {"column": entry} if isinstance(entry, str) else entry
    if not isinstance(said, Mapping):
        raise InputError(file, place, shown(entry), 'a column\'s name or a table such as { column = "T1" }')
    how = _check(key.partition("@")[0], said, file, place)
    settings = {name: _ENTRIES[name][2](value) for name, value in said.items()}
    if winding := settings.pop("thermometer", None):  # R = R_0 (1 + α (T - T_0)), solved for T
        winding = {**_COPPER, **winding}
        settings["scale"] = 1 / (winding["alpha"] * winding["resistance"])
        settings["offset"] = winding["at"] - 1 / winding["alpha"]
    if how not in ("rate", "value"):
        settings["columns"] = settings.pop(how)
    if how in _COMBINED:
        settings["how"] = how
    quantity, wanted = quantity_of(key), "its quantity, such as V"
    if settings.get("value") == START and quantity != "temperature":
        raise InputError(file, f"{place} value", f'"{START}"', "a number; the start tells temperatures alone")
    if quantity in SI_UNITS:
        wanted = f"{quantity.partition('_')[0]}, such as {SI_UNITS[quantity]}"
    try:
        to_si(np.zeros(1), quantity, settings.get("unit"))
    except Exception as error:  # pint raises a dozen kinds of its own and Python's for a text that is no unit
        raise InputError(file, place, f"unit '{settings['unit']}'", f"a unit of {wanted}") from error
    return ColumnSource(**settings)


def _check(key: str, said: Mapping[str, Any], file: str | Path, place: str) -> str:
    """How an entry says where its values stand; settings that can't be used, or not for its quantity, are refused."""

    def refuse(problem: str, expected: str, name: str = "") -> NoReturn:
        raise InputError(file, f"{place} {name}".rstrip(), problem, expected)

    for name, value in said.items():
        if name not in _ENTRIES:
            refuse(f"key '{name}'", f"one of {', '.join(_ENTRIES)}")
        if not _ENTRIES[name][0](value):
            refuse(shown(value), _ENTRIES[name][1], name)
    places = [name for name in _PLACES if name in said]
    if len(places) != 1:
        problem = f"both {places[0]} and {places[1]}" if places else "neither column nor norm, product, mean or ratio"
        refuse(problem, 'one of them: column = "T1" or mean = ["T1", "T2"]')
    for name in said.keys() & _OF_KEYS.keys():
        keys, expected, others = _OF_KEYS[name]
        if not keys.fullmatch(key):
            refuse(shown(said[name]), f"{name} of {expected}", name)
        if beside := sorted(others & said.keys()):
            refuse(f"{beside[0]} beside {name}", "one of the two")
    return places[0]


# --- Where it stands, written: the line that a user pastes into `[columns]`, or an option `--map` ---


def toml_line(key: str, source: ColumnSource) -> str:
    """A line of `[columns]`, such as `"temperature.a" = { column = "T1", unit = "degF" }`."""
    entry = {word: _written(value, toml=True) for word, value in _as_entry(source).items()}
    inside = ", ".join(f"{word} = {value}" for word, value in entry.items())
    name = key if key == "time" else _written(key, toml=True)
    return f"{name} = {entry['column'] if entry.keys() == {'column'} else f'{{ {inside} }}'}"


def map_option(key: str, source: ColumnSource) -> str:
    """An option such as `--map "temperature.a=T1[degF]"`; '' for columns of several whose names have a comma."""
    if len(source.columns) > 1 and any(mark in name for name in source.columns for mark in ",;[]"):
        return ""
    entry = {word: _written(value) for word, value in _as_entry(source).items()}
    column, unit = entry.pop("column", ""), entry.pop("unit", "")
    inside = "; ".join([*filter(None, [unit]), *(f"{word}={value}" for word, value in entry.items())])
    bracket = f"[{inside}]" if inside or column.endswith("]") else ""
    return f'--map "{key}={column}{bracket}"'


def _written(value: Any, *, toml: bool = False) -> str:
    """What an entry says, as TOML has it or, by default, as `--map` has it."""
    if isinstance(value, tuple):
        listed = (", " if toml else ",").join(_written(one, toml=toml) for one in value)
        return f"[{listed}]" if toml else listed
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False) if toml else value
    return "true" if value is True else f"{value:.12g}"


def as_line_or_option(key: str, source: ColumnSource) -> str:
    """Both, for a message of one line."""
    option = map_option(key, source)
    return f"{toml_line(key, source)} in [columns]" + (f", or {option}" if option else "")


def _as_entry(source: ColumnSource) -> dict[str, Any]:
    """A source as an entry of `[columns]`, without what it has by default."""
    place: tuple[str, Any] = ("rate", source.rate) if source.value is None else ("value", source.value)
    if source.columns:
        place = ("column", source.columns[0]) if len(source.columns) == 1 else (source.how, source.columns)
    names = ("unit", "rows", "scale", "offset", "wrap", "invalid", "valid", "afterwards", "hold")
    said = {name: getattr(source, name) for name in names}
    return dict([place]) | {name: x for name, x in said.items() if x not in ("", getattr(ColumnSource, name))}


# --- What a column's name says: its words, and the unit that it ends in ----------------------------

UNITS: Mapping[str, Mapping[str, str]] = {
    "time": {
        "s": "s", "sec": "s", "secs": "s", "seconds": "s", "ms": "ms", "msec": "ms", "millis": "ms",
        "milliseconds": "ms", "us": "us", "usec": "us", "micros": "us", "microseconds": "us", "µ s": "us", "ns": "ns",
        "nsec": "ns", "nanos": "ns", "nanoseconds": "ns", "min": "min", "minutes": "min",
        "h": "h", "hours": "h", "d": "d", "days": "d",
    },
    "temperature": {
        "c": "degC", "degc": "degC", "deg c": "degC", "° c": "degC", "celsius": "degC", "f": "degF", "degf": "degF",
        "deg f": "degF", "° f": "degF", "fahrenheit": "degF", "k": "K", "degk": "K", "kelvin": "K",
    },
    "torque": {
        "nm": "N*m", "n m": "N*m", "mnm": "mN*m", "m nm": "mN*m", "m n m": "mN*m", "ncm": "N*cm", "knm": "kN*m",
    },
    "current": {"a": "A", "amp": "A", "amps": "A", "ampere": "A", "ma": "mA", "m a": "mA", "milliamps": "mA"},
    "velocity": {
        "rad s": "rad/s", "rads": "rad/s", "radps": "rad/s", "rpm": "rpm", "1 min": "rpm", "deg s": "deg/s",
        "degps": "deg/s", "dps": "deg/s", "rps": "turn/s", "rev s": "turn/s",
    },
    "speed": {"m s": "m/s", "mps": "m/s", "ms": "m/s", "km h": "km/h", "kmh": "km/h", "kph": "km/h", "mm s": "mm/s"},
    "power": {"w": "W", "watt": "W", "watts": "W", "mw": "mW", "m w": "mW", "kw": "kW", "k w": "kW"},
}  # fmt: skip
"""What names end in, by quantity, in lower case with words apart, and the unit that it means."""

_BRACKETED = re.compile(r"[\[(]\s*([^\[\]()]+?)\s*[\])]\s*$")
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+|°|µ|%|[^\W\d_a-zA-Zµ²³]+")  # at last letters of any script
_OTHER_UNITS = frozenset(("%", "v", "mv", "hz", "w m", "deg", "rad", "h", "pa", "bar", "n", "m", "mm", "kg", "j"))
"""Units, written in the same way, of what no model asks for."""


def is_unit(cell: str) -> bool:
    """Whether a cell below a name is the unit of what stands there; a dash or nothing says that it has none."""
    text = cell.strip()
    if len(text) > 2 and text[0] + text[-1] in {"[]", "()"}:
        return True
    words = " ".join(words_of(text))
    if not words:
        return not any(map(str.isalpha, text))
    return words in _OTHER_UNITS or any(words in endings for endings in UNITS.values())


def spelled_words(name: str) -> list[str]:
    """The words of a name, letters and digits apart: `FR_calfTemp2` is FR, calf, Temp, 2."""
    return _WORD.findall(name)


def words_of(name: str) -> tuple[str, ...]:
    """The words of a name in lower case."""
    return tuple(word.lower() for word in spelled_words(name))


ELSEWHERE = frozenset(
    words_of("baro barometer imu gyro accel accelerometer mag magnetometer cpu gpu soc core mcu fpga ssd disk camera")
    + words_of("lidar gps radio airspeed charger")
)
"""Words for what is no joint and no battery, and has a thermometer of its own."""
_WITH_HEAT = ELSEWHERE.union(words_of("pc computer onboard battery batt bat board controller inverter fet"))


def has_own_heat(place: str) -> bool:
    """Whether a place is called something that is warm by heat of its own, as a computer or a battery is."""
    return not _WITH_HEAT.isdisjoint(words_of(place))


@dataclass(frozen=True)
class ColumnName:
    """A column's name taken apart.

    Attributes:
        words: as of `words_of`.
        bracket: what stands in a bracket at the end, such as a unit or an index; '' if nothing does.
    """

    words: tuple[str, ...]
    bracket: str

    @classmethod
    def of(cls, name: str, unit: str = "") -> ColumnName:
        """A name taken apart, or with what a row of units says of it; no unit in a bracket are words of the name."""
        if unit:
            return cls(words_of(name), unit)
        match = _BRACKETED.search(name)
        if match is None:
            return cls(words_of(name), "")
        before, inside = name[: match.start()], match[1]
        words = words_of(inside)
        is_unit = not inside.isdigit() and any(" ".join(words) in endings for endings in UNITS.values())
        return cls((*words_of(before), *(() if is_unit else words)), inside)

    def unit(self, quantity: str) -> str:
        """The unit that the name ends in, or has in a bracket; '' where it has none that `quantity` could have."""
        endings = UNITS.get(quantity, {})
        if (inside := " ".join(words_of(self.bracket))) in endings:
            return endings[inside]
        for count in (3, 2, 1):
            ending = " ".join(self.words[-count:])
            # A letter alone is a unit only behind something that it is the unit of.
            if len(self.words) > count and ending in endings:
                return endings[ending]
        return ""
