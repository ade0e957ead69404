"""Virtual robots as ground truth for tests of a diagnosis; nothing here uses the rest of the library."""

from __future__ import annotations

from .hidden import BEYOND, EFFECTS, Hidden, places
from .leg import leg_logs, write_logs
from .truth import JOINTS

__all__ = ["BEYOND", "EFFECTS", "JOINTS", "Hidden", "leg_logs", "places", "write_logs"]
