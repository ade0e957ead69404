"""Torque within temperature limits: thermal model-predictive control on a fitted model."""

from .answer import plan_kind
from .controller import Plan, TorqueMPC
from .loop import ControlLoop
from .settings import Settings

__all__ = ["ControlLoop", "Plan", "Settings", "TorqueMPC", "plan_kind"]
