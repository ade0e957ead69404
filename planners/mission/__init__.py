"""Mission planning: speeds, rests and loads such that nothing overheats and the time is least (`lptn plan`)."""

from .answer import MissionAnswer, plan_kind
from .gait import Gait, LogPart, gait_from_logs, gait_from_tables
from .mission import Activity, Mission, MissionSegment, Transition
from .mission_file import read_mission
from .plan import MissionPlan, plan_mission
from .program import MissionProgram, MissionSolution

__all__ = [
    "Activity",
    "Gait",
    "LogPart",
    "Mission",
    "MissionAnswer",
    "MissionPlan",
    "MissionProgram",
    "MissionSegment",
    "MissionSolution",
    "Transition",
    "gait_from_logs",
    "gait_from_tables",
    "plan_kind",
    "plan_mission",
    "read_mission",
]
