"""The answer to a mission: the fastest plan, or what is given up; the bottleneck and its price; how they show."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal, NamedTuple

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.basics.lines import time_axis
from lptn.basics.places import class_of

from .mission import Course, Mission, MissionSegment, Schedule, Timed, limited_later, segments_of, simulate_plan

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Verdict = Literal["met", "late", "cut", "none"]
"""All is done in time; all is done but later than the deadline; not all is done; nothing can be done but rest."""
EXACT = 0.005  # K by which a replayed plan may pass a limit
COUNTS = 1e-3  # s/K; smaller multipliers are solver dust


class PassedLimit(NamedTuple):
    """The first limit that a mission passes: whose it is, when [s], and the name of the piece in which it is passed."""

    node: str
    time: float
    name: str


@dataclass(frozen=True, repr=False)
class MissionPlan(Schedule):
    """The answer to a mission: a schedule without rests of no length, and further.

    Args:
        mission: what was asked.
        verdict: whether it can be done.
        share: of each activity that is done.
        course: temperatures along it, from the replay in fine steps.
        coarse: greatest temperature of each limited node as the program has it [degC].
        lowered: by how much the limits were lowered so that the replayed plan keeps them [K].
        prices: seconds of the whole (of work done, where the verdict is "cut") for one unit more of a parameter;
            empty where no solve converged.
        raise_needed: by how much all limits together would have to rise for all to be done in time [K]; 0 where
            nothing is missing, `None` where no rise up to 100 K was found that would suffice. Where the verdict is
            "cut" it is enough, and at most a tenth too much.
        status: IPOPT's return status.
        assumed: nodes without a temperature at the start; they are taken to be at their limit.
    """

    mission: Mission
    verdict: Verdict
    share: FloatArray
    course: Course
    coarse: dict[str, float]
    lowered: float
    prices: dict[str, float]
    raise_needed: float | None
    status: str
    assumed: tuple[str, ...] = ()

    def __repr__(self) -> str:
        pieces = f"{len(self.segments)} piece{'s' * (len(self.segments) != 1)}"
        return f"<MissionPlan of {self.mission.name}: {self.verdict}, {pieces}, {self.total:.0f} s>"

    @property
    def late(self) -> float:
        """Seconds after the deadline; negative before it, 0 where there is none."""
        return 0.0 if self.mission.deadline is None else self.total - self.mission.deadline

    @property
    def limit_prices(self) -> dict[str, float]:
        """Seconds gained for one kelvin more of each node's limit, dearest first; only those that count."""
        sign = 1.0 if self.verdict == "cut" else -1.0
        by_node = {name.removeprefix("limit."): sign * value for name, value in self.prices.items() if "limit." in name}
        return dict(sorted(((n, v) for n, v in by_node.items() if v > COUNTS), key=lambda item: -item[1]))

    @property
    def class_prices(self) -> dict[str, float]:
        """Seconds gained for one kelvin more of the limits of all joints of a class, dearest first.

        Joints that are loaded alike reach their limits together. Then one joint's own price is not unique, the sum is.
        """
        by_class: dict[str, float] = {}
        for node, price in self.limit_prices.items():
            by_class[class_of(node)] = by_class.get(class_of(node), 0.0) + price
        return dict(sorted(by_class.items(), key=lambda item: -item[1]))

    @property
    def bottleneck(self) -> str | None:
        """The node whose limit is worth most; `None` where no limit holds the plan up."""
        return next(iter(self.limit_prices), None)

    @property
    def peaks(self) -> dict[str, float]:
        """Greatest temperature of each limited node along the replayed plan [degC]."""
        return peaks_of(self.mission, self.segments, self.course)

    @property
    def obstacle(self) -> PassedLimit | None:
        """Where the mission fails if it is done straight on, as fast as it goes, without rests but those asked for.

        `None` where no limit is passed so.
        """
        mission = self.mission
        asked = [activity for activity in mission.activities if activity.chooses_load]
        room = sum(activity.load[1] - activity.load[0] for activity in asked)
        lacking = mission.carry - sum(activity.load[0] for activity in asked)
        share = min(max(lacking, 0.0) / room, 1.0) if room else 0.0
        pieces = []
        for segment in (segment for segment in segments_of(mission) if segment.activity >= 0):
            activity = mission.activities[segment.activity]
            speed, (low, high) = activity.speed[1], activity.load
            time = segment.length / speed if segment.travels else segment.time[0]
            middle = tuple((least + most) / 2 for least, most in segment.posture)
            pieces.append(Timed(segment, time, speed, low + share * (high - low), middle))
        course = simulate_plan(mission, Schedule(pieces))
        first: PassedLimit | None = None
        for node, limit in mission.limits.items():
            over = np.flatnonzero(course.states[mission.model.places.index(node)] > limit + EXACT)
            if over.size and (first is None or course.time[over[0]] < first.time):
                at = int(np.searchsorted(course.ends, over[0]))
                first = PassedLimit(node, float(course.time[over[0]]), pieces[at].segment.name)
        return first

    @property
    def coarseness(self) -> float:
        """Greatest difference between the program's peaks and the replayed ones [K]."""
        return max((abs(self.peaks[node] - value) for node, value in self.coarse.items()), default=0.0)

    def table(self) -> pd.DataFrame:
        """A row for each piece of the plan; with the temperature of every node at its end."""
        places = self.mission.model.places
        ends = self.course.states[: len(places), self.course.ends]
        columns: dict[str, object] = {
            "start [s]": np.concatenate([[0.0], np.cumsum(self.time)])[:-1], "duration [s]": self.time,
            "activity": [segment.name for segment in self.segments],
            "speed [m/s]": self.speed, "load [kg]": self.load, "distance [m]": self.speed * self.time,
            "hottest": [places[k] for k in ends.argmax(axis=0)] if self.segments else [],
        }  # fmt: skip
        named = [dict(zip(piece.segment.gait.postures, piece.posture, strict=True)) for piece in self.pieces]
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
        from lptn.basics.style import TEXT, new_figure, plain

        figure = new_figure(6.4)
        upper, lower = np.asarray(figure.subfigures(2, 1, height_ratios=[3.2, 1]))
        top = upper.subplots(2, 1, sharex=True, height_ratios=[2.6, 1])
        _draw_temperatures(top[0], self)
        _draw_speed_and_load(top[1], self)
        _draw_prices(lower.subplots(), self)
        figure.suptitle(plain(f"{self.mission.name}: {_VERDICTS[self.verdict]}"), fontsize=TEXT + 1)
        return figure

    def as_json(self) -> dict[str, object]:
        """The whole answer, SI and degC; `seconds_per_kelvin` counts what one kelvin more of a limit gains."""
        mission, first = self.mission, self.obstacle
        rows = self._activities().rename(columns=lambda name: name.partition(" ")[0]).to_dict("records")
        return {
            "mission": mission.name, "verdict": self.verdict, "total": self.total, "deadline": mission.deadline,
            "late": self.late if mission.deadline is not None else None, "plan": rows,
            "done": [
                {"activity": activity.do, "share": share}
                for activity, share in zip(mission.activities, self.share.tolist(), strict=True)
            ],
            "obstacle": None if first is None else {"node": first.node, "time": first.time, "in": first.name},
            "bottleneck": self.bottleneck, "seconds_per_kelvin": self.limit_prices,
            "seconds_per_kelvin_of_class": self.class_prices, "prices": self.prices,
            "raise_needed": self.raise_needed, "limits": mission.limits, "peaks": self.peaks,
            "limits_lowered": self.lowered, "program_peaks": self.coarse, "coarseness": self.coarseness,
            "solver": self.status, "assumed": list(self.assumed),
        }  # fmt: skip

    def text(self) -> str:
        """What was given up first, then what is in the way, then the self."""
        lines = _verdict(self)
        if self.assumed:
            nodes = ", ".join(self.assumed)
            lines.append(f"no temperature of {nodes}: taken to be at its limit, or as hot as the hottest")
        table = self._activities()
        if table.empty:
            return "\n".join([*lines, *_prices(self), "", "nothing to do", "", *_check(self)])
        table["[degC]"] = self.course.states[: len(self.mission.model.places), self.course.ends].max(axis=0)
        table.columns = table.columns.map(lambda name: _HEADS.get(name, name))
        formats = {name: "{:.3g}" for segment in self.segments for name in segment.gait.postures} | {
            "from [s]": "{:.0f}", "for [s]": "{:.0f}", "[m/s]": "{:.2f}", "[kg]": "{:.1f}", "[m]": "{:.0f}",
            "[degC]": "{:.1f}",
        }  # fmt: skip
        rows = table.to_string(index=False, formatters={name: form.format for name, form in formats.items()})
        return "\n".join([*lines, *_prices(self), *_check(self), "", rows])


