"""A mission's plan in one figure: temperatures with their limits, speed and load, and what each limit is worth."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lptn.basics.lines import time_axis
from lptn.basics.places import class_of
from lptn.basics.style import FAINT, INK, LIMIT, PALETTE, SHADE, SMALL, TEXT, dress, new_figure, plain

from .plan import MissionPlan

_VERDICTS = {
    "met": "all done",
    "late": "all done, after the deadline",
    "cut": "a part done",
    "none": "nothing but rest",
}


def mission_figure(plan: MissionPlan) -> Figure:
    """Draw a plan."""
    figure = new_figure(6.4)
    upper, lower = np.asarray(figure.subfigures(2, 1, height_ratios=[3.2, 1]))
    top = upper.subplots(2, 1, sharex=True, height_ratios=[2.6, 1])
    _temperatures(top[0], plan)
    _speed_and_load(top[1], plan)
    _prices(lower.subplots(), plan)
    figure.suptitle(plain(f"{plan.mission.name}: {_VERDICTS[plan.verdict]}"), fontsize=TEXT + 1)
    return figure


def _temperatures(ax: Axes, plan: MissionPlan) -> None:
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


def _speed_and_load(ax: Axes, plan: MissionPlan) -> None:
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


def _prices(ax: Axes, plan: MissionPlan) -> None:
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
