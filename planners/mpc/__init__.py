"""Torque within temperature limits: thermal model-predictive control on a fitted model."""

from .answer import plan_kind
from .controller import Plan, TorqueMPC
from .settings import Settings

__all__ = ["Plan", "Settings", "TorqueMPC", "plan_kind"]
