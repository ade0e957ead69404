"""The U8 in torque and speed, after the thesis's figure 2-3: `python …/figure_torque_speed.py map.png`.

The voltage bounds the speed, the data sheet's current the torque; between its continuous rating and that lies what the
winding bears for a while. How long is told by the network of the stalled motor: losses in the iron and the air that the
rotor stirs are left out, so it holds near standstill. Source: [Chen2017, chapter 2]; the figure itself is absent.
"""

from __future__ import annotations

import io
import math
import sys
from pathlib import Path

import numpy as np
from circuits import Circuit
from matplotlib.figure import Figure
from scipy.optimize import brentq
from table import networks
from textbook import U8_RATED_TORQUE, U8_RESISTANCE

from lptn.basics.files import write_whole
from lptn.basics.style import BEST, GIVEN, INK, SMALL, dress, new_figure
from lptn.planners.trade.motors import ENAMEL_LIMIT, U8

K_T, R, MOST = U8.torque_constant, U8_RESISTANCE, U8.limits.given["current"]
VOLTAGES = (22.2, 44.4)  # V: 6S and 12S, the two of the data sheet's table
TIMES = (20.0, 60.0, 180.0)  # s


def no_load_speed(voltage: float) -> float:
    """Speed [rpm] at which the induced voltage is the supply's [V]."""
    return voltage / K_T * 60 / (2 * math.pi)


def most_torque(speed: float, voltage: float) -> float:
    """Torque [N·m] that a voltage [V] drives at a speed [rpm], whatever the current."""
    return K_T * (voltage - K_T * speed * 2 * math.pi / 60) / R


def bearable(circuit: Circuit, seconds: float) -> float:
    """Torque [N·m] after which the winding is at its limit, held from rest for so long [s]."""

    def over(current: float) -> float:
        return circuit.time_to(ENAMEL_LIMIT, current) - seconds

    return K_T * float(brentq(over, 1.01 * MOST / 3, 3 * MOST))


def figure() -> Figure:
    """The diagram."""
    drawn = new_figure(3.8)
    ax = drawn.subplots()
    for voltage, style in zip(VOLTAGES, (BEST, GIVEN), strict=True):
        speeds = np.linspace(0.0, no_load_speed(voltage), 200)
        torque = np.minimum([most_torque(speed, voltage) for speed in speeds], K_T * MOST)
        ax.plot(speeds, torque, **style, label=f"{voltage:g} V, at most {MOST:.0f} A")
    ax.axhspan(0.0, U8_RATED_TORQUE, color=BEST["color"], alpha=0.15, lw=0, label="continuous, data sheet")
    for seconds in TIMES:
        held = bearable(networks()[1], seconds)
        ax.axhline(held, color=INK, lw=0.7, ls=":")
        ax.annotate(f"{seconds:.0f} s to {ENAMEL_LIMIT:.0f} degC", (60, held), fontsize=SMALL, va="bottom")
    ax.set(xlabel="speed [rpm]", ylabel="torque [N·m]", xlim=(0, 4500), ylim=(0, 4.4))
    ax.set_title("U8: what voltage, current and winding allow", fontsize=9)
    ax.legend(frameon=False, fontsize=SMALL, loc="upper left", ncols=3)
    dress(ax)
    return drawn


def main(output: Path) -> None:
    """Write the figure."""
    picture = io.BytesIO()
    figure().savefig(picture, format=output.suffix.removeprefix("."))
    write_whole(output, picture.getvalue())


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "torque_speed.png"))
