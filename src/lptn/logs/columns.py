"""Columns of other people's logs: where a quantity stands, in which unit, how that is written, and what names say."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal, NoReturn

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError, shown
from lptn.basics.units import registry

# --- Units that people write, turned into SI (temperatures into degC) -----------------------------


_SI = {  # of a quantity, and what a unit of it is called in a message
    "time": ("s", "time, such as s"),
    "temperature": ("degC", "temperature, such as degC"),
    "torque": ("N*m", "torque, such as N*m"),
    "current": ("A", "current, such as A"),
    "current_abs": ("A", "current, such as A"),
    "velocity": ("rad/s", "angular velocity, such as rad/s"),
    "velocity_rms": ("rad/s", "angular velocity, such as rad/s"),
    "speed": ("m/s", "speed, such as m/s"),
    "power": ("W", "power, such as W"),
    "mechanical_power": ("W", "power, such as W"),
    "voltage": ("V", "voltage, such as V"),
    "resistance": ("ohm", "resistance, such as ohm"),
}

_NEVER_CONVERTED = {"torque_abs": "N*m", "powered": "1", "fan": "1", "irradiance": "W/m^2"}


def column_unit(column: str) -> str:
    """The unit that a log column of lptn's has by its quantity, empty where the quantity has none."""
    quantity = column.partition(".")[0]
    return _SI[quantity][0] if quantity in _SI else _NEVER_CONVERTED.get(quantity, "")


# pint reads Nm as "number metre" and does not know rev.
_SPELLINGS = {"Nm": "N*m", "mNm": "mN*m", "kNm": "kN*m", "rev/min": "turn/min", "rev/s": "turn/s"}

# To pint these are 1/s, that is rad/s; of a shaft they mean turns, a factor 2 pi apart.
_TURNS = {"Hz": "turn/s", "1/min": "turn/min", "min^-1": "turn/min"}


def to_si(values: FloatArray, quantity: str, unit: str | None) -> FloatArray:
    """`values` in `unit` converted to the SI unit of `quantity`, degC for temperatures.

    No unit: unchanged. A quantity that is not in the list is converted to SI base units.
    """
    if unit is None:
        return values
    name = _SPELLINGS.get(unit, unit)
    if quantity.startswith("velocity"):
        name = _TURNS.get(unit, name)
    if quantity in _SI and name == _SI[quantity][0]:  # the usual case, and pint takes half a second to begin
        return np.asarray(values, dtype=np.float64)
    measured = registry().Quantity(values, registry().parse_units(name))
    converted = measured.to(_SI[quantity][0]) if quantity in _SI else measured.to_base_units()
    return np.asarray(converted.magnitude, dtype=np.float64)


# --- Where a quantity stands in a log --------------------------------------------------------------


_KEY = re.compile(r"time|[A-Za-z_]\w*\.[^\s.]+")


def is_key(name: str) -> bool:
    """Whether `name` is `time` or `<quantity>.<place>`."""
    return _KEY.fullmatch(name) is not None


Combined = Literal["norm", "product", "mean", "ratio"]
_COMBINED: Mapping[Combined, Callable[[Sequence[FloatArray]], FloatArray]] = {
    "norm": lambda columns: np.sqrt(np.sum(np.square(columns), axis=0)),
    "product": lambda columns: np.prod(columns, axis=0),
    "mean": lambda columns: np.mean(columns, axis=0),  # where one is missing, the others' mean would be another one's
    "ratio": lambda columns: _ratio(*columns),
}
_LEAST_SHARE = 0.1
"""Of the largest current of a log: below it a measured resistance has over ten times the error that it has there."""


