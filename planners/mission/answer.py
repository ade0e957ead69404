"""`kind = "mission"` for `lptn plan`: a plan as table, figure, JSON and text."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from lptn.basics.places import class_of
from lptn.model.model import Model

from .mission import Mission
from .mission_file import read_mission
from .plan import MissionPlan, plan_mission

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class MissionAnswer:
    """A plan as table, figure, JSON and text.

    Args:
        plan: the plan.
    """

    plan: MissionPlan

    def table(self) -> pd.DataFrame:
        """A row for each piece of the plan; with the temperature of every node at its end."""
        plan = self.plan
        places = plan.mission.model.places
        begins = np.concatenate([[0.0], np.cumsum(plan.time)[:-1]]) if plan.time.size else np.zeros(0)
        ends = plan.course.states[: len(places), plan.course.ends]
        distance = plan.speed * plan.time
        columns: dict[str, object] = {
            "start [s]": begins, "duration [s]": plan.time, "activity": [segment.name for segment in plan.segments],
            "speed [m/s]": plan.speed, "load [kg]": plan.load, "distance [m]": distance,
            "hottest": [places[k] for k in ends.argmax(axis=0)] if plan.segments else [],
        }  # fmt: skip
        names = dict.fromkeys(name for segment in plan.segments for name in segment.gait.postures)
        for name in names:
            columns[name] = [
                dict(zip(segment.gait.postures, posture, strict=True)).get(name, np.nan)
                for segment, posture in zip(plan.segments, plan.posture, strict=True)
            ]
        warm = {f"temperature.{node} [degC]": row for node, row in zip(places, ends, strict=True)}
        return pd.DataFrame(columns | warm)

    def figure(self) -> Figure:
        """Temperatures with their limits, speed and load over time, and the prices."""
        from .figure import mission_figure

        return mission_figure(self.plan)

    def as_json(self) -> dict[str, object]:
        """The whole answer, SI and degC; `seconds_per_kelvin` counts what one kelvin more of a limit gains."""
        plan, mission, first = self.plan, self.plan.mission, self.plan.obstacle
        rows = _activity_rows(self.table()).rename(columns=lambda name: name.partition(" ")[0]).to_dict("records")
        return {
            "mission": mission.name, "verdict": plan.verdict, "total": plan.total, "deadline": mission.deadline,
            "late": plan.late if mission.deadline is not None else None, "plan": rows,
            "done": [
                {"activity": activity.do, "share": share}
                for activity, share in zip(mission.activities, plan.share.tolist(), strict=True)
            ],
            "obstacle": None if first is None else {"node": first.node, "time": first.time, "in": first.name},
            "bottleneck": plan.bottleneck, "seconds_per_kelvin": plan.limit_prices,
            "seconds_per_kelvin_of_class": plan.class_prices, "prices": plan.prices,
            "raise_needed": plan.raise_needed, "limits": mission.limits, "peaks": plan.peaks,
            "limits_lowered": plan.lowered, "program_peaks": plan.coarse, "coarseness": plan.coarseness,
            "solver": plan.status, "assumed": list(plan.assumed),
        }  # fmt: skip

    def text(self) -> str:
        """What was given up first, then what is in the way, then the plan."""
        plan = self.plan
        assumed = [f"no temperature of {', '.join(plan.assumed)}: taken to be at its limit, or as hot as the hottest"]
        lines = [*_verdict(plan), *(assumed if plan.assumed else []), *_prices(plan)]
        return "\n".join([*lines, "", *self._rows(), "", *_check(plan)])

    def _rows(self) -> list[str]:
        table = _activity_rows(self.table())
        if table.empty:
            return ["nothing to do"]
        ends = self.plan.course.states[: len(self.plan.mission.model.places), self.plan.course.ends].max(axis=0)
        table["[degC]"] = ends
        postures = {name: "{:.3g}" for segment in self.plan.segments for name in segment.gait.postures}
        formats = postures | {
            "start [s]": "{:.0f}", "duration [s]": "{:.0f}", "speed [m/s]": "{:.2f}", "load [kg]": "{:.1f}",
            "distance [m]": "{:.0f}", "[degC]": "{:.1f}",
        }  # fmt: skip
        return str(
            table.to_string(index=False, formatters={key: value.format for key, value in formats.items()})
        ).splitlines()


def _activity_rows(table: pd.DataFrame) -> pd.DataFrame:
    """What is done, without the temperature of every node."""
    return table[[column for column in table.columns if not column.startswith("temperature.")]]


def _verdict(plan: MissionPlan) -> list[str]:
    mission, total = plan.mission, _time(plan.total)
    until = "" if mission.deadline is None else f", deadline {_time(mission.deadline)}"
    if plan.verdict == "met":
        spare = "" if mission.deadline is None else f", {_time(-plan.late)} to spare"
        return [f"{mission.name}: done in {total}{until}{spare}"]
    if plan.verdict == "none":
        return [f"{mission.name}: given up: all of it; the plan is to rest", _reason_for_rest(plan), *_obstacle(plan)]
    if plan.verdict == "late":
        missed = f"the deadline, missed by {_time(plan.late)}"
        return [f"{mission.name}: given up: {missed} ({total}{until})", *_obstacle(plan), *_needed_rise(plan)]
    parts = [
        f"{activity.do} {1 + sum(earlier.do == activity.do for earlier in mission.activities[:k])} {100 * share:.1f} %"
        for k, (activity, share) in enumerate(zip(mission.activities, plan.share.tolist(), strict=True))
        if share < 1 - 1e-4
    ]
    return [f"{mission.name}: given up: part of the work; done of {', '.join(parts)} ({total}{until})",
            *_obstacle(plan), *_needed_rise(plan)]  # fmt: skip


def _obstacle(plan: MissionPlan) -> list[str]:
    first = plan.obstacle
    if first is None:
        return []
    limit = f"{plan.mission.limits[first.node]:g} degC"
    return [
        f"done straight on at full speed, {first.node} passes its {limit} after {_time(first.time)}, in {first.name}"
    ]


def _reason_for_rest(plan: MissionPlan) -> str:
    over = {node: peak for node, peak in plan.peaks.items() if peak > plan.mission.limits[node]}
    if over:
        node = max(over, key=lambda name: over[name] - plan.mission.limits[name])
        return f"even at rest {node} gets to {over[node]:.1f} degC, its limit is {plan.mission.limits[node]:g} degC"
    return f"no plan was found that does a part of it within the limits (solver: {plan.status})"


def _needed_rise(plan: MissionPlan) -> list[str]:
    mission = plan.mission
    if mission.deadline is not None and mission.fastest > mission.deadline:
        return [f"no rise of the limits would suffice: at its fastest it takes {_time(mission.fastest)}"]
    if plan.raise_needed is None:
        return ["no rise of the limits up to 100 K was found that would suffice"]
    return [f"all of it in time would need all limits {plan.raise_needed:.1f} K higher"]


def _prices(plan: MissionPlan) -> list[str]:
    if not plan.prices:
        return ["what a limit is worth is not given: the solve did not converge"]
    if plan.bottleneck is None:
        return ["no temperature limit holds it up"]
    more = "work" if plan.verdict == "cut" else "time saved"
    classes = list(plan.class_prices.items())[:4]
    lines = []
    for name, price in classes:
        tied = [node for node in plan.limit_prices if name in (node, class_of(node))]
        nodes = f"{tied[0]}" if len(tied) == 1 else f"{', '.join(tied)} together"
        lines.append(f"{nodes}: {price:.1f} s of {more} for 1 K more of the limit")
    return [f"bottleneck: {lines[0]}", *(f"then {line}" for line in lines[1:])]


def _check(plan: MissionPlan) -> list[str]:
    over = {node: peak - plan.mission.limits[node] for node, peak in plan.peaks.items()}
    if not over:
        return []
    node = max(over, key=lambda name: over[name])
    lines = [f"replayed in fine steps: {node} is nearest to its limit, {plan.peaks[node]:.2f} of "
             f"{plan.mission.limits[node]:g} degC; program and replay differ by {plan.coarseness:.2f} K"]  # fmt: skip
    if plan.coarseness > 0.5:  # K between the program's few steps and the simulation
        lines.append("that is a large difference: divide the activities into more pieces")
    if plan.lowered > 0:
        lines.append(f"found with limits {plan.lowered:.2f} K lower, so that the replay keeps them")
    return lines


def _time(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 600 else f"{seconds / 60:.1f} min"


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
