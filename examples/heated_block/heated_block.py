"""Heat that is spread out: five networks of a heated block against the exact answer [BlockLPTN].

Run `python examples/heated_block/heated_block.py` for the tables; `--figures FOLDER` draws them, `--fast` takes fewer
times and pieces.
"""

# %% [markdown]
# A block generates heat evenly; its ends are held at T1 and T2. A T-network with all heat at its one node makes the
# node twice as hot above its ends as the block's middle, and three times as hot as the block's mean. What helps?

# %%
from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from exact_block import (
    HALVED,
    NEGATIVE,
    PEAK,
    PLAIN,
    SHIFTED,
    HeatedBlock,
    Method,
    block_network,
    order,
    steady_errors,
)
from figures import steady_figure, transient_figure
from lptn.model.file import parse_model
from lptn.model.model import Model

Row = tuple[str, ...]
EQUAL, UNEQUAL, STEEP = HeatedBlock(left=20.0), HeatedBlock(left=40.0), HeatedBlock(left=80.0)
COUNTS = (1, 2, 4, 8, 16, 64)
CASES = ((PLAIN, COUNTS), (HALVED, (1, 4)), (SHIFTED, (1,)), (NEGATIVE, COUNTS), (PEAK, (1,)))
ODD = np.array([1, 3, 5, 9, 17, 33])  # with an even number and equal ends a node hits the maximum by luck


# %% [markdown]
# ## Steady state
# `node`: the worst node against the block at the node's own place. `max`, `mean`: highest node and mean of the nodes
# against the block's. `heat`: how much of the heat arrives at the ends.


# %%
def steady_rows() -> Iterator[Row]:
    """Errors [K] of every network, for equal and for unequal ends."""
    yield "method", "n", "node", "max, T1=T2", "mean, T1=T2", "max, T1=T2+20", "mean, T1=T2+20", "max, T1=T2+60", "heat"
    for method, counts in CASES:
        for n in counts:
            equal, unequal = (steady_errors(block_network(block, n, method)) for block in (EQUAL, UNEQUAL))
            steep = "-" if method.shifted else _kelvin(steady_errors(block_network(STEEP, n, method)).maximum)
            numbers = (equal.node, equal.maximum, equal.mean, unequal.maximum, unequal.mean)
            yield method.title, str(n), *(_kelvin(value) for value in numbers), steep, f"{equal.heat:.0%}"


def _kelvin(value: float) -> str:
    """A signed number; rounding errors are none."""
    return f"{value:+.4f}" if abs(value) > 1e-9 else "0"


# %% [markdown]
# ## Order of convergence
# Errors of node and mean fall as 1/n², for any ends. The highest node does so only where the hottest place lies
# inside: on the hotter end it is half a cell away from any node, and the order is 1.


# %%
def order_rows() -> Iterator[Row]:
    """Order of convergence over odd n."""
    yield "method", "ends", "node", "mean", "max", "n² × node error"
    for method in (PLAIN, NEGATIVE):
        for name, block in (("T1=T2", EQUAL), ("T1=T2+20", UNEQUAL), ("T1=T2+60", STEEP)):
            errors = [steady_errors(block_network(block, int(n), method)) for n in ODD]
            node, mean, top = (np.array([getattr(one, key) for one in errors]) for key in ("node", "mean", "maximum"))
            mean_order = "exact" if np.abs(mean).max() < 1e-9 else f"{order(ODD, mean):.4f}"
            spread = np.ptp(node * ODD**2) / np.abs(node * ODD**2).max()
            constant = f"{(node * ODD**2).mean():.4f} ± {spread:.0e}"
            yield method.title, name, f"{order(ODD, node):.4f}", mean_order, f"{order(ODD, top):.2f}", constant


# %% [markdown]
# ## Where the block is hottest
# Printed [BlockLPTN, eq. 5], it is zero for equal ends and right for one difference only, (√2 - 1) q L²/(2k).


# %%
def place_rows() -> Iterator[Row]:
    """Hottest place [mm], exact and as printed, and what the printed one costs [K]."""
    yield "T1 - T2 [K]", "hottest place", "as printed", "T_max [degC]", "T at the printed place"
    for difference in (-20.0, 0.0, 5.0, 20.0, (2**0.5 - 1) * 50.0, 40.0, 60.0):
        block = HeatedBlock(left=20.0 + difference)
        place, printed = block.hottest_place, block.printed_hottest_place
        inside = 0.0 <= printed <= block.length
        there = f"{float(block.temperature(printed)):.3f}" if inside else "outside the block"
        yield f"{difference:.4g}", f"{1e3 * place:.4f}", f"{1e3 * printed:.4f}", f"{block.maximum:.3f}", there


# %% [markdown]
# ## In time
# The heat is switched on; the reference is the same block in 200 finite volumes. The network with the negative
# resistance follows the mean; its star point carries no heat capacity and is eliminated.


