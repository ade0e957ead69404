"""Columns of other people's logs: units, names, the `[columns]` table, the option `--map`, and back to text."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError, shown
from lptn.basics.units import registry

# --- Units that people write, turned into SI (temperatures into degC) -----------------------------


_TARGETS = {
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
}

# pint reads Nm as "number metre" and does not know rev.
_SPELLINGS = {"Nm": "N*m", "mNm": "mN*m", "kNm": "kN*m", "rev/min": "turn/min", "rev/s": "turn/s"}

# To pint these are 1/s, that is rad/s; of a shaft they mean turns, a factor 2 pi apart.
_TURNS = {"Hz": "turn/s", "1/min": "turn/min", "min^-1": "turn/min"}


def check_unit(unit: str, quantity: str, file: str | Path, place: str) -> None:
    """Refuse a unit that is unknown or of the wrong dimension for `quantity`.

    Raises:
        InputError: with `file` and `place` as given.
    """
    try:
        to_si(np.zeros(1), quantity, unit)
    except Exception as error:  # pint raises a dozen kinds of its own and Python's for a text that is no unit
        wanted = _TARGETS[quantity][1] if quantity in _TARGETS else "its quantity, such as V"
        raise InputError(file, place, f"unit '{unit}'", f"a unit of {wanted}") from error


def to_si(values: FloatArray, quantity: str, unit: str | None) -> FloatArray:
    """`values` in `unit` converted to the SI unit of `quantity`, degC for temperatures.

    No unit: unchanged. A quantity that is not known is converted to SI base units.
    """
    if unit is None:
        return values
    name = _SPELLINGS.get(unit, unit)
    if quantity.startswith("velocity"):
        name = _TURNS.get(unit, name)
    measured = registry().Quantity(values, registry().parse_units(name))
    target = _TARGETS.get(quantity)
    converted = measured.to(target[0]) if target else measured.to_base_units()
    return np.asarray(converted.magnitude, dtype=np.float64)


# --- Column names taken apart: words, indices, and the unit that a name ends in -------------------


def _set(words: str) -> frozenset[str]:
    return frozenset(words.split())


_BRACKETED = re.compile(r"[\[(]\s*([^\[\]()]+?)\s*[\])]\s*$")
_WORD = re.compile(r"[A-Z]?[a-z]+|[A-Z]+(?![a-z])|\d+|°|µ|%")

UNITS: Mapping[str, Mapping[str, str]] = {
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

ELECTRICAL = ("erpm", "e rpm")
"""Speeds in electrical turns: the number of pole pairs, which no log says, makes them mechanical."""


@dataclass(frozen=True)
class NameParts:
    """A column's name taken apart.

    Args:
        words: in lower case, letters and digits apart, `FR_calfTemp2` being fr, calf, temp, 2.
        bracket: what stands in a bracket at the end, such as a unit or an index; '' if nothing does.
    """

    words: tuple[str, ...]
    bracket: str

    def unit(self, quantity: str) -> str:
        """The unit that the name ends in, or has in a bracket; '' where it has none that `quantity` could have."""
        known = UNITS.get(quantity, {})
        if (inside := " ".join(words_of(self.bracket))) in known:
            return known[inside]
        for count in (3, 2, 1):
            ending = " ".join(self.words[-count:])
            # A letter alone is a unit only behind something that it is the unit of.
            if len(self.words) > count and ending in known:
                return known[ending]
        return ""

    @property
    def electrical(self) -> bool:
        """Whether it is a speed in electrical turns."""
        return " ".join(self.words).endswith(ELECTRICAL) or "erpm" in self.words


def words_of(name: str) -> tuple[str, ...]:
    """The words of a name, in lower case."""
    return tuple(word.lower() for word in _WORD.findall(name))


def parts_of(name: str) -> NameParts:
    """A name taken apart; what stands in a bracket and is no unit are words of it."""
    match = _BRACKETED.search(name)
    if match is None:
        return NameParts(words_of(name), "")
    before, inside = name[: match.start()], match[1]
    words = words_of(inside)
    is_unit = not inside.isdigit() and any(" ".join(words) in known for known in UNITS.values())
    return NameParts((*words_of(before), *(() if is_unit else words)), inside)


QUANTITIES: Mapping[str, frozenset[str]] = {
    "time": _set("time t timestamp stamp ts clock elapsed"),
    "temperature": _set("temperature temperatures temp temps tmp t thermistor ntc pt therm thermocouple"),
    "torque": _set("torque torques tau effort trq tq moment"),
    "current": _set("current currents i cur curr iq amps amp"),
    "velocity": _set("velocity velocities vel omega speed dq qd qdot rpm w"),
    "speed": _set("speed velocity vel v vx"),
    "power": _set("power watt watts p"),
    "powered": _set("powered enabled enable"),
    "fan": _set("fan duty"),
    "irradiance": _set("irradiance sun solar"),
}
"""Words that say which quantity a column holds."""

PLACES: Mapping[str, frozenset[str]] = {
    "ambient": _set("ambient amb room air env environment lab surroundings"),
    "base": _set("base body trunk robot com"),
    "battery": _set("battery batt bat"),
    "pc": _set("pc computer cpu onboard"),
    "winding": _set("winding windings coil copper"),
    "housing": _set("housing case casing body shell"),
    "calf": _set("calf knee shank"),
}
"""Words that say which place, where it is not called by its own name."""

NOT_MEASURED = _set(
    "cmd command commanded des desired target ref reference goal limit max min set setpoint error err status flag "
    "count fault warning id mode"
)
"""Words of columns that hold what was wanted, or something about a quantity, and not the quantity."""


# --- Other people's column names: the `[columns]` table and the option `--map` --------------------


_KEY = re.compile(r"time|[A-Za-z_]\w*\.[^\s.]+")
_OPTION = re.compile(r"(?P<key>[^=]+)=(?P<column>.+?)(?:\[(?P<unit>[^\[\]]*)\])?")
_COLUMNS = ("column", "norm", "product")
_ALLOWED = (*_COLUMNS[:2], "unit", "scale", "offset", "product", "wrap", "invalid", "valid")


@dataclass(frozen=True)
class ColumnSource:
    """Where a quantity stands in a log: `scale * x + offset` in `unit`, x a column or made of several.

    Attributes:
        columns: names in the file; several are combined as the root of the sum of their squares, or multiplied.
        unit: what `scale * x + offset` is in; None for SI (degC for temperatures).
        scale: factor on x.
        offset: added after scaling, in `unit`.
        product: several columns are multiplied: voltage and current.
        wrap: what a counter of few bits jumps by, 65536 for one of 16 bit; 0 for none. Of what is no time, the
            middle value is taken to lie between -wrap/2 and wrap/2.
        invalid: numbers in the file that stand for no reading, such as 850.
        valid: least and greatest number in the file that is a reading.
    """

    columns: tuple[str, ...]
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0
    product: bool = False
    wrap: float = 0.0
    invalid: tuple[float, ...] = ()
    valid: tuple[float, float] = (-math.inf, math.inf)

    def values(self, key: str, raw: Mapping[str, FloatArray]) -> FloatArray:
        """The quantity `key` in SI (degC), (n,), from the file's columns `raw`, (n,) each; NaN where invalid."""
        quantity = key.partition(".")[0]
        parts = [self._unwrapped(self._readings(raw[name]), quantity) for name in self.columns]
        x = parts[0]
        if self.product:
            x = np.prod(parts, axis=0)
        elif len(parts) > 1:
            x = np.sqrt(np.sum(np.square(parts), axis=0))
        return to_si(self.scale * x + self.offset, quantity, self.unit)

    def missing(self, raw: Mapping[str, FloatArray]) -> int:
        """How many numbers in the file `invalid` and `valid` take for no reading."""
        return sum(int((np.isnan(self._readings(raw[name])) & ~np.isnan(raw[name])).sum()) for name in self.columns)

    def _readings(self, x: FloatArray) -> FloatArray:
        low, high = self.valid
        if not self.invalid and (low, high) == (-math.inf, math.inf):
            return x
        return np.where(np.isin(x, self.invalid) | (x < low) | (x > high), np.nan, x)

    def _unwrapped(self, x: FloatArray, quantity: str) -> FloatArray:
        known = np.isfinite(x)
        if not self.wrap or not known.any():
            return x
        whole = x.copy()
        whole[known] = np.unwrap(x[known], period=self.wrap)
        turns = 0.0 if quantity == "time" else np.round(np.median(whole[known]) / self.wrap)
        return np.asarray(whole - turns * self.wrap)


