"""Other people's column names: the `[columns]` table and the option `--map`."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from lptn.arrays import FloatArray
from lptn.errors import InputError
from lptn.logs.units import check_unit, to_si

_KEY = re.compile(r"time|[A-Za-z_]\w*\.[^\s.]+")
_OPTION = re.compile(r"(?P<key>[^=]+)=(?P<column>.+?)(?:\[(?P<unit>[^\[\]]*)\])?")
_ALLOWED = ("column", "norm", "unit", "scale", "offset")


@dataclass(frozen=True)
class ColumnSource:
    """Where a quantity stands in a log: `scale * x + offset` in `unit`, x a column or the norm of several.

    Attributes:
        columns: names in the file; several are combined as the root of the sum of their squares.
        unit: what `scale * x + offset` is in; None for SI (degC for temperatures).
        scale: factor on x.
        offset: added after scaling, in `unit`.
    """

    columns: tuple[str, ...]
    unit: str | None = None
    scale: float = 1.0
    offset: float = 0.0

    def values(self, key: str, raw: Mapping[str, FloatArray]) -> FloatArray:
        """The quantity `key` in SI (degC), (n,), from the file's columns `raw`, (n,) each."""
        x = raw[self.columns[0]]
        if len(self.columns) > 1:
            x = np.sqrt(sum((np.square(raw[name]) for name in self.columns), start=np.zeros_like(x)))
        return to_si(self.scale * x + self.offset, key.partition(".")[0], self.unit)


def is_key(name: str) -> bool:
    """Whether `name` is `time` or `<quantity>.<place>`."""
    return _KEY.fullmatch(name) is not None


def parse_columns(table: Mapping[str, object], file: str | Path, place: str) -> dict[str, ColumnSource]:
    """Read a `[columns]` table.

    An entry is a name, `{ column = "T1" }` or `{ norm = ["i_d", "i_q"] }`, with unit, scale and offset.

    Args:
        table: the table as it was read from TOML.
        file: the file that holds it.
        place: what the table is called there, such as `[columns]`.

    Raises:
        InputError: a key, name, unit or number that can't be used.
    """
    return {str(key): _entry(str(key), entry, file, f"{place} {key}") for key, entry in table.items()}


def parse_map_option(text: str, option: str = "--map") -> tuple[str, ColumnSource]:
    """Read `temperature.a=T1` or `temperature.a=T1[degF]`; for a name that ends in a bracket: `T[x][]`.

    Raises:
        InputError: the text or its unit can't be used.
    """
    match = _OPTION.fullmatch(text.strip())
    if match is None:
        raise InputError(option, "its value", f"'{text}'", "<quantity>.<place>=COLUMN or …=COLUMN[UNIT]")
    key, unit = match["key"].strip(), (match["unit"] or "").strip()
    entry: dict[str, object] = {"column": match["column"].strip()} | ({"unit": unit} if unit else {})
    return key, _entry(key, entry, option, key)


def _entry(key: str, entry: object, file: str | Path, place: str) -> ColumnSource:
    if not is_key(key):
        raise InputError(file, place, f"key '{key}'", "time or <quantity>.<place>, such as torque.FR_calf")
    if isinstance(entry, str):
        entry = {"column": entry}
    if not isinstance(entry, Mapping):
        raise InputError(file, place, f"{entry!r}", 'a column\'s name or a table such as { column = "T1" }')
    unknown = [str(name) for name in entry if name not in _ALLOWED]
    if unknown:
        raise InputError(file, place, f"key '{unknown[0]}'", f"one of {', '.join(_ALLOWED)}")
    return ColumnSource(
        _names(entry, file, place),
        _unit(entry, key.partition(".")[0], file, place),
        _number(entry, "scale", 1.0, file, place),
        _number(entry, "offset", 0.0, file, place),
    )


def _names(entry: Mapping[str, object], file: str | Path, place: str) -> tuple[str, ...]:
    if ("column" in entry) == ("norm" in entry):
        found = "both column and norm" if "column" in entry else "neither column nor norm"
        raise InputError(file, place, found, 'one of them: column = "T1" or norm = ["i_d", "i_q"]')
    column, norm = entry.get("column"), entry.get("norm")
    if "column" in entry:
        if isinstance(column, str) and column:
            return (str(column),)
        raise InputError(file, f"{place} column", f"{column!r}", "the name of a column")
    if isinstance(norm, Sequence) and not isinstance(norm, str) and len(norm) > 1:
        names = [str(name) for name in norm if isinstance(name, str) and name]
        if len(names) == len(norm):
            return tuple(names)
    raise InputError(file, f"{place} norm", f"{norm!r}", 'two or more column names, such as ["i_d", "i_q"]')


def _unit(entry: Mapping[str, object], quantity: str, file: str | Path, place: str) -> str | None:
    if "unit" not in entry:
        return None
    unit = entry["unit"]
    if not isinstance(unit, str) or not unit.strip():
        raise InputError(file, f"{place} unit", f"{unit!r}", 'the name of a unit, such as "degC"')
    check_unit(unit.strip(), quantity, file, place)
    return unit.strip()


def _number(entry: Mapping[str, object], name: str, default: float, file: str | Path, place: str) -> float:
    value = entry.get(name, default)
    usable = isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)
    if not usable or (name == "scale" and value == 0):
        raise InputError(file, f"{place} {name}", f"{value!r}", "a finite number" + " but 0" * (name == "scale"))
    return float(value)  # type: ignore[arg-type]
