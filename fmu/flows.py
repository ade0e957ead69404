"""Heat flows of a model, one by one: what each link carries and what each effect brings."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import casadi as ca

from lptn.effects import EdgeEffect, GroupEffect, LinkEffect, LossEffect, MassEffect, NodeEffect
from lptn.model import Model
from lptn.network import Link, Use

from .naming import joined, of_group


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
        self.network, self.balance = model.network, model.balance

    def all(self) -> list[Flow]:
        found = [self._link(link) for link in self.network.resistors]
        for use in self.network.uses:
            found += self._effect(use)
        return found

    def _ordered(self, ends: Iterable[str]) -> tuple[str, str]:
        """The two ends by name, a prescribed one last."""
        one, other = sorted(ends, key=lambda name: (name in self.network.prescribed, name))
        return one, other

    def _away(self, link: Link, source: str, left_out: Use | None = None) -> Any:
        """Heat that a link carries away from one of its ends, perhaps with one effect left out."""
        inward = self.balance.exchange(link, left_out)
        return -inward if link.ends[0] == source else inward

    def _link(self, link: Link) -> Flow:
        source, target = self._ordered(link.ends)
        return Flow(source, target, "", False, self._away(link, source))

    def _effect(self, use: Use) -> list[Flow]:
        effect, node, label = use.effect, use.ends[0], use.name
        if isinstance(effect, EdgeEffect):
            one, other = self._ordered(use.ends)
            inward = self.balance.edge_flow(use)
            return [Flow(one, other, label, False, -inward if node == one else inward)]
        if isinstance(effect, MassEffect):
            return [Flow(node, "", label, False, self.balance.state_heat(use, node))]
        if isinstance(effect, GroupEffect):
            label = of_group(label, use.place)
            return [Flow(end, "", label, False, self.balance.state_heat(use, end)) for end in use.ends]
        if isinstance(effect, NodeEffect):
            return [Flow(node, "", label, False, self.balance.heat_of(use))]
        if isinstance(effect, LossEffect):
            bases = [base for base in self.network.uses if base.effect.key == effect.acts_on and base.ends == use.ends]
            added = (self.balance.heat_of(base) - self.balance.heat_of(base, use) for base in bases)
            return [Flow(node, "", label, True, sum(added, start=ca.SX(0)))]
        if isinstance(effect, LinkEffect):
            return self._link_effect(use)
        return []

    def _link_effect(self, use: Use) -> list[Flow]:
        (link,) = (link for link in self.network.resistors if set(link.ends) == set(use.ends))
        node, around = use.ends
        added = self._away(link, node, use) - self._away(link, node)
        # A node with several surroundings has one such effect for each: the place then is an edge.
        target = around if "~" in use.place else ""
        return [Flow(node, target, use.name, True, -added if target else added)]
