"""The thesis's last chapter in numbers: heat exchanger, bigger motor, or the prosthesis's own structure as the sink.

`python examples/u8_trade/compare_designs.py compare.png` prints the table and draws the figure.
Source: [Chen2017, chapter 5]. The U10's network is the U8's scaled, not measured.
"""

from __future__ import annotations

import io
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from lptn.basics.files import write_whole
from lptn.basics.style import INK, SMALL, dress, new_figure
from lptn.planners.trade import DesignProblem, Option, parse_study
from lptn.planners.trade.motors import U8, U10

DURATIONS = (1.0, 3.0, 10.0, 20.0, 30.0, 60.0, 120.0, 180.0, 300.0, 600.0, 1800.0, 3600.0)  # s
SHOWN = (10.0, 60.0, 180.0, 3600.0)  # s
STUDY = """
[study]
goal = "held_torque"
cooling = ["{cooling}"]
[task]
duration = 60
ambient = 21.5
[[motors]]
name = "{motor}"
"""


@dataclass(frozen=True)
class Candidate:
    """A design of the thesis's comparison: motor, sink [J/K, K/W] or none, mass in all [kg]."""

    name: str
    motor: str
    sink: tuple[float, float] | None
    mass: float
    colour: str
    dashes: str | tuple[int, tuple[float, ...]] = "-"


THESIS = 0.867  # kg, motor and exchanger
PIPES = 0.18  # kg, four heat pipes and their mount; assumed
SINK, FAN = (
    (353.0, 3.3),
    (353.0, 0.225),
)  # J/K, K/W: fitted to what is said of the exchanger, examples/u8_thesis/facts.py
CANDIDATES = (
    Candidate("U8 alone", "U8", None, U8.mass, "#0072B2"),
    Candidate("U8, thesis's exchanger, still air", "U8", SINK, THESIS, "#56B4E9", (0, (5, 1.5))),
    Candidate("U8, thesis's exchanger, fan", "U8", FAN, THESIS, "#56B4E9", (0, (1, 1))),
    # [Chen2017, chapter 5]: "similar thermal capacitance and resistance" as the sink: only pipes are added.
    Candidate("U8, prosthesis's structure as the sink", "U8", SINK, U8.mass + PIPES, "#CC79A7", (0, (4, 1, 1, 1))),
    Candidate("U8, a sink without any resistance", "U8", (1500.0, 0.01), float("nan"), INK, (0, (1, 2))),
    Candidate("U10 alone", "U10", None, U10.mass, "#009E73"),
)


def option_of(candidate: Candidate) -> Option:
    """The candidate as a trade study's discrete choice."""
    cooling = "none" if candidate.sink is None else "passive"
    return parse_study(STUDY.format(cooling=cooling, motor=candidate.motor), Path("comparison")).options()[0]


def held(candidate: Candidate, durations: tuple[float, ...] = DURATIONS) -> list[float]:
    """Torque [N·m] that a candidate holds for each duration [s]: 105 degC at the winding, 35 A, 260 W in the pipes."""
    problem = DesignProblem(option_of(candidate), candidate.sink)
    solutions = [problem.solve({"duration": duration}) for duration in durations]
    return [solution.value if solution.success else float("nan") for solution in solutions]


def time_held(candidate: Candidate, torque: float) -> float:
    """How long [s] a candidate holds a torque [N·m]; at most 3600 s."""
    cooling = "none" if candidate.sink is None else "passive"
    text = STUDY.format(cooling=cooling, motor=candidate.motor).replace("held_torque", "time_to_limit")
    text = text.replace("duration = 60", f"torque = {torque}") + "[limits]\ncurrent = 60\n"
    (option,) = parse_study(text, Path("comparison")).options()
    solution = DesignProblem(option, candidate.sink).solve()
    return solution.value if solution.success else float("nan")


def figure(curves: dict[str, list[float]]) -> Figure:
    """Held torque over time, and held torque over mass."""
    drawn = new_figure(4.4)
    left, right = drawn.subplots(1, 2, width_ratios=[1.25, 1.0])
    for candidate in CANDIDATES:
        look = {"color": candidate.colour, "linestyle": candidate.dashes}
        left.plot(DURATIONS, curves[candidate.name], lw=1.8, label=candidate.name, **look)
        for duration, marker in ((10.0, "^"), (60.0, "o"), (3600.0, "s")):
            torque = curves[candidate.name][DURATIONS.index(duration)]
            right.plot(1e3 * candidate.mass, torque, marker, color=candidate.colour, ms=6)
    left.set(xscale="log", xlabel="time held [s]", ylabel="torque [N·m]", ylim=(0, 4.2))
    left.set_title("Torque until 105 degC, at most 35 A", fontsize=9)
    left.legend(frameon=False, fontsize=SMALL - 1, loc="lower left")
    for marker, words in (("^", "10 s"), ("o", "60 s"), ("s", "1 h")):
        right.plot([], [], marker, color="0.4", ms=6, label=f"held for {words}")
    right.set(xlabel="mass of motor and cooling [g]", ylabel="torque [N·m]", ylim=(0, 4.2), xlim=(200, 920))
    right.set_title("The same over mass", fontsize=9)
    right.legend(frameon=False, fontsize=SMALL, loc="upper right")
    for ax in (left, right):
        dress(ax)
    return drawn


def table(curves: dict[str, list[float]]) -> list[str]:
    """The comparison as lines."""
    words = [f"{time:.0f} s" for time in SHOWN]
    lines = [
        f"{'torque held for':40s}{'mass':>8s}" + "".join(f"{word:>9s}" for word in words) + f"{'3.2 N·m for':>13s}"
    ]
    for candidate in CANDIDATES:
        numbers = [curves[candidate.name][DURATIONS.index(time)] for time in SHOWN]
        mass = "–" if np.isnan(candidate.mass) else f"{1e3 * candidate.mass:.0f} g"
        line = f"{candidate.name:40s}{mass:>8s}" + "".join(f"{number:9.2f}" for number in numbers)
        lines.append(line + f"{time_held(candidate, 3.2):11.1f} s")
    return lines


def main(output: Path) -> dict[str, list[float]]:
    """Print the table, write the figure, return the torques for `DURATIONS`."""
    curves = {candidate.name: held(candidate) for candidate in CANDIDATES}
    print("\n".join(table(curves)))
    picture = io.BytesIO()
    figure(curves).savefig(picture, format=output.suffix.removeprefix("."))
    write_whole(output, picture.getvalue())
    return curves


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "compare.png"))
