"""Load sharing: how the legs of a standing robot share its weight so that the first joint to get hot lasts longest."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.places import matching
from lptn.model.model import Model

from .body import Body
from .convex import Share, StanceError
from .heating import Heating
from .stance import Stance, Statics, statics

How = Literal["coolest", "equal", "least_torque"]
_ROUNDS, _GAIN = 25, 1e-4  # of the search, and the relative gain below which it ends
_NOW = 60.0  # s, the horizon where a limit is passed already


@dataclass(frozen=True)
class Sharing:
    """Forces at the feet, and what they mean for the joints.

    Args:
        how: `coolest`; or a peer, `equal` or `least_torque`.
        forces: of the ground on the feet [N], in the trunk's frame, shape (legs, 3).
        torques: of the joints [N·m], shape (joints,).
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
    time: float
    first: str | None
    margin: float
    grip: float
    effort: float
    rounds: int = 0


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
        for pattern, most in limits.items():
            found = matching(pattern, model.nodes)
            if not found:
                raise InputError("limits", pattern, "no such node", f"some of {', '.join(model.nodes)}")
            self._limits[[model.nodes.index(node) for node in found]] = most
        if not np.isfinite(self._limits).any():
            raise InputError("limits", "limits", "none", "the greatest temperature of a node at least")
        self._heating = Heating(model, body.joints, ambient=ambient, inputs=inputs, torque_constant=torque_constant)

    def share(self, stance: Stance, temperatures: float | Mapping[str, float]) -> Sharing:
        """The forces with which the first joint to get hot lasts longest.

        At a horizon that the best sharing so far just reaches, the convex program finds a cooler one; that one lasts
        longer, and so on. For a model that is linear in its temperatures the end is the best there is; else the gains
        are taken anew in each round.

        Args:
            stance: posture and load.
            temperatures: now [degC], one for all nodes or one for each.

        Raises:
            StanceError: no forces within friction cones and torque limits hold the robot.
            ValueError: the stance doesn't fit the body.
        """
        equations, start = statics(self.body, stance), self._heating.start(temperatures)
        program = Share(equations, stance)
        forces = program.least_torque(equations.equal())
        best, rounds = self._judged("coolest", equations, stance, start, forces, 0), 0
        for rounds in range(1, _ROUNDS + 1):
            horizon = min(best.time, self.horizon) if best.time > 0 else _NOW
            warm, gains = self._linear(start, best.torques, horizon)
            forces = program.coolest(warm, gains, self._limits, best.forces)
            found = self._judged("coolest", equations, stance, start, forces, rounds)
            done = not _better(found, best)
            best = found if (found.time, found.margin) > (best.time, best.margin) else best
            if done:
                break
        return best

    def equal(self, stance: Stance, temperatures: float | Mapping[str, float]) -> Sharing:
        """The peer: vertical forces as equal as equilibrium lets them be; cones and torque limits are not looked at."""
        equations, start = statics(self.body, stance), self._heating.start(temperatures)
        return self._judged("equal", equations, stance, start, equations.equal(), 0)

    def least_torque(self, stance: Stance, temperatures: float | Mapping[str, float]) -> Sharing:
        """The stronger peer: the least sum of squared torques, which knows nothing of temperatures.

        Raises:
            StanceError: no forces within friction cones and torque limits hold the robot.
        """
        equations, start = statics(self.body, stance), self._heating.start(temperatures)
        forces = Share(equations, stance).least_torque(equations.equal())
        return self._judged("least_torque", equations, stance, start, forces, 1)

    def _linear(self, start: FloatArray, torques: FloatArray, horizon: float) -> tuple[FloatArray, FloatArray]:
        """Temperatures at the horizon without torque, and what each squared torque adds, as seen from these torques."""
        there, gains = self._heating.at(start, torques, horizon)
        gains = gains.clip(min=0.0)
        return there - gains @ torques**2, gains

    def _judged(
        self, how: How, equations: Statics, stance: Stance, start: FloatArray, forces: FloatArray, rounds: int
    ) -> Sharing:
        torques = equations.torques(forces)
        time, node = self._heating.reached(start, torques, self._limits, self.horizon)
        there, _ = self._heating.at(start, torques, min(time, self.horizon) if time > 0 else _NOW)
        normal = forces @ equations.up
        along = np.linalg.norm(forces - np.outer(normal, equations.up), axis=1)
        stands = np.array(equations.standing)
        grip = float(np.max(along[stands] / (stance.friction * np.maximum(normal[stands], 1e-9))))
        return Sharing(
            how,
            forces,
            torques,
            time,
            self.model.nodes[node] if node >= 0 else None,
            float(np.min(self._limits - there)),
            grip,
            float(np.max(np.abs(torques) / equations.most)),
            rounds,
        )


def _better(found: Sharing, best: Sharing) -> bool:
    """Whether another round is worth it."""
    if np.isfinite(found.time) and found.time > 0:
        return found.time > best.time * (1 + _GAIN)
    return found.time > best.time or found.margin > best.margin + 1e-3


__all__ = ["How", "LoadSharing", "Sharing", "StanceError"]
