"""Task files of `lptn plan`: which planner answers one, and what all of them have in common."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

import numpy as np
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError, shown
from lptn.basics.files import text_of
from lptn.basics.toml import Strict, mistakes_by_line, toml_of
from lptn.model.model import Model

from .heating import Heating
from .values import by_place

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from pandas import DataFrame

Task = TypeVar("Task")


class Answer(Protocol):
    """A solved task, or one that can't be met with what is in the way: both are answers."""

    def table(self) -> DataFrame:
        """The plan as rows of a table; units in the column names, `torque.FR_calf [N*m]`. `lptn plan -o` writes it."""
        ...

    def figure(self) -> Figure:
        """The plan as a picture. `lptn plan --plot` writes it."""
        ...

    def as_json(self) -> dict[str, object]:
        """The plan for programs, SI and degC; numbers that are not finite become null when it is written."""
        ...

    def text(self) -> str:
        """Lines for the terminal; what was given up stands first."""
        ...


@dataclass(frozen=True)
class Kind(Generic[Task]):
    """One kind of task, chosen by `kind = "..."` in the table `[task]` of the task file.

    Args:
        file: tables and keys of the whole task file.
        task: (the file's tables, its name, the model) -> a task; raises `InputError` where something in it can't be
            used. The name is for messages, and for paths beside it.
        run: task -> its answer. What can't be met is said in the answer, it is no exception.
        emit_c: (task, folder) -> the files of its step as C code for a robot, in the order a person reads them; `None`
            for a kind that has none. The folder is made if missing.
        c_code: what that is, in words.
    """

    file: type[Strict]
    task: Callable[[Any, str, Model], Task]
    run: Callable[[Task], Answer]
    emit_c: Callable[[Task, Path], list[Path]] | None = None
    c_code: str = "the controller in C"

    def read(self, table: Mapping[str, Any], origin: str, model: Model) -> Task:
        """A task from the whole parsed task file.

        Args:
            table: the whole document.
            origin: the task file, for messages and for files beside it.
            model: the model that the task is about.

        Raises:
            InputError: something in it can't be used; with its line where the file is there.
        """
        path = Path(origin)
        with mistakes_by_line(path, text_of(path, "a task file") if path.is_file() else ""):
            return self.task(self.file.model_validate(dict(table)), origin, model)


_WHERE = {
    "track": "lptn.planners.mpc.plan_kind",
    "limit": "lptn.planners.limiter.plan_kind",
    "firmware": "lptn.planners.limiter.firmware_kind",
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
        problem = "no such key" if kind is None else shown(kind)
        raise InputError(origin, "task.kind", problem, f"one of {', '.join(KINDS)}")
    module, _, name = _WHERE[kind].rpartition(".")
    planner: Kind[Any] = getattr(import_module(module), name)
    return planner


# --- what task files have in common --------------------------------------------------------------


def load_task(path: Path) -> dict[str, Any]:
    """The whole task file as plain Python values.

    Raises:
        InputError: it can't be read, or is no TOML.
    """
    return toml_of(path, text_of(path, "a task file"))


def start_of(given: Mapping[str, float], model: Model, origin: str, table: str = "start") -> FloatArray:
    """Temperatures of all states at the start [degC], from those of a table by node or pattern.

    Raises:
        InputError: a node is left out.
    """
    by_node = by_place(given, model.nodes, origin, table)
    missing = [node for node in model.nodes if node not in by_node]
    if missing:
        raise InputError(origin, table, f"no temperature of {missing[0]}", 'one of each node, such as "*" = 25')
    nodes = np.array([by_node[node] for node in model.nodes])
    return np.asarray(nodes[np.array(model.owners)])


def conditions_of(given: Mapping[str, float], heat: Heating, asked: FloatArray, origin: str) -> FloatArray:
    """The model's other inputs in order, beside what the joints are asked for, shape (joints,).

    Raises:
        InputError: one of them is left out.
    """
    names = heat.conditions
    by_column = by_place(given, tuple(dict.fromkeys((*names, *heat.decided))), origin, "conditions")
    values = heat.conditions_from(by_column, asked)
    missing = [name for name, value in zip(names, values, strict=True) if np.isnan(value)]
    if missing:
        raise InputError(origin, "conditions", f"no {missing[0]}", f"each of {', '.join(names)}; a pattern will do")
    return values


def check_limits_at_rest(
    model: Model,
    origin: str,
    limits: Mapping[str, float],
    start: FloatArray,
    idle: Callable[[float, FloatArray], FloatArray],
    ends: FloatArray,
    air: Mapping[str, float],
) -> None:
    """Refuse a limit that a node passes, or never comes down to, though no joint does anything all the time.

    Args:
        model: the model.
        origin: the task file.
        limits: degC by node.
        start: states [degC].
        idle: (time [s], states) -> rates of the states [K/s] without any load.
        ends: ends of the task's steps [s]; in between the conditions are constant.
        air: hottest of each surrounding temperature [degC] by column.

    Raises:
        InputError: the node, and what warms it.
    """
    x, hottest, before = start, np.full(len(start), -np.inf), 0.0
    first = idle(0.0, start)
    for end in ends:
        x = solve_ivp(idle, (before, end), x, method="LSODA", t_eval=[end], max_step=end - before).y[:, -1]
        hottest, before = np.maximum(hottest, x), float(end)
    for node, limit in limits.items():
        row = model.places.index(node)
        above = start[row] > limit  # then it is enough that it cools
        if above and (first[row] < 0 or x[row] <= limit):
            continue
        if not above and hottest[row] <= limit + 0.01:  # K; less is the integrator's own
            continue
        column, warmest = max(air.items(), key=lambda item: item[1], default=("", -np.inf))
        why = f"{column} of {warmest:g} degC" if warmest > limit else "heat that is there without any load"
        raise InputError(
            origin, f"limits.{node}", f"{limit:g} degC, which {node} passes by {why}, though no joint does anything",
            f"a limit above {max(hottest[row], x[row]):.4g} degC, which it reaches so by the end",
        )  # fmt: skip


def check_folder(folder: Path | None, kind: Kind[Any], origin: str) -> None:
    """Refuse a folder for C code that can't be made, and a kind of task that has no C code.

    Raises:
        InputError: it is a file, or lies in no folder; or the kind has no C code.
    """
    if folder is None:
        return
    if kind.emit_c is None:
        raise InputError(
            origin, "--emit-c", "a kind of task without a controller step", 'kind = "track", "limit" or "firmware"'
        )
    if folder.exists() and not folder.is_dir():
        raise InputError(folder, "--emit-c", "a file", "a folder")
    if not folder.absolute().parent.is_dir():
        raise InputError(folder, "--emit-c", "no such folder", "a folder in one that exists")
