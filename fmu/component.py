"""A model as an FMU's component: variables, and expressions of states, inputs and parameters in kelvin."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import casadi as ca

from lptn.effects import SensorEffect
from lptn.errors import InputError
from lptn.model import Model
from lptn.parameters import Unknown
from lptn.places import matching

from .flows import heat_flows
from .naming import described, joined, of_column, of_owner
from .units import ZERO_CELSIUS, feature_unit, plain
from .variables import Kind, Variable, refuse_twice

if TYPE_CHECKING:
    from .admissible import Admissible

DEFAULT_LIMIT = 80.0
"""Temperature limit of a node whose limit nobody gave [degC]."""
ROOM = 25.0
"""Start temperature where nobody gave one [degC]."""
_BAND, _HORIZON = 10.0, 3600.0  # K below the limit where derating begins; s that the forecast looks ahead
_USUAL = {"powered": 1.0}  # a robot that is simulated is switched on; all other inputs start at rest
_POSITIVE = 1e-9  # the least value of a parameter that must be positive


@dataclass(frozen=True)
class Component:
    """What is exported.

    Args:
        model: the model behind it.
        variables: all variables in the order of their value references.
        x: states [K].
        u: inputs, temperatures in kelvin.
        p: parameters, temperatures in kelvin; the model's, then limits, band and horizon.
        rates: dx/dt [K/s].
        outputs: the calculated outputs, states left out.
        limited: for each node the index of its limit in p.
        admissible: the predictive limiter, where its outputs were asked for.
    """

    model: Model
    variables: tuple[Variable, ...]
    x: Any
    u: Any
    p: Any
    rates: Any
    outputs: Any
    limited: tuple[int, ...]
    admissible: Admissible | None = None

    def of(self, *kinds: Kind) -> list[Variable]:
        """The variables of some kinds, in order."""
        return [variable for variable in self.variables if variable.kind in kinds]

    def first(self, kind: Kind) -> int:
        """The value reference of the first variable of a kind."""
        kinds: list[Kind] = ["time", "state", "rate", "input", "parameter", "output", "admissible", "forecast"]
        return sum(len(self.of(each)) for each in kinds[: kinds.index(kind)])

    @cached_property
    def names(self) -> dict[str, Variable]:
        """The variables by name."""
        return {variable.name: variable for variable in self.variables}


def component(
    model: Model,
    limits: Mapping[str, float] | float | None = None,
    start: Mapping[str, float] | float | None = None,
    *,
    admissible: bool = False,
    current_limits: Mapping[str, float] | float | None = None,
) -> Component:
    """A model's component.

    Args:
        limits: temperature limit [degC] of each node by name or pattern, or one of all; 80 degC where none is given.
        start: start temperature [degC] in the same way; 25 degC where none is given.
        admissible: whether to add the admissible torques.
        current_limits: of the joints [A], for the admissible torques.

    Raises:
        InputError: a limit or start names no node, or lies below absolute zero; or the model has no admissible torque.
    """
    limited, started = _by_node(model, limits, DEFAULT_LIMIT, "limits"), _by_node(model, start, ROOM, "start")
    builder = _Builder(model, limited, started)
    if admissible:
        builder.limit(current_limits)
    return builder.build()


def _by_node(model: Model, given: Mapping[str, float] | float | None, default: float, where: str) -> dict[str, float]:
    """A temperature [degC] for each node; the last pattern that matches wins."""
    table = {"*": default} | ({} if given is None else dict(given) if isinstance(given, Mapping) else {"*": given})
    found: dict[str, float] = {}
    for pattern, value in table.items():
        nodes = matching(pattern, model.nodes)
        if not nodes:
            known = f"one of {', '.join(model.nodes)}, or a pattern"
            raise InputError(model.network.origin, where, f'"{pattern}"', known)
        if not -ZERO_CELSIUS < value < 1e4:
            raise InputError(model.network.origin, where, f"{value!r} degC", "a temperature in degC")
        found |= dict.fromkeys(nodes, value)
    return found


class _Builder:
    """Collects variables block by block, for a value reference is a place in that order."""

    def __init__(self, model: Model, limits: Mapping[str, float], start: Mapping[str, float]) -> None:
        self.model, self.limits, self.start = model, limits, start
        self.variables: list[Variable] = [Variable("time", 0, "time", "s", None, "Simulation time")]
        self.x, self.u = ca.SX.sym("x", len(model.states)), ca.SX.sym("u", len(model.inputs))
        self.known = len(model.unknowns)
        self.p = ca.SX.sym("p", self.known + len(model.nodes) + 2)
        self.limited = tuple(self.known + row for row in range(len(model.nodes)))

        self.shift = [ZERO_CELSIUS if feature_unit(column) == "degC" else 0.0 for column in model.inputs]
        self.raised = [ZERO_CELSIUS if unknown.declared.unit == "degC" else 0.0 for unknown in model.unknowns]
        self.admissible: Admissible | None = None

    def limit(self, current_limits: Mapping[str, float] | float | None) -> None:
        """Add the predictive limiter."""
        from .admissible import admissible

        self.admissible = admissible(self.model, self.limits, current_limits, self.shift, self.raised)

    def build(self) -> Component:
        arguments = [self.x - ZERO_CELSIUS, self.u - ca.DM(self.shift), self.p[: self.known] - ca.DM(self.raised)]
        self._states()
        self._inputs()
        self._parameters()
        outputs = self._outputs(self._in_celsius(arguments))
        for name, unit, text in self.admissible.outputs if self.admissible else ():
            self._add(name, "admissible", unit, None, text)
        for node in self.model.nodes:
            text = f"Time until {node} reaches its limit, inputs held"
            self._add(joined(node, "time_to_limit"), "forecast", "s", None, text)
        refuse_twice(self.variables, self.model.network.origin)
        rates = self.model.rhs(*arguments)
        values = ca.vertcat(*outputs)
        known = (self.x, self.u, self.p)
        return Component(self.model, tuple(self.variables), *known, rates, values, self.limited, self.admissible)

    def _in_celsius(self, arguments: list[Any]) -> Callable[[Any], Any]:
        """An expression of the model's own symbols as one of the component's."""
        own = self.model.symbols
        return lambda expression: ca.substitute([expression], [own.x, own.u, own.p], arguments)[0]

    def _add(self, name: str, kind: Kind, unit: str, start: float | None, description: str, **more: Any) -> int:
        reference = len(self.variables)
        self.variables.append(Variable(name, reference, kind, unit, start, description, **more))
        return reference

    def _states(self) -> None:
        references = []
        for node in self.model.nodes:
            name, start = joined(node, "temperature"), self.start[node] + ZERO_CELSIUS
            references.append(self._add(name, "state", "K", start, f"Temperature of {node}", celsius=True, minimum=0.0))
        for use in self.model.balance.hidden:
            place, _ = of_owner(use.place, ())
            text = f"Temperature behind {use.name} at {use.place}"
            more: dict[str, Any] = {"celsius": True, "minimum": 0.0, "hidden": True}
            name = joined(place, use.name, "temperature")
            references.append(self._add(name, "state", "K", self._resting(use.ends), text, **more))
        for reference in references:
            name = self.variables[reference].name
            self._add(f"der({name})", "rate", "K/s", None, f"Rate of {name}", hidden=True, of=reference)

    def _resting(self, places: tuple[str, ...]) -> float:
        """Where a hidden state starts [K]: at the mean of its nodes, or at the prescribed temperature that it is of."""
        prescribed, found = self.model.network.prescribed, []
        for place in places:
            source = prescribed.get(place)
            given = self.model.values[source] if isinstance(source, int) else ROOM
            found.append(self.start.get(place, float(given)))
        return sum(found) / len(found) + ZERO_CELSIUS

    def _inputs(self) -> None:
        for column in self.model.inputs:
            unit = feature_unit(column)
            hot = unit == "degC"
            text = described(column)
            start = ROOM + ZERO_CELSIUS if hot else _USUAL.get(column.partition(".")[0], 0.0)
            self._add(of_column(column), "input", plain(unit), start, text, celsius=hot, minimum=0.0 if hot else None)

    def _parameters(self) -> None:
        for unknown in self.model.unknowns:
            self._parameter(unknown)
        for node in self.model.nodes:
            limit = self.limits[node] + ZERO_CELSIUS
            text = f"Limit that {node} must not pass"
            self._add(joined(node, "temperature_limit"), "parameter", "K", limit, text, celsius=True, minimum=0.0)
        text = "Range below the limit in which the limiter takes torque away"
        self._add("limiter.band", "parameter", "K", _BAND, text, minimum=1e-3)
        text = "How far time_to_limit looks ahead; it shows this where no limit is reached before"
        self._add("limiter.horizon", "parameter", "s", _HORIZON, text, minimum=1e-3, maximum=1e7)

    def _parameter(self, unknown: Unknown) -> None:
        declared, unit = unknown.declared, unknown.declared.unit
        hot = unit == "degC"
        lower, upper = declared.bounds
        shape = unit == "1" and upper < 1e3  # an exponent or a share keeps its bounds; a size may be tuned past a fit's
        minimum = 0.0 if hot else lower if shape else _POSITIVE if lower > 0 else 0.0 if lower == 0 else None
        prefix, _, owner = unknown.name.rpartition(".")
        label, title = prefix.rpartition(".")[0], declared.title or declared.name
        text = f"{label} at {owner}: {title}" if label else f"{title[0].upper()}{title[1:]} of {owner}"
        self._add(
            self._parameter_name(unknown),
            "parameter",
            plain(unit),
            unknown.value + (ZERO_CELSIUS if hot else 0.0),
            text,
            celsius=hot,
            minimum=minimum,
            maximum=upper if shape else None,
        )

    def _parameter_name(self, unknown: Unknown) -> str:
        prefix, _, owner = unknown.name.rpartition(".")
        label, _, name = prefix.rpartition(".")
        one, other = of_owner(owner, self.model.network.prescribed)
        if not other:
            return joined(one, label, name) if label else joined(one, name)
        return joined(one, f"{label}_to_{other}" if label else f"to_{other}", name)

    def _outputs(self, celsius: Callable[[Any], Any]) -> list[Any]:
        found = []
        for node, reading in zip(self.model.nodes, ca.vertsplit(self.model.symbols.readings), strict=True):
            if self._is_sensed(node):
                text = f"What the sensor of {node} reads"
                self._add(joined(node, "reading"), "output", "K", None, text, celsius=True)
                found.append(celsius(reading) + ZERO_CELSIUS)
        for flow in heat_flows(self.model):
            self._add(flow.name, "output", "W", None, flow.text)
            found.append(celsius(flow.expression))
        band = self.p[self.known + len(self.model.nodes)]
        for row, node in enumerate(self.model.nodes):
            if self._is_driven(node):
                text = f"Factor that a thermal limiter puts on the torque of {node}"
                self._add(joined(node, "torque_scale"), "output", "1", None, text)
                found.append(ca.fmin(1, ca.fmax(0, (self.p[self.limited[row]] - self.x[row]) / band)))
        return found

    def _is_sensed(self, node: str) -> bool:
        return any(isinstance(use.effect, SensorEffect) and use.ends[0] == node for use in self.model.network.uses)

    def _is_driven(self, node: str) -> bool:
        return any(
            {"torque", "current"} & set(use.effect.needed()) and use.ends[0] == node for use in self.model.network.uses
        )
