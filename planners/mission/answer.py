"""`kind = "mission"` for `lptn plan`: a plan as table, figure, JSON and text."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from lptn.basics.places import class_of

from ..tasks import Kind
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
        ends = plan.course.states[: len(places), plan.course.ends]
        columns: dict[str, object] = {
            "start [s]": np.concatenate([[0.0], np.cumsum(plan.time)])[:-1], "duration [s]": plan.time,
            "activity": [segment.name for segment in plan.segments],
            "speed [m/s]": plan.speed, "load [kg]": plan.load, "distance [m]": plan.speed * plan.time,
            "hottest": [places[k] for k in ends.argmax(axis=0)] if plan.segments else [],
        }  # fmt: skip
        named = [dict(zip(piece.segment.gait.postures, piece.posture, strict=True)) for piece in plan.pieces()]
        for name in dict.fromkeys(name for posture in named for name in posture):
            columns[name] = [posture.get(name, np.nan) for posture in named]
        warm = {f"temperature.{node} [degC]": row for node, row in zip(places, ends, strict=True)}
        return pd.DataFrame(columns | warm)

    def _activities(self) -> pd.DataFrame:
        """What is done, without the temperature of every node."""
        table = self.table()
        return table[[column for column in table.columns if not column.startswith("temperature.")]]

    def figure(self) -> Figure:
        """Temperatures with their limits, speed and load over time, and the prices."""
        from .figure import mission_figure

        return mission_figure(self.plan)

    def as_json(self) -> dict[str, object]:
        """The whole answer, SI and degC; `seconds_per_kelvin` counts what one kelvin more of a limit gains."""
        plan, mission, first = self.plan, self.plan.mission, self.plan.obstacle
        rows = self._activities().rename(columns=lambda name: name.partition(" ")[0]).to_dict("records")
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
        lines = _verdict(plan)
        if plan.assumed:
            nodes = ", ".join(plan.assumed)
            lines.append(f"no temperature of {nodes}: taken to be at its limit, or as hot as the hottest")
        table = self._activities()
        if table.empty:
            return "\n".join([*lines, *_prices(plan), "", "nothing to do", "", *_check(plan)])
        table["[degC]"] = plan.course.states[: len(plan.mission.model.places), plan.course.ends].max(axis=0)
        table.columns = table.columns.map(lambda name: _HEADS.get(name, name))
        formats = {name: "{:.3g}" for segment in plan.segments for name in segment.gait.postures} | {
            "from [s]": "{:.0f}", "for [s]": "{:.0f}", "[m/s]": "{:.2f}", "[kg]": "{:.1f}", "[m]": "{:.0f}",
            "[degC]": "{:.1f}",
        }  # fmt: skip
        rows = table.to_string(index=False, formatters={name: form.format for name, form in formats.items()})
        return "\n".join([*lines, *_prices(plan), *_check(plan), "", rows])


_HEADS = {
    "start [s]": "from [s]", "duration [s]": "for [s]",
    "speed [m/s]": "[m/s]", "load [kg]": "[kg]", "distance [m]": "[m]",
}  # fmt: skip
"""Heads of the table's columns on a terminal, where a line has 80 characters."""


def _verdict(plan: MissionPlan) -> list[str]:
    """What is done and what was given up; where something was, the first limit in the way and what would help."""
    mission, total = plan.mission, _time(plan.total)
    until = "" if mission.deadline is None else f", deadline {_time(mission.deadline)}"
    if plan.verdict == "met":
        spare = "" if mission.deadline is None else f", {_time(-plan.late)} to spare"
        return [f"{mission.name}: done in {total}{until}{spare}"]
    if plan.verdict == "none":
        given_up, why = "all of it; the plan is to rest", [_reason_for_rest(plan)]
    elif plan.verdict == "late":
        given_up, why = f"the deadline, missed by {_time(plan.late)} ({total}{until})", []
    else:
        shares = zip(mission.names, plan.share.tolist(), strict=True)
        parts = ", ".join(f"{name} {100 * share:.1f} %" for name, share in shares if share < 1 - 1e-4)
        given_up, why = f"part of the work; done: {parts} ({total}{until})", []
    if first := plan.obstacle:
        passed = f"{first.node} passes its {mission.limits[first.node]:g} degC after {_time(first.time)}"
        why.append(f"done straight on at full speed, {passed}, in {first.name}")
    if plan.verdict == "none":
        remedy = []
    elif mission.deadline is not None and mission.fastest > mission.deadline:
        remedy = [f"no rise of the limits would suffice: at its fastest it takes {_time(mission.fastest)}"]
    elif plan.raise_needed is None:
        remedy = ["no rise of the limits up to 100 K was found that would suffice"]
    else:
        remedy = [f"all of it in time would need all limits {plan.raise_needed:.1f} K higher"]
    return [f"{mission.name}: given up: {given_up}", *why, *remedy]


def _reason_for_rest(plan: MissionPlan) -> str:
    over = {node: peak for node, peak in plan.peaks.items() if peak > plan.mission.limits[node]}
    if over:
        node = max(over, key=lambda name: over[name] - plan.mission.limits[name])
        return f"even at rest {node} gets to {over[node]:.1f} degC, its limit is {plan.mission.limits[node]:g} degC"
    return f"no plan was found that does a part of it within the limits (solver: {plan.status})"


def _prices(plan: MissionPlan) -> list[str]:
    if not plan.prices:
        return ["what a limit is worth is not given: the solve did not converge"]
    if plan.bottleneck is None:
        return ["no temperature limit holds it up"]
    more = "work" if plan.verdict == "cut" else "time saved"
    lines: list[str] = []
    for name, price in list(plan.class_prices.items())[:4]:
        tied = [node for node in plan.limit_prices if name in (node, class_of(node))]
        nodes = ", ".join(tied) + " together" * (len(tied) > 1)
        lines.append(f"{'then' if lines else 'bottleneck:'} {nodes}: {price:.1f} s of {more} for 1 K more of the limit")
    return lines


def _check(plan: MissionPlan) -> list[str]:
    limits, peaks = plan.mission.limits, plan.peaks
    if not peaks:
        return []
    node = max(peaks, key=lambda name: peaks[name] - limits[name])
    lines = [f"replayed in fine steps: {node} is nearest to its limit, {peaks[node]:.2f} of {limits[node]:g} degC; "
             f"program and replay differ by {plan.coarseness:.2f} K"]  # fmt: skip
    if plan.coarseness > 0.5:  # K between the program's few steps and the simulation
        lines.append("that is a large difference: divide the activities into more pieces")
    if plan.lowered > 0:
        lines.append(f"found with limits {plan.lowered:.2f} K lower, so that the replay keeps them")
    return lines


def _time(seconds: float) -> str:
    return f"{seconds:.0f} s" if seconds < 600 else f"{seconds / 60:.1f} min"


plan_kind = Kind(read_mission, lambda mission: MissionAnswer(plan_mission(mission)))
