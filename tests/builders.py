"""Small runs, networks and random points that the tests build on."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.parameters import Parameter, ParameterInstance
from lptn.effects import Effect, catalogue
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, LinkDeclaration, Network, NodeDeclaration
from lptn.simulate.bound_run import BoundRun, bind

LEG = ("FR_hip", "FR_thigh", "FR_calf")
AMBIENT = NodeDeclaration("ambient", temperature="temperature.ambient")


def capacity(value: float = 300.0, **more: object) -> Parameter:
    """A heat capacity [J/K]."""
    bounds = (1e-3, max(1e6, 10 * value))
    return replace(Parameter("capacity", value, "J/K", bounds, typical=300.0), **more)  # type: ignore[arg-type]


def resistance(value: float = 5.0, **more: object) -> Parameter:
    """A thermal resistance [K/W]."""
    return replace(Parameter("resistance", value, "K/W", (1e-4, 1e4), typical=5.0), **more)  # type: ignore[arg-type]


def node(name: str, value: float = 300.0) -> NodeDeclaration:
    """A dynamic node."""
    return NodeDeclaration(name, capacity(value))


def link(one: str, other: str, value: float = 5.0) -> LinkDeclaration:
    """A link."""
    return LinkDeclaration((one, other), resistance(value))


def effect(key: str, at: str = "*", **values: float) -> EffectDeclaration:
    """An effect of the catalogue with some of its parameters set."""
    kind = catalogue()[key]
    chosen = tuple(replace(p, value=values.get(p.name, p.value)) for p in kind.parameters)
    return EffectDeclaration(kind(), at, chosen)


def leg(effects: Sequence[EffectDeclaration] = (), ambient: float | None = 10.0) -> Network:
    """Three joints of 300 J/K in a row, each with 10 K/W to the ambient, or without any ambient."""
    links = [link("FR_hip", "FR_thigh", 3.0), link("FR_thigh", "FR_calf", 2.0)]
    nodes = [node(name) for name in LEG]
    if ambient is not None:
        nodes.append(AMBIENT)
        links += [link(name, "ambient", ambient) for name in LEG]
    return Network("leg", tuple(nodes), tuple(links), tuple(effects))


def two_nodes(effects: Sequence[EffectDeclaration] = (), *, linked: bool = False) -> Network:
    """Two nodes that touch the ambient, and each other if they are linked."""
    links = (link("a", "ambient", 4.0), link("b", "ambient", 7.0), *((link("a", "b", 3.0),) if linked else ()))
    return Network("two", (node("a", 120.0), node("b", 250.0), AMBIENT), links, tuple(effects))


def with_every_effect() -> Network:
    """Two nodes with everything that the catalogue holds, copper loss first since others act on it."""
    keys = sorted(catalogue(), key=lambda key: catalogue()[key].scales_heat)
    return two_nodes([effect(key) for key in keys], linked=True)


def base_network(kind: type[Effect]) -> Network:
    """Two nodes to which an effect of this kind can be added."""
    return two_nodes(base_for(kind), linked=kind.site == "contact")


def base_for(kind: type[Effect]) -> list[EffectDeclaration]:
    """What must be there already for the effect to act."""
    rest = [effect("constant_heat")] if kind.key != "constant_heat" else [effect("heat_input")]
    if kind.site == "pair":
        rest.append(effect("conduction"))
    if kind.heat_of:
        rest.append(effect(kind.heat_of))
    return rest


def off(kind: type[Effect]) -> EffectDeclaration:
    """An effect at its off-value, everywhere."""
    return EffectDeclaration(kind(), "*", tuple(parameter.switched_off for parameter in kind.parameters))


def make_run(columns: Mapping[str, FloatArray], *, step: float = 1.0, averaged: bool = False, name: str = "run") -> Run:
    """A run of the given columns, from time 0 on."""
    n = len(next(iter(columns.values())))
    return Run(name, step, step * np.arange(float(n)), dict(columns), averaged, f"{name}.csv", "00")


def bound_runs(model: Model, runs: Sequence[Run]) -> list[BoundRun]:
    """Each of several runs bound to a model."""
    return [bind(model, run) for run in runs]


def random_run(
    model: Model, n: int, seed: int = 0, *, step: float = 1.0, averaged: bool = False, hold: int = 20, rise: float = 0.0
) -> Run:
    """A run with every input of the model changing every `hold` steps; its temperatures are only a start.

    The ambient rises by `rise` [K] over the run.
    """
    rng = np.random.default_rng(seed)
    columns = {f"temperature.{name}": np.full(n, 25.0 + 3.0 * row) for row, name in enumerate(model.nodes)}
    for column in model.inputs:
        air = 22.0 + rise * np.arange(float(n)) / n
        size = air if column.startswith("temperature.") else rng.uniform(0.0, 6.0, n // hold + 1).repeat(hold)[:n]
        columns[column] = np.broadcast_to(np.asarray(size, dtype=float), n).copy()
    return make_run(columns, step=step, averaged=averaged)


def random_inputs(model: Model, rng: np.random.Generator) -> dict[str, float]:
    """One value for each input, torques and speeds of both signs."""
    return {
        column: rng.uniform(0.0, 35.0) if column.startswith("temperature.") else rng.uniform(-6.0, 6.0)
        for column in model.inputs
    }


def random_value(parameter: ParameterInstance, rng: np.random.Generator) -> float:
    """An admissible value of the usual size."""
    declared = parameter.declared
    lower, upper = declared.bounds
    size = abs(declared.typical)
    if lower > 0:
        low, high = np.log(max(lower, size / 4)), np.log(min(upper, size * 4))
        return float(np.exp(rng.uniform(low, high)))
    return float(rng.uniform(max(lower, -3 * size), min(upper, 3 * size)))
