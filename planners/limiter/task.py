"""`kind = "limit"` for `lptn plan`: its task file, and its answer as table, figure, JSON and text."""

from __future__ import annotations

from math import inf, isinf
from typing import TYPE_CHECKING, Literal

import numpy as np
import pandas as pd
from pydantic import Field

from lptn.basics.toml import Strict
from lptn.model.model import Model

from ..heating import Request
from ..tasks import Kind, conditions_of, start_of
from ..values import ByPlace, Celsius, Positive, by_place
from .limiter import Limiter

if TYPE_CHECKING:
    from matplotlib.figure import Figure


_NO_LIMIT = 1e6  # N*m or A; more is no limit


class LimitTable(Strict):
    kind: Literal["limit"]
    name: str = "admissible torque"
    request: Request | None = None
    horizons: list[Positive] = Field(default=[10.0, 60.0, 300.0], min_length=1, max_length=12)


class LimitFile(Strict):
    task: LimitTable
    limits: dict[str, Celsius] = Field(min_length=1)
    start: dict[str, Celsius] = Field(min_length=1)
    load: ByPlace = Field(default_factory=dict)
    conditions: ByPlace = Field(default_factory=dict)
    current_limits: dict[str, Positive] = Field(default_factory=dict)


class LimitTask:
    """A limiter and the present.

    Args:
        file: the task file's tables.
        origin: its name.
        model: the model.

    Attributes:
        name: for the figure.
        limiter: at the task's limits and horizons, the last one infinite.
        load: RMS torque or current of each joint.
        x: states [degC].
        conditions: the model's other inputs.

    Raises:
        InputError: something in the file can't be used.
    """

    def __init__(self, file: LimitFile, origin: str, model: Model) -> None:
        by_place(file.limits, model.places, origin, "limits")
        self.name = file.task.name
        self.limiter = Limiter(model, file.limits, request=file.task.request, current_limits=file.current_limits or inf,
                               horizons=(*sorted(set(file.task.horizons)), inf))  # fmt: skip
        levels = by_place(file.load, self.limiter.joints, origin, "load")
        self.load = np.array([levels.get(joint, 0.0) for joint in self.limiter.joints])
        self.conditions = conditions_of(file.conditions, self.limiter.heating, self.load, origin)
        self.x = start_of(file.start, model, origin)


class LimitAnswer:
    """What each joint may give at present, and how far all can be scaled.

    Args:
        task: the limiter and the present.

    Attributes:
        admissible: shape (joints, horizons).
        scales: of the present load of all joints, by horizon; infinite without a load.
    """

    def __init__(self, task: LimitTask) -> None:
        self.name, self.limiter, self.load, self.x = task.name, task.limiter, task.load, task.x
        given = task.x, task.load
        scales = [task.limiter.largest_scale(*given, seconds, task.conditions) for seconds in task.limiter.horizons]
        self.admissible, self.scales = task.limiter.admissible(*given, task.conditions), np.array(scales)

    def table(self) -> pd.DataFrame:
        """A row a joint."""
        limiter = self.limiter
        unit, nodes = limiter.heating.unit, limiter.model.nodes
        warm = [self.x[nodes.index(joint)] if joint in nodes else np.nan for joint in limiter.joints]
        columns: dict[str, object] = {"joint": list(limiter.joints), "temperature [degC]": warm,
                                      f"load [{unit}]": self.load}  # fmt: skip
        for number, seconds in enumerate(limiter.horizons):
            columns[f"{_named(seconds)} [{unit}]"] = self.admissible[:, number]
        return pd.DataFrame(columns)

    def figure(self) -> Figure:
        """Bars of the admissible values by joint and horizon, the present load as a line across them.

        What nothing limits is drawn to the top.
        """
        from matplotlib.lines import Line2D

        from lptn.basics.style import BAD, INK, SMALL, dress, new_figure, plain

        limiter = self.limiter
        figure, width = new_figure(3.2), 0.84  # inch; of a joint's bars
        ax = figure.subplots()
        count, places = len(limiter.horizons), np.arange(len(limiter.joints))
        limited = self.admissible[self.admissible < _NO_LIMIT]
        top = 1.15 * max(float(limited.max(initial=0.0)), float(np.abs(self.load).max(initial=0.0)), 1e-9)
        shades = np.linspace(1.0, 0.25, count)
        for number, seconds in enumerate(limiter.horizons):
            at = places + width * ((number + 0.5) / count - 0.5)
            shown = np.minimum(self.admissible[:, number], top)
            ax.bar(at, shown, width / count, color=BAD, alpha=shades[number], label=_named(seconds))
        ax.hlines(np.abs(self.load), places - width / 2, places + width / 2, color=INK, linewidth=1.4)
        ax.set_xticks(places, [plain(joint) for joint in limiter.joints], size=SMALL, rotation=30, ha="right")
        ax.set_ylim(0, top)
        ax.set_ylabel(f"admissible {limiter.heating.request} [{limiter.heating.unit.replace('*', '·')}]", size=SMALL)
        handles, _ = ax.get_legend_handles_labels()
        line = Line2D([], [], color=INK, linewidth=1.4, label="load now")
        figure.legend(
            handles=[*handles, line], loc="outside upper center", ncols=count + 1, fontsize=SMALL, frameon=False
        )
        dress(ax)
        return figure

    def as_json(self) -> dict[str, object]:
        """Admissible values by joint and horizon; `for ever` under null seconds."""
        limiter = self.limiter
        return {
            "kind": "limit",
            "name": self.name,
            "unit": limiter.heating.unit,
            "seconds": [None if isinf(seconds) else seconds for seconds in limiter.horizons],
            "admissible": dict(zip(limiter.joints, self.admissible.tolist(), strict=True)),
            "scale": [None if isinf(scale) else scale for scale in self.scales],
        }

    def text(self) -> str:
        """The table, and the scales of the whole load."""
        limiter = self.limiter
        names = [_named(seconds) for seconds in limiter.horizons]
        head = "".join(f"{name:>12}" for name in names)
        lines = [f"{'joint':16} {'load':>8} {head} [{limiter.heating.unit}]"]
        for joint, load, row in zip(limiter.joints, self.load, self.admissible, strict=True):
            lines.append(f"{joint:16} {load:8.3g} " + "".join(f"{_short(value):>12}" for value in row))
        lines.append(f"{'all, as a factor':16} {1:8} " + "".join(f"{_short(value):>12}" for value in self.scales))
        nothing = [joint for joint, row in zip(limiter.joints, self.admissible, strict=True) if not row.any()]
        if nothing:
            why = "a node is at its limit, or gets there by the other joints' load"
            lines.insert(0, f"No torque at all is admissible at {', '.join(nothing)}: {why}.")
        return "\n".join(lines)


def _named(seconds: float) -> str:
    return "continuous" if isinf(seconds) else f"{seconds:g} s"


def _short(value: float) -> str:
    return "no limit" if isinf(value) or value > _NO_LIMIT else f"{value:.3g}"


plan_kind = Kind(
    LimitFile,
    LimitTask,
    LimitAnswer,
    lambda task, folder: task.limiter.emit(folder, task.x, task.load, task.conditions),
    "the limiter in C",
)
