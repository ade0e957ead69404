"""The heated block's figures: profiles and convergence; the transient and what a mass on the star point does."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from exact_block import HALVED, NEGATIVE, PLAIN, SHIFTED, HeatedBlock, Method, block_network, steady_errors
from lptn.basics.files import write_whole
from lptn.basics.style import INK, SMALL, TEXT, dress, new_figure

_RED = "#D55E00"
_LINES: dict[str, dict[str, Any]] = {
    PLAIN.title: {"color": "#0072B2", "linestyle": (0, (5, 1.5)), "marker": "o"},
    HALVED.title: {"color": "#E69F00", "linestyle": ":", "marker": "s"},
    SHIFTED.title: {"color": "#E69F00", "linestyle": ":", "marker": "D", "markerfacecolor": "white"},
    NEGATIVE.title: {"color": "#009E73", "linestyle": "-", "marker": "^"},
}


def steady_figure(equal: HeatedBlock, unequal: HeatedBlock, path: Path) -> None:
    """Temperatures along the block for two pairs of ends, and errors over the number of nodes."""
    figure = new_figure(3.4)
    left, middle, right = figure.subplots(1, 3)
    _profile(left, equal, "T1 = T2")
    _profile(middle, unequal, "T1 = T2 + 20 K")
    middle.sharey(left)
    left.set_ylabel("temperature [degC]", fontsize=TEXT)
    _convergence(right, unequal)
    _save(figure, path)


def _profile(ax: Axes, block: HeatedBlock, title: str) -> None:
    x = np.linspace(0.0, block.length, 201)
    ax.plot(1e3 * x, block.temperature(x), color=INK, linewidth=1.2, label="exact")
    ax.axhline(block.mean, color=INK, linewidth=0.7, linestyle=(0, (1, 2)), label="exact mean")
    for method in (PLAIN, HALVED, SHIFTED, NEGATIVE):
        network = block_network(block, 1, method)
        places = np.concatenate([[0.0], network.places, [block.length]])
        heights = np.concatenate([[block.left], network.steady(), [block.right]])
        style = _LINES[method.title]
        if method in (PLAIN, HALVED):
            ax.plot(1e3 * places, heights, linewidth=0.8, **style | {"marker": ""})
        ax.plot(1e3 * network.places, network.steady(), label=method.title, **style | {"linestyle": "none"})
    ax.set_title(title, fontsize=TEXT)
    ax.set_xlabel("place [mm]", fontsize=TEXT)
    if block.left == block.right:
        ax.set_ylim(18.0, 66.0)  # room for the legend
        ax.legend(fontsize=SMALL - 1.5, frameon=False, loc="upper left")
    dress(ax)


def _convergence(ax: Axes, block: HeatedBlock) -> None:
    n = np.array([1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64])
    for method, key, label in (
        (PLAIN, "mean", "plain: mean"),
        (PLAIN, "node", "plain: node"),
        (NEGATIVE, "node", "-L/(6kA): node"),
    ):
        errors = [abs(getattr(steady_errors(block_network(block, int(m), method)), key)) for m in n]
        style = _LINES[method.title] | ({"marker": "x"} if key == "mean" else {})
        ax.loglog(n, errors, label=label, linewidth=1.0, markersize=4, **style)
    ax.loglog(n, 30.0 / n**2.0, color="0.55", linewidth=0.8, label="slope -2")
    ax.set_title("-L/(6kA): mean exact for every n", fontsize=TEXT)
    ax.set_xlabel("number of nodes n", fontsize=TEXT)
    ax.set_ylabel("error [K]", fontsize=TEXT)
    ax.legend(fontsize=SMALL - 1.5, frameon=False)
    dress(ax)


def transient_figure(block: HeatedBlock, volumes: int, path: Path) -> None:
    """One node after the heat is switched on, and with a tenth of the heat capacity on the star point."""
    figure = new_figure(3.4)
    left, right = figure.subplots(1, 2)
    t = np.linspace(0.0, 5.0 * block.time_constant, 201)
    exact = block.slices(volumes, t)
    left.plot(t / 60.0, exact.mean(axis=1), color=INK, linewidth=1.4, label=f"{volumes} finite volumes: mean")
    left.plot(t / 60.0, exact[:, volumes // 2], color=INK, linewidth=0.8, linestyle=(0, (1, 2)), label="their middle")
    for method in (PLAIN, HALVED, NEGATIVE):
        style = _LINES[method.title] | {"marker": ""}
        left.plot(t / 60.0, block_network(block, 1, method).after(t)[:, 0], label=method.title, linewidth=1.3, **style)
    left.set_title("one node, heat switched on", fontsize=TEXT)
    left.legend(fontsize=SMALL - 1.0, frameon=False)
    _star_point(right, block, exact.mean(axis=1), t)
    for ax in (left, right):
        ax.set_xlabel("time [min]", fontsize=TEXT)
        ax.set_ylabel("temperature [degC]", fontsize=TEXT)
        dress(ax)
    _save(figure, path)


def _star_point(ax: Axes, block: HeatedBlock, mean: Any, t: Any) -> None:
    style = _LINES[NEGATIVE.title] | {"marker": ""}
    ax.plot(t / 60.0, mean, color=INK, linewidth=1.4, label="finite volumes: mean")
    ax.plot(t / 60.0, block_network(block, 1, NEGATIVE).after(t)[:, 0], label="star point massless", **style)
    for share, dash in ((0.9, "-"), (0.5, "--"), (0.1, "-.")):
        network = block_network(block, 1, Method("", foot=-1 / 6, star=share))
        path = network.after(t)[:, 0]
        ax.plot(t / 60.0, path, color=_RED, linewidth=1.1, linestyle=dash, label=f"{share:.0%} of C on the star point")
    ax.set_ylim(block.left - 5.0, block.left + 60.0)
    ax.set_title("the negative resistance bears no mass on its star point", fontsize=TEXT)
    ax.legend(fontsize=SMALL - 1.0, frameon=False)


def _save(figure: Figure, path: Path) -> None:
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    write_whole(path, picture.getvalue())
