"""`kind = "track"` for `lptn plan`: the closest admissible torques or currents over a whole task, and how they show."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import inf
from pathlib import Path
from subprocess import CalledProcessError
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.model.model import Model

from ..heating import heating
from .controller import TorqueMPC
from .reference import ReferenceProgram
from .settings import settle
from .task import TrackTask, read_task

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
        slack: by how much each limit is passed at the end of each step [K], shape (steps, limited nodes).
        cost: 0 for all that was asked, 1 for nothing.
        solver: which found it.
        given_up: in words.
    """

    task: TrackTask
    admitted: FloatArray
    temperatures: FloatArray
    limits: dict[str, float]
    slack: FloatArray
    cost: float
    solver: str
    given_up: tuple[str, ...]

    @property
    def joints(self) -> tuple[str, ...]:
        """Names, in order."""
        return heating(self.task.model, self.task.request).joints

    @property
    def shares(self) -> FloatArray:
        """Admitted as a share of what was asked, by joint, both summed over the steps; NaN where nothing is asked."""
        asked = np.abs(self.task.asked).sum(axis=0)
        with np.errstate(invalid="ignore"):
            return np.asarray(np.where(asked > 0, np.abs(self.admitted).sum(axis=0) / asked, np.nan))

    def table(self) -> pd.DataFrame:
        """A row a step: what was asked, what is admitted, temperatures at its end, slack."""
        task, model = self.task, self.task.model
        unit = heating(model, task.request).unit
        columns: dict[str, object] = {"time [s]": task.period * np.arange(len(task.asked))}
        for number, joint in enumerate(self.joints):
            columns[f"requested.{joint} [{unit}]"] = task.asked[:, number]
            columns[f"{task.request}.{joint} [{unit}]"] = self.admitted[:, number]
        for number, node in enumerate(model.places):
            columns[f"temperature.{node} [degC]"] = self.temperatures[number, 1:]
        for number, node in enumerate(self.limits):
            columns[f"slack.{node} [K]"] = self.slack[:, number]
        return pd.DataFrame(columns)

    def figure(self) -> Figure:
        """Asked and admitted values, temperatures with their limits, slack."""
        from .figure import track_figure

        return track_figure(self.task, self.joints, self.admitted, self.temperatures, self.limits)

    def as_json(self) -> dict[str, object]:
        """The plan by joint and node, in SI and degC."""
        task = self.task
        nodes = {
            node: {"limit": limit, "hottest": float(self.temperatures[task.model.places.index(node)].max()),
                   "slack": float(self.slack[:, number].max())}
            for number, (node, limit) in enumerate(self.limits.items())
        }  # fmt: skip
        return {
            "kind": "track",
            "name": task.name,
            "request": task.request,
            "period": task.period,
            "cost": self.cost,
            "solver": self.solver,
            "given_up": list(self.given_up),
            "joints": {
                joint: {"share": float(self.shares[number]), "requested": task.asked[:, number].tolist(),
                        "admitted": self.admitted[:, number].tolist()}
                for number, joint in enumerate(self.joints)
            },
            "nodes": nodes,
        }  # fmt: skip

    def text(self) -> str:
        """What was given up, what each joint gets, what limits it."""
        lines = [f"Given up: {sentence}." for sentence in self.given_up]
        lines += [f"{'joint':16} {'share admitted':>14} {'least':>9} {'hottest':>10} {'limit':>7}"]
        hottest = self.temperatures.max(axis=1)
        unit = heating(self.task.model, self.task.request).unit
        for number, joint in enumerate(self.joints):
            node = self.task.model.nodes.index(joint) if joint in self.task.model.nodes else None
            share = f"{self.shares[number]:14.1%}" if np.isfinite(self.shares[number]) else f"{'-':>14}"
            least = np.abs(self.admitted[:, number]).min()
            warm = "" if node is None else f" {hottest[node]:7.1f} °C {self.limits.get(joint, inf):7.5g}"
            lines.append(f"{joint:16} {share} {least:5.3g} {unit}{warm}".replace(" inf", "   -"))
        lines.append(f"Over {self.task.duration:g} s in steps of {self.task.period:g} s; {self.solver}.")
        return "\n".join(lines)


class TrackKind:
    """`kind = "track"`."""

    def read(self, table: Mapping[str, Any], origin: str, model: Model) -> TrackTask:
        """A task from the whole parsed task file.

        Raises:
            InputError: something in it can't be used.
        """
        return read_task(table, origin, model)

    def run(self, task: TrackTask) -> TrackAnswer:
        """The optimum over the whole task, a stage for each period; by IPOPT where the C solver can't be had."""
        settings = task.settings | {"horizon": task.duration, "stages": len(task.asked)}
        try:
            mpc = TorqueMPC(task.model, task.file.limits, **settings, model_error=0.0, level=0.5)
        except (OSError, CalledProcessError):
            return _by_ipopt(task, settings, "there is no C compiler")
        plan = mpc.step(task.start[: len(task.model.nodes)], task.asked, task.conditions)
        if not plan.converged:
            return _by_ipopt(task, settings, "the C solver did not converge")
        solver = "the full request stays cool" if plan.full else f"interior point in C, {plan.iterations} iterations"
        return _answer(task, plan.currents, plan.temperatures, mpc.settings.limits, plan.cost, solver, plan.given_up)

    def emit_c(self, task: TrackTask, folder: Path) -> list[Path]:
        """The controller of the table `[controller]` as C, with a `main.c` that runs it."""
        table = task.file.controller
        mpc = TorqueMPC(task.model, task.file.limits, **task.settings, horizon=table.horizon, stages=table.stages,
                        noise=table.noise, resolution=table.resolution, level=table.level,
                        model_error=table.model_error, lost_sensor=table.lost_sensor)  # fmt: skip
        return mpc.emit(folder, task.start, task.asked, task.conditions)


def _by_ipopt(task: TrackTask, settings: dict[str, Any], why: str) -> TrackAnswer:
    heat = heating(task.model, task.request)
    given = {key: value for key, value in settings.items() if key != "request"}
    spread = settle(
        heat, task.file.limits, **given, noise=0.1, resolution=0.0, level=0.5, model_error=0.0, standard_errors={}
    )
    solution = ReferenceProgram(heat, spread).solve(task.start, task.asked, task.conditions)
    given_up = () if solution.converged else ("IPOPT did not converge either; this plan is not proven best",)
    slack = zip(spread.limits, solution.slack.max(axis=0), strict=True)
    worst = {node: over for node, over in slack if over > 1e-3}  # K; less is the solver's own
    if worst:
        where = ", ".join(f"{node} by {over:.2g} K" for node, over in worst.items())
        given_up = (f"a limit less its margin can't be met: {where}", *given_up)
    return _answer(task, np.sqrt(solution.scale) * task.asked, solution.temperatures, spread.limits, solution.cost,
                   f"IPOPT, for {why}", given_up)  # fmt: skip


def _answer(
    task: TrackTask,
    admitted: FloatArray,
    temperatures: FloatArray,
    limits: dict[str, float],
    cost: float,
    solver: str,
    given_up: tuple[str, ...],
) -> TrackAnswer:
    rows = [task.model.places.index(node) for node in limits]
    over = temperatures[rows, 1:].T - np.array(list(limits.values()))
    return TrackAnswer(task, admitted, temperatures, limits, np.maximum(over, 0.0), cost, solver, given_up)


plan_kind = TrackKind()
