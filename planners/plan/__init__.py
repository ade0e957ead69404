"""`lptn plan MODEL TASK.toml`: one task file, one kind of planner, one answer."""

from .kind import Answer, EmitsC, Kind

__all__ = ["Answer", "EmitsC", "Kind"]