def _ratio(above: FloatArray, below: FloatArray) -> FloatArray:
    """The first over the second, NaN where the second is too small to tell."""
    size = np.abs(below)
    enough = size > _LEAST_SHARE * np.nanmax(size, initial=0.0)
    return np.asarray(np.divide(above, below, out=np.full(below.shape, np.nan), where=enough))


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
        rate: rows a second, of a log without a time column.
        rows: of `time`, over what the other columns of a row are means, one of `MEANS`, or `SAMPLES`; "" where nobody
            said, for samples.
    """

    columns: tuple[str, ...]
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0
    how: Combined = "norm"
    wrap: float = 0.0
    invalid: tuple[float, ...] = ()
    valid: tuple[float, float] = (-math.inf, math.inf)
    rate: float = 0.0
    afterwards: float | None = None
    rows: str = ""

    def parts(self) -> tuple[ColumnSource, ...]:
        """What a mean is taken of, each as a source of its own; this one itself of all else."""
        if self.how != "mean":
            return (self,)
        return tuple(replace(self, columns=(name,), how="norm") for name in self.columns)

    def values(self, key: str, raw: Mapping[str, FloatArray]) -> FloatArray:
        """The quantity `key` in SI (degC), (n,), from the file's columns `raw`, (n,) each; NaN where invalid."""
        quantity = key.partition(".")[0]
        columns = [self._unwrapped(self._readings(raw[name]), quantity) for name in self.columns]
        x = columns[0]
        if len(columns) > 1:
            x = _COMBINED[self.how](columns)
        if self.scale != 1 or self.offset:  # a copy of millions of rows only where it says something else
            x = self.scale * x + self.offset
        if self.afterwards is not None and (there := np.flatnonzero(np.isfinite(x))).size:
            x = np.where(np.arange(x.size) > there[-1], self.afterwards, x)
        return to_si(x, quantity, self.unit)

    def missing(self, raw: Mapping[str, FloatArray]) -> int:
        """How many numbers in the file `invalid` and `valid` take for no reading."""
        return sum(int((np.isnan(self._readings(raw[name])) & ~np.isnan(raw[name])).sum()) for name in self.columns)

    def _readings(self, x: FloatArray) -> FloatArray:
        low, high = self.valid
        if not self.invalid and (low, high) == (-math.inf, math.inf):
            return x
        return np.where(np.isin(x, self.invalid) | (x < low) | (x > high), np.nan, x)

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
_COLUMN_ENTRIES = ("column", "norm", "product", "mean", "ratio", "rate")  # of which an entry has one
_SETTINGS = ("unit", "scale", "offset", "wrap", "invalid", "valid", "afterwards", "thermometer", "rows")
_ENTRIES = (*_COLUMN_ENTRIES, *_SETTINGS)
_EXAMPLES = {
    "norm": '["i_d", "i_q"]',
    "product": '["u_dc", "i_dc"]',
    "mean": '["T1", "T2"]',
    "ratio": '["u_dc", "i_dc"]',
}
MEANS = {"means after": 0.0, "means around": 0.5, "means before": 1.0}
"""What a row may be the mean over, and the share of this interval that lies before the row's time."""
SAMPLES = "samples"
_THERMOMETER = "{ resistance = 0.186, at = 25, alpha = 0.0039 }: ohm, degC, 1/K"


def parse_columns(table: Mapping[str, object], file: str | Path, place: str) -> dict[str, ColumnSource]:
    """Read a `[columns]` table.

    An entry is a name, `{ column = "T1" }`, `{ norm = ["i_d", "i_q"] }`, `{ product = ["u_dc", "i_dc"] }`,
    `{ mean = ["T1", "T2"] }` or `{ ratio = ["u_dc", "i_dc"] }`, with unit, scale, offset, wrap, invalid, valid and
    afterwards; or, of `time`, `{ rate = 50 }`, and rows where these are means. With
    `thermometer = { resistance = 0.186, at = 25, alpha = 0.0039 }` a resistance [ohm] becomes the temperature at which
    a winding has it ([QuadrupedLPTN, eq. 6]).

    Args:
        table: the table as it was read from TOML.
        file: the file that holds it.
        place: what the table is called there, such as `[columns]`.

    Raises:
        InputError: a key, name, unit or number that can't be used.
    """
    return {str(key): _Entry(str(key), entry, file, f"{place} {key}").source() for key, entry in table.items()}


def parse_map_option(text: str, option: str = "--map") -> tuple[str, ColumnSource]:
    """Read `temperature.a=T1`, `temperature.a=T1[degF]` or `temperature.a=T1[degC; invalid=850,-127]`.

    Behind the unit may stand scale, offset, wrap, invalid, valid, afterwards, and of time rows. Without a column one of
    `mean=T1,T2`, `norm=…`, `product=…` stands there, or of time `rate=50`: `temperature.a=[degC; mean=T1,T2]`. A name
    that ends in a bracket is written with another one behind it: `T[x][]`.

    Raises:
        InputError: the text or its unit can't be used.
    """
    match = _OPTION.fullmatch(text.strip())
    if match is None:
        raise InputError(option, "its value", f"'{text}'", "<quantity>.<place>=COLUMN or …=COLUMN[UNIT]")
    key, (unit, *settings) = match["key"].strip(), [word.strip() for word in (match["unit"] or "").split(";")]
    entry: dict[str, object] = {"unit": unit} if unit else {}
    if "=" in unit:
        entry, settings = {}, [unit, *settings]
    for setting in filter(None, settings):
        name, _, value = (word.strip() for word in setting.partition("="))
        words = [word.strip() for word in value.split(",")]
        numbers = [_number_or_text(word) for word in words]
        entry[name] = numbers if name in {"invalid", "valid"} else numbers[0] if len(numbers) == 1 else value
        if name in _EXAMPLES:
            entry[name] = words
    column = match["column"].strip()
    if column or not entry.keys() & set(_COLUMN_ENTRIES):
        entry["column"] = column
    return key, _Entry(key, entry, option, key).source()