def is_key(name: str) -> bool:
    """Whether `name` is `time` or `<quantity>.<place>`."""
    return _KEY.fullmatch(name) is not None


def parse_columns(table: Mapping[str, object], file: str | Path, place: str) -> dict[str, ColumnSource]:
    """Read a `[columns]` table.

    An entry is a name, `{ column = "T1" }`, `{ norm = ["i_d", "i_q"] }` or `{ product = ["u_dc", "i_dc"] }`, with
    unit, scale, offset, wrap, invalid and valid.

    Args:
        table: the table as it was read from TOML.
        file: the file that holds it.
        place: what the table is called there, such as `[columns]`.

    Raises:
        InputError: a key, name, unit or number that can't be used.
    """
    return {str(key): _entry(str(key), entry, file, f"{place} {key}") for key, entry in table.items()}


def parse_map_option(text: str, option: str = "--map") -> tuple[str, ColumnSource]:
    """Read `temperature.a=T1`, `temperature.a=T1[degF]` or `temperature.a=T1[degC; invalid=850,-127]`.

    Behind the unit may stand scale, offset, wrap, invalid and valid. A name that ends in a bracket is written with
    another one behind it: `T[x][]`.

    Raises:
        InputError: the text or its unit can't be used.
    """
    match = _OPTION.fullmatch(text.strip())
    if match is None:
        raise InputError(option, "its value", f"'{text}'", "<quantity>.<place>=COLUMN or …=COLUMN[UNIT]")
    key, (unit, *more) = match["key"].strip(), [word.strip() for word in (match["unit"] or "").split(";")]
    entry: dict[str, object] = {"column": match["column"].strip()}
    if "=" in unit:
        unit, more = "", [unit, *more]
    if unit:
        entry["unit"] = unit
    for word in filter(None, more):
        name, _, value = (part.strip() for part in word.partition("="))
        numbers = [_as_number(part) for part in value.split(",")]
        entry[name] = numbers if name in {"invalid", "valid"} else numbers[0] if len(numbers) == 1 else value
    return key, _entry(key, entry, option, key)


