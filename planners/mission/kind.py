"""Missions as a kind of task for `lptn plan`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from lptn.model.model import Model

from .activities import Mission
from .answer import MissionAnswer
from .mission_file import read_mission
from .plan import plan_mission


class MissionKind:
    """`kind = "mission"`: speeds, rests and loads, so that nothing overheats and the time is least."""

    def read(self, table: Mapping[str, Any], origin: str, model: Model) -> Mission:
        """A mission from the whole parsed task file.

        Raises:
            InputError: something in it can't be used.
        """
        return read_mission(table, origin, model)

    def run(self, task: Mission) -> MissionAnswer:
        """Plan it. What can't be done is said in the answer."""
        return MissionAnswer(plan_mission(task))


plan_kind = MissionKind()
