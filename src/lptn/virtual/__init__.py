"""Virtual robots as ground truth for tests of a diagnosis; nothing here uses the rest of the library."""

from __future__ import annotations

from .activities import Segment
from .faults import Fault
from .hidden import BEYOND, EFFECTS, SINGLE, Hidden, places
from .leg import leg_logs, write_logs
from .plans import PLANS, plan
from .quadruped import Logs, quadruped, quadruped_logs, write_quadruped
from .runs import Run
from .truth import JOINTS

__all__ = [
    "BEYOND",
    "EFFECTS",
    "JOINTS",
    "PLANS",
    "SINGLE",
    "Fault",
    "Hidden",
    "Logs",
    "Run",
    "Segment",
    "leg_logs",
    "places",
    "plan",
    "quadruped",
    "quadruped_logs",
    "write_logs",
    "write_quadruped",
]
