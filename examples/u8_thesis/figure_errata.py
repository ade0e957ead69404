"""Why R_h = R_0/I² was needed, and what it does at 35 A: `python examples/u8_thesis/figure_errata.py errata.png`."""

from __future__ import annotations

import io
import sys
from pathlib import Path
from typing import Any

import as_printed as printed
import numpy as np
from as_printed import AMBIENT, PASSIVE, R_0
from circuits import RESISTANCE
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from table import networks
from textbook import wire_capacity, wire_length

from lptn.basics.files import write_whole
from lptn.basics.style import BEST, GIVEN, INK, SMALL, dress, new_figure

LIMIT: dict[str, Any] = {"color": "#D55E00", "linewidth": 1.2}
CURRENTS = np.linspace(4.0, 36.0, 641)


def pole_current(r_h: float = PASSIVE.r_h) -> float:
    """The current [A] at which a R_h = 1, where equation 3.3 has its pole."""
    return float(1 / np.sqrt(printed.ALPHA * RESISTANCE * r_h))


def _loop_gain(ax: Axes) -> None:
    held = [printed.loop_gain(i, PASSIVE.r_h) for i in CURRENTS]
    fitted = [printed.loop_gain(i, printed.housing_resistance(i)) for i in CURRENTS]
    ax.plot(CURRENTS, held, **GIVEN, label="R_h = 11.96 K/W held")
    ax.plot(CURRENTS, fitted, **BEST, label="R_h = 1447/I²")
    ax.axhline(1.0, **LIMIT)
    ax.annotate("negative resistance above", (36.0, 0.93), fontsize=SMALL, color=LIMIT["color"], va="top", ha="right")
    ax.set(xlabel="current [A]", ylabel="loop gain a R_h [1]", yscale="log", title="R_0/I² holds a R_h at 1.050")
    ax.legend(frameon=False, fontsize=SMALL, loc="lower right")


def _amplitude(ax: Axes) -> None:
    # The pole itself is left out of the line.
    held = np.array([printed.printed_amplitude(PASSIVE, i) for i in CURRENTS])
    fitted = [printed.printed_amplitude(PASSIVE, i, printed.housing_resistance(i)) for i in CURRENTS]
    ax.plot(CURRENTS, held, **GIVEN, label="R_h = 11.96 K/W held")
    ax.plot(CURRENTS, fitted, **BEST, label="R_h = 1447/I²")
    ax.axvline(pole_current(), **LIMIT)
    ax.annotate(f"pole at {pole_current():.2f} A", (pole_current() + 0.4, 3e3), fontsize=SMALL, color=LIMIT["color"])
    ax.set(xlabel="current [A]", ylabel="b/(C (1 - a R_h)²), read as K", yscale="log", ylim=(1e-3, 1e4))
    ax.set_title("With R_h held only currents near the pole heat")
    ax.legend(frameon=False, fontsize=SMALL, loc="center right", bbox_to_anchor=(1.0, 0.42))


def _at_35_a(ax: Axes) -> None:
    times = np.linspace(0.0, 20.0, 401)
    for r_0, shade in ((R_0, 1.0), (1450.0, 0.65), (1452.0, 0.4)):
        curve = [printed.heating(PASSIVE, 35.0, t, printed.housing_resistance(35.0, r_0)) for t in times]
        ax.plot(times, curve, **(GIVEN | {"alpha": shade}), label=f"equation 3.3 as printed, R_0 = {r_0:.0f}")
    two, *three = networks()
    ax.plot(times, AMBIENT + three[1].rise(35.0, times)[0], **BEST, label="consistent, three nodes and passive sink")
    ax.plot(
        times,
        AMBIENT + two.rise(35.0, times)[0],
        color=BEST["color"],
        lw=1.2,
        ls=":",
        label="consistent, two nodes, no sink",
    )
    capacity = wire_capacity(wire_length(RESISTANCE, 1e-3), 1e-3)
    _, loss = printed.slope_and_offset(35.0)
    gain = printed.slope_and_offset(35.0)[0]
    ax.plot(
        times,
        AMBIENT + loss / gain * np.expm1(gain * times / capacity),
        color=INK,
        lw=1.0,
        label="most that energy allows (61 g of wire, no cooling)",
    )
    ax.axhline(105.0, **LIMIT)
    ax.annotate("enamel, 105 degC", (11.5, 106.0), ha="center", fontsize=SMALL, color=LIMIT["color"])
    ax.plot([1.0], [47.0], "ko", ms=4)
    ax.annotate(
        "thesis: 47 degC after 1 s", (1.0, 47.0), (7.2, 30.0), fontsize=SMALL, arrowprops={"arrowstyle": "-", "lw": 0.6}
    )
    ax.set(xlabel="time at 35 A [s]", ylabel="winding [degC]", ylim=(20, 130), xlim=(0, 20))
    ax.set_title("35 A: 105 degC after 3 to 4 s as printed, after 17 to 19 s with energy conserved")
    ax.legend(frameon=False, fontsize=SMALL, loc="upper center", bbox_to_anchor=(0.5, -0.17), ncols=2)


def figure() -> Figure:
    """The three panels."""
    drawn = new_figure(6.4)
    axes = drawn.subplot_mosaic([["gain", "amplitude"], ["pulse", "pulse"]])
    for ax, draw in ((axes["gain"], _loop_gain), (axes["amplitude"], _amplitude), (axes["pulse"], _at_35_a)):
        draw(ax)
        ax.title.set_fontsize(9)
        dress(ax)
    return drawn


def predictions() -> dict[str, tuple[float, float]]:
    """At 35 A: rise after 1 s [K] and time to 105 degC [s], for each network."""
    names = ("two nodes", "three nodes", "three nodes, passive", "three nodes, fan")
    pulse = np.array([1.0])
    return {
        name: (float(network.rise(35.0, pulse)[0, 0]), network.time_to(105.0, 35.0))
        for name, network in zip(names, networks(), strict=True)
    }


def main(output: Path) -> None:
    """Write the figure and print the predictions."""
    picture = io.BytesIO()
    figure().savefig(picture, format=output.suffix.removeprefix("."))
    write_whole(output, picture.getvalue())
    print("35 A                   rise after 1 s  105 degC after")
    for name, (rise, time) in predictions().items():
        print(f"{name:22s} {rise:8.1f} K {time:12.1f} s")


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "errata.png"))
