"""Two joints with awkward names, driven for ten minutes."""

from __future__ import annotations

import numpy as np

from lptn.basics.parameters import Parameter
from lptn.diagnose.improvement import History
from lptn.effects.copper_loss import CopperLoss
from lptn.identify.data import DataSplit
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, LinkDeclaration, Network, NodeDeclaration
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import simulate

NODES = ("thigh<b>&", "calf$a$髋")
AMBIENT = 20.0  # degC
NOISE = 0.05  # K
STEP = 2.0  # s

Told = tuple[History, DataSplit]


def robot(*extra: EffectDeclaration) -> Model:
    """Two warm joints in air."""
    capacity = Parameter("capacity", 60.0, "J/K", (5.0, 1000.0), title="heat capacity")
    resistance = Parameter("resistance", 4.0, "K/W", (0.1, 100.0), title="thermal resistance")
    joints = [NodeDeclaration(name, capacity) for name in NODES]
    air = NodeDeclaration("ambient", temperature="temperature.ambient")
    links = tuple(LinkDeclaration((name, "ambient"), resistance) for name in NODES)
    return Model(Network("two <joints>", (*joints, air), links, (EffectDeclaration(CopperLoss(), "*"), *extra)))


def make_run(truth: Model, seed: int, name: str, count: int = 300) -> Run:
    """A run of the true robot under random steps of torque, with noise on the readings."""
    rng = np.random.default_rng(seed)
    columns = {"temperature.ambient": np.full(count, AMBIENT)}
    for node in NODES:
        columns[f"torque.{node}"] = np.repeat(rng.uniform(0.0, 4.0, 10), count // 10)
        columns[f"temperature.{node}"] = np.full(count, AMBIENT)
    time = np.arange(count, dtype=float) * STEP
    blank = Run(name, STEP, time, columns, True, f"folder/{name}.csv", f"{seed:064x}", ("One <gap> was filled.",))
    readings = simulate(truth, bind(truth, blank), truth.values, np.full(len(truth.states), AMBIENT)).readings
    for node, row in zip(NODES, readings, strict=True):
        columns[f"temperature.{node}"] = row + rng.normal(0.0, NOISE, count)
    return blank