def peaks_of(mission: Mission, segments: Sequence[MissionSegment], course: Course) -> dict[str, float]:
    """Greatest temperature of each limited node along a course [degC], from where its limit counts."""
    later, peaks = limited_later(mission, segments), {}
    for node in mission.limits:
        pieces, _ = later.get(node, (0, np.inf))
        begin = course.ends[pieces - 1] if pieces else 0
        peaks[node] = float(course.states[mission.model.places.index(node), begin:].max())
    return peaks


# --- in words -------------------------------------------------------------------------------------

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


# --- as a figure ----------------------------------------------------------------------------------

_VERDICTS = {
    "met": "all done",
    "late": "all done, after the deadline",
    "cut": "a part done",
    "none": "nothing but rest",
}


def _draw_temperatures(ax: Axes, plan: MissionPlan) -> None:
    from lptn.basics.style import LIMIT, PALETTE, SMALL, dress, plain

    nodes = plan.mission.model.places
    classes = list(dict.fromkeys(class_of(node) for node in nodes))
    time, _ = time_axis(plan.course.time)
    seen: set[str] = set()
    for row, node in enumerate(nodes):
        group = class_of(node)
        label = None if group in seen else plain(group)
        seen.add(group)
        colour = PALETTE[classes.index(group) % len(PALETTE)]
        ax.plot(time, plan.course.states[row], lw=1.0, color=colour, label=label)
    for limit in sorted(set(plan.mission.limits.values())):
        held = [class_of(node) for node, most in plan.mission.limits.items() if most == limit]
        ax.axhline(limit, color=LIMIT, lw=1.0, ls=(0, (4, 2)))
        named = ", ".join(dict.fromkeys(held))
        ax.annotate(f"limit of {plain(named)}", (0.005, limit), (0, 2), xycoords=("axes fraction", "data"),
                    textcoords="offset points", fontsize=SMALL, color=LIMIT)  # fmt: skip
    ax.set_ylabel("temperature [°C]")
    ax.set_ylim(top=max([*plan.mission.limits.values(), float(plan.course.states.max())]) + 4)
    ax.legend(frameon=False, fontsize=SMALL, ncols=len(classes), loc="lower right")
    dress(ax)


