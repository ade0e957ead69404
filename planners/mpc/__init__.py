"""Torque within temperature limits: thermal model-predictive control on a fitted model."""

from .controller import TorqueMPC
from .heat import Heating, heating
from .kind import plan_kind
from .plan import Plan
from .settings import Settings

__all__ = ["Heating", "Plan", "Settings", "TorqueMPC", "heating", "plan_kind"]
