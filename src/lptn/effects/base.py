"""What every physical effect is: a small class with one equation, its parameters and its signature."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, ClassVar, Literal

from lptn.basics.parameters import Parameter

Site = Literal["node", "link", "edge", "loss", "sensor", "pair", "group", "boundary"]
Symbol = Any
"""A symbolic scalar (`casadi.SX`) or a plain number: an equation is written once for both."""


@dataclass(frozen=True)
class Signature:
    """How an effect shows itself to a person who looks at residuals.

    Args:
        looks_like: what the model without it gets wrong.
        separate_by: the experiment that tells it from its rivals.
        confused_with: keys of the effects that look alike on ordinary data.
    """

    looks_like: str
    separate_by: str
    confused_with: tuple[str, ...] = ()


class Effect(ABC):
    """One physical effect at one place.

    A subclass states its `key`, a `title`, the input features it `needs`, its `parameters`, its
    `signature` and its `source`, and writes one equation. With its amplitude (the parameter that has an
    off-value) at that value, the equation leaves the model unchanged to the last bit.

    An effect with a state of its own (`has_state`) keeps it as a temperature, which starts a run in
    equilibrium with the place that it belongs to. `per_run` marks what may well differ from one run to the
    next (a fan, a door, a clock) and is then also looked for in single runs; `whole_robot` what is the same
    for all places.
    """

    key: ClassVar[str]
    title: ClassVar[str]
    site: ClassVar[Site]
    needs: ClassVar[tuple[str, ...]] = ()
    parameters: ClassVar[tuple[Parameter, ...]] = ()
    signature: ClassVar[Signature]
    source: ClassVar[str]
    has_state: ClassVar[bool] = False
    options: ClassVar[Mapping[str, tuple[str, ...]]] = {}
    per_run: ClassVar[bool] = False
    whole_robot: ClassVar[bool] = False
    in_one_run: ClassVar[tuple[str, str]] = ("", "")
    """What it means in one run, for an amplitude above and below 0; fields as in `diagnose.other_runs_search`."""

    def __init__(self, **chosen: str) -> None:
        """Take one of the admissible words for each of the effect's options; the first is the default."""
        self.chosen = {name: words[0] for name, words in self.options.items()} | chosen
        for name, word in chosen.items():
            if word not in self.options.get(name, ()):
                raise ValueError(f"{self.key}: option {name} = {word!r} is not one of {self.options.get(name, ())}")

    @classmethod
    def amplitude(cls) -> Parameter | None:
        """The parameter that switches the effect off, `None` where the effect can't be switched off."""
        return next((parameter for parameter in cls.parameters if parameter.off is not None), None)

    @classmethod
    def shape(cls) -> Parameter | None:
        """The parameter that is scored on a grid, `None` for an effect without a shape."""
        return next((parameter for parameter in cls.parameters if parameter.grid), None)

    def needed(self) -> tuple[str, ...]:
        """Input features that the equation reads; an option called `input` names the one."""
        return (self.chosen["input"],) if "input" in self.options else self.needs


class NodeEffect(Effect):
    """Heat that an effect brings into a node."""

    site = "node"

    @abstractmethod
    def heat(self, temperature: Symbol, inputs: SimpleNamespace, p: SimpleNamespace) -> Symbol:
        """Heat into the node [W], from its temperature [degC], its inputs and the parameters."""


class MassEffect(Effect):
    """A state of its own (degC) beside the node, exchanging heat with it."""

    site = "node"
    has_state = True

    @abstractmethod
    def heat(self, temperature: Symbol, state: Symbol, p: SimpleNamespace) -> Symbol:
        """Heat from the state into the node [W]."""

    @abstractmethod
    def rate(self, temperature: Symbol, state: Symbol, p: SimpleNamespace) -> Symbol:
        """Time derivative of the state [K/s]."""


