"""A model as an FMU's component: variables, and expressions of states, inputs and parameters in kelvin."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import reduce
from typing import TYPE_CHECKING, Any

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.parameters import ParameterInstance
from lptn.basics.places import matching
from lptn.logs.columns import column_unit
from lptn.logs.resampling import raw_keys
from lptn.model.model import Model
from lptn.model.network import EffectInstance, Link

from .variables import (
    ZERO_CELSIUS,
    Kind,
    Variable,
    celsius_offset,
    column_description,
    fmi_unit,
    from_column,
    name_between,
    pattern_as_word,
    place_name,
    places_of_owner,
    structured_name,
)

if TYPE_CHECKING:
    from .admissible import Admissible

DEFAULT_LIMIT = 80.0
"""Temperature limit of a node where none is given [degC]."""
ROOM = 25.0
"""Start temperature where none is given [degC]."""
_INPUT_STARTS = {"powered": 1.0}  # a robot that is simulated is switched on; all other inputs start at rest
_AT_LEAST_ZERO = ("powered", "fan", "irradiance")  # inputs that no robot has below 0


def _by_place(
    places: Sequence[str], values: Mapping[str, float] | float | None, default: float, origin: str, where: str
) -> dict[str, float]:
    """A temperature [degC] for each place; the last pattern that matches wins."""
    table = {"*": default} | ({} if values is None else dict(values) if isinstance(values, Mapping) else {"*": values})
    temperatures: dict[str, float] = {}
    for pattern, value in table.items():
        matched = matching(pattern, places)
        if not matched:
            raise InputError(origin, where, f'"{pattern}"', f"one of {', '.join(places)}, or a pattern")
        if not -ZERO_CELSIUS < value < 1e4:
            raise InputError(origin, where, f"{value!r} degC", "a temperature in degC")
        temperatures |= dict.fromkeys(matched, value)
    return temperatures


def _raw_of(column: str) -> tuple[str, ...]:
    """The raw columns whose mean over a step a column is, none for a raw one."""
    raw = raw_keys(column)
    return () if raw == (column,) else raw


class Component:
    """A model as an FMU's component: variables block by block, for a value reference is a place in that order.

    Args:
        model: the model behind it.
        limits: temperature limit [degC] of each place by name or pattern, or one of all; 80 degC where none is given.
        start: start temperature [degC] in the same way; 25 degC where none is given.
        forecast: whether to add the time to each node's limit.
        events: whether to add limits that are crossed as events.
        clocks: whether clocks tick with the events; FMI 2 knows none.
        admissible: whether to add the admissible torques.
        current_limits: of the joints [A], for the admissible torques.

    Attributes:
        names: all variables by name, in the order of their value references.
        x: states [K].
        u: inputs, temperatures in kelvin: the model's, then raw ones that only means are formed from.
        p: parameters, temperatures in kelvin: the model's, limits of its places, band, horizon.
        rates: dx/dt [K/s].
        outputs: the calculated outputs: readings [K], heat flows [W], torque scales.
        limited: for each place of the model the index of its limit among `p`.
        admissible: the predictive limiter, where admissible torques are outputs.

    Raises:
        InputError: a limit or start names no node, or lies below absolute zero; the model has no admissible torque; or
            two places have names that FMI can't tell apart.
    """

    def __init__(
        self,
        model: Model,
        limits: Mapping[str, float] | float | None = None,
        start: Mapping[str, float] | float | None = None,
        *,
        forecast: bool = False,
        events: bool = False,
        clocks: bool = True,
        admissible: bool = False,
        current_limits: Mapping[str, float] | float | None = None,
    ) -> None:
        self.model = model
        warmest = _by_place(model.places, limits, DEFAULT_LIMIT, model.network.origin, "limits")
        begin = _by_place(model.nodes, start, ROOM, model.network.origin, "start")
        own = len(model.parameters)
        self.limited = tuple(range(own, own + len(model.places)))
        # Behind the model's inputs the raw columns of which it takes means alone.
        self._columns = tuple(dict.fromkeys((*model.inputs, *(raw for of in model.inputs for raw in _raw_of(of)))))
        sizes = {"x": len(model.states), "u": len(self._columns), "p": own + len(model.places) + (2 if forecast else 1)}
        self.x, self.u, self.p = (ca.SX.sym(name, size) for name, size in sizes.items())
        # What the component's values exceed the model's by: kelvin here, degC there.
        self._input_offsets = [celsius_offset(column_unit(column)) for column in self._columns]
        offsets = [celsius_offset(parameter.declared.unit) for parameter in model.parameters]
        inputs = self._model_inputs()
        # The model's states, inputs and parameters as expressions of the component's.
        self._arguments = [self.x - ZERO_CELSIUS, inputs(self.u), self.p[:own] - ca.DM(offsets)]
        self.admissible: Admissible | None = None
        if admissible:
            from .admissible import Admissible  # the planners are loaded only where they are needed

            self.admissible = Admissible(model, warmest, current_limits, self._columns, inputs, offsets)
        self.names: dict[str, Variable] = {}
        self._add("time", "time", "s", None, "Simulation time")
        self._add_states(begin)
        self._add_inputs()
        self._add_parameters(warmest, forecast)
        self.outputs = ca.vertcat(*self._add_outputs())
        for name, unit, description in self.admissible.outputs if self.admissible else ():
            self._add(name, "admissible", unit, None, description, minimum=0.0)
        for place in model.places if forecast else ():
            description = f"Time until {place} reaches its limit, inputs held: connect a display or a planner"
            self._add(place_name(place, "time_to_limit"), "forecast", "s", None, description, minimum=0.0)
        if events:
            self._add_events(clocks)
        self.rates = model.rhs(*self._arguments)

    @property
    def variables(self) -> tuple[Variable, ...]:
        """All variables in the order of their value references."""
        return tuple(self.names.values())

    def of(self, *kinds: Kind) -> list[Variable]:
        """The variables of some kinds, in order."""
        return [variable for variable in self.variables if variable.kind in kinds]

    def starts(self, kind: Kind) -> FloatArray:
        """The start values of the variables of a kind, which all have one."""
        return np.array([variable.start for variable in self.of(kind)], dtype=float)

    def _model_inputs(self) -> ca.Function:
        """The model's inputs from the component's.

        A mean over a step, such as `velocity_rms`, is formed from the raw input while it is negative: at a
        simulator's step both are the same. So one velocity is enough, and a coarse step can still give its own mean.
        """
        u = ca.SX.sym("u", len(self._columns))
        given = dict(zip(self._columns, ca.vertsplit(u - ca.DM(self._input_offsets)), strict=True))
        inputs = []
        for column in self.model.inputs:
            own = given[column]
            if raw := _raw_of(column):
                own = ca.if_else(own < 0, ca.fabs(math.prod(given[name] for name in raw)), own)
            inputs.append(own)
        return ca.Function("inputs", [u], [ca.vertcat(*inputs)])

    def _add(self, name: str, kind: Kind, unit: str, start: float | None, description: str, **more: Any) -> None:
        if name in self.names:
            # The names of two places differ only in characters that FMI names lack.
            expected = "places that stay apart as words"
            raise InputError(self.model.network.origin, "names", f'two FMU variables "{name}"', expected)
        self.names[name] = Variable(name, len(self.names), kind, unit, start, description, **more)

    def _add_states(self, begin: Mapping[str, float]) -> None:
        """Add states that begin at these temperatures of the nodes [degC], and their rates."""

        def resting(place: str) -> float:
            source = self.model.network.prescribed.get(place)
            prescribed = self.model.values[source] if isinstance(source, int) else ROOM
            return begin.get(place, float(prescribed))

        for node in self.model.nodes:
            name, start = structured_name(node, "temperature"), begin[node] + ZERO_CELSIUS
            description = f"Temperature of {node}, settable before the start: connect a display or a controller"
            self._add(name, "state", "K", start, description, celsius=True, minimum=0.0)
        for point in self.model.network.hottest:
            name, start = place_name(point.name, "temperature"), begin[point.element] + ZERO_CELSIUS
            description = f"Temperature of the hottest point of {point.element}: connect a display or a limiter"
            self._add(name, "state", "K", start, description, celsius=True, minimum=0.0)
        for effect in self.model.balance.hidden:
            place, _ = places_of_owner(effect.place, ())
            name = structured_name(place, effect.name, "temperature")
            start = sum(map(resting, effect.ends)) / len(effect.ends) + ZERO_CELSIUS
            description = f"Temperature behind {effect.name} at {effect.place}"
            self._add(name, "state", "K", start, description, celsius=True, minimum=0.0, hidden=True)
        for state in self.of("state"):
            description, of = f"Rate of {state.name}", state.reference
            self._add(f"der({state.name})", "rate", "K/s", None, description, hidden=True, of=of)

    def _add_inputs(self) -> None:
        not_connected = -1.0  # of a mean that can't be negative: it is formed from the raw inputs
        for column, offset in zip(self._columns, self._input_offsets, strict=True):
            hot, quantity = offset > 0, column.partition(".")[0]
            start = ROOM + offset if hot else _INPUT_STARTS.get(quantity, 0.0)
            start = not_connected if _raw_of(column) else start
            name, unit, description = from_column(column), fmi_unit(column_unit(column)), column_description(column)
            least = 0.0 if hot or quantity in _AT_LEAST_ZERO else None
            self._add(name, "input", unit, start, description, celsius=hot, minimum=least)

    def _add_parameters(self, limits: Mapping[str, float], forecast: bool) -> None:
        for parameter in self.model.parameters:
            self._add_parameter(parameter)
        for place in self.model.places:
            name, limit = place_name(place, "temperature_limit"), limits[place] + ZERO_CELSIUS
            description = f"Limit that {place} must not pass"
            self._add(name, "parameter", "K", limit, description, celsius=True, minimum=0.0)
        description = "Range below the limit in which the limiter takes torque away"
        band = 10.0  # K below the limit where derating begins
        self._add("limiter.band", "parameter", "K", band, description, minimum=1e-3)
        if forecast:
            description = "How far time_to_limit looks ahead; it shows this where no limit is reached before"
            horizon = 3600.0  # s that the forecast looks ahead
            self._add("limiter.horizon", "parameter", "s", horizon, description, minimum=1e-3, maximum=1e7)

    def _add_events(self, clocks: bool) -> None:
        for place in self.model.places:
            name, description = place_name(place, "limit_indicator"), f"Changes sign where {place} crosses its limit"
            self._add(name, "indicator", "K", None, description, hidden=True)
        for place in self.model.places:
            description = f"Whether {place} has passed its limit: connect what must react at once"
            self._add(place_name(place, "limit_crossed"), "crossed", "", None, description)
        if clocks:
            self._add("clocks.limit_crossed", "clock", "", None, "Ticks when any limit is passed, or is no longer")
            description = "Set it when a run begins anew: all temperatures are those of the start again"
            self._add("clocks.run_begins", "clock", "", None, description, entrance=True)

    def _add_parameter(self, parameter: ParameterInstance) -> None:
        declared, unit = parameter.declared, parameter.declared.unit
        hot = unit == "degC"
        lower, upper = declared.bounds
        shape = unit == "1" and upper < 1e3  # an exponent or a share keeps its bounds; a size may be tuned past a fit's
        least_positive = 1e-9  # the least value of a parameter that must be positive
        minimum = 0.0 if hot else lower if shape else least_positive if lower > 0 else 0.0 if lower == 0 else None
        label, quantity, owner = parameter.effect, declared.name, parameter.owner
        title = declared.title or declared.name
        one, other = places_of_owner(owner, self.model.network.prescribed)
        self._add(
            name_between(one, label, other, quantity),
            "parameter",
            fmi_unit(unit),
            parameter.value + celsius_offset(unit),
            f"{label} at {owner}: {title}" if label else f"{title[0].upper()}{title[1:]} of {owner}",
            celsius=hot,
            minimum=minimum,
            maximum=upper if shape else None,
        )

    def _add_outputs(self) -> list[Any]:
        """Add the calculated outputs; returns their expressions."""
        own, outputs = self.model.symbols, []

        def of_component(expression: Any) -> Any:
            return ca.substitute([expression], [own.x, own.u, own.p], self._arguments)[0]

        instances = self.model.network.effect_instances
        sensed = {instance.ends[0] for instance in instances if instance.effect.changes_reading}
        with_torque = {
            instance.ends[0] for instance in instances if {"torque", "current"} & set(instance.effect.needed())
        }
        for node, reading in zip(self.model.nodes, ca.vertsplit(own.readings), strict=True):
            if node in sensed:
                name = structured_name(node, "reading")
                description = f"What the sensor of {node} reads: connect what would read the real one"
                self._add(name, "output", "K", None, description, celsius=True, minimum=0.0)
                outputs.append(of_component(reading) + ZERO_CELSIUS)
        for name, description, flow in _heat_flows(self.model):
            self._add(name, "output", "W", None, description)
            outputs.append(of_component(self.model.balance.with_faces_solved(flow)))
        band = self.p[self.limited[-1] + 1]
        for row, node in enumerate(self.model.nodes):
            if node in with_torque:
                description = f"Thermal limiter of {node}: multiply the wanted torque by it, 1 below the limit's band"
                name = structured_name(node, "torque_scale")
                self._add(name, "output", "1", None, description, minimum=0.0, maximum=1.0)
                there = (k for k, owner in enumerate(self.model.owners[: len(self.model.places)]) if owner == row)
                room = reduce(ca.fmin, (self.p[self.limited[k]] - self.x[k] for k in there))
                outputs.append(ca.fmin(1, ca.fmax(0, room / band)))
        return outputs


# --- heat flows: what each link carries and what each effect brings --------------------------------


def _heat_flows(model: Model) -> Iterator[tuple[str, str, Any]]:
    """Name, description and size [W] of every link's and every effect's heat flow, in the order of the network.

    Links and effects between nodes count from the first node to the second, prescribed nodes last. A loss or link
    effect counts what it adds to the flow that it acts on: the flow with it less the flow without it.

    Source: [QuadrupedLPTN, eq. 1, 3, 5].
    """
    network, heat = model.network, model.balance.heat_into_ends

    def in_order(ends: Iterable[str]) -> list[str]:
        return sorted(ends, key=lambda name: (name in network.prescribed, name))

    def away(link: Link, source: str, left_out: EffectInstance | None = None) -> Any:
        inward = model.balance.exchange(link, left_out)
        return -inward if link.ends[0] == source else inward

    for link in network.resistors:
        source, target = in_order(link.ends)
        name = name_between(source, "", target, "heat_flow")
        yield name, f"Heat that flows from {source} to {target}", away(link, source)
    for instance in network.effect_instances:
        effect, label, node = instance.effect, instance.name, instance.ends[0]
        if effect.between_ends:
            source, target = in_order(instance.ends)
            name, inward = name_between(source, label, target, "heat_flow"), heat(instance)[instance.ends.index(target)]
            yield name, f"Heat that flows from {source} to {target} by {label}", inward
        elif heats := heat(instance):
            label = label if instance.place in instance.ends else f"{label}_{pattern_as_word(instance.place)}"
            for end, brought in zip(instance.ends, heats, strict=True):
                yield name_between(end, label, "", "heat_flow"), f"Heat that {label} brings into {end}", brought
        elif effect.scales_heat:
            at_node = [base for base in network.effect_instances if base.ends == instance.ends]
            scaled = [base for base in at_node if base.effect.key == effect.heat_of]
            added = sum((heat(base)[0] - heat(base, instance)[0] for base in scaled), start=ca.SX(0))
            yield name_between(node, label, "", "heat_flow"), f"What {label} adds to the heat that enters {node}", added
        elif effect.changes_link:
            (link,) = (link for link in network.resistors if set(link.ends) == set(instance.ends))
            added = away(link, node, instance) - away(link, node)
            # A node with several surroundings has one such effect for each: the place then is an edge.
            target = instance.ends[1] if "~" in instance.place else ""
            path = f"flows from {node} to {target}" if target else f"enters {node}"
            name = name_between(node, label, target, "heat_flow")
            yield name, f"What {label} adds to the heat that {path}", -added if target else added
