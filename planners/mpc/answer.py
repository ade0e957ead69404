"""`kind = "track"` for `lptn plan`: the closest admissible torques or currents over a whole task, and how they show."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from pathlib import Path
from subprocess import CalledProcessError
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray

from ..tasks import Kind
from .controller import TorqueMPC
from .reference import ReferenceProgram
from .settings import Settings
from .task import TrackFile, TrackTask

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class TrackAnswer:
    """A plan over a whole task.

    Args:
        task: what was asked.
        admitted: RMS values, shape (steps, joints).
        temperatures: of the states at the n + 1 ends of the steps [degC], shape (states, steps + 1).
        limits: degC by node, the margin not taken off.
        cost: 0 for all that was asked, 1 for nothing.
        solver: which found it.
        given_up: in words.
    """

    task: TrackTask
    admitted: FloatArray
    temperatures: FloatArray
    limits: dict[str, float]
    cost: float
    solver: str
    given_up: tuple[str, ...]

    @property
    def slack(self) -> FloatArray:
        """By how much each limit is passed at the end of each step [K], shape (steps, limited nodes)."""
        rows = [self.task.heating.model.places.index(node) for node in self.limits]
        return np.asarray(np.maximum(self.temperatures[rows, 1:].T - np.array(list(self.limits.values())), 0.0))

    @property
    def shares(self) -> FloatArray:
        """Admitted as a share of what was asked, by joint, both summed over the steps; NaN where nothing is asked."""
        asked = np.abs(self.task.asked).sum(axis=0)
        with np.errstate(invalid="ignore"):
            return np.asarray(np.where(asked > 0, np.abs(self.admitted).sum(axis=0) / asked, np.nan))

    @property
    def power(self) -> FloatArray | None:
        """Of all joints together at the supply [W], shape (steps,); `None` where it has no limit."""
        task, heat = self.task, self.task.heating
        if task.file.task.power_limit is None:
            return None
        middles = (self.temperatures[:, :-1] + self.temperatures[:, 1:]) / 2
        points = zip(middles.T, self.admitted**2, task.conditions, strict=True)
        power = heat.power_function()
        return np.array([power(x, square, d, heat.model.values)[0].full().sum() for x, square, d in points])

    def table(self) -> pd.DataFrame:
        """A row a step: what was asked, what is admitted, temperatures at its end, slack; a power that is limited."""
        task, heat, slack = self.task, self.task.heating, self.slack
        columns: dict[str, object] = {"time [s]": task.period * np.arange(len(task.asked))}
        for number, joint in enumerate(heat.joints):
            columns[f"requested.{joint} [{heat.unit}]"] = task.asked[:, number]
            columns[f"{heat.request}.{joint} [{heat.unit}]"] = self.admitted[:, number]
        for number, node in enumerate(heat.model.places):
            columns[f"temperature.{node} [degC]"] = self.temperatures[number, 1:]
        for number, node in enumerate(self.limits):
            columns[f"slack.{node} [K]"] = slack[:, number]
        if (power := self.power) is not None:
            columns["power [W]"] = power
        return pd.DataFrame(columns)

    def figure(self) -> Figure:
        """For each joint its request and what is admitted above, its temperature with its limit below.

        Drawn are the twelve joints that get the smallest share.
        """
        from matplotlib.lines import Line2D

        from lptn.basics.lines import time_axis
        from lptn.basics.style import BEST, GIVEN, INK, LIMIT, MEASURED, SMALL, TEXT, dress, new_figure, plain

        task, heat, limits = self.task, self.task.heating, self.limits
        shares = np.nan_to_num(self.shares, nan=1.0)
        chosen = sorted(int(number) for number in np.argsort(shares, kind="stable")[:12])
        columns, rows = min(3, len(chosen)), -(-len(chosen) // 3)
        figure = new_figure(2.8 * rows + 0.5)
        axes = figure.subplots(2 * rows, columns, squeeze=False, sharex=True, sharey=False)
        ends, label = time_axis(np.arange(len(task.asked) + 1, dtype=float) * task.period)
        temperatures = dict(zip(heat.model.places, self.temperatures, strict=False))
        for ax in axes.ravel():
            ax.set_visible(False)
        for place, number in enumerate(chosen):
            row, column = divmod(place, columns)
            upper, lower = axes[2 * row, column], axes[2 * row + 1, column]
            joint = heat.joints[number]
            upper.set_visible(True)
            upper.stairs(np.abs(task.asked[:, number]), ends, baseline=None, color=INK, linewidth=MEASURED["linewidth"])
            upper.stairs(np.abs(self.admitted[:, number]), ends, baseline=None, color=BEST["color"], linewidth=1.8)
            upper.set_ylim(bottom=0)
            upper.set_title(plain(joint), size=TEXT, loc="left", pad=3)
            if joint in temperatures:
                lower.set_visible(True)
                lower.plot(ends, temperatures[joint], **GIVEN)
                lower.margins(y=0.12)
            if joint in temperatures and joint in limits:
                over = np.maximum(temperatures[joint], limits[joint])
                lower.axhline(limits[joint], color=LIMIT, linewidth=1.2)
                lower.fill_between(ends, limits[joint], over, color=LIMIT, alpha=0.35, linewidth=0)
            if column == 0:
                upper.set_ylabel(f"{heat.request} [{heat.unit.replace('*', '·')}]", size=SMALL)
                lower.set_ylabel("temp. [°C]", size=SMALL)
            if place + columns >= len(chosen):
                lower.set_xlabel(label, size=SMALL)
                lower.tick_params(labelbottom=True)
            dress(upper)
            dress(lower)
        handles = [
            Line2D([], [], color=INK, linewidth=0.8, label="requested"),
            Line2D([], [], color=BEST["color"], linewidth=1.8, label="admitted"),
            Line2D([], [], label="temperature", **GIVEN),
            Line2D([], [], color=LIMIT, linewidth=1.2, label="limit"),
        ]
        if any(temperatures[node][1:].max() > limit for node, limit in limits.items()):
            handles.append(Line2D([], [], color=LIMIT, alpha=0.35, linewidth=6, label="slack"))
        figure.legend(handles=handles, loc="outside upper center", ncols=5, fontsize=SMALL, frameon=False)
        return figure

    def as_json(self) -> dict[str, object]:
        """The plan by joint and node, in SI and degC."""
        task, heat = self.task, self.task.heating
        hottest = dict(zip(heat.model.places, self.temperatures.max(axis=1).tolist(), strict=False))
        slack = dict(zip(self.limits, self.slack.max(axis=0).tolist(), strict=True))
        return {
            "kind": "track",
            "name": task.file.task.name,
            "request": heat.request,
            "period": task.period,
            "cost": self.cost,
            "solver": self.solver,
            "given_up": list(self.given_up),
            "joints": {
                joint: {"share": share, "requested": asked, "admitted": admitted}
                for joint, share, asked, admitted in zip(
                    heat.joints, self.shares.tolist(), task.asked.T.tolist(), self.admitted.T.tolist(), strict=True
                )
            },
            "nodes": {
                node: {"limit": limit, "hottest": hottest[node], "slack": slack[node]}
                for node, limit in self.limits.items()
            },
        }

    def text(self) -> str:
        """What was given up, what each joint gets, what limits it."""
        task, nodes, unit = self.task, self.task.heating.model.nodes, self.task.heating.unit
        lines = [f"Given up: {sentence}." for sentence in self.given_up]
        if (power := self.power) is not None:
            lines.append(f"Power at the supply: at most {power.max():.4g} W of {task.file.task.power_limit:g} W.")
        lines += [f"{'joint':16} {'share admitted':>14} {'least':>9} {'hottest':>10} {'limit':>7}"]
        hottest, least = self.temperatures.max(axis=1), np.abs(self.admitted).min(axis=0)
        for joint, part, smallest in zip(task.heating.joints, self.shares, least, strict=True):
            share = f"{part:14.1%}" if np.isfinite(part) else f"{'-':>14}"
            warm = ""
            if joint in nodes:
                warm = f" {hottest[nodes.index(joint)]:7.1f} °C {self.limits.get(joint, inf):7.5g}"
            lines.append(f"{joint:16} {share} {smallest:5.3g} {unit}{warm}".replace(" inf", "   -"))
        steps = len(task.asked)
        lines.append(f"Over {task.period * steps:g} s in steps of {task.period:g} s; {self.solver}.")
        return "\n".join(lines)


def _track(task: TrackTask) -> TrackAnswer:
    """The optimum over the whole task, a stage for each period; by IPOPT where the C solver can't be had."""
    heat, steps = task.heating, len(task.asked)
    settings = task.settings | {"horizon": task.period * steps, "stages": steps, "model_error": 0.0, "level": 0.5}
    try:
        mpc = TorqueMPC(heat.model, task.file.limits, request=heat.request, **settings)
    except (OSError, CalledProcessError):
        return _by_ipopt(task, settings, "there is no C compiler")
    plan = mpc.step(task.start[: len(heat.model.nodes)], task.asked, task.conditions)
    if not plan.converged:
        return _by_ipopt(task, settings, "the C solver did not converge")
    solver = "the full request stays cool" if plan.full else f"interior point in C, {plan.iterations} iterations"
    return TrackAnswer(task, plan.currents, plan.temperatures, mpc.settings.limits, plan.cost, solver, plan.given_up)


