"""Motors: what a study needs to know of one beside its thermal network, those whose data are known here, and tables.

A table that people extend is a CSV or TOML file whose rows have the keys of a study's `[[motors]]`.
"""

from __future__ import annotations

import csv
import math
from contextlib import suppress
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from lptn.basics.errors import InputError
from lptn.basics.files import text_of
from lptn.basics.toml import Number, Strict, expectation, first_mistake, found_in, mistakes_by_line, place_of, toml_of
from lptn.model.file import parse_model
from lptn.model.network import Network

from .. import values as si

MAGNET_COEFFICIENT = -0.0012
"""Temperature coefficient of the flux density of NdFeB magnets [1/K], [Chen2017, eq. 2.6]."""
ENAMEL_LIMIT = 105.0
"""Winding temperature at which the enamel fails [degC], [Chen2017, fig. 4-9]; curves without a limit go to it."""
REFERENCE = 25.0
"""Temperature at which data sheets are taken to hold [degC]; neither sheet states it."""


_Turns = Annotated[si.Positive, Field(ge=0.05, le=20.0)]  # beyond, the wire of the same copper is a bar, or a hair
_MOST_TURNS = 20  # choices of a motor, some seconds each
_Windings = Annotated[list[_Turns], Field(min_length=1, max_length=_MOST_TURNS)]


class MotorLimits(Strict):
    """What a motor's data sheet limits; none where it is silent."""

    winding: si.Celsius | None = None
    magnet: si.Celsius | None = None
    current: si.Current | None = None
    speed: si.ShaftSpeed | None = None  # of the motor's shaft

    @property
    def given(self) -> dict[str, float]:
        """The limits that are given, by name."""
        return self.model_dump(exclude_none=True)


class DataSheet(Strict):
    """The thermal numbers that makers of motors print: two resistances, two time constants."""

    resistance: si.Ohms
    winding_to_housing: si.Resistance
    housing_to_ambient: si.Resistance
    winding_time: si.Seconds
    motor_time: si.Seconds


class CatalogueMotor(Strict):
    """A motor of a study or of a catalogue."""

    name: str
    model: str | None = None
    data_sheet: DataSheet | None = None
    winding: str | None = None  # node or pattern; the nodes with copper loss
    magnet: str | None = None  # node or pattern; nodes called magnet…, else the housing
    sink_at: str | None = None  # node, body's face or pattern; else [sink] at, else the stator or housing's outside
    mass: si.Mass | None = None
    volume: si.Volume | None = None
    diameter: si.Length | None = None
    length: si.Length | None = None
    torque_constant: si.TorqueConstant | None = None  # at 25 degC
    speed_constant: si.SpeedConstant | None = None
    magnet_coefficient: Annotated[Number, Field(gt=-0.01, le=0)] = MAGNET_COEFFICIENT  # of the torque constant, 1/K
    turns: _Windings = Field(default=[1.0])  # each a choice, by those of the motor described
    rotor_inertia: si.Inertia = 0.0
    price: si.NotNegative | None = None  # none where nobody said
    limits: MotorLimits = MotorLimits()
    source: str | None = None

    def over(self, other: CatalogueMotor) -> CatalogueMotor:
        """This motor, and where it says nothing, what the other one says."""
        said = self.model_dump(exclude_unset=True)
        kept = other.model_dump(exclude_unset=True) | said | {"limits": other.limits.given | self.limits.given}
        # Two ways to say the same: the later one counts alone.
        for one, another in _EITHER:
            if any(key in said for key in one) and not any(key in said for key in another):
                kept = {key: value for key, value in kept.items() if key not in another}
        return CatalogueMotor(**kept)

    @property
    def package(self) -> float | None:
        """Its volume [m³], perhaps that of the cylinder which it fills."""
        if self.volume is not None or self.diameter is None or self.length is None:
            return self.volume
        return math.pi * self.diameter**2 / 4 * self.length

    @property
    def constant(self) -> float | None:
        """Torque by the ampere [N·m/A], which is voltage by the radian per second."""
        if self.torque_constant is not None or self.speed_constant is None:
            return self.torque_constant
        return 1 / self.speed_constant


_EITHER = [(one, other) for pair in ((("volume",), ("diameter", "length")), (("torque_constant",), ("speed_constant",)),
                                     (("model",), ("data_sheet",))) for one, other in (pair, pair[::-1])]  # fmt: skip


def data_sheet_network(name: str, sheet: DataSheet) -> Network:
    """Winding, housing and air, after a data sheet.

    A winding's time constant is taken as its heat capacity times its resistance to the housing, the motor's as the
    housing's capacity times its resistance to the air.
    """
    text = f"""
[model]
name = "data-sheet"
ambient = "temperature.ambient"
[nodes.winding]
capacity = {sheet.winding_time / sheet.winding_to_housing!r}
[nodes.housing]
capacity = {sheet.motor_time / sheet.housing_to_ambient!r}
[[links]]
between = ["winding", "housing"]
resistance = {sheet.winding_to_housing!r}
[[links]]
between = ["housing", "ambient"]
resistance = {sheet.housing_to_ambient!r}
[[effects]]
kind = "copper_loss"
at = "winding"
input = "current"
resistance = {sheet.resistance!r}
[[effects]]
kind = "resistance_rise"
at = "winding"
alpha = 0.0039  # 1/K, copper; [Chen2017, eq. 2.5]
reference = {REFERENCE}
"""
    return parse_model(text, Path(f"data sheet of {name}")).network


# --- tables of motors ----------------------------------------------------------------------------


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
        inner[last], unit = cell.strip(), unit.strip().removesuffix("]").strip()
        with suppress(ValueError):  # a text
            inner[last] = {"value": float(cell), "unit": unit} if unit else float(cell)
    return table


MOTORS = read_catalogue(Path(str(files("lptn.planners.trade").joinpath("motors.toml"))))
"""The motors whose data sheets are known here, by name; their models are ready ones."""
U8, U10 = MOTORS["U8"], MOTORS["U10"]
