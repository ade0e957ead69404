"""Admissible torque now: how much each joint may give for 10 s, 60 s, 300 s and for ever."""

from .limiter import HORIZONS, Limiter
from .task import plan_kind

__all__ = ["HORIZONS", "Limiter", "plan_kind"]
