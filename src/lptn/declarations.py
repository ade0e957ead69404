"""What a model declares: nodes, links and effects, each perhaps for many places, and what becomes of them."""

from __future__ import annotations

from dataclasses import dataclass

from lptn.effects import Effect
from lptn.elements import Element
from lptn.parameters import Parameter
from lptn.places import in_run

START = "start"
"""Prescribed temperature taken from the start of each run, for logs without an ambient column."""
RUN = "run"
"""Indicators of runs are parameters of this name: 1 in the run, else 0."""


@dataclass(frozen=True)
class NodeDeclaration:
    """Nodes of one kind: a capacitance, or a prescribed temperature.

    Args:
        pattern: a name, or a glob over the model's joints.
        capacity: heat capacity [J/K] of a dynamic node.
        temperature: for a prescribed node a log column (`"temperature.ambient"`), `"start"`, or a
            parameter [degC].
        element: for a dynamic node its body; links attach to the faces, `"stator.outer"`, and the node's
            temperature is the body's mean.
    """

    pattern: str
    capacity: Parameter | None = None
    temperature: str | Parameter | None = None
    element: Element | None = None


@dataclass(frozen=True)
class LinkDeclaration:
    """Thermal resistance [K/W] between places; `{leg}` in both patterns means the same leg.

    A resistance of `None` is perfect contact: a face has the temperature of what it touches.
    """

    between: tuple[str, str]
    resistance: Parameter | None


@dataclass(frozen=True)
class EffectDeclaration:
    """An effect at the places that a pattern matches.

    Args:
        effect: the effect, with its options chosen.
        at: a node, an edge `"a~b"`, a glob, or `"*"`.
        parameters: its parameters with this model's values; those left out take the effect's own.
        label: what its parameters are named after, by default the effect's key.
        driven_by: the place whose log columns drive it, where that is not its own: one motor's current heats
            every piece of the winding.
        run: name of the only run in which the effect acts, or a glob of such names; every run by default. A log
            that was split into pieces `monday#1`, `monday#2` is meant as a whole by `monday`.
    """

    effect: Effect
    at: str
    parameters: tuple[Parameter, ...] = ()
    label: str = ""
    driven_by: str = ""
    run: str = ""

    @property
    def name(self) -> str:
        """What its parameters are named after."""
        return self.label or self.effect.key

    @property
    def where(self) -> str:
        """Place, and run if there is one: `"*_calf"`, `"*_calf@monday"`."""
        return in_run(self.at, self.run)

    @property
    def resolved(self) -> dict[str, Parameter]:
        """All parameters of the effect, this model's values first."""
        own = {parameter.name: parameter for parameter in self.parameters}
        return {parameter.name: own.get(parameter.name, parameter) for parameter in self.effect.parameters}


@dataclass(frozen=True)
class Link:
    """Two places and the index of the resistance between them."""

    place: str
    ends: tuple[str, str]
    resistance: int


@dataclass(frozen=True)
class Use:
    """One effect at one place: the nodes it touches, the indices of its parameters and of its run's indicator."""

    declaration: EffectDeclaration
    place: str
    ends: tuple[str, ...]
    parameters: dict[str, int]
    indicator: int | None = None

    @property
    def effect(self) -> Effect:
        return self.declaration.effect

    @property
    def name(self) -> str:
        """The effect's name, and the run's if there is one: `"sensor_offset@monday"`."""
        return in_run(self.declaration.name, self.declaration.run)

    @property
    def label(self) -> str:
        """What its state is called."""
        return in_run(f"{self.declaration.name}.{self.place}", self.declaration.run)
