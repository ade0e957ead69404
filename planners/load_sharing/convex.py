"""The convex program of a stance: forces at the feet that keep the hottest joint coolest, or ask for least torque."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray

from .stance import Stance, Statics

_FORCE = 50.0  # N, a size that makes the program's numbers about one
_ROUND = 1e-8  # rounds off the tip of the friction cone, whose slope has no value there
_TIDY = 1e-6  # K/(N·m)², of two sharings equally good the one with less torque is meant
_OPTIONS: dict[str, Any] = {
    "print_time": False,
    "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-9, "max_iter": 200},
}


class StanceError(ValueError):
    """No forces within friction cones and torque limits hold the robot."""


class Share:
    """The program of one stance.

    Temperatures at the horizon grow with the squares of the torques, and torques are linear in the forces; friction
    cones and torque limits are convex. So its one optimum is the best there is.

    Args:
        statics: the equations of the stance.
        stance: friction and least normal force.
    """

    def __init__(self, statics: Statics, stance: Stance) -> None:
        self._statics = statics
        legs, joints = len(statics.standing), statics.most.size
        scaled = ca.SX.sym("f", 3 * legs)
        worst = ca.SX.sym("worst")
        torques = ca.DM(statics.idle) + ca.mtimes(ca.DM(statics.lever), scaled * _FORCE)
        self._w, self._scaled, self._worst, self._torques = ca.vertcat(scaled, worst), scaled, worst, torques
        cones, normals = self._contacts(stance)
        self._rows = ca.vertcat((ca.mtimes(ca.DM(statics.balance), scaled * _FORCE) - statics.weight) / _FORCE, cones)
        self._low = np.concatenate([np.zeros(6), np.full(legs, -np.inf)])
        self._high = np.zeros(6 + legs)
        self._normals = normals
        self._least = np.where(statics.standing, stance.least_normal, 0.0)
        self._joints = joints
        self._solvers: dict[int, Any] = {}

    def _contacts(self, stance: Stance) -> tuple[Any, Any]:
        """The friction cone of each foot, at most zero, and its normal force."""
        up, cones, normals = ca.DM(self._statics.up), [], []
        for k, stands in enumerate(self._statics.standing):
            force = self._scaled[3 * k : 3 * k + 3]
            normal = ca.dot(up, force)
            along = force - normal * up
            cones.append(ca.sqrt(ca.sumsqr(along) + _ROUND) - stance.friction * normal if stands else ca.SX(-1))
            normals.append(normal)
        return ca.vertcat(*cones), ca.vertcat(*normals)

    def coolest(self, warm: FloatArray, gains: FloatArray, limits: FloatArray, near: FloatArray) -> FloatArray:
        """Forces [N], shape (legs, 3), that keep the node nearest to its limit farthest from it.

        Args:
            warm: temperatures at the horizon without any torque [degC], shape (nodes,).
            gains: what each squared torque adds [K/(N·m)²], shape (nodes, joints), none below zero.
            limits: shape (nodes,) [degC], infinite for none.
            near: forces to start from [N].

        Raises:
            StanceError: no forces hold the robot.
        """
        counts = np.isfinite(limits)
        p = np.concatenate([(warm - limits)[counts], gains[counts].T.ravel()])
        return self._solve(int(counts.sum()), p, near)

    def least_torque(self, near: FloatArray) -> FloatArray:
        """Forces [N], shape (legs, 3), with the least sum of squared torques.

        Raises:
            StanceError: no forces hold the robot.
        """
        return self._solve(0, np.zeros(0), near)

    def _solver(self, nodes: int) -> Any:
        """The program for so many limited nodes; without any, the sum of squared torques is what counts."""
        if nodes not in self._solvers:
            above, gains = ca.SX.sym("above", nodes), ca.SX.sym("gains", nodes, self._joints)
            squares = ca.sumsqr(self._torques)
            cost = self._worst + _TIDY * squares if nodes else 1e-2 * squares + self._worst**2
            hot = above + ca.mtimes(gains, self._torques**2) - self._worst
            free = ca.vertcat(self._rows, self._torques, self._normals * _FORCE, hot)
            problem = {"x": self._w, "p": ca.vertcat(above, ca.vec(gains)), "f": cost, "g": free}
            self._solvers[nodes] = ca.nlpsol("share", "ipopt", problem, _OPTIONS)
        return self._solvers[nodes]

    def _solve(self, nodes: int, p: FloatArray, near: FloatArray) -> FloatArray:
        most, legs = self._statics.most, len(self._statics.standing)
        stands = np.repeat(self._statics.standing, 3)
        reach = np.append(np.where(stands, np.inf, 0.0), np.inf)
        low = np.concatenate([self._low, -most, self._least, np.full(nodes, -np.inf)])
        high = np.concatenate([self._high, most, np.full(legs, np.inf), np.zeros(nodes)])
        solver = self._solver(nodes)
        x0 = np.append(near.ravel() / _FORCE, 0.0)
        found = solver(x0=x0, p=p, lbx=-reach, ubx=reach, lbg=low, ubg=high)
        if not solver.stats()["success"]:
            raise StanceError(
                f"stance: no forces within friction cones and torque limits found ({solver.stats()['return_status']}); "
                "expected the centre of mass above the standing feet, and a load that the joints can bear"
            )
        return np.asarray(found["x"].full().ravel()[:-1].reshape(legs, 3) * _FORCE)