def _number_or_text(text: str) -> object:
    """A number that stands in an option; the text itself where it is none, for the message."""
    try:
        return float(text)
    except ValueError:
        return text


class _Entry:
    """One entry of `[columns]`, checked as it is read.

    Args:
        key: the quantity that it is for.
        entry: a name, or a table.
        file: the file, or option, that holds it.
        place: where it stands there.

    Raises:
        InputError: a wrong key, an entry that is neither name nor table, or one with an unknown setting.
    """

    def __init__(self, key: str, entry: object, file: str | Path, place: str) -> None:
        self.key, self.file, self.place = key, file, place
        if not is_key(key):
            self.refuse("", f"key '{key}'", "time or <quantity>.<place>, such as torque.FR_calf")
        if isinstance(entry, str):
            entry = {"column": entry}
        if not isinstance(entry, Mapping):
            self.refuse("", shown(entry), 'a column\'s name or a table such as { column = "T1" }')
        self.table: Mapping[str, object] = entry
        for name in entry:
            if name not in _ENTRIES:
                self.refuse("", f"key '{name}'", f"one of {', '.join(_ENTRIES)}")

    def refuse(self, name: str, problem: str, expected: str) -> NoReturn:
        raise InputError(self.file, f"{self.place} {name}" if name else self.place, problem, expected)

    def source(self) -> ColumnSource:
        """What the entry says.

        Raises:
            InputError: a name, unit or number that can't be used.
        """
        low, high = self.numbers("valid", (-math.inf, math.inf))[:2]
        how, columns = self.columns()
        if how == "rate":
            return self.rate()
        unit, (scale, offset) = self.unit(), self.thermometer()
        return ColumnSource(
            columns,
            unit,
            scale,
            offset,
            how if how in _EXAMPLES else "norm",  # type: ignore[arg-type]
            self.number("wrap", 0.0),
            self.numbers("invalid", ()),
            (low, high),
            afterwards=self.number("afterwards", 0.0) if "afterwards" in self.table else None,
            rows=self.rows(),
        )

    def thermometer(self) -> tuple[float, float]:
        """Factor and offset; those that make a temperature of a resistance where the entry says that it is one."""
        if "thermometer" not in self.table:
            return self.number("scale", 1.0), self.number("offset", 0.0)
        said = self.table["thermometer"]
        both = [name for name in ("unit", "scale", "offset") if name in self.table]
        if both or not self.key.startswith("temperature."):
            problem = f"{both[0]} beside thermometer" if both else f"a thermometer for {self.key}"
            self.refuse("", problem, f"of a temperature: thermometer = {_THERMOMETER}")
        numbers = {"at": 25.0, "alpha": 0.0039, **(said if isinstance(said, Mapping) else {})}
        if set(numbers) != {"resistance", "at", "alpha"} or not all(map(_is_finite_number, numbers.values())):
            self.refuse("thermometer", shown(said), _THERMOMETER)
        cold, at, alpha = (float(numbers[name]) for name in ("resistance", "at", "alpha"))
        if cold <= 0 or alpha <= 0:
            self.refuse("thermometer", shown(said), "a resistance and an alpha above 0")
        # R = R_0 (1 + α (T - T_0)), solved for T.
        return 1 / (alpha * cold), at - 1 / alpha

    def rows(self) -> str:
        rows, possible = self.table.get("rows", ""), (*MEANS, SAMPLES)
        if "rows" in self.table and not (self.key == "time" and rows in possible):
            self.refuse("rows", shown(rows), f"of time: one of {', '.join(shown(value) for value in possible)}")
        return str(rows)

    def rate(self) -> ColumnSource:
        rate = self.table["rate"]
        if self.key not in ("time", "time.2"):
            self.refuse("rate", shown(rate), "a rate for time alone: time = { rate = 50 }")
        others = [name for name in self.table if name not in ("rate", "rows")]
        if others:
            self.refuse("", f"{others[0]} beside rate", "the rows of the log a second, alone or with rows")
        if not _is_finite_number(rate) or not rate > 0:  # type: ignore[operator]
            self.refuse("rate", shown(rate), "the rows of the log a second, such as 50")
        return ColumnSource((), rate=float(rate), rows=self.rows())  # type: ignore[arg-type]

    def columns(self) -> tuple[str, tuple[str, ...]]:
        """How an entry says where its values stand, and the names of their columns."""
        names = [name for name in _COLUMN_ENTRIES if name in self.table]
        if len(names) != 1:
            problem = f"both {names[0]} and {names[1]}" if names else "neither column nor norm, product, mean or ratio"
            self.refuse("", problem, 'one of them: column = "T1" or mean = ["T1", "T2"]')
        name, value = names[0], self.table[names[0]]
        if name == "rate":
            return name, ()
        if name == "column":
            if isinstance(value, str) and value:
                return name, (str(value),)
            self.refuse(name, shown(value), "the name of a column")
        listed = value if isinstance(value, Sequence) and not isinstance(value, str) else ()
        columns = tuple(str(column) for column in listed if isinstance(column, str) and column)
        if len(columns) < 2 or len(columns) < len(listed) or (name == "ratio" and len(columns) > 2):
            many = "two column names" if name == "ratio" else "two or more column names"
            self.refuse(name, shown(value), f"{many}, such as {_EXAMPLES[name]}")
        return name, columns

    def unit(self) -> str | None:
        if "unit" not in self.table:
            return None
        unit = self.table["unit"]
        if not isinstance(unit, str) or not unit.strip():
            self.refuse("unit", shown(unit), 'the name of a unit, such as "degC"')
        unit, quantity = unit.strip(), self.key.partition(".")[0]
        try:
            to_si(np.zeros(1), quantity, unit)
        except Exception as error:  # pint raises a dozen kinds of its own and Python's for a text that is no unit
            wanted = _SI[quantity][1] if quantity in _SI else "its quantity, such as V"
            raise InputError(self.file, self.place, f"unit '{unit}'", f"a unit of {wanted}") from error
        return unit

    def number(self, name: str, default: float) -> float:
        value = self.table.get(name, default)
        zero = {"scale": " but 0", "wrap": " above 0"}.get(name, "")
        usable = _is_finite_number(value)
        if usable and name in self.table:
            usable = {"scale": value != 0, "wrap": value > 0}.get(name, True)  # type: ignore[operator]
        if not usable:
            self.refuse(name, shown(value), "a finite number" + zero)
        return float(value)  # type: ignore[arg-type]

    def numbers(self, name: str, default: tuple[float, ...]) -> tuple[float, ...]:
        if name not in self.table:
            return default
        value = self.table[name]
        listed = [value] if name == "invalid" and _is_finite_number(value) else value
        numbers: list[float] = []
        if isinstance(listed, Sequence) and not isinstance(listed, str) and all(map(_is_finite_number, listed)):
            numbers = [float(number) for number in listed]
        if not numbers or (name == "valid" and not (len(numbers) == 2 and numbers[0] < numbers[1])):
            example = "numbers, such as [850, -127]" if name == "invalid" else "least and greatest, such as [-40, 200]"
            self.refuse(name, shown(value), example)
        return tuple(numbers)


