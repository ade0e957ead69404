"""The thesis's curves again: its formula as printed beside consistent networks: `python …/figure_curves.py curves.png`.

Its figures 3-5, 3-6, 4-4, 4-5 and 4-7 to 4-10 are not available; only numbers from its text are marked.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import as_printed as printed
import numpy as np
from as_printed import AMBIENT, FAN, PASSIVE, UNALTERED
from circuits import Circuit
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from table import networks

from lptn.basics.files import write_whole
from lptn.basics.style import BEST, GIVEN, INK, SMALL, dress, new_figure

STATED: dict[str, Any] = {"color": INK, "marker": "o", "markersize": 4, "linestyle": "none"}
WIDTHS = (2.2, 1.4, 0.8)


def pulse(circuit: Circuit, current: float, heated: float, times: np.ndarray) -> np.ndarray:
    """Winding temperature [degC] of a consistent network under a current for a while, then without."""
    before, after = times[times <= heated], times[times > heated] - heated
    hot = circuit.rise(current, np.array([heated]))[:, 0]
    return AMBIENT + np.concatenate([circuit.rise(current, before)[0], circuit.rise(0.0, after, hot)[0]])


def printed_pulse(
    circuit: printed.Circuit, current: float, heated: float, times: np.ndarray, r_h: float | None = None
) -> np.ndarray:
    """The same by equation 3.3 as printed and equation 3.4 mended."""
    top = printed.heating(circuit, current, heated, r_h)
    tau = circuit.r_w * circuit.c
    return np.array(
        [
            printed.heating(circuit, current, t, r_h) if t <= heated else printed.cooling(top, t, heated, tau)
            for t in times
        ]
    )


def _unaltered(ax: Axes) -> None:
    times = np.linspace(0.0, 800.0, 401)
    two = networks()[0]
    ax.plot(times, printed_pulse(UNALTERED, 11.0, 120.0, times), **GIVEN, label="as printed")
    ax.plot(times, pulse(two, 11.0, 120.0, times), **BEST, label="two nodes, winding")
    hot = two.rise(11.0, np.array([120.0]))[:, 0]
    late = times[times > 120.0]
    ax.plot(late, AMBIENT + two.rise(0.0, late - 120.0, hot)[1], color=BEST["color"], lw=1.2, ls=":", label="housing")
    ax.plot([120.0, 220.0], [55.0, 26.5], **STATED, label="stated")
    ax.set(xlabel="time [s]", ylabel="temperature [degC]", title="Unaltered, 11 A to 55 degC, then off (3-5)")


def _swept(ax: Axes) -> None:
    times = np.linspace(0.0, 300.0, 151)
    for capacity, width in zip((100.0, 133.3, 200.0), WIDTHS, strict=True):
        swept = printed.Circuit("", UNALTERED.r_w, capacity, UNALTERED.r_h)
        curve = [printed.heating(swept, 11.0, t) for t in times]
        ax.plot(times, curve, **(GIVEN | {"linewidth": width}), label=f"as printed, C = {capacity:g} J/K")
    for r_h, width in zip((12.0, 12.1, 12.2), WIDTHS, strict=True):
        curve = [printed.heating(UNALTERED, 11.0, t, r_h) for t in times]
        ax.plot(times, curve, **(BEST | {"linewidth": width}), label=f"as printed, R_h = {r_h:g} K/W")
    ax.set(xlabel="time at 11 A [s]", ylabel="winding [degC]", title="C and R_h swept: higher R_h, colder (3-6)")


def _passive(ax: Axes) -> None:
    times = np.linspace(0.0, 900.0, 301)
    level, heated = 55.0, networks()[2].time_to(55.0, 11.0)
    by_formula = printed.heating_time(PASSIVE, 11.0, level)
    ax.plot(times, printed_pulse(PASSIVE, 11.0, by_formula, times), **GIVEN, label="as printed")
    ax.plot(times, pulse(networks()[2], 11.0, heated, times), **BEST, label="network")
    ax.axhline(level, color=INK, lw=0.6, ls=":")
    ax.set(xlabel="time [s]", ylabel="winding [degC]", title="Passive exchanger, 11 A to 55 degC, then off (4-4)")


def _currents(circuit: printed.Circuit, number: int, reached: float, title: str) -> Callable[[Axes], None]:
    """A panel of three currents: one circuit, its consistent network, the stated time to 55 degC at 15 A [s]."""

    def draw(ax: Axes) -> None:
        times = np.linspace(0.0, 300.0, 301)
        for current, width in zip((15.0, 11.0, 5.0), WIDTHS, strict=True):
            r_h = printed.housing_resistance(current)
            words = f", {current:.0f} A"
            curve = [printed.heating(circuit, current, t, r_h) for t in times]
            ax.plot(times, curve, **(GIVEN | {"linewidth": width}), label="as printed" + words)
            real = AMBIENT + networks()[number].rise(current, times)[0]
            ax.plot(times, real, **(BEST | {"linewidth": width}), label="network" + words)
        ax.plot([reached], [55.0], **STATED)
        ax.set(xlabel="time [s]", ylabel="winding [degC]", ylim=(20, 110), title=title)

    return draw


def _three(ax: Axes) -> None:
    times = np.linspace(0.0, 900.0, 301)
    circuits, consistent = (UNALTERED, PASSIVE, FAN), networks()[1:]
    for circuit, network, width in zip(circuits, consistent, WIDTHS, strict=True):
        curve = [printed.heating(circuit, 11.0, t) for t in times]
        ax.plot(times, curve, **(GIVEN | {"linewidth": width}), label=f"as printed, {circuit.name}")
        curve = AMBIENT + network.rise(11.0, times)[0]
        ax.plot(times, curve, **(BEST | {"linewidth": width}), label=f"network, {circuit.name}")
    ax.set(xlabel="time at 11 A [s]", ylabel="winding [degC]", title="With and without exchanger, 11 A (4-8)")


def _stalled(ax: Axes) -> None:
    times = np.linspace(0.0, 20.0, 201)
    r_h = printed.housing_resistance(35.0)
    for circuit, number, width in zip((PASSIVE, FAN), (2, 3), WIDTHS[:2], strict=True):
        curve = [printed.heating(circuit, 35.0, t, r_h) for t in times]
        ax.plot(times, curve, **(GIVEN | {"linewidth": width}), label=f"as printed, {circuit.name}")
        real = AMBIENT + networks()[number].rise(35.0, times)[0]
        ax.plot(times, real, **(BEST | {"linewidth": width}), label=f"network, {circuit.name}")
    ax.axhline(105.0, color=INK, lw=0.6, ls=":")
    ax.plot([4.0], [105.0], **STATED)
    ax.set(xlabel="time at 35 A [s]", ylabel="winding [degC]", ylim=(20, 160), title="Stalled, 35 A (4-9)")


def _capacities(ax: Axes) -> None:
    times = np.concatenate([np.linspace(0.0, 1.0, 40), np.linspace(1.01, 120.0, 200)])
    r_h = printed.housing_resistance(35.0)
    for circuit, width in zip((PASSIVE, FAN, printed.Circuit("C = 400 J/K", 1.2, 400.0, r_h)), WIDTHS, strict=True):
        curve = printed_pulse(circuit, 35.0, 1.0, times, r_h)
        ax.plot(times, curve, **(GIVEN | {"linewidth": width}), label=f"as printed, {circuit.name}")
    ax.plot(times, pulse(networks()[2], 35.0, 1.0, times), **BEST, label="network, passive")
    ax.plot([1.0, 1.0], [47.0, 45.5], **STATED)
    ax.set(xlabel="time [s]", ylabel="winding [degC]", title="35 A for 1 s, then off (4-10)")


PANELS = (
    _unaltered,
    _swept,
    _passive,
    _currents(PASSIVE, 2, 50.0, "Passive exchanger (4-5)"),
    _currents(FAN, 3, 56.0, "With fan (4-7)"),
    _three,
    _stalled,
    _capacities,
)


def figure() -> Figure:
    """Every panel."""
    drawn = new_figure(14.0)
    for ax, draw in zip(drawn.subplots(4, 2).ravel(), PANELS, strict=True):
        draw(ax)
        ax.title.set_fontsize(9)
        ax.legend(frameon=False, fontsize=SMALL - 1)
        dress(ax)
    return drawn


def main(output: Path) -> None:
    """Write the figure."""
    picture = io.BytesIO()
    figure().savefig(picture, format=output.suffix.removeprefix("."))
    write_whole(output, picture.getvalue())


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "curves.png"))