def _by_ipopt(task: TrackTask, settings: dict[str, Any], why: str) -> TrackAnswer:
    spread = Settings(task.heating, task.file.limits, **settings)
    solution = ReferenceProgram(task.heating, spread).solve(task.start, task.asked, task.conditions)
    given_up = () if solution.converged else ("IPOPT did not converge either; this plan is not proven best",)
    slack = zip(spread.limits, solution.slack.max(axis=0), strict=True)
    worst = ", ".join(f"{node} by {over:.2g} K" for node, over in slack if over > 1e-3)  # K; less is the solver's own
    if worst:
        given_up = (f"a limit less its margin can't be met: {worst}", *given_up)
    return TrackAnswer(
        task, np.sqrt(solution.scale) * task.asked, solution.temperatures, spread.limits, solution.cost,
        f"IPOPT, for {why}", given_up,
    )  # fmt: skip


def _emit_c(task: TrackTask, folder: Path) -> list[Path]:
    """The controller of the table `[controller]` as C, with a `main.c` that runs it."""
    heat, controller = task.heating, task.file.controller.model_dump()
    mpc = TorqueMPC(heat.model, task.file.limits, request=heat.request, **task.settings, **controller)
    return mpc.emit(folder, task.start, task.asked, task.conditions)


plan_kind = Kind(TrackFile, TrackTask, _track, _emit_c)