def _is_finite_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


# --- Where it stands, written: the line that a user pastes into `[columns]`, or an option `--map` ---


def toml_line(key: str, source: ColumnSource) -> str:
    """A line of `[columns]`, such as `"temperature.a" = { column = "T1", unit = "degF" }`."""
    name = key if key == "time" else json.dumps(key, ensure_ascii=False)
    if source.rate:
        rows = f', rows = "{source.rows}"' if source.rows else ""
        return f"{name} = {{ rate = {source.rate:.12g}{rows} }}"
    columns = [json.dumps(column, ensure_ascii=False) for column in source.columns]
    settings = [f'{word} = "{text}"' for word, text in (("unit", source.unit), ("rows", source.rows)) if text]
    settings += [
        f"{word} = [{', '.join(numbers)}]" if word in {"invalid", "valid"} else f"{word} = {numbers[0]}"
        for word, numbers in _settings(source)
    ]
    if len(columns) == 1 and not settings:
        return f"{name} = {columns[0]}"
    several = f"{source.how} = [{', '.join(columns)}]"
    where = several if len(columns) > 1 else f"column = {columns[0]}"
    return f"{name} = {{ {', '.join([where, *settings])} }}"


def map_option(key: str, source: ColumnSource) -> str:
    """An option such as `--map "temperature.a=T1[degF]"`; '' for columns of several whose names have a comma."""
    settings = [f"{word}={','.join(numbers)}" for word, numbers in _settings(source)]
    settings += [f"rows={source.rows}"] if source.rows else []
    if len(source.columns) == 1:
        column = source.columns[0]
    else:
        column = ""
        settings = [
            f"{source.how}={','.join(source.columns)}" if source.columns else f"rate={source.rate:g}",
            *settings,
        ]
        if any("," in name or ";" in name or "]" in name or "[" in name for name in source.columns):
            return ""
    inside = "; ".join([source.unit, *settings] if source.unit else settings)
    bracket = f"[{inside}]" if inside or column.endswith("]") else ""
    return f'--map "{key}={column}{bracket}"'


