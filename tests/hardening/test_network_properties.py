"""What holds for every network: balance of energy, symmetry, cooperation, and units and order that change nothing."""

from __future__ import annotations

import random
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lptn.basics.arrays import FloatArray
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network
from tests.builders import AMBIENT, effect, link, node

SIZES = st.floats(-2, 3).map(lambda exponent: float(10.0**exponent))


@dataclass(frozen=True)
class Drawn:
    """A random network, as plain numbers.

    Args:
        capacities: J/K by node.
        links: K/W by pair of nodes; the ambient is a node as well.
        copper: resistance [ohm] by node with a copper loss at 0.5 N·m/A.
        heats: gain by node with a logged power.
        conduction: W/K by pair.
    """

    capacities: dict[str, float]
    links: dict[tuple[str, str], float]
    copper: dict[str, float]
    heats: dict[str, float]
    conduction: dict[tuple[str, str], float]

    def network(self, order: random.Random | None = None) -> Network:
        """The network, perhaps with everything in another order and every link the other way round."""
        nodes = [node(name, value) for name, value in self.capacities.items()]
        links = [link(*(pair[::-1] if order else pair), value) for pair, value in self.links.items()]
        effects: list[EffectDeclaration] = [
            *(effect("copper_loss", name, resistance=r, torque_constant=0.5) for name, r in self.copper.items()),
            *(effect("heat_input", name, gain=value) for name, value in self.heats.items()),
            *(effect("conduction", "~".join(pair), conductance=value) for pair, value in self.conduction.items()),
        ]
        for part in (nodes, links, effects):
            if order:
                order.shuffle(part)
        return Network("drawn", (*nodes, AMBIENT), tuple(links), tuple(effects))


@st.composite
def drawn(draw: st.DrawFn) -> Drawn:
    """Up to six nodes, each with a way to the ambient, directly or through others."""
    names = [f"n{number}" for number in range(draw(st.integers(1, 6)))]
    links: dict[tuple[str, str], float] = {}
    for number, name in enumerate(names):
        links[draw(st.sampled_from(["ambient", *names[:number]])), name] = draw(SIZES)
    pairs = [(one, other) for k, one in enumerate(names) for other in names[k + 1 :] if (one, other) not in links]
    conduction = draw(st.dictionaries(st.sampled_from(pairs), st.floats(0, 100), max_size=3)) if pairs else {}
    some = st.dictionaries(st.sampled_from(names), st.floats(1e-3, 10), max_size=3)
    return Drawn({name: draw(SIZES) for name in names}, links, draw(some), draw(some), conduction)


class Point:
    """A model at a random point."""

    def __init__(self, network: Network, seed: int) -> None:
        self.model = Model(network)
        rng = np.random.default_rng(seed)
        # by name, so that the same point is meant whatever the order
        self.temperature = {name: float(rng.uniform(-20, 150)) for name in sorted(self.model.nodes)}
        self.inputs = {name: float(rng.uniform(-40, 40)) for name in sorted(self.model.inputs)}
        self.x = np.array([self.temperature[name] for name in self.model.nodes])
        self.u = np.array([self.inputs[name] for name in self.model.inputs])

    def rates(self) -> FloatArray:
        """dT/dt [K/s] in the order of the nodes' names."""
        derivatives = np.asarray(self.model.rhs(self.x, self.u, self.model.values).full()).ravel()
        return derivatives[np.argsort(self.model.nodes)]

    def jacobian(self) -> FloatArray:
        """d rates / d temperatures."""
        return np.asarray(self.model.state_jacobian(self.x, self.u, self.model.values).full())


@given(drawn(), st.integers(0, 99))
def test_what_the_nodes_take_up_is_what_heats_less_what_leaves(robot: Drawn, seed: int) -> None:
    point = Point(robot.network(), seed)
    taken_up = float(point.rates() @ np.array([robot.capacities[name] for name in sorted(point.model.nodes)]))
    copper = [r * (point.inputs[f"torque.{name}"] / 0.5) ** 2 for name, r in robot.copper.items()]
    logged = [gain * point.inputs[f"power.{name}"] for name, gain in robot.heats.items()]
    air = point.inputs.get("temperature.ambient", 0.0)
    leaving = [(point.temperature[b] - air) / r for (a, b), r in robot.links.items() if a == "ambient"]
    size = sum(map(abs, [*copper, *logged, *leaving])) + float(np.abs(point.rates()).max())
    assert taken_up == pytest.approx(sum(copper) + sum(logged) - sum(leaving), abs=1e-9 * size + 1e-9)


