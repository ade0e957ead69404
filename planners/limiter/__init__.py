"""Admissible torque now, for 10 s, 60 s, 300 s and for ever, and numbers for the simple limiters of drives."""

from .firmware import firmware_kind
from .limiter import HORIZONS, Limiter
from .task import plan_kind

__all__ = ["HORIZONS", "Limiter", "firmware_kind", "plan_kind"]
