"""The table of kinds: which planner a task file's `kind` names."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any

from lptn.basics.errors import InputError, shown

from .kind import Kind

_WHERE = {
    "track": "lptn.planners.mpc.plan_kind",
    "limit": "lptn.planners.limiter.plan_kind",
    "mission": "lptn.planners.mission.plan_kind",
}
"""Kind -> the object that offers it, imported only when asked for."""

KINDS = tuple(_WHERE)


def kind_of(table: Mapping[str, Any], origin: str) -> Kind[Any]:
    """The planner that a task file asks for.

    Raises:
        InputError: no `[task]` table with a known `kind`.
    """
    task = table.get("task")
    kind = task.get("kind") if isinstance(task, Mapping) else None
    if not isinstance(kind, str) or kind not in _WHERE:
        found = "no such key" if kind is None else shown(kind)
        raise InputError(origin, "task.kind", found, f"one of {', '.join(KINDS)}")
    module, _, name = _WHERE[kind].rpartition(".")
    planner: Kind[Any] = getattr(import_module(module), name)
    return planner
