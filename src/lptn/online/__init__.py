"""Temperatures and their uncertainty in real time, from a model and whatever readings come in."""

from lptn.online.estimate import Estimate
from lptn.online.estimator import Estimator
from lptn.online.model_error import ModelError

__all__ = ["Estimate", "Estimator", "ModelError"]