# %%
def transient_rows(fast: bool) -> Iterator[Row]:
    """One node against the finite volumes, over ten time constants."""
    yield "method", "time constant [s]", "exact", "worst against mean [K]", "worst against middle [K]"
    volumes, times = (50, 101) if fast else (200, 1001)
    t = np.linspace(0.0, 10.0 * EQUAL.time_constant, times)
    exact = EQUAL.slices(volumes, t)
    mean, middle = exact.mean(axis=1), exact[:, volumes // 2 - 1 : volumes // 2 + 1].mean(axis=1)
    for method in (PLAIN, HALVED, NEGATIVE, PEAK):
        network = block_network(EQUAL, 1, method)
        node = network.after(t)[:, 0]
        off = (np.abs(node - other).max() for other in (mean, middle))
        seconds = -1.0 / network.rates()[0]
        yield method.title, f"{seconds:.1f}", f"{EQUAL.time_constant:.1f}", *(f"{value:.2f}" for value in off)


# %% [markdown]
# ## Where the negative resistance is safe
# Eliminated, it leaves a network that takes in no work: every rate is negative, whatever passive stands around it.
# A heat capacity on the star point, however small, makes one rate positive. From three cells on some
# conductances between nodes are negative: a warmer node may cool another for a while. An explicit integrator needs a
# step three times shorter.


# %%
def safety_rows() -> Iterator[Row]:
    """Rates of chains with the negative resistance, and with some of the heat capacity on the star point."""
    yield (
        "network",
        "n",
        "slowest rate [1/s]",
        "fastest rate [1/s]",
        "step limit / plain",
        "least conductance [W/K]",
    )
    for n in (1, 2, 3, 4, 16):
        network, plain = block_network(EQUAL, n, NEGATIVE), block_network(EQUAL, n, PLAIN)
        rates, off = network.rates(), network.matrix - np.diag(np.diag(network.matrix))
        limit = plain.rates()[0] / rates[0]
        least = f"{min(-float(off.max()), 0.0) + 0.0:.3f}"
        yield "star point massless", str(n), f"{rates[-1]:.3g}", f"{rates[0]:.3g}", f"{limit:.3f}", least
    for share in (0.01, 0.1, 0.5, 0.9):
        rates = block_network(EQUAL, 1, Method("", foot=-1 / 6, star=share)).rates()
        yield f"{share:.0%} of C on the star point", "1", f"{rates[-1]:+.3g} grows", f"{rates[0]:.3g}", "-", "-"


# %% [markdown]
# ## Behind a resistance
# With an outer resistance R_e at each end the error of the plain network fades: the correction is worth having where
# L/(2kA) is more than a tenth of R_e.


# %%
def outside_rows() -> Iterator[Row]:
    """The plain network's mean rise, too high by so much, by R_e in units of L/(2kA)."""
    yield "R_e / (L/2kA)", "plain mean rise too high by"
    arm = EQUAL.length / (2.0 * EQUAL.conductivity * EQUAL.area)
    for ratio in (0.0, 0.5, 2.0, 10.0, 20.0):
        outer = ratio * arm
        exact = (outer + arm / 3.0) / 2.0  # mean rise by watt: L/12kA, and two outer resistances side by side
        plain = (outer + arm) / 2.0
        yield f"{ratio:g}", f"{plain / exact - 1.0:.1%}"


# %% [markdown]
# ## The same in a model file
# An `element` makes a node such a body; the links attach to its faces.

# %%
MODEL = """
[model]
name = "heated block"

[nodes.block.element]
kind = "cuboid"
length_x = { value = 10, unit = "cm" }
length_y = { value = 10, unit = "cm" }
length_z = { value = 1, unit = "cm" }
conductivity = 10
density = 7000
specific_heat = 500

[nodes.warm_end]
temperature = 40

[nodes.cold_end]
temperature = 20

[[links]]
between = ["block.x0", "warm_end"]
perfect = true

[[links]]
between = ["block.x1", "cold_end"]
perfect = true

[[effects]]
kind = "constant_heat"
at = "block"
power = 10
"""


def model_rows() -> Iterator[Row]:
    """Steady mean temperature by the model, and exactly."""
    model = Model(parse_model(MODEL, Path("heated_block.toml")).network)
    steady = model.step("zoh")([20.0], [], model.values, 1e5).full().item()
    yield "mean temperature by lptn [degC]", "exact"
    yield f"{steady:.6f}", f"{UNEQUAL.mean:.6f}"


# %%
def show(title: str, rows: Sequence[Row]) -> None:
    """Print a table."""
    widths = [max(len(row[column]) for row in rows) for column in range(len(rows[0]))]
    print(f"\n{title}")
    for row in rows:
        print("  ".join(text.ljust(width) for text, width in zip(row, widths, strict=True)).rstrip())


def main(words: Sequence[str] | None = None) -> None:
    """Print all tables, and draw the figures where a folder is given."""
    parser = argparse.ArgumentParser(description="Five networks of a heated block against the exact answer.")
    parser.add_argument("--fast", action="store_true", help="fewer times and pieces")
    parser.add_argument("--figures", type=Path, help="folder to draw into")
    asked = parser.parse_args(words)
    show("Steady errors [K]; q L²/(8k) = 12.5 K", list(steady_rows()))
    show("Order of convergence, n = 1, 3, 5, 9, 17, 33", list(order_rows()))
    show("Hottest place [mm] of a block 100 mm long", list(place_rows()))
    show("One node after the heat is switched on, against finite volumes", list(transient_rows(asked.fast)))
    show("Stability", list(safety_rows()))
    show("Outer resistance R_e at each end", list(outside_rows()))
    show("In a model file", list(model_rows()))
    if asked.figures is not None:
        asked.figures.mkdir(parents=True, exist_ok=True)
        steady_figure(EQUAL, UNEQUAL, asked.figures / "steady.png")
        transient_figure(EQUAL, 50 if asked.fast else 200, asked.figures / "transient.png")


if __name__ == "__main__":
    main()
