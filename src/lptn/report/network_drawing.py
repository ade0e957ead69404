"""A network as a drawing: nodes, links, what acts on them, the surroundings that they give heat to; and over a run."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import casadi as ca
import numpy as np

from lptn.basics.arrays import BoolArray, FloatArray
from lptn.basics.places import edge
from lptn.identify.comparison import Comparison, Prediction
from lptn.model.model import Model
from lptn.model.network import EffectInstance, Network
from lptn.report.document import environment
from lptn.report.network_layout import Point, places_of
from lptn.report.text import number, title_of

# --- what flows: heat through every link and from every effect ----------------------------------------------


def heat_flows(model: Model, states: FloatArray, inputs: FloatArray) -> dict[str, FloatArray]:
    """Heat that flows at some moments [W]: through a link into its first end, and from an effect into its place.

    Args:
        model: the model, at the values of its parameters.
        states: its states [degC], shape (states, k), as `lptn.simulate` gives them.
        inputs: its inputs, shape (inputs, k), in the order of `model.inputs`.

    Returns:
        W by the names of links, `"a~b"`, and of effects, `"copper_loss.FR_calf"`, shape (k,) each.
    """
    balance = model.balance
    flows = balance.flows
    arguments = [balance.x, balance.u, balance.p]
    make = lambda: ca.Function("flows", arguments, [ca.vertcat(*flows.values())])  # noqa: E731
    values = model.made_once("heat flows", make)(states, inputs, model.values)
    return dict(zip(flows, np.asarray(values, dtype=float), strict=True))


# --- what is drawn -------------------------------------------------------------------------------------------


@dataclass
class _Line:
    """A link of the drawing, with the effects that act on it; `around` is its end in surroundings, empty for none."""

    name: str
    ends: tuple[str, str]
    around: str
    parameters: list[str] = field(default_factory=list)
    effects: list[EffectInstance] = field(default_factory=list)


# --- how it looks --------------------------------------------------------------------------------------------


_LETTER, _SMALL_LETTER, _HIGH, _AROUND = 7.3, 6.4, 26.0, 22.0  # px: letters' widths, a box's height, a margin
_STUB = 34.0  # px from a box's edge to the mark of the surroundings
_BADGE = 6.5  # px, radius
_THIN, _WIDEST = 1.6, 9.0  # px, of links
_DIRECTIONS = 24  # that are tried for a stub
_SCALE = ((255, 247, 188), (254, 196, 79), (236, 112, 20), (153, 52, 4))  # cool to hot; told apart in grey, too
_LEGEND = 19.0  # px, a line of the legend


class Drawing(str):
    """An SVG, which a notebook shows as the picture that it is."""

    __slots__ = ()

    def _repr_svg_(self) -> str:
        return str(self)


def draw_network(
    model: Model | Network, temperatures: Mapping[str, float] | None = None, flows: Mapping[str, float] | None = None
) -> Drawing:
    """A drawing of a network as one `<svg>` element, for a page or a file of its own; light and dark.

    Each node is a box, each resistance a line. A short line that ends in a mark is a resistance to the surroundings.
    What acts on a node or link is a numbered badge, with its name in the legend. For scripts, a node's element has
    `data-node`, a link's `data-link`, a badge's `data-effect`; `data-parameter` holds a JSON list of the names of
    its parameters.

    Args:
        model: a model or its network.
        temperatures: degC by node, prescribed ones too where they are known; they colour the boxes.
        flows: W by link and effect, as `heat_flows` gives them; they set the width of the lines.

    Returns:
        SVG; the same arguments give the same text.

    Example:
        >>> import lptn
        >>> model = lptn.load_model("examples/tclab/two_heaters.toml").model
        >>> draw_network(model).count("data-link=")
        2
    """
    network = model.network if isinstance(model, Model) else model
    return Drawing(_Drawing(network, dict(temperatures or {}), dict(flows or {})).text())


class _Drawing:
    """Boxes placed, then lines below them, then badges and a legend; faces stand for the body that they belong to."""

    def __init__(self, network: Network, temperatures: dict[str, float], flows: dict[str, float]) -> None:
        self.network, self.temperatures, self.flows = network, temperatures, flows
        self.names = [parameter.name for parameter in network.parameters]
        self.kinds = list(dict.fromkeys(instance.effect.key for instance in network.effect_instances))
        self.nodes, self.around = list(network.dynamic), list(network.prescribed)
        self.effects: dict[str, list[EffectInstance]] = {}  # of nodes
        self.lines: dict[str, _Line] = {}  # every link, and what effects exchange heat where there is none
        resistors = [(link.place, link.ends, link.resistance) for link in network.resistors]
        inside = [(edge(*conductor.ends), conductor.ends, conductor.conductivity) for conductor in network.conductors]
        for place, ends, index in [*resistors, *inside]:
            if line := self._line(place, ends):
                line.parameters.append(self.names[index])
        for instance in network.effect_instances:
            acted_on = self._line_of(instance)
            effects = acted_on.effects if acted_on else self.effects.setdefault(self._body(instance.ends[0]), [])
            effects.append(instance)
        finite = [value for value in temperatures.values() if np.isfinite(value)]
        self.coolest, self.hottest = (min(finite), max(finite)) if finite else (0.0, 0.0)
        through = [abs(flows[line.name]) for line in self.lines.values() if np.isfinite(flows.get(line.name, np.nan))]
        self.most = max(through, default=0.0)
        self.sizes = {name: self._size(name) for name in self.nodes}
        inner = [line.ends for line in self.lines.values() if not line.around]
        self.at = places_of(self.nodes, inner, self.sizes)
        self.badges: list[dict[str, object]] = []
        self.reached: list[FloatArray] = []  # corners of what is drawn beside the boxes

    def _body(self, place: str) -> str:
        return place if place in (*self.nodes, *self.around) else place.rpartition(".")[0]

    def _line(self, name: str, places: Sequence[str]) -> _Line | None:
        """The line of a link; none within one body and between places whose temperatures are given."""
        one, other = (self._body(place) for place in places)
        if one == other or {one, other} <= set(self.around):
            return None
        around = next((end for end in (one, other) if end in self.around), "")
        return self.lines.setdefault(name, _Line(name, (one, other), around))

    def _line_of(self, instance: EffectInstance) -> _Line | None:
        """The line that an effect acts on; none where it acts on a node."""
        if len(instance.ends) < 2:
            return None
        bodies = {self._body(place) for place in instance.ends}
        matches = (line for line in self.lines.values() if set(line.ends) == bodies)
        return next(matches, None) or self._line(instance.place, instance.ends[:2])

    def _size(self, name: str) -> Point:
        shown = [name, self._degrees(name)]
        width = _LETTER * max(map(len, shown)) + 20
        badges = 2.3 * _BADGE * len(self.effects.get(name, ()))
        return max(width, badges + 8), _HIGH + (15.0 if shown[1] else 0.0) + (2 * _BADGE if badges else 0.0)

    def _degrees(self, name: str) -> str:
        value = self.temperatures.get(name, np.nan)
        return f"{value:.1f} °C" if np.isfinite(value) else ""

    def text(self) -> str:
        between = [self._between(line) for line in self.lines.values() if not line.around]
        links, nodes = [*between, *self._stubs()], [self._box(name) for name in self.nodes]
        for name, middle in self.at.items():
            half = np.divide(self.sizes[name], 2)
            self.reached += [middle - half, middle + half]
        low, high = np.min(self.reached, axis=0), np.max(self.reached, axis=0)
        left, top = (low - _AROUND).tolist()
        width, height = (high - low + 2 * _AROUND).tolist()
        words = [", ".join(filter(None, (name, self._degrees(name)))) for name in self.around]
        entries = [*zip(self.around, words, strict=True), *(("", title_of(key)) for key in self.kinds)]
        column = 30.0 + _SMALL_LETTER * max(len(words) for _, words in entries)
        across = max(width, 330.0, column + 16)
        left -= (across - width) / 2
        legend, below = self._legend(entries, left + 8, top + height + 4, column, across)
        return (
            environment()
            .get_template("network.svg.j2")
            .render(
                label=f"thermal network {self.network.name}: {len(self.nodes)} nodes, {len(self.lines)} links",
                box=[f"{value:.0f}" for value in (left, top, across, height + below)],
                links=links,
                nodes=nodes,
                badges=self.badges,
                legend=legend,
                most=f"{number(self.most, 3)} W through a link" if self.most else "",
                foot=(left + 8, top + height + below - _LEGEND + 2),
                widest=_WIDEST,
                radius=_BADGE,
            )
        )

    # --- nodes ------------------------------------------------------------------------------------

    def _box(self, name: str) -> dict[str, object]:
        (x, y), height = self.at[name], self.sizes[name][1]
        self._add_badges(self.effects.get(name, ()), x, y + height / 2 - 1)
        colour, ink = self._colour(name)
        known = {"capacity": self.names[self.network.capacities[name]], "degrees": self._degrees(name)}
        return known | {"name": name, "at": self.at[name], "size": self.sizes[name], "colour": colour, "ink": ink}

    def _colour(self, name: str) -> tuple[str, str]:
        """Of a box and of what is written in it; empty without a temperature."""
        value = self.temperatures.get(name, np.nan)
        if not np.isfinite(value):
            return "", ""
        share = (value - self.coolest) / (self.hottest - self.coolest) if self.hottest > self.coolest else 0.0
        at = share * (len(_SCALE) - 1)
        rgb = [np.interp(at, range(len(_SCALE)), [colour[k] for colour in _SCALE]) for k in range(3)]
        light = 0.299 * rgb[0] + 0.587 * rgb[1] + 0.114 * rgb[2] > 140
        return "rgb({:.0f},{:.0f},{:.0f})".format(*rgb), "#1a1a19" if light else "#fff"

    # --- links ------------------------------------------------------------------------------------

    def _between(self, line: _Line) -> dict[str, object]:
        start, end = np.array(self.at[line.ends[0]]), np.array(self.at[line.ends[1]])
        along = end - start
        beside = [other for other in self.lines.values() if {*other.ends} == {*line.ends}]
        across = np.array([-along[1], along[0]]) / max(float(np.hypot(*along)), 1e-9)
        shift = 13.0 * (beside.index(line) - (len(beside) - 1) / 2) * across
        middle = (start + end) / 2 + shift
        self._add_badges(line.effects, *middle.tolist())
        return self._link(line, start + shift, end + shift)

    def _link(self, line: _Line, start: FloatArray, end: FloatArray) -> dict[str, object]:
        flow, width, said = self.flows.get(line.name, np.nan), _THIN, ""
        if np.isfinite(flow):
            into, source = line.ends if flow > 0 else line.ends[::-1]
            said = f": {number(abs(flow), 3)} W from {source} to {into}"
            width = max(_WIDEST * abs(flow) / self.most, 0.8) if self.most else _THIN
        ends = {"start": start, "end": end, "width": width}
        return ends | {"name": line.name, "parameters": line.parameters, "said": said}

    def _stubs(self) -> list[dict[str, object]]:
        """Links to the surroundings, each where its node has most room."""
        angles: dict[str, list[float]] = {name: [] for name in self.nodes}
        for line in self.lines.values():
            if not line.around:
                for one, other in (line.ends, line.ends[::-1]):
                    dx, dy = np.subtract(self.at[other], self.at[one])
                    angles[one].append(float(np.arctan2(dy, dx)))
        drawn = []
        named = len(self.around) > 1 or len(self.nodes) < 3
        for line in self.lines.values():
            if not line.around:
                continue
            name = next(end for end in line.ends if end != line.around)
            angle = self._free_angle(name, angles[name])
            angles[name].append(angle)
            direction = np.array([np.cos(angle), np.sin(angle)])
            start = np.array(self.at[name])
            rim = start + direction * self._to_edge(name, direction)
            end = rim + direction * (_STUB + 2 * _BADGE * bool(line.effects))
            across = np.array([-direction[1], direction[0]])
            stub = self._link(line, start, end) | {"bar": (end - 7 * across, end + 7 * across)}
            if named:
                upright = abs(direction[0]) < 0.5
                anchor = "middle" if upright else "start" if direction[0] > 0 else "end"
                x, y = end + direction * 9 + [0.0, 4.0 + 5.0 * (direction[1] if upright else 0.0)]
                stub |= {"around": line.around, "at": (x, y), "anchor": anchor}
                wide = _SMALL_LETTER * len(line.around)
                first = {"middle": x - wide / 2, "start": x, "end": x - wide}[anchor]
                self.reached += [np.array([first, y - 11]), np.array([first + wide, y])]
            self.reached += [end - 9, end + 9]
            self._add_badges(line.effects, *((rim + end) / 2).tolist())
            drawn.append(stub)
        return drawn

    def _to_edge(self, name: str, direction: FloatArray) -> float:
        half = np.divide(self.sizes[name], 2)
        return float(min(half[k] / abs(direction[k]) for k in range(2) if abs(direction[k]) > 1e-9))

    def _free_angle(self, name: str, angles: Sequence[float]) -> float:
        """The direction with most room between the node's other lines and other boxes; upward among equals."""
        here = np.array(self.at[name])
        badges = bool(self.effects.get(name))
        others = [other for other in self.nodes if other != name]
        middles = np.array([self.at[other] for other in others]).reshape(-1, 2)
        halves = np.array([self.sizes[other] for other in others]).reshape(-1, 2) / 2
        inner = [line.ends for line in self.lines.values() if not line.around and name not in line.ends]
        ends = np.array([[self.at[one], self.at[other]] for one, other in inner]).reshape(-1, 2, 2)
        best, room = 0.0, -np.inf
        for place in range(_DIRECTIONS):
            angle = 2 * np.pi * place / _DIRECTIONS
            direction = np.array([np.cos(angle), np.sin(angle)])
            end = here + direction * (self._to_edge(name, direction) + _STUB)
            clear = min((abs((angle - other + np.pi) % (2 * np.pi) - np.pi) for other in angles), default=np.pi)
            outside = np.maximum(np.abs(end - middles) - halves, 0.0)  # how far the end is from each box [px]
            near = float(np.hypot(outside[:, 0], outside[:, 1]).min(initial=99.0))
            crossing = int(_crossed(here, end, ends[:, 0], ends[:, 1]).sum())
            score = min(clear, 1.2) + min(near, 30.0) / 30.0 - 1.5 * crossing
            score -= 0.7 * badges * max(direction[1], 0.0)  # a node's badges stand below it
            score += 0.1 * abs(direction[1]) - 0.05 * direction[1]  # up or down, where names are not
            if score > room + 1e-9:
                best, room = angle, score
        return float(best)

    # --- badges and legend ------------------------------------------------------------------------

    def _add_badges(self, effects: Sequence[EffectInstance], x: float, y: float) -> None:
        first = x - 2.3 * _BADGE * (len(effects) - 1) / 2
        self.badges += [self._badge(one, first + 2.3 * _BADGE * place, y) for place, one in enumerate(effects)]

    def _badge(self, instance: EffectInstance, x: float, y: float) -> dict[str, object]:
        flow = self.flows.get(instance.label, np.nan)
        watts = f": {number(flow, 3)} W" if np.isfinite(flow) else ""
        said = f"{title_of(instance.effect.key)} at {instance.place}{watts}"
        parameters = [self.names[index] for index in instance.parameters.values()]
        kind = self.kinds.index(instance.effect.key) + 1
        return {"label": instance.label, "parameters": parameters, "said": said, "at": (x, y), "number": kind}

    def _legend(
        self, entries: Sequence[tuple[str, str]], x: float, y: float, column: float, width: float
    ) -> tuple[list[dict[str, object]], float]:
        """What surroundings and badges mean, from a corner on, in as many columns as there is room for; its height."""
        columns, drawn = max(int((width - 16) // column), 1), list[dict[str, object]]()
        for place, (around, words) in enumerate(entries):
            left, top = x + column * (place % columns), y + _LEGEND * (place // columns) + 10
            beside = left + 28 + _SMALL_LETTER * len(words)
            badges = [
                self._badge(one, beside + 2.3 * _BADGE * k, top) for k, one in enumerate(self.effects.get(around, ()))
            ]
            kind = place - len(self.around) + 1
            drawn.append({"at": (left, top), "around": around, "number": kind, "words": words, "badges": badges})
        rows = -(-len(entries) // columns)
        return drawn, _LEGEND * (rows + bool(self.most)) + 12


def _crossed(start: FloatArray, end: FloatArray, ones: FloatArray, others: FloatArray) -> BoolArray:
    """Which of the lines from `ones` to `others`, shape (n, 2), the line from start to end crosses."""

    def side(a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
        across = (b - a)[..., 0] * (c - a)[..., 1] - (b - a)[..., 1] * (c - a)[..., 0]
        return np.asarray(across)

    between = side(start, end, ones) * side(start, end, others) < 0
    return np.asarray(between & (side(ones, others, start) * side(ones, others, end) < 0))


# --- a network over a run --------------------------------------------------------------------------------------


_MOST_MOMENTS = 400  # of a run; the plot above the drawing is about a thousand pixels wide


@dataclass(frozen=True)
class NetworkCourse:
    """What a model predicts of a run.

    Args:
        network: the model's.
        time: s in the log's clock, shape (k,).
        temperatures: degC by node, prescribed ones too, shape (k,) each.
        flows: W by link and effect as `heat_flows` gives them, shape (k,) each.
    """

    network: Network
    time: FloatArray
    temperatures: Mapping[str, FloatArray]
    flows: Mapping[str, FloatArray]

    @classmethod
    def of(cls, model: Model, prediction: Prediction) -> NetworkCourse:
        """From the prediction of a run."""
        run, count = prediction.segment.run, prediction.bound.inputs.shape[1]
        model = model.with_values(model.in_run(run.name, model.values))
        moments = np.unique(np.linspace(0, count - 1, min(count, _MOST_MOMENTS)).astype(int))
        states, inputs = prediction.states[:, moments], prediction.bound.inputs[:, moments]
        temperatures = dict(zip(model.nodes, states, strict=False))
        for name, source in model.network.prescribed.items():
            column = f"temperature.{name}" if source == "start" else source
            temperature = model.values[column] if isinstance(column, int) else inputs[model.inputs.index(column)]
            temperatures[name] = np.broadcast_to(temperature, moments.shape)
        return cls(model.network, run.time[moments], temperatures, heat_flows(model, states, inputs))

    @property
    def hottest(self) -> tuple[float, str, float]:
        """The highest temperature of a node [degC], the node, and when [s]."""
        nodes = list(self.network.dynamic)
        table = np.array([self.temperatures[name] for name in nodes])
        node, moment = np.unravel_index(int(np.argmax(table)), table.shape)
        return float(table[node, moment]), nodes[node], float(self.time[moment])

    def drawing(self, time: float) -> Drawing:
        """The network as SVG at the moment that is nearest to a time [s]."""
        moment = int(np.argmin(np.abs(self.time - time)))
        temperatures, flows = (
            {name: float(values[moment]) for name, values in table.items()} for table in (self.temperatures, self.flows)
        )
        return draw_network(self.network, temperatures, flows)


def hottest_moment(comparison: Comparison) -> tuple[Drawing, str]:
    """The network when a node of the compared runs is hottest, and that moment in words."""
    predictions = {prediction.segment.run.name: prediction for prediction in comparison.predictions}
    courses = {name: NetworkCourse.of(comparison.model, prediction) for name, prediction in predictions.items()}
    run = max(courses, key=lambda name: courses[name].hottest)
    _, node, time = courses[run].hottest
    elapsed = time - predictions[run].segment.run.origin
    return courses[run].drawing(time), f"at {elapsed:.0f} s of {run}, when {node} is hottest"