def as_line_or_option(key: str, source: ColumnSource) -> str:
    """Both, for a message of one line."""
    option = map_option(key, source)
    return f"{toml_line(key, source)} in [columns]" + (f", or {option}" if option else "")


def _settings(source: ColumnSource) -> list[tuple[str, list[str]]]:
    """The settings of a source that are numbers, and not as they are by default."""
    settings: list[tuple[str, list[float]]] = []
    if source.scale != 1.0:
        settings.append(("scale", [source.scale]))
    if source.offset:
        settings.append(("offset", [source.offset]))
    if source.wrap:
        settings.append(("wrap", [source.wrap]))
    if source.invalid:
        settings.append(("invalid", list(source.invalid)))
    if source.valid != (-math.inf, math.inf):
        settings.append(("valid", list(source.valid)))
    if source.afterwards is not None:
        settings.append(("afterwards", [source.afterwards]))
    return [(word, [f"{number:.12g}" for number in numbers]) for word, numbers in settings]


# --- What a column's name says: its words, and the unit that it ends in ----------------------------


_UNITS: Mapping[str, Mapping[str, str]] = {
    "time": {
        "s": "s", "sec": "s", "secs": "s", "seconds": "s", "ms": "ms", "msec": "ms", "millis": "ms",
        "milliseconds": "ms", "us": "us", "usec": "us", "micros": "us", "microseconds": "us", "µ s": "us", "ns": "ns",
        "nsec": "ns", "nanos": "ns", "nanoseconds": "ns", "min": "min", "minutes": "min",
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
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+|°|µ|%")
_ELECTRICAL = ("erpm", "e rpm")
"""Speeds in electrical turns: the number of pole pairs, which no log says, makes them mechanical."""
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
    return words in _OTHER_UNITS or any(words in endings for endings in _UNITS.values())


def could_be_in(key: str, unit: str) -> bool:
    """Whether a quantity could be in what a file calls its unit; of a quantity with any unit nobody knows."""
    quantity = key.partition(".")[0]
    return quantity not in _UNITS or bool(ColumnName.of("", unit).unit(quantity))


def words_of(name: str) -> tuple[str, ...]:
    """The words of a name, in lower case, letters and digits apart: `FR_calfTemp2` is fr, calf, temp, 2."""
    return tuple(word.lower() for word in _WORD.findall(name))


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
        is_unit = not inside.isdigit() and any(" ".join(words) in endings for endings in _UNITS.values())
        return cls((*words_of(before), *(() if is_unit else words)), inside)

    def unit(self, quantity: str) -> str:
        """The unit that the name ends in, or has in a bracket; '' where it has none that `quantity` could have."""
        endings = _UNITS.get(quantity, {})
        if (inside := " ".join(words_of(self.bracket))) in endings:
            return endings[inside]
        for count in (3, 2, 1):
            ending = " ".join(self.words[-count:])
            # A letter alone is a unit only behind something that it is the unit of.
            if len(self.words) > count and ending in endings:
                return endings[ending]
        return ""

    @property
    def electrical(self) -> bool:
        """Whether it is a speed in electrical turns."""
        return " ".join(self.words).endswith(_ELECTRICAL) or "erpm" in self.words
