"""Measured curves and maps of a study: a fan's pressure over its flow, a gear's efficiency over speed and torque."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, TypeVar

import casadi as ca
import numpy as np
from pydantic import AfterValidator, Field, ValidationInfo, field_validator

from lptn.basics.arrays import FloatArray
from lptn.basics.toml import Number, Strict

from .. import values as si

_MOST_KNOTS = 40  # of a curve: each is a term of the program
Of = TypeVar("Of")
Share = Annotated[Number, Field(gt=0, le=1)]


def _rising(knots: list[float]) -> list[float]:
    if knots != sorted({*knots}):
        raise ValueError("numbers that rise")
    return knots


Rising = Annotated[list[Of], Field(min_length=2, max_length=_MOST_KNOTS), AfterValidator(_rising)]
"""Where a curve or a map has its points."""


def between(at: Any, knots: Sequence[float] | FloatArray, values: Any) -> Any:
    """A line through points, level beyond both ends, at a number, an array or a symbol; its values may be symbols."""
    if isinstance(at, ca.SX):
        inside = ca.fmin(ca.fmax(at, float(knots[0])), float(knots[-1]))
        return ca.pw_lin(inside, ca.DM(list(knots)), values if isinstance(values, ca.SX) else ca.DM(list(values)))
    return np.interp(at, knots, values)


class EfficiencyMap(Strict):
    """Table `[gears.map]`: measured efficiencies, bilinear between them, level beyond."""

    speed: Rising[si.NotNegative]  # rad/s, of the motor's shaft
    torque: Rising[si.NotNegative]  # N*m, behind the gear
    efficiency: Annotated[list[list[Share]], Field(max_length=_MOST_KNOTS)]  # a row for each torque

    @field_validator("efficiency")
    @classmethod
    def _rows(cls, rows: list[list[float]], info: ValidationInfo) -> list[list[float]]:
        wanted = [len(info.data.get("speed", ()))] * len(info.data.get("torque", ()))
        if wanted and [len(row) for row in rows] != wanted:
            raise ValueError(f"{len(wanted)} rows, one for each torque, of {wanted[0]} numbers, one for each speed")
        return rows

    def at(self, speed: Any, torque: Any) -> Any:
        """Efficiency at a speed of the motor and a torque behind the gear."""
        rows = [between(ca.fabs(speed), self.speed, row) for row in self.efficiency]
        return between(torque, self.torque, ca.vertcat(*map(ca.SX, rows)))


class FanCurve(Strict):
    """Table `[fan.curve]`: what a fan's data sheet shows."""

    flow: Rising[si.Flow]
    pressure: Annotated[list[si.Pressure], Field(max_length=_MOST_KNOTS)]  # at each flow, falling

    @field_validator("pressure")
    @classmethod
    def _falls(cls, pressure: list[float], info: ValidationInfo) -> list[float]:
        if len(pressure) != len(info.data.get("flow", pressure)) or pressure != sorted({*pressure}, reverse=True):
            raise ValueError("a pressure for each flow, falling")
        return pressure
