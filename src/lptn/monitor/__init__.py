"""Faults of temperature sensors, found from what a model expects."""

from lptn.monitor.alarms import Alarm
from lptn.monitor.calibration import Calibration, calibrate
from lptn.monitor.monitoring import Monitoring, Watched, monitor

__all__ = ["Alarm", "Calibration", "Monitoring", "Watched", "calibrate", "monitor"]
