"""Mission planning: speeds, rests and loads such that nothing overheats and the time is least (`lptn plan`)."""

from .answer import MissionPlan
from .gait import Gait, LogPart, gait_from_logs, gait_from_tables
from .mission import Activity, Mission, MissionSegment, Transition
from .plan import plan_kind, plan_mission
from .program import MissionProgram, MissionSolution

read_mission = plan_kind.read

__all__ = [
    "Activity", "Gait", "LogPart", "Mission", "MissionPlan", "MissionProgram", "MissionSegment", "MissionSolution",
    "Transition", "gait_from_logs", "gait_from_tables", "plan_kind", "plan_mission", "read_mission",
]  # fmt: skip
