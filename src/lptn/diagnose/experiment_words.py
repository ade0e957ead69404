"""A proposed run in words that a technician can follow."""

from __future__ import annotations

from collections.abc import Sequence

from lptn.diagnose.experiment_moves import BASE, Logged, Move
from lptn.diagnose.experiment_programs import Program, Step
from lptn.places import EVERYWHERE, is_glob

_UNITS = {"torque": "N*m", "torque_abs": "N*m", "current": "A", "current_abs": "A", "power": "W", "heat": "W"}
_ALIKE = 1.1  # values whose largest is no more than so many times the least are said as one


def unit_of(quantity: str) -> str:
    """SI unit of a load, empty where the column's name tells none."""
    return _UNITS.get(quantity, "")


def instructions(wanted: Program, logged: Logged) -> str:
    """What to do, a sentence or two."""
    air = f"With the robot at rest and as warm as the air, {wanted.ambient:.0f} degC"
    air += ", which is not the temperature of the logs" if wanted.moved_air else ""
    parts = [_step(step, logged) for step in wanted.steps]
    return f"{air}: {', then '.join(parts)}."


def named(rival: tuple[str, str]) -> str:
    """An effect and its place."""
    return f"{rival[0]} at {rival[1]}"


def listed(names: Sequence[str]) -> str:
    """Names joined by commas and an 'and'."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _step(step: Step, logged: Logged) -> str:
    return f"{_doing(step.move, logged)} for {_minutes(step.seconds)} min"


def _doing(move: Move, logged: Logged) -> str:
    if not move.joints:
        return "leave it unpowered"
    quantity, loads = logged.loads(move)
    load, speeds = _range(loads, unit_of(quantity) or f"of {quantity}"), logged.speeds(move)
    where = _where(move)
    if move.travelling:
        base = logged.high.get(BASE, 0.0) * move.speed
        return f"walk at {base:.2g} m/s with {load} at {where}"
    if move.speed == 0.0:
        return f"hold {load} at {where} standing" if logged.moving else f"hold {load} at {where}"
    pace = _range(speeds, "rad/s")
    if move.load == 0.0:
        return f"swing {where} without load at {pace} on average"
    return f"move {where} at {pace} on average with {load}"


def _where(move: Move) -> str:
    if move.at == EVERYWHERE:
        return "all joints"
    return f"every {move.at}" if is_glob(move.at) else move.at


def _range(values: Sequence[float], unit: str) -> str:
    """One value, or the least and the largest."""
    if not values:
        return f"the usual {unit}"
    least, most = min(values), max(values)
    if most <= _ALIKE * least:
        return f"{sum(values) / len(values):.2g} {unit}"
    return f"{least:.2g} to {most:.2g} {unit}"


def _minutes(seconds: float) -> str:
    return f"{seconds / 60:.3g}"
