"""Temperatures and their uncertainty in real time; forecasts of the time to a limit, and faults of sensors."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
