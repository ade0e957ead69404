"""Load sharing: how the legs of a standing robot share its weight so that the first joint to get hot lasts longest.

Torques are linear in the forces at the feet, friction cones and torque limits are convex, and the temperatures at a
horizon grow with the squared torques: a convex program. The best sharing so far sets the horizon of the next program.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.model.model import Model

from ..values import by_place
from .body import Body, Stance, Statics, statics
from .temperatures import StandingTemperatures

How = Literal["coolest", "equal", "least_torque"]
_NOW = 60.0  # s, the horizon where a limit is passed already
_FORCE = 50.0  # N, a size that makes the program's numbers about one
_OPTIONS: dict[str, Any] = {
    "print_time": False,
    "ipopt": {"print_level": 0, "sb": "yes", "tol": 1e-9, "max_iter": 200},
}


class StanceError(ValueError):
    """No forces within friction cones and torque limits hold the robot."""


@dataclass(frozen=True, repr=False)
class Sharing:
    """Forces at the feet, and what they mean for the joints.

    Args:
        how: `coolest`; or a peer, `equal` or `least_torque`.
        forces: of the ground on the feet [N], in the trunk's frame, shape (legs, 3).
        torques: of `joints` [N·m], shape (joints,).
        joints: their names, in the body's order, as in `Stance.angles`.
        time: until the first node is at its limit [s]; infinite where none gets there within the horizon.
        first: that node; `None` where none gets there.
        margin: least distance of any node from its limit at the horizon [K]; negative where one is past it.
        grip: greatest share of the friction that a foot uses; above 1 it slips.
        effort: greatest share of its torque limit that a joint uses; above 1 it can't.
        rounds: programs that were solved.
    """

    how: How
    forces: FloatArray
    torques: FloatArray
    joints: tuple[str, ...]
    time: float
    first: str | None
    margin: float
    grip: float
    effort: float
    rounds: int = 0

    def __repr__(self) -> str:
        ends = "no limit is reached" if self.first is None else f"{self.first} is at its limit after {self.time:.0f} s"
        return f"<Sharing {self.how}: {ends}>"


class LoadSharing:
    """A robot's body and its thermal model.

    Args:
        model: the thermal model, with the body's joints as nodes.
        body: kinematics, masses, torque limits.
        limits: greatest temperature by node, or by pattern of nodes [degC].
        ambient: of the air [degC].
        inputs: further inputs of the model by column, such as `{"power.pc": 16}`.
        torque_constant: torque at the joint per ampere [N·m/A], for a model that is driven by currents.
        horizon: how far is looked [s].

    Raises:
        InputError: model and body don't fit together, or a limit has no node.
    """

    def __init__(
        self,
        model: Model,
        body: Body,
        limits: Mapping[str, float],
        *,
        ambient: float = 25.0,
        inputs: Mapping[str, float] | None = None,
        torque_constant: float | None = None,
        horizon: float = 3600.0,
    ) -> None:
        self.model, self.body, self.horizon = model, body, horizon
        self._limits = np.full(len(model.nodes), np.inf)
        for node, most in by_place(limits, model.nodes, "load sharing", "limits").items():
            self._limits[model.nodes.index(node)] = most
        if not np.isfinite(self._limits).any():
            raise InputError("limits", "limits", "none", "the greatest temperature of a node at least")
        self._temperatures = StandingTemperatures(
            model, body.joints, ambient=ambient, inputs=inputs, torque_constant=torque_constant
        )

    def share(self, stance: Stance, temperatures: float | Mapping[str, float], *, rounds: int = 25) -> Sharing:
        """The forces with which the first joint to get hot lasts longest.

        At a horizon that the best sharing so far just reaches, the convex program finds a cooler one; that one lasts
        longer, and so on. For a model that is linear in its temperatures the end is the best there is; else the gains
        are taken anew in each round.

        Args:
            stance: posture and load.
            temperatures: now [degC], one for all nodes or one for each.
            rounds: at most; it ends where one gains less than 1e-4 of the time, or 1 mK where no limit is reached.

        Raises:
            StanceError: no forces within friction cones and torque limits hold the robot.
            ValueError: the stance doesn't fit the body.
        """
        equations, start = statics(self.body, stance), self._temperatures.start(temperatures)
        program = _ForceProgram(equations, stance)
        forces = program.least_torque(equations.equal())
        best = self._sharing_of("coolest", equations, stance, start, forces, 0)
        for number in range(1, rounds + 1):
            horizon = min(best.time, self.horizon) if best.time > 0 else _NOW
            there, gains = self._temperatures.at(start, best.torques, horizon)
            gains = gains.clip(min=0.0)
            unloaded = there - gains @ best.torques**2
            forces = program.coolest(unloaded, gains, self._limits, best.forces)
            candidate = self._sharing_of("coolest", equations, stance, start, forces, number)
            if np.isfinite(candidate.time) and candidate.time > 0:
                gained = candidate.time > best.time * (1 + 1e-4)
            else:
                gained = candidate.time > best.time or candidate.margin > best.margin + 1e-3
            best = candidate if (candidate.time, candidate.margin) > (best.time, best.margin) else best
            if not gained:
                break
        return best

    def equal(self, stance: Stance, temperatures: float | Mapping[str, float]) -> Sharing:
        """The peer: vertical forces as equal as equilibrium lets them be; cones and torque limits are not looked at."""
        equations, start = statics(self.body, stance), self._temperatures.start(temperatures)
        return self._sharing_of("equal", equations, stance, start, equations.equal(), 0)

    def least_torque(self, stance: Stance, temperatures: float | Mapping[str, float]) -> Sharing:
        """The stronger peer: the least sum of squared torques, blind to temperatures.

        Raises:
            StanceError: no forces within friction cones and torque limits hold the robot.
        """
        equations, start = statics(self.body, stance), self._temperatures.start(temperatures)
        forces = _ForceProgram(equations, stance).least_torque(equations.equal())
        return self._sharing_of("least_torque", equations, stance, start, forces, 1)

    def _sharing_of(
        self, how: How, equations: Statics, stance: Stance, start: FloatArray, forces: FloatArray, rounds: int
    ) -> Sharing:
        torques = equations.torques(forces)
        time, node = self._temperatures.reached(start, torques, self._limits, self.horizon)
        there, _ = self._temperatures.at(start, torques, min(time, self.horizon) if time > 0 else _NOW)
        normal = forces @ equations.up
        along = np.linalg.norm(forces - np.outer(normal, equations.up), axis=1)
        stands = np.array(equations.standing)
        grip = float(np.max(along[stands] / (stance.friction * np.maximum(normal[stands], 1e-9))))
        return Sharing(
            how,
            forces,
            torques,
            tuple(self.body.joints),
            time,
            self.model.nodes[node] if node >= 0 else None,
            float(np.min(self._limits - there)),
            grip,
            float(np.max(np.abs(torques) / equations.most)),
            rounds,
        )


# --- the convex program ---------------------------------------------------------------------------


class _ForceProgram:
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
        rounded = 1e-8  # the tip of the cone, whose slope has no value there
        for k, stands in enumerate(self._statics.standing):
            force = self._scaled[3 * k : 3 * k + 3]
            normal = ca.dot(up, force)
            along = force - normal * up
            cones.append(ca.sqrt(ca.sumsqr(along) + rounded) - stance.friction * normal if stands else ca.SX(-1))
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
            # Of two sharings equally good the one with less torque is meant: 1e-6 K/(N·m)².
            cost = self._worst + 1e-6 * squares if nodes else 1e-2 * squares + self._worst**2
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
        solution = solver(x0=x0, p=p, lbx=-reach, ubx=reach, lbg=low, ubg=high)
        if not solver.stats()["success"]:
            raise StanceError(
                f"stance: no forces within friction cones and torque limits ({solver.stats()['return_status']}); "
                "expected the centre of mass above the standing feet, and a load that the joints can bear"
            )
        return np.asarray(solution["x"].full().ravel()[:-1].reshape(legs, 3) * _FORCE)
