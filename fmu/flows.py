"""Heat flows of a model, one by one: what each link carries and what each effect brings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import casadi as ca

from lptn.effects import EdgeEffect, LinkEffect, LossEffect, MassEffect, NodeEffect
from lptn.model import Model, input_column
from lptn.network import Link, Use

from .naming import joined


@dataclass(frozen=True)
class Flow:
    """One heat flow [W].

    Args:
        source: the node that it leaves, or for an effect at one node the node that it enters.
        target: the node that it enters; empty for an effect at one node.
        label: the effect's name; empty for a link.
        inner: `True` for a share of another flow, which must not be counted twice.
        expression: its size.
    """

    source: str
    target: str
    label: str
    inner: bool
    expression: Any

    @property
    def of_edge(self) -> bool:
        """Whether it runs from one node to another."""
        return bool(self.target)

    @property
    def name(self) -> str:
        """Name of the variable that shows it."""
        if not self.of_edge:
            return joined(self.source, self.label, "heat_flow")
        return joined(self.source, f"{self.label}_to_{self.target}" if self.label else f"to_{self.target}", "heat_flow")

    @property
    def text(self) -> str:
        """What a person reads of it."""
        way = f"flows from {self.source} to {self.target}"
        if self.inner:
            return f"What {self.label} adds to the heat that {way if self.of_edge else f'enters {self.source}'}"
        if self.of_edge:
            return f"Heat that {way} by {self.label}" if self.label else f"Heat that {way}"
        return f"Heat that {self.label} brings into {self.source}"


def heat_flows(model: Model) -> list[Flow]:
    """Every link's and every effect's heat flow, in the order of the network.

    Links and effects between nodes count from the first node to the second, prescribed nodes last. A loss or link
    effect counts what it adds to the flow that it acts on: the flow with it less the flow without it.

    Source: source S0, rows E1, E3 and E5.
    """
    return _Flows(model).all()


class _Flows:
    def __init__(self, model: Model) -> None:
        self.network, symbols = model.network, model.symbols
        self.p = symbols.p
        self.inputs = dict(zip(model.inputs, ca.vertsplit(symbols.u) if model.inputs else (), strict=True))
        values = dict(zip(model.states, ca.vertsplit(symbols.x), strict=True))
        self.states = values
        self.temperature: dict[str, Any] = {node: values[node] for node in model.nodes}
        for name, source in self.network.prescribed.items():
            column = f"temperature.{name}" if source == "start" else source
            self.temperature[name] = self.p[column] if isinstance(column, int) else self.inputs[column]

    def all(self) -> list[Flow]:
        found = [self._link(link) for link in self.network.resistors]
        for use in self.network.uses:
            found += self._effect(use)
        return found

    def _parameters(self, use: Use) -> SimpleNamespace:
        return SimpleNamespace(**{name: self.p[index] for name, index in use.parameters.items()})

    def _features(self, use: Use) -> SimpleNamespace:
        node = use.ends[0]
        return SimpleNamespace(**{name: self.inputs[input_column(name, node)] for name in use.effect.needed()})

    def _ordered(self, ends: Iterable[str]) -> tuple[str, str]:
        """The two ends by name, a prescribed one last."""
        one, other = sorted(ends, key=lambda name: (name in self.network.prescribed, name))
        return one, other

    def _exchange(self, link: Link, source: str, left_out: Use | None = None) -> Any:
        """Heat that a link carries away from one of its ends, perhaps with one effect left out."""
        (target,) = set(link.ends) - {source}
        factor, inward = ca.SX(1), ca.SX(0)
        for use in self.network.uses:
            if use is left_out or not isinstance(use.effect, LinkEffect) or set(use.ends) != set(link.ends):
                continue
            node, around = (self.temperature[end] for end in use.ends)
            p = self._parameters(use)
            factor = factor * use.effect.conductance_factor(node, around, self._features(use), p)
            extra = use.effect.extra_heat(node, around, p)
            inward = inward + (extra if use.ends[0] == source else -extra)
        drop = self.temperature[source] - self.temperature[target]
        return factor * drop / self.p[link.resistance] - inward

    def _link(self, link: Link) -> Flow:
        source, target = self._ordered(link.ends)
        return Flow(source, target, "", False, self._exchange(link, source))

    def _effect(self, use: Use) -> list[Flow]:
        effect, node, label = use.effect, use.ends[0], use.declaration.name
        if isinstance(effect, EdgeEffect):
            one, other = self._ordered(use.ends)
            drop = self.temperature[one] - self.temperature[other]
            return [Flow(one, other, label, False, effect.conductance(self._parameters(use)) * drop)]
        if isinstance(effect, MassEffect):
            state = self.states[f"{label}.{use.place}"]
            return [Flow(node, "", label, False, effect.heat(self.temperature[node], state, self._parameters(use)))]
        if isinstance(effect, NodeEffect):
            return [Flow(node, "", label, False, self._heat(use))]
        if isinstance(effect, LossEffect):
            bases = [base for base in self.network.uses if base.effect.key == effect.acts_on and base.ends == use.ends]
            added = sum((self._heat(base) - self._heat(base, use) for base in bases), start=ca.SX(0))
            return [Flow(node, "", label, True, added)]
        if isinstance(effect, LinkEffect):
            return self._link_effect(use)
        return []

    def _heat(self, use: Use, left_out: Use | None = None) -> Any:
        """Heat that an effect brings into its node, with the factors of loss effects, perhaps one left out."""
        node, effect = use.ends[0], cast(NodeEffect, use.effect)
        heat = effect.heat(self.temperature[node], self._features(use), self._parameters(use))
        for other in self.network.uses:
            if other is left_out or not isinstance(other.effect, LossEffect) or other.ends != use.ends:
                continue
            if other.effect.acts_on == use.effect.key:
                heat = heat * other.effect.factor(self.temperature[node], self._parameters(other))
        return heat

    def _link_effect(self, use: Use) -> list[Flow]:
        (link,) = (link for link in self.network.resistors if set(link.ends) == set(use.ends))
        node, around = use.ends
        added = self._exchange(link, node, use) - self._exchange(link, node)
        # A node with several surroundings has one such effect for each: the place then is an edge.
        target = around if "~" in use.place else ""
        return [Flow(node, target, use.declaration.name, True, -added if target else added)]