def _entry(key: str, entry: object, file: str | Path, place: str) -> ColumnSource:
    if not is_key(key):
        raise InputError(file, place, f"key '{key}'", "time or <quantity>.<place>, such as torque.FR_calf")
    if isinstance(entry, str):
        entry = {"column": entry}
    if not isinstance(entry, Mapping):
        raise InputError(file, place, shown(entry), 'a column\'s name or a table such as { column = "T1" }')
    unknown = [str(name) for name in entry if name not in _ALLOWED]
    if unknown:
        raise InputError(file, place, f"key '{unknown[0]}'", f"one of {', '.join(_ALLOWED)}")
    low, high = _numbers(entry, "valid", (-math.inf, math.inf), file, place)[:2]
    return ColumnSource(
        _names(entry, file, place),
        _unit(entry, key.partition(".")[0], file, place),
        _number(entry, "scale", 1.0, file, place),
        _number(entry, "offset", 0.0, file, place),
        "product" in entry,
        _number(entry, "wrap", 0.0, file, place),
        _numbers(entry, "invalid", (), file, place),
        (low, high),
    )


def _names(entry: Mapping[str, object], file: str | Path, place: str) -> tuple[str, ...]:
    ways = [way for way in _COLUMNS if way in entry]
    if len(ways) != 1:
        found = f"both {ways[0]} and {ways[1]}" if ways else "neither column nor norm"
        raise InputError(file, place, found, 'one of them: column = "T1" or norm = ["i_d", "i_q"]')
    way, given = ways[0], entry[ways[0]]
    if way == "column":
        if isinstance(given, str) and given:
            return (str(given),)
        raise InputError(file, f"{place} column", shown(given), "the name of a column")
    if isinstance(given, Sequence) and not isinstance(given, str) and len(given) > 1:
        names = [str(name) for name in given if isinstance(name, str) and name]
        if len(names) == len(given):
            return tuple(names)
    example = '["i_d", "i_q"]' if way == "norm" else '["u_dc", "i_dc"]'
    raise InputError(file, f"{place} {way}", shown(given), f"two or more column names, such as {example}")


