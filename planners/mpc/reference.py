"""The same optimal-control problem as one nonlinear program for IPOPT: the yardstick, and the slow fallback."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.model.model import rk4

from ..heating import Heating
from .settings import SLACK_PRICES, Settings

_OPTIONS: dict[str, Any] = {
    "print_time": False,
    "error_on_fail": False,
    "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-9, "max_iter": 300, "mu_strategy": "adaptive"},
}


@dataclass(frozen=True)
class ReferenceSolution:
    """What IPOPT found.

    Args:
        scale: heat scales, shape (stages, joints).
        temperatures: at the ends of the stages [degC], shape (states, stages + 1).
        slack: K above each limit, shape (stages, limited nodes).
        cost: 0 for all that was requested, 1 for nothing; slack not counted.
        converged: whether IPOPT says so.
    """

    scale: FloatArray
    temperatures: FloatArray
    slack: FloatArray
    cost: float
    converged: bool


class ReferenceProgram:
    """Direct multiple shooting, RK4, in heat scales.

    Args:
        heating: the model.
        settings: limits, weights and stages.
    """

    def __init__(self, heating: Heating, settings: Settings) -> None:
        self.heating, self.settings = heating, settings
        self._solver = self._build()

    def solve(self, start: FloatArray, request: FloatArray, conditions: FloatArray) -> ReferenceSolution:
        """Solve it.

        Args:
            start: states [degC].
            request: RMS of each stage, shape (stages, joints).
            conditions: means of each stage, shape (stages, conditions).
        """
        settings, p = self.settings, self.heating.model.values
        n, joints = len(settings.stages), len(self.heating.joints)
        weight = settings.stages[:, None] * settings.weights * request**2
        weight = np.maximum(weight / weight.sum(), 1e-9) if weight.sum() > 0 else np.full_like(weight, 1 / weight.size)
        most = self._most(start, request, p)
        nodes = [self.heating.model.places.index(node) for node in settings.limits]
        asked, floor = np.maximum(np.abs(request), 1e-12), 1e-3  # of the heat scale, as in `c/linear.inc`
        least = np.maximum(floor * most, np.minimum((settings.floors / asked) ** 2, most))
        rows = len(nodes) + bool(np.isfinite(settings.power))  # limits of a stage
        lower = np.concatenate([np.ravel(least), np.full(n * len(start), -ca.inf), np.zeros(n * rows)])
        upper = np.concatenate([np.ravel(most), np.full(n * (len(start) + rows), ca.inf)])
        guess = np.concatenate([np.ravel(0.5 * most), np.tile(start, n), np.full(n * rows, 0.1)])
        limits = settings.limits_from(start[nodes]).T
        parameters = [np.ravel(each) for each in (start, request**2, conditions, weight, p, limits)]
        bounds = np.zeros(n * (len(start) + rows))
        low = bounds.copy()
        low[n * len(start) :] = -ca.inf
        solution = self._solver(x0=guess, lbx=lower, ubx=upper, lbg=low, ubg=bounds, p=np.concatenate(parameters))
        flat = np.asarray(solution["x"]).ravel()
        scale, states, slack = np.split(flat, [n * joints, n * (joints + len(start))])
        scale = np.clip(scale.reshape(n, joints), 0, most)
        return ReferenceSolution(
            scale,
            np.vstack([start, states.reshape(n, len(start))]).T,
            slack.reshape(n, rows)[:, : len(nodes)],
            float((weight * (1 - np.sqrt(scale)) ** 2).sum()),
            bool(self._solver.stats()["success"]),
        )

    def _most(self, start: FloatArray, request: FloatArray, p: FloatArray) -> FloatArray:
        """Largest heat scale that the current limit allows, at the present temperatures."""
        heating, settings = self.heating, self.settings
        if not np.isfinite(settings.currents).any():
            return np.ones_like(request)
        gain = np.asarray(ca.Function("gain", [heating.x, heating.p], [heating.gain])(start, p)).ravel()
        current = np.abs(request) * gain
        return np.where(current > settings.currents, (settings.currents / np.maximum(current, 1e-12)) ** 2, 1.0)

    def _build(self) -> Any:
        heating, settings = self.heating, self.settings
        states, joints, others = heating.x.numel(), len(heating.joints), len(heating.conditions)
        nodes, n = [heating.model.places.index(node) for node in settings.limits], len(settings.stages)
        limited = bool(np.isfinite(settings.power))
        s, x, e = ca.MX.sym("s", joints, n), ca.MX.sym("x", states, n), ca.MX.sym("e", len(nodes) + limited, n)
        start, square = ca.MX.sym("start", states), ca.MX.sym("square", joints, n)
        d, weight = ca.MX.sym("d", others, n), ca.MX.sym("weight", joints, n)
        p = ca.MX.sym("p", heating.p.numel())
        following = []
        powers = ca.MX(int(limited), 0 if limited else n)
        before = start
        for k in range(n):
            if limited:  # at the middle of the stage, as in C
                middle = (before + x[:, k]) / 2
                power, _ = heating.power_function()(middle, s[:, k] * square[:, k], d[:, k], p)
                powers = ca.horzcat(powers, ca.sum1(power) / settings.power - 1)
            step = self._step(float(settings.stages[k]))
            following.append(step(before, s[:, k] * square[:, k], d[:, k], p) - x[:, k])
            before = x[:, k]
        limits = ca.MX.sym("limits", len(nodes), n)
        over = ca.vertcat(x[nodes, :] - limits, powers) - e
        linear, quadratic = SLACK_PRICES
        cost = ca.sum1(ca.vec(weight * (1 - ca.sqrt(s)) ** 2))
        cost += linear * ca.sum1(ca.vec(e)) + quadratic / 2 * ca.sumsqr(e)
        program = {
            "x": ca.veccat(s, x, e),
            "p": ca.veccat(start, square, d, weight, p, limits),
            "f": cost,
            "g": ca.vertcat(*following, ca.vec(over)),
        }
        return ca.nlpsol("reference", "ipopt", program, {**_OPTIONS, "expand": True})

    def _step(self, h: float) -> ca.Function:
        """(x, heat, d, p) -> x after h seconds, by RK4."""
        heating = self.heating
        # In parts of some 5 s RK4 is exact to 1e-4 K on joints of a minute's time constant.
        parts = max(1, round(h / 5.0))
        rate, part, x, heat = heating.rate_function(), h / parts, heating.x, ca.SX.sym("heat", len(heating.joints))
        for _ in range(parts):
            x = rk4(lambda state: rate(state, heat, heating.d, heating.p), x, part)
        return ca.Function("step", [heating.x, heat, heating.d, heating.p], [x])
