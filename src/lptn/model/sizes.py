"""The size of a network's places, heat capacity and conductance, which sets typical values there.

The heat of a motor's electronics is watts, that of a machine's is kilowatts. An effect states the size at which it is
met at a robot's joint, and what that size goes with (`lptn.basics.parameters.Parameter.relative_to`); here it becomes
the size at a place of a network.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from types import SimpleNamespace

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.parameters import Parameter, Scale
from lptn.model.network import Network

JOINT: Mapping[Scale, float] = {"": 1.0, "capacity": 300.0, "conductance": 0.3, "resistance": 1 / 0.3, "link": 0.1}
"""J/K, W/K, K/W and W/K of the joint for which effects state their usual sizes: one of the quadruped (`lptn.robots`),
with 10 K/W to the air and twice as much again through its neighbours."""
_LONGEST_MEMORY = 24 * 3600.0
"""s; no place counts as keeping its heat for longer. It matters where a fit has lost the way out of the heat, or a
network has none: from 12 to 48 h a joint of 300 J/K and 10 K/W goes from 0.107 to 0.102 W/K."""

_LEAST = 1e-9  # W/K


class Sizes:
    """Capacitances and conductances of a network's places, at its own values.

    A node's conductance is the heat that warms it by 1 K in the long run, everything else left to itself: neighbours
    that it warms along with it count by what they pass on. Of effects those between nodes count; with `rates` all that
    carry heat, as radiation and convection do, which a fit may have put in the place of a link.

    Args:
        network: the network, with fitted values.
        rates: derivative of the states' rates by the states [1/s], shape (states, states), in the order of its model,
            about the temperatures that are usual.
    """

    def __init__(self, network: Network, rates: FloatArray | None = None) -> None:
        values = np.array([parameter.value for parameter in network.parameters])
        self._capacities = {name: float(values[index]) for name, index in network.capacities.items()}
        flows: list[tuple[tuple[str, ...], float]] = [
            (link.ends, 1 / float(values[link.resistance])) for link in network.resistors
        ]
        self._links = {frozenset(ends): conductance for ends, conductance in flows}
        flows += [(inside.ends, float(values[inside.conductivity]) * inside.shape) for inside in network.conductors]
        for instance in network.effect_instances:
            if instance.effect.between_ends and instance.indicator is None:
                p = SimpleNamespace(**{name: values[index] for name, index in instance.parameters.items()})
                inward = instance.effect.heat_into_ends(SimpleNamespace(temperatures=(0.0, 1.0), p=p))
                flows.append((instance.ends, float(inward[0])))
        self._conductances = self._by_place([*network.dynamic, *network.massless], flows)
        if rates is not None:
            self._conductances |= self._by_node(network.dynamic, rates)

    def _by_place(self, places: Sequence[str], flows: Iterable[tuple[tuple[str, ...], float]]) -> dict[str, float]:
        """1 / R_ii [W/K], R the inverse of the matrix of conductances between places whose temperature isn't given."""
        number = {name: row for row, name in enumerate(places)}
        least = np.array([self._capacities.get(name, 0.0) / _LONGEST_MEMORY for name in places])
        matrix: FloatArray = np.diag(least)
        for ends, conductance in flows:
            inside = [number[end] for end in ends if end in number]
            matrix[inside, inside] += conductance
            if len(inside) == 2:
                matrix[inside, inside[::-1]] -= conductance
        # Only a difference in conduction that a fit made too negative has less than its own memory leaves.
        conductances = np.maximum(1 / np.diag(np.linalg.inv(matrix)), np.maximum(least, _LEAST))
        return dict(zip(places, conductances.tolist(), strict=True))

    def _by_node(self, nodes: Sequence[str], rates: FloatArray) -> dict[str, float]:
        """What holds a node against a heat that stays [W/K]: its capacitance over the time that all states need."""
        times = np.diag(np.linalg.inv(np.eye(len(rates)) / _LONGEST_MEMORY - rates)).tolist()
        capacities = [self._capacities[name] for name in nodes]
        held = {name: c / time for name, c, time in zip(nodes, capacities, times, strict=False) if time > 0}
        return {
            name: max(conductance, self._capacities[name] / _LONGEST_MEMORY, _LEAST)
            for name, conductance in held.items()
        }

    def typical(self, parameter: Parameter, places: Iterable[Sequence[str]]) -> float:
        """The usual size of an effect's parameter, in the parameter's unit: the geometric mean over places.

        Args:
            parameter: as the effect states it, for a robot's joint.
            places: of each place the ends: what the effect touches there. The smallest of them counts.
        """
        relative_to = parameter.relative_to
        shares = [math.log(self._scale(relative_to, ends) / JOINT[relative_to]) for ends in places if relative_to]
        return parameter.typical * math.exp(sum(shares) / max(len(shares), 1))

    def conductance(self, ends: Sequence[str]) -> float:
        """Heat that warms a place by 1 K in the long run [W/K], at that of its ends where it is least."""
        return min(self._conductances[end] for end in ends if end in self._conductances)

    def _scale(self, relative_to: Scale, ends: Sequence[str]) -> float:
        if relative_to == "capacity":
            return min(self._capacities[end] for end in ends if end in self._capacities)
        conductance = self.conductance(ends)
        if relative_to == "link":
            return self._links.get(frozenset(ends), conductance)
        return 1 / conductance if relative_to == "resistance" else conductance