class LossEffect(Effect):
    """A factor on another effect's heat at the same node."""

    site = "loss"
    acts_on: ClassVar[str]

    @abstractmethod
    def factor(self, temperature: Symbol, p: SimpleNamespace) -> Symbol:
        """Factor on the heat, 1 when off."""


class LinkEffect(Effect):
    """A change of the exchange between a node and its surroundings (ambient, coolant)."""

    site = "link"

    def conductance_factor(
        self,
        temperature: Symbol,
        surroundings: Symbol,
        inputs: SimpleNamespace,
        p: SimpleNamespace,
    ) -> Symbol:
        """Factor on the link's conductance, 1 when off; temperatures in degC."""
        return 1.0

    def extra_heat(self, temperature: Symbol, surroundings: Symbol, p: SimpleNamespace) -> Symbol:
        """Heat from the surroundings into the node [W] beside the link's own."""
        return 0.0


class EdgeEffect(Effect):
    """Exchange of heat between two nodes that the network does not link."""

    site = "edge"

    @abstractmethod
    def conductance(self, p: SimpleNamespace) -> Symbol:
        """Conductance between the two nodes [W/K]."""


class SensorEffect(Effect):
    """A difference between what the sensor reads and the node's temperature."""

    site: ClassVar[Site] = "sensor"

    @abstractmethod
    def error(self, temperature: Symbol, state: Symbol, p: SimpleNamespace) -> Symbol:
        """Reading minus temperature [K]; `state` is `None` for an effect without one."""

    def rate(self, temperature: Symbol, state: Symbol, p: SimpleNamespace) -> Symbol:
        """Time derivative of the sensor's state [K/s], for an effect that has one."""
        return 0.0


class ClockEffect(Effect):
    """A time by which readings come late, or early, against the inputs of the same log.

    It is a matter of the log and not of the robot, so it acts where a model is driven by one, and in no FMU and no
    estimator.
    """

    site = "sensor"

    @abstractmethod
    def delay(self, p: SimpleNamespace) -> Symbol:
        """How late the readings come [s]."""


class ExcessEffect(SensorEffect):
    """A sensor error with inertia, which follows the heat in its node, or time, but not the temperature.

    Its state is the node's temperature plus an excess, so that it starts a run without any.
    """

    has_state = True
    heat_of: ClassVar[str] = ""
    """Key of the effect whose heat at the same node drives the excess."""

    @abstractmethod
    def excess_rate(self, excess: Symbol, heat: Symbol, p: SimpleNamespace) -> Symbol:
        """Time derivative of state minus temperature [K/s], from that excess [K] and the driving heat [W]."""


class PairSensorEffect(SensorEffect):
    """A sensor error that comes from another node: place `"a~b"` is the sensor of *a*, disturbed by *b*."""

    site = "pair"

    @abstractmethod
    def error(self, temperature: Symbol, state: Symbol, p: SimpleNamespace) -> Symbol:
        """Reading minus temperature [K]; `state` is the other node's temperature [degC]."""


class GroupEffect(Effect):
    """One state (degC) beside several nodes, exchanging heat with each of them and with their surroundings."""

    site = "group"
    has_state = True

    @abstractmethod
    def heat(self, temperature: Symbol, state: Symbol, p: SimpleNamespace) -> Symbol:
        """Heat from the state into one of the nodes [W]."""

    @abstractmethod
    def rate(self, mean: Symbol, state: Symbol, surroundings: Symbol, p: SimpleNamespace) -> Symbol:
        """Time derivative of the state [K/s], from the nodes' mean temperature and that of the surroundings."""


class BoundaryEffect(Effect):
    """A difference between a prescribed temperature as it is given and as the nodes feel it."""

    site = "boundary"

    @abstractmethod
    def error(self, temperature: Symbol, state: Symbol, p: SimpleNamespace) -> Symbol:
        """What is felt minus what is given [K]; `state` is `None` for an effect without one."""

    def rate(self, temperature: Symbol, state: Symbol, p: SimpleNamespace) -> Symbol:
        """Time derivative of the state [K/s], for an effect that has one."""
        return 0.0