def _unit(entry: Mapping[str, object], quantity: str, file: str | Path, place: str) -> str | None:
    if "unit" not in entry:
        return None
    unit = entry["unit"]
    if not isinstance(unit, str) or not unit.strip():
        raise InputError(file, f"{place} unit", shown(unit), 'the name of a unit, such as "degC"')
    check_unit(unit.strip(), quantity, file, place)
    return unit.strip()


def _number(entry: Mapping[str, object], name: str, default: float, file: str | Path, place: str) -> float:
    value = entry.get(name, default)
    given = name in entry
    if not _usable(value) or (name == "scale" and value == 0) or (name == "wrap" and given and not value > 0):  # type: ignore[operator]
        more = {"scale": " but 0", "wrap": " above 0"}.get(name, "")
        raise InputError(file, f"{place} {name}", shown(value), "a finite number" + more)
    return float(value)  # type: ignore[arg-type]


def _numbers(
    entry: Mapping[str, object], name: str, default: tuple[float, ...], file: str | Path, place: str
) -> tuple[float, ...]:
    if name not in entry:
        return default
    given = entry[name]
    listed = [given] if name == "invalid" and _usable(given) else given
    numbers: list[float] = []
    if isinstance(listed, Sequence) and not isinstance(listed, str) and all(map(_usable, listed)):
        numbers = [float(number) for number in listed]
    if not numbers or (name == "valid" and not (len(numbers) == 2 and numbers[0] < numbers[1])):
        example = "numbers, such as [850, -127]" if name == "invalid" else "least and greatest, such as [-40, 200]"
        raise InputError(file, f"{place} {name}", shown(given), example)
    return tuple(numbers)


def _usable(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _as_number(text: str) -> object:
    """A number that stands in an option; the text itself where it is none, for the message."""
    try:
        return float(text)
    except ValueError:
        return text


# --- Where a column stands, written as the line that a user pastes: of `[columns]`, or an option `--map` ---


def toml_line(key: str, source: ColumnSource) -> str:
    """A line of `[columns]`, such as `"temperature.a" = { column = "T1", unit = "degF" }`."""
    name = key if key == "time" else json.dumps(key, ensure_ascii=False)
    columns = [json.dumps(column, ensure_ascii=False) for column in source.columns]
    unit = [f'unit = "{source.unit}"'] if source.unit else []
    more = [*unit, *(f"{word} = {_listed(word, numbers)}" for word, numbers in _numbers_as_toml(source))]
    if len(columns) == 1 and not more:
        return f"{name} = {columns[0]}"
    several = f"{'product' if source.product else 'norm'} = [{', '.join(columns)}]"
    where = several if len(columns) > 1 else f"column = {columns[0]}"
    return f"{name} = {{ {', '.join([where, *more])} }}"


def map_option(key: str, source: ColumnSource) -> str:
    """An option such as `--map "temperature.a=T1[degF]"`; a mapping of several columns has none, and gives ''."""
    if len(source.columns) != 1:
        return ""
    column = source.columns[0]
    inside = "; ".join(
        [source.unit or "", *(f"{word}={','.join(numbers)}" for word, numbers in _numbers_as_toml(source))]
    )
    inside = inside.removeprefix("; ")
    bracket = f"[{inside}]" if inside or column.endswith("]") else ""
    return f'--map "{key}={column}{bracket}"'


def either(key: str, source: ColumnSource) -> str:
    """Both, for a message of one line."""
    option = map_option(key, source)
    return f"{toml_line(key, source)} in [columns]" + (f", or {option}" if option else "")


def _numbers_as_toml(source: ColumnSource) -> list[tuple[str, list[str]]]:
    given: list[tuple[str, list[float]]] = []
    if source.scale != 1.0:
        given.append(("scale", [source.scale]))
    if source.offset:
        given.append(("offset", [source.offset]))
    if source.wrap:
        given.append(("wrap", [source.wrap]))
    if source.invalid:
        given.append(("invalid", list(source.invalid)))
    if source.valid != (-math.inf, math.inf):
        given.append(("valid", list(source.valid)))
    return [(word, [f"{number:.12g}" for number in numbers]) for word, numbers in given]


def _listed(word: str, numbers: list[str]) -> str:
    return f"[{', '.join(numbers)}]" if word in {"invalid", "valid"} else numbers[0]
