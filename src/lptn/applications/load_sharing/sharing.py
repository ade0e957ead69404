"""Load sharing: how the legs of a standing robot share its weight so that the first joint to get hot lasts longest.

Torques are linear in the forces at the feet, friction cones and torque limits are convex, and the temperatures at a
horizon grow with the squared torques: a convex program. The best sharing so far sets the horizon of the next program.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.places import is_glob
from lptn.model.model import Model
from lptn.planners.tasks import start_of
from lptn.planners.values import by_place
from lptn.simulate.dynamics import longest_step

from .body import Body, Stance, Statics, statics

How = Literal["coolest", "equal", "least_torque"]
_NOW = 60.0  # s, the horizon where a limit is passed already
_FORCE = 50.0  # N, a size that makes the program's numbers about one
_STEPS = 256  # that one call takes
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
        program = _ForceProgram(equations, stance, self._limits)
        forces = program.least_torque(equations.equal())
        best = self._sharing_of("coolest", equations, stance, start, forces, 0)
        for number in range(1, rounds + 1):
            horizon = min(best.time, self.horizon) if best.time > 0 else _NOW
            there, gains = self._temperatures.at(start, best.torques, horizon)
            gains = gains.clip(min=0.0)
            unloaded = there - gains @ best.torques**2
            forces = program.coolest(unloaded, gains, best.forces)
            candidate = self._sharing_of("coolest", equations, stance, start, forces, number)
            if np.isfinite(candidate.time) and candidate.time > 0:
                gained = candidate.time > best.time * (1 + 1e-4)
            else:
                gained = candidate.time > best.time or candidate.margin > best.margin + 1e-3
            best = max(best, candidate, key=lambda sharing: (sharing.time, sharing.margin))
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
        forces = _ForceProgram(equations, stance, self._limits).least_torque(equations.equal())
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
        first = self.model.nodes[node] if node >= 0 else None
        margin, effort = float(np.min(self._limits - there)), float(np.max(np.abs(torques) / equations.most))
        return Sharing(how, forces, torques, tuple(self.body.joints), time, first, margin, grip, effort, rounds)


# --- the convex program ---------------------------------------------------------------------------


class _ForceProgram:
    """The program of one stance.

    Temperatures at the horizon grow with the squares of the torques, and torques are linear in the forces; friction
    cones and torque limits are convex. So its one optimum is the best there is.

    Args:
        statics: the equations of the stance.
        stance: friction and least normal force.
        limits: by node [degC], infinite for none; shape (nodes,).
    """

    def __init__(self, statics: Statics, stance: Stance, limits: FloatArray) -> None:
        legs, joints, stands = len(statics.standing), statics.most.size, np.array(statics.standing)
        self._limited, self._limits = np.isfinite(limits), limits
        scaled, worst = ca.SX.sym("f", 3 * legs), ca.SX.sym("worst")
        torques = ca.DM(statics.idle) + ca.mtimes(ca.DM(statics.lever), scaled * _FORCE)
        up, cones, normals = ca.DM(statics.up), [], []
        rounded = 1e-8  # the tip of the cone, whose slope has no value there
        for k, force in enumerate(ca.vertsplit(scaled, 3)):
            normals.append(ca.dot(up, force))
            along = ca.sqrt(ca.sumsqr(force - normals[k] * up) + rounded)
            cones.append(along - stance.friction * normals[k] if stands[k] else ca.SX(-1))
        balance = (ca.mtimes(ca.DM(statics.balance), scaled * _FORCE) - statics.weight) / _FORCE
        rows = ca.vertcat(balance, *cones, torques, ca.vertcat(*normals) * _FORCE)
        least = np.where(stands, stance.least_normal, 0.0)
        self._low = np.concatenate([np.zeros(6), np.full(legs, -np.inf), -statics.most, least])
        self._high = np.concatenate([np.zeros(6 + legs), statics.most, np.full(legs, np.inf)])
        self._reach = np.append(np.where(np.repeat(stands, 3), np.inf, 0.0), np.inf)
        w, squares = ca.vertcat(scaled, worst), ca.sumsqr(torques)
        nodes = int(self._limited.sum())
        above, gains = ca.SX.sym("above", nodes), ca.SX.sym("gains", nodes, joints)
        hot = above + ca.mtimes(gains, torques**2) - worst
        # Of two sharings equally good the one with less torque is meant: 1e-6 K/(N·m)².
        coolest = {"p": ca.vertcat(above, ca.vec(gains)), "f": worst + 1e-6 * squares, "g": ca.vertcat(rows, hot)}
        self._coolest = ca.nlpsol("share", "ipopt", {"x": w, **coolest}, _OPTIONS)
        effort = {"f": 1e-2 * squares + worst**2, "g": rows}
        self._least = ca.nlpsol("share", "ipopt", {"x": w, **effort}, _OPTIONS)

    def coolest(self, warm: FloatArray, gains: FloatArray, near: FloatArray) -> FloatArray:
        """Forces [N], shape (legs, 3), that keep the node nearest to its limit farthest from it.

        Args:
            warm: temperatures at the horizon without any torque [degC], shape (nodes,).
            gains: what each squared torque adds [K/(N·m)²], shape (nodes, joints), none below zero.
            near: forces to start from [N].

        Raises:
            StanceError: no forces hold the robot.
        """
        p = np.concatenate([(warm - self._limits)[self._limited], gains[self._limited].T.ravel()])
        return self._solved(self._coolest, p, near)

    def least_torque(self, near: FloatArray) -> FloatArray:
        """Forces [N], shape (legs, 3), with the least sum of squared torques.

        Raises:
            StanceError: no forces hold the robot.
        """
        return self._solved(self._least, np.zeros(0), near)

    def _solved(self, solver: Any, p: FloatArray, near: FloatArray) -> FloatArray:
        nodes = solver.size1_in("lbg") - self._low.size  # whose limits count
        low, high = np.append(self._low, np.full(nodes, -np.inf)), np.append(self._high, np.zeros(nodes))
        x0 = np.append(near.ravel() / _FORCE, 0.0)
        solution = solver(x0=x0, p=p, lbx=-self._reach, ubx=self._reach, lbg=low, ubg=high)
        if not solver.stats()["success"]:
            raise StanceError(
                f"stance: no forces within friction cones and torque limits ({solver.stats()['return_status']}); "
                "expected the centre of mass above the standing feet, and a load that the joints can bear"
            )
        return np.asarray(solution["x"].full().ravel()[:-1].reshape(near.shape) * _FORCE)


# --- temperatures -----------------------------------------------------------------------------------


class StandingTemperatures:
    """A thermal model that stands: torques are held, nothing moves.

    Args:
        model: whose inputs are `torque.<joint>`, or `current.<joint>` with a torque constant.
        joints: names of the joints, in the order of the torques.
        ambient: of the air [degC].
        inputs: further inputs by column (`power.pc`); drives are powered unless said otherwise, speeds are 0.
        torque_constant: torque at the joint per ampere [N·m/A], for a model that is driven by currents.

    Raises:
        InputError: the model needs an input that isn't given, or has none of the joints.
    """

    def __init__(
        self,
        model: Model,
        joints: Sequence[str],
        *,
        ambient: float = 25.0,
        inputs: Mapping[str, float] | None = None,
        torque_constant: float | None = None,
    ) -> None:
        self.model = model
        self._values = model.values
        self._constant = np.zeros(len(model.inputs))
        self._weights = np.zeros((len(model.inputs), len(joints)))
        given = dict(inputs or {})
        for row, column in enumerate(model.inputs):
            quantity, _, place = column.partition(".")
            if column in given:
                self._constant[row] = given[column]
            elif quantity == "temperature":
                self._constant[row] = ambient
            elif place in joints and quantity in ("torque", "torque_abs", "current", "current_abs"):
                per_unit = 1.0 if quantity.startswith("torque") else torque_constant
                if per_unit is None:
                    raise InputError(model.network.origin, column, "no torque constant", "torque_constant in N·m/A")
                self._weights[row, joints.index(place)] = 1 / per_unit
            elif quantity == "powered":
                self._constant[row] = 1.0
            elif column != "speed.base" and quantity not in ("torque", "velocity", "velocity_rms", "mechanical_power"):
                raise InputError(model.network.origin, column, "no value", f'inputs = {{"{column}": …}}')
        if not self._weights.any():
            raise InputError(model.network.origin, "inputs", "no torque or current of any joint", ", ".join(joints))

    def start(self, temperatures: float | Mapping[str, float]) -> FloatArray:
        """States [degC] from one temperature, or from those of nodes by name or pattern; other places' are ignored.

        Raises:
            InputError: a node has none.
        """
        by_name = temperatures if isinstance(temperatures, Mapping) else {"*": temperatures}
        given = {name: value for name, value in by_name.items() if name in self.model.nodes or is_glob(name)}
        if unread := [node for node, value in given.items() if not np.isfinite(value)]:
            expected = "a temperature [degC]; the limit where there is no reading"
            raise InputError("temperatures", unread[0], "no number", expected)
        return np.asarray(start_of(given, self.model, "temperatures", "nodes"))

    def reached(self, start: FloatArray, torques: FloatArray, limits: FloatArray, horizon: float) -> tuple[float, int]:
        """When the first node passes its limit [s], and which; infinity and -1 where none does within the horizon.

        Args:
            start: states [degC].
            torques: of the joints [N·m].
            limits: by node [degC], infinite for none.
            horizon: [s].
        """
        nodes, x, time = limits.size, start, 0.0
        if (x[:nodes] >= limits).any():
            return 0.0, int((x[:nodes] - limits).argmax())
        h = min(1.0, self._longest_step(x, torques))
        while time < horizon:
            u = np.repeat(self._inputs(torques[:, None]), _STEPS, axis=1)
            path = np.hstack([x[:, None], self.model.run(_STEPS)(x, u, self._values, h).full()])
            passed = (path[:nodes] >= limits[:, None]).any(axis=0)
            if passed.any():
                k = int(passed.argmax())
                before, after = path[:nodes, k - 1], path[:nodes, k]
                over = after >= limits
                share = np.full(nodes, np.inf)  # of the step, until each node is at its limit
                share[over] = (limits - before)[over] / (after - before)[over]
                reached = time + h * (k - 1 + float(share.min()))
                return (reached, int(share.argmin())) if reached <= horizon else (np.inf, -1)
            x, time = path[:, -1], time + _STEPS * h
        return np.inf, -1

    def at(
        self, start: FloatArray, torques: FloatArray, horizon: float, nudge: float = 1.0
    ) -> tuple[FloatArray, FloatArray]:
        """Temperatures at the horizon, and what each squared torque adds to them, moved by a nudge [(N·m)²].

        Returns:
            Shapes (nodes,) [degC] and (nodes, joints) [K/(N·m)²].
        """
        squared = np.repeat((torques**2)[:, None], torques.size + 1, axis=1)
        squared[np.arange(torques.size), np.arange(1, torques.size + 1)] += nudge
        x = np.repeat(start[:, None], torques.size + 1, axis=1)
        blocks = max(1, int(np.ceil(horizon / (_STEPS * self._longest_step(start, torques)))))
        run = self.model.made_once(
            ("together", _STEPS, torques.size + 1), lambda: self.model.run(_STEPS).map(torques.size + 1)
        )
        u = np.repeat(self._inputs(np.sqrt(squared)), _STEPS, axis=1)
        p = np.repeat(self._values[:, None], torques.size + 1, axis=1)
        for _ in range(blocks):
            path = run(x, u, p, np.full((1, torques.size + 1), horizon / (_STEPS * blocks))).full()
            x = path[:, _STEPS - 1 :: _STEPS]
        nodes = len(self.model.nodes)
        return x[:nodes, 0], (x[:nodes, 1:] - x[:nodes, :1]) / nudge

    def _inputs(self, torques: FloatArray) -> FloatArray:
        """The model's inputs for magnitudes of the torques, shapes (inputs, n) and (joints, n)."""
        return np.asarray(self._constant[:, None] + self._weights @ np.abs(torques))

    def _longest_step(self, x: FloatArray, torques: FloatArray) -> float:
        return longest_step(self.model, x, self._inputs(torques[:, None])[:, 0], self._values)
