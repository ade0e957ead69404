"""A figure of a co-simulation: each node, or each output, over each run."""

from __future__ import annotations

from math import ceil

import numpy as np
from matplotlib.artist import Artist
from matplotlib.figure import Figure

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.style import BEST, GIVEN, MEASURED, SMALL, TEXT, draw_over_time, new_figure, plain

from .cosim import CosimulatedRun, Cosimulation

_Line = tuple[str, FloatArray, dict[str, object]]


def cosimulation_figure(done: Cosimulation) -> Figure:
    """Temperatures [°C] of each node: measured, by the FMU, by its model; all outputs where it has no temperatures.

    Raises:
        InputError: nothing to draw, or more than 60 panels.
    """
    panels = [panel for run in done.runs for panel in _panels(run)]
    most = 60  # panels; more are no picture that anybody reads
    if not 0 < len(panels) <= most:
        raise InputError(done.fmu, "--plot", f"{len(panels)} nodes and outputs", f"1 to {most}, by fewer logs at once")
    columns, height = 2, 1.7  # of panels; inch
    rows = ceil(len(panels) / columns)
    figure = new_figure(height * rows + 0.4)
    grid = figure.subplots(rows, columns, squeeze=False)
    for ax in grid.flat[len(panels) :]:
        ax.remove()
    for ax, (title, unit, time, lines) in zip(grid.flat, panels, strict=False):
        draw_over_time(ax, time - time[0], [(values, look | {"label": name}) for name, values, look in lines])
        ax.set_title(plain(title), size=TEXT, loc="left", pad=3)
        ax.set_ylabel(unit, size=SMALL)
    handles: dict[str, Artist] = {}
    for ax in figure.axes:
        for handle, name in zip(*ax.get_legend_handles_labels(), strict=True):
            handles.setdefault(str(name), handle)
    if len(handles) > 1:
        figure.legend(
            handles.values(), handles.keys(), loc="outside upper right", ncols=3, frameon=False, fontsize=SMALL
        )
    return figure


def _panels(run: CosimulatedRun) -> list[tuple[str, str, FloatArray, list[_Line]]]:
    """Title, label of the ordinate, times and lines of each panel of a run."""
    time, panels = run.run.time, []
    for row, node in enumerate(run.nodes):
        lines: list[_Line] = []
        if np.isfinite(run.measured[row]).any():
            lines.append(("measured", run.measured[row], MEASURED))
        if run.predicted is not None:
            lines.append(("model", run.predicted[row], BEST))
        lines.append(("FMU", run.readings[row], GIVEN))
        panels.append((f"{node}, run {run.run.name}", "temperature [°C]", time, lines))
    if panels:
        return panels
    outputs = [name for name in run.table if name != "time"]
    ends = run.table["time"]
    return [(f"{name}, run {run.run.name}", "", ends, [("FMU", run.table[name], GIVEN)]) for name in outputs]