def _draw_speed_and_load(ax: Axes, plan: MissionPlan) -> None:
    from lptn.basics.style import FAINT, INK, PALETTE, SHADE, SMALL, dress

    edges = np.concatenate([[0.0], np.cumsum(plan.time)])
    scale = 1 / 60 if time_axis(plan.course.time)[1].endswith("[min]") else 1.0
    for segment, begin, end in zip(plan.segments, edges[:-1] * scale, edges[1:] * scale, strict=True):
        if segment.gait is plan.mission.rest:
            ax.axvspan(begin, end, color=SHADE, lw=0)
            if end - begin > 0.05 * edges[-1] * scale:
                ax.annotate("rest", ((begin + end) / 2, 0.5), xycoords=("data", "axes fraction"), ha="center",
                            fontsize=SMALL, color=FAINT)  # fmt: skip
    ax.stairs(plan.speed, edges * scale, color=INK, lw=1.4, baseline=None)
    ax.set(xlabel=time_axis(plan.course.time)[1], ylabel="speed [m/s]")
    ax.set_ylim(0, max(1.15 * float(plan.speed.max(initial=0.0)), 0.1))
    other = ax.twinx()
    other.stairs(plan.load, edges * scale, color=PALETTE[0], lw=1.4, ls=(0, (5, 1.5)), baseline=None)
    other.set_ylim(0, max(1.3 * float(plan.load.max(initial=0.0)), 0.1))
    other.set_ylabel("load [kg]", color=PALETTE[0])
    other.tick_params(labelsize=SMALL, colors=PALETTE[0])
    other.spines["top"].set_visible(False)
    dress(ax)


def _draw_prices(ax: Axes, plan: MissionPlan) -> None:
    from lptn.basics.style import PALETTE, SMALL, dress, plain

    shown = list(plan.class_prices.items())[:8][::-1]
    ax.barh(range(len(shown)), [price for _, price in shown], 0.6, color=PALETTE[0])
    ax.set_yticks(range(len(shown)), [plain(name) for name, _ in shown])
    what = "work gained" if plan.verdict == "cut" else "time saved"
    ax.set_xlabel(f"{what} by one kelvin more of the limit [s/K]")
    if not shown:
        said = "no temperature limit holds it up" if plan.prices else "not given: the solve did not converge"
        ax.annotate(said, (0.5, 0.5), xycoords="axes fraction", ha="center", fontsize=SMALL)
        ax.set_yticks([])
    ax.set_ylim(-0.6, max(len(shown), 3) - 0.4)
    dress(ax)
