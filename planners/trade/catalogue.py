"""Motors as a table that people extend: rows of a CSV or TOML file, with the keys of a study's `[[motors]]`."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

from pydantic import Field, ValidationError

from lptn.basics.errors import InputError
from lptn.basics.files import text_of
from lptn.basics.toml import Strict, expectation, first_mistake, found_in, mistakes_by_line, place_of, toml_of

from .motors import CatalogueMotor


class CatalogueFile(Strict):
    """A catalogue in TOML."""

    motors: list[CatalogueMotor] = Field(min_length=1)


def read_catalogue(path: Path) -> dict[str, CatalogueMotor]:
    """Motors of a table, by name.

    Args:
        path: a TOML file with tables `[[motors]]`, or a CSV file whose columns are called as their keys, with units in
            brackets: `name, mass [g], limits.current [A]`; empty cells say nothing.

    Raises:
        InputError: it can't be read, or says something that can't be; with its line.
    """
    text = text_of(path, "a catalogue of motors")
    if path.suffix.lower() == ".csv":
        rows = _rows_of_csv(path, text)
    else:
        with mistakes_by_line(path, text):
            tables = CatalogueFile.model_validate(toml_of(path, text))
        rows = [(f"motors[{number}].name", motor) for number, motor in enumerate(tables.motors)]
    motors: dict[str, CatalogueMotor] = {}
    for place, motor in rows:
        if motor.name in motors:
            raise InputError(path, place, f'"{motor.name}" a second time', "a name of its own for each motor")
        motors[motor.name] = motor
    return motors


def _rows_of_csv(path: Path, text: str) -> list[tuple[str, CatalogueMotor]]:
    lines = csv.reader(text.splitlines())
    try:
        said = [(lines.line_num, cells) for cells in lines if any(cell.strip() for cell in cells)]
    except csv.Error as error:
        raise InputError(path, f"line {lines.line_num}", str(error), "cells as in a table of motors") from error
    said = [(number, cells) for number, cells in said if not cells[0].lstrip().startswith("#")]
    if len(said) < 2:
        raise InputError(path, "motors", "no row of a motor", "a line of column names, then a line for each motor")
    names = [name.strip() for name in said[0][1]]
    rows = []
    for number, cells in said[1:]:
        if len(cells) > len(names):
            raise InputError(path, f"line {number}", f"{len(cells)} cells", f"at most {len(names)}, as many as columns")
        try:
            rows.append((f"line {number}", CatalogueMotor.model_validate(_nested(names, cells))))
        except ValidationError as error:
            first = first_mistake(error)
            place = f"line {number}, column{place_of(first).replace('.', ' ', 1)}"
            raise InputError(path, place, found_in(first), expectation(first)) from error
    return rows


def _nested(names: list[str], cells: list[str]) -> dict[str, Any]:
    """A row as the table that TOML would hold."""
    table: dict[str, Any] = {}
    for name, cell in zip(names, cells, strict=False):
        if not cell.strip():
            continue
        key, _, unit = name.partition("[")
        *path, last = key.strip().split(".")
        inner = table
        for part in path:
            if not isinstance(inner := inner.setdefault(part, {}), dict):
                inner = table[name] = {}  # `a` and `a.b`: no key of a motor, which is said as such
        inner[last] = _value(cell.strip(), unit.strip().removesuffix("]").strip())
    return table


def _value(cell: str, unit: str) -> Any:
    try:
        number = float(cell)
    except ValueError:
        return cell
    return {"value": number, "unit": unit} if unit else number