@given(drawn(), st.integers(0, 99))
def test_heat_flows_both_ways_alike_and_never_from_cold_to_hot(robot: Drawn, seed: int) -> None:
    point = Point(robot.network(), seed)
    capacities = np.array([robot.capacities[name] for name in point.model.nodes])
    conductances = capacities[:, None] * point.jacobian()
    size = np.abs(conductances).max()
    np.testing.assert_allclose(conductances, conductances.T, rtol=0, atol=1e-12 * size)
    outside = conductances - np.diag(np.diag(conductances))
    assert (outside >= 0).all()  # cooperative: a warmer neighbour never cools
    assert (conductances.sum(axis=1) <= 1e-12 * size).all()  # nor can a network warm itself
    assert np.linalg.eigvalsh((conductances + conductances.T) / 2).max() <= 1e-9 * size


@given(drawn(), st.integers(0, 99))
def test_the_order_in_which_things_are_declared_changes_nothing(robot: Drawn, seed: int) -> None:
    one, other = Point(robot.network(), seed), Point(robot.network(random.Random(seed)), seed)
    size = np.abs(one.rates()).max()
    np.testing.assert_allclose(one.rates(), other.rates(), rtol=1e-9, atol=1e-9 * size)


UNITS = {
    "J/K": {"J/K": 1.0, "kJ/K": 1e-3, "W*s/K": 1.0, "cal/K": 1 / 4.184, "kJ/delta_degC": 1e-3},
    "K/W": {"K/W": 1.0, "mK/W": 1e3, "K/kW": 1e3, "delta_degC/W": 1.0},
    "ohm": {"ohm": 1.0, "mohm": 1e3, "V/A": 1.0, "Ω": 1.0},
    "N*m/A": {"N*m/A": 1.0, "mN*m/A": 1e3, "N*cm/A": 1e2, "V*s": 1.0},
    "degC": {"degC": 1.0},
    "m": {"m": 1.0, "mm": 1e3, "cm": 1e2, "inch": 1 / 0.0254},
}


def _text(values: dict[str, tuple[float, str]]) -> str:
    entries = {name: f'{{ value = {value!r}, unit = "{unit}" }}' for name, (value, unit) in values.items()}
    return f"""
[model]
ambient = {entries["ambient"]}
[nodes.a]
capacity = {entries["capacity"]}
[nodes.body.element]
kind = "cuboid"
length_x = {entries["x"]}
length_y = {entries["y"]}
length_z = 0.03
conductivity = 20
density = 2700
specific_heat = 900
[[links]]
between = ["a", "ambient"]
resistance = {entries["resistance"]}
[[links]]
between = ["body.x1", "a"]
resistance = 0.5
[[effects]]
kind = "copper_loss"
at = "a"
resistance = {entries["ohms"]}
torque_constant = {entries["constant"]}
"""


BASE = {"ambient": (22.0, "degC"), "capacity": (310.0, "J/K"), "x": (0.02, "m"), "y": (0.05, "m"),
        "resistance": (4.0, "K/W"), "ohms": (0.15, "ohm"), "constant": (0.84, "N*m/A")}  # fmt: skip


@settings(max_examples=30)
@given(st.data())
def test_the_unit_in_which_a_value_is_given_changes_nothing(data: st.DataObject) -> None:
    said = {}
    for name, (value, unit) in BASE.items():
        chosen = data.draw(st.sampled_from(sorted(UNITS[unit])), label=name)
        said[name] = value * UNITS[unit][chosen], chosen
    if data.draw(st.booleans(), label="kelvin"):
        said["ambient"] = 22.0 + 273.15, "kelvin"
    plain, other = (Point(parse_model(_text(values), Path("x.toml")).network, 1) for values in (BASE, said))
    np.testing.assert_allclose(other.rates(), plain.rates(), rtol=1e-9)
