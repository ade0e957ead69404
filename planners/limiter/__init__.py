"""Admissible torque now: how much each joint may give for 10 s, 60 s, 300 s and for ever."""

from .kind import plan_kind
from .limiter import HORIZONS, Limiter

__all__ = ["HORIZONS", "Limiter", "plan_kind"]
