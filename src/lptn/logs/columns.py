"""Other people's column names: the `[columns]` table and the option `--map`."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lptn.arrays import FloatArray
from lptn.errors import InputError, shown
from lptn.logs.units import check_unit, to_si

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
