"""Where a column stands, written as the line that a user pastes: of `[columns]`, or an option `--map`."""

from __future__ import annotations

import json
import math

from lptn.logs.columns import ColumnSource


def toml_line(key: str, source: ColumnSource) -> str:
    """A line of `[columns]`, such as `"temperature.a" = { column = "T1", unit = "degF" }`."""
    name = key if key == "time" else json.dumps(key, ensure_ascii=False)
    columns = [json.dumps(column, ensure_ascii=False) for column in source.columns]
    unit = [f'unit = "{source.unit}"'] if source.unit else []
    more = [*unit, *(f"{word} = {_listed(word, numbers)}" for word, numbers in _numbers(source))]
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
    inside = "; ".join([source.unit or "", *(f"{word}={','.join(numbers)}" for word, numbers in _numbers(source))])
    inside = inside.removeprefix("; ")
    bracket = f"[{inside}]" if inside or column.endswith("]") else ""
    return f'--map "{key}={column}{bracket}"'


def either(key: str, source: ColumnSource) -> str:
    """Both, for a message of one line."""
    option = map_option(key, source)
    return f"{toml_line(key, source)} in [columns]" + (f", or {option}" if option else "")


def _numbers(source: ColumnSource) -> list[tuple[str, list[str]]]:
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
