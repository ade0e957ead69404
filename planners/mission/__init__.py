"""Mission planning: speeds, rests and loads such that nothing overheats and the time is least (`lptn plan`)."""

from .activities import Activity, Mission, Segment
from .answer import MissionAnswer
from .gait import Gait
from .gait_logs import LogPart, gait_from_logs
from .gait_tables import gait_from_tables
from .kind import plan_kind
from .mission_file import read_mission
from .plan import Plan, plan_mission
from .program import Program, Solution

__all__ = [
    "Activity",
    "Gait",
    "LogPart",
    "Mission",
    "MissionAnswer",
    "Plan",
    "Program",
    "Segment",
    "Solution",
    "gait_from_logs",
    "gait_from_tables",
    "plan_kind",
    "plan_mission",
    "read_mission",
]
