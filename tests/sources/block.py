"""S2: heat sources spread out in a thermal network [BlockLPTN]: 0.1 m of 10 W/(m K) under 1e5 W/m³."""

from __future__ import annotations

import tempfile
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path

import numpy as np

from exact_block import HALVED, NEGATIVE, PLAIN, SHIFTED, HeatedBlock, Method, block_network, order, steady_errors
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.robots.presets import presets
from tests.sources.row import Check, Verdict, above, below, differs, equal, row

EQUAL, UNEQUAL, STEEP = HeatedBlock(left=20.0), HeatedBlock(left=40.0), HeatedBlock(left=80.0)
ODD = (1, 3, 5, 9, 17, 33)  # at equal ends an even number has a node on the maximum by luck
LONG = "tests/examples/test_heated_block.py"


@row("S2-E1", "energy balance of a node", "Σ Q_ij + S_i = ρVc dT/dt (1)", more=LONG)
def energy_balance() -> Iterable[Check]:
    for n in (1, 3, 8):
        network = block_network(UNEQUAL, n, PLAIN)
        heat = float(network.heat_to_ends().sum())
        yield equal(f"heat into both ends, {n} nodes", heat, UNEQUAL.power, "W", 1e-10)
    model = Model(parse_model(presets()["heated-block"], Path("heated-block.toml")).network)
    yield above("nodes of the ready model", len(model.nodes), 0)


@row("S2-E2..E4", "conduction with a source, its ends, its parabola", "T'' + q/k = 0, T(0) = T1, T(L) = T2", more=LONG)
def poisson() -> Iterable[Check]:
    x = np.linspace(0.0, UNEQUAL.length, 9)
    temperatures = UNEQUAL.temperature(x)
    curvature = np.diff(temperatures, 2) / (x[1] - x[0]) ** 2
    yield equal("largest k T'' + q over q", float(np.abs(10.0 * curvature / 1e5 + 1).max()), 0.0, "", 1e-10)
    yield equal("T(0)", float(temperatures[0]), 40.0, "degC")
    yield equal("T(L)", float(temperatures[-1]), 20.0, "degC")


@row(
    "S2-E5",
    "hottest place",
    "x_max = L (T1 - T2)/(q L²/2k + T1 - T2) (5)",
    Verdict.CORRECTED,
    more=LONG,
)
def hottest_place() -> Iterable[Check]:
    yield equal("x_max", UNEQUAL.hottest_place, 0.03, "m")
    yield equal("T_max", UNEQUAL.maximum, 44.5, "degC")
    grid = UNEQUAL.temperature(np.linspace(0.0, 0.1, 100001))
    yield equal("T_max sought on a grid", float(grid.max()), UNEQUAL.maximum, "degC", 1e-8)
    yield equal("as printed, T1 = T2", EQUAL.printed_hottest_place, 0.0, "m", why="the middle is hottest")
    lucky = HeatedBlock(left=20.0 + (2**0.5 - 1.0) * 4.0 * EQUAL.rise)
    yield equal("as printed at the one lucky difference", lucky.printed_hottest_place, lucky.hottest_place, "m")


@row("S2-E6/E7", "the source alone, ends at zero", "T'' = -q/k, T(0) = T(L) = 0 (6, 7)", more=LONG)
def source_alone() -> Iterable[Check]:
    alone = HeatedBlock(left=0.0, right=0.0)
    x = np.linspace(0.0, 0.1, 11)
    linear = HeatedBlock(left=40.0, heat=0.0).temperature(x)
    worst = float(np.abs(UNEQUAL.temperature(x) - linear - alone.temperature(x)).max())
    yield equal("sum of both problems less the whole", worst, 0.0, "K")


@row("S2-E8", "mean rise by the source", "q L²/(12 k) (8)", more=LONG)
def mean_rise() -> Iterable[Check]:
    alone = HeatedBlock(left=0.0, right=0.0)
    simpson = float(alone.temperature(np.array([0.0, 0.05, 0.1])) @ [1.0, 4.0, 1.0]) / 6.0
    yield equal("mean rise", alone.mean, 25.0 / 3.0, "K")
    yield equal("the same by Simpson's rule, exact for a parabola", simpson, alone.mean, "K")
    yield equal("unequal ends: mean less that of the ends", UNEQUAL.mean - 30.0, 25.0 / 3.0, "K")


@row("S2-E9", "correcting resistance", "R_x3 = -L/(6 k A) (9)", more=LONG)
def negative_resistance() -> Iterable[Check]:
    for block, ends in ((EQUAL, "T1 = T2"), (UNEQUAL, "T1 = T2 + 20 K"), (STEEP, "T1 = T2 + 60 K")):
        worst = max(abs(steady_errors(block_network(block, n, NEGATIVE)).mean) for n in (1, 2, 3, 8, 16))
        yield equal(f"largest error of the mean, {ends}", worst, 0.0, "K", 1e-10)


@row("S2-F1..F7", "geometry, networks and curves", "figures, absent; no numbers", Verdict.MISSING, more=LONG)
def figures() -> Iterable[Check]:
    drawn = import_module("figures")
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "steady.png"
        drawn.steady_figure(EQUAL, UNEQUAL, path)
        yield above("profiles and convergence drawn again", path.stat().st_size, 20_000, "bytes")
    # Figure 3: the network's midpoint over the exact one's rise.
    node = float(block_network(EQUAL, 1, PLAIN).steady()[0])
    yield equal("figure 3: midpoint of the network over the exact", (node - 20) / (EQUAL.maximum - 20), 2.0)


