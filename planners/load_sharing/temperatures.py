"""Temperatures of a standing robot under constant torques: over time, at a horizon, and each torque's share there."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.model.model import Model
from lptn.simulate.dynamics import longest_step

_STEPS = 256  # that one call takes


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
        """States [degC] from one temperature, or from one for each node.

        Raises:
            InputError: a node has none.
        """
        nodes = self.model.nodes
        given = temperatures if isinstance(temperatures, Mapping) else dict.fromkeys(nodes, temperatures)
        for node in nodes:
            if node not in given:
                raise InputError("temperatures", node, "no temperature", f"one of each of {', '.join(nodes)}")
            if not np.isfinite(given[node]):
                expected = "a temperature [degC]; the limit where there is no reading"
                raise InputError("temperatures", node, "no number", expected)
        return np.asarray(np.array([float(given[node]) for node in nodes])[np.array(self.model.owners)])

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