@row("S2-M1", "half the source", '"aligns the results with the analytical solution" (sec. 2.1)', more=LONG)
def half_the_source() -> Iterable[Check]:
    for block, ends in ((EQUAL, "T1 = T2"), (UNEQUAL, "T1 = T2 + 20 K")):
        errors = steady_errors(block_network(block, 1, HALVED))
        yield equal(f"error at the node's own place, {ends}", errors.node, 0.0, "K", 1e-10)
        yield equal(f"heat that arrives, {ends}", errors.heat, 0.5, why="the other half is lost")
    four = steady_errors(block_network(EQUAL, 4, HALVED)).maximum
    yield equal("error of the maximum, 4 nodes", four, -6.25, "K", why="only one node aligns")


@row("S2-M1b", "half the source, node shifted", '"iteratively adjusted until convergence" (sec. 2.1)', more=LONG)
def shifted_node() -> Iterable[Check]:
    for block, ends in ((EQUAL, "T1 = T2"), (UNEQUAL, "T1 = T2 + 20 K")):
        errors = steady_errors(block_network(block, 1, SHIFTED))
        yield equal(
            f"error of the maximum, {ends}", errors.maximum, 0.0, "K", 1e-12, "no iteration: the place is known"
        )
        off = _ready(block)[1] - block.maximum
        yield equal(f"ready model's hottest point, {ends}", off, 0.0, "K", 1e-9, "and all heat arrives")


def _ready(block: HeatedBlock) -> tuple[float, float]:
    """Mean and hottest point of the ready model between such ends, when it has settled [degC]."""
    text = presets()["heated-block"].replace("temperature = 40", f"temperature = {block.left}")
    model = Model(parse_model(text, Path("heated-block.toml")).network)
    inputs = np.zeros((len(model.inputs), 1000))
    mean, hottest = model.run(1000)([20.0, 20.0], inputs, model.values, 15.0).full()[:, -1]
    return float(mean), float(hottest)


@row("S2-M2", "negative resistance, the node", '"ensures a more accurate average" (sec. 3)', more=LONG)
def mean_and_maximum() -> Iterable[Check]:
    errors = steady_errors(block_network(EQUAL, 1, NEGATIVE))
    yield equal("error of the mean", errors.mean, 0.0, "K", 1e-10)
    yield equal("error of the maximum, T1 = T2", errors.maximum, -1e5 * 0.1**2 / (24 * 10), "K")
    for block, ends in ((EQUAL, "T1 = T2"), (UNEQUAL, "T1 = T2 + 20 K"), (STEEP, "T1 = T2 + 60 K")):
        mean, hottest = _ready(block)
        yield equal(f"ready model: error of the mean, {ends}", mean - block.mean, 0.0, "K")
        yield equal(f"its hottest point's, {ends}", hottest - block.maximum, 0.0, "K")


@row("S2-M3", "more nodes", '"improves spatial accuracy" (sec. 2.3)', more=LONG)
def more_nodes() -> Iterable[Check]:
    node = np.array([steady_errors(block_network(EQUAL, n, PLAIN)).node for n in ODD])
    times_square = node * np.array(ODD) ** 2
    yield equal("order", order(np.array(ODD), node), 2.0, "", 1e-6)
    yield below("spread of error × n²", float(np.ptp(times_square) / times_square.mean()), 1e-4)
    yield equal("error × n²", float(times_square.mean()), EQUAL.rise, "K")


@row("S2-N1", "the network overestimates", '"tends to overestimate the temperature"', Verdict.CONTRADICTED, more=LONG)
def overestimates() -> Iterable[Check]:
    equal_ends = steady_errors(block_network(EQUAL, 1, PLAIN))
    yield equal("peak over the exact, one node", (equal_ends.maximum + 12.5) / 12.5, 2.0)
    yield equal("mean over the exact, one node", (equal_ends.mean + 25 / 3) / (25 / 3), 3.0)
    steep = steady_errors(block_network(STEEP, 1, PLAIN)).maximum
    yield equal("error of the maximum, T1 = 80, T2 = 20 degC", steep, -5.0, "K", why="not always: here it is too low")


@row("S2-N2", "halving aligns", '"aligns with the analytical solution" (fig. 4)', Verdict.CONTRADICTED, more=LONG)
def aligns_at_the_node() -> Iterable[Check]:
    errors = steady_errors(block_network(EQUAL, 1, HALVED))
    yield equal("error at the node", errors.node, 0.0, "K")
    yield equal("error of the mean", errors.mean, 25.0 / 6.0, "K", why="at the node only")
    unequal = steady_errors(block_network(UNEQUAL, 1, HALVED)).maximum
    yield equal("error of the maximum, T1 = T2 + 20 K", unequal, -2.0, "K")


@row(
    "S2-N3", "the midpoint", '"lowering the predicted midpoint temperature" (sec. 2.2)', Verdict.CONTRADICTED, more=LONG
)
def midpoint() -> Iterable[Check]:
    node = float(block_network(EQUAL, 1, NEGATIVE).steady()[0])
    yield equal("the node", node, EQUAL.mean, "degC", why="the block's mean, not its midpoint")
    yield differs("the midpoint less the node", EQUAL.maximum - node, "0", "K")


@row("S2-N4", "infinitely many nodes", '"can be reproduced exactly" (sec. 2.3)', more=LONG)
def many_nodes() -> Iterable[Check]:
    for method in (PLAIN, NEGATIVE):
        errors = [abs(_worst(method, n)) for n in (65, 257)]
        yield below(f"largest error of 257 nodes, {method.title}", errors[1], 2.5e-4, "K")
        yield equal("that of 65 nodes over it", errors[0] / errors[1], (257 / 65) ** 2, "", 1e-2)


def _worst(method: Method, n: int) -> float:
    return steady_errors(block_network(UNEQUAL, n, method)).node
