"""All nodes and runs of a story to look through: tiles of errors, lines over time, the network at its hottest."""

from __future__ import annotations

import json
from collections.abc import Sequence
from itertools import zip_longest
from typing import Any

import numpy as np
from markupsafe import Markup

from lptn.basics.arrays import FloatArray
from lptn.basics.lines import thinned, time_unit
from lptn.diagnose.unexplained_heat import UnexplainedHeat
from lptn.identify.comparison import Comparison, Prediction
from lptn.report.charts import POINTS, ChartPanel, Charts, Line, View
from lptn.report.comparison_figures import NAMES
from lptn.report.document import Picture
from lptn.report.network_drawing import hottest_moment
from lptn.report.shown import NOISE_BAND, ONE_SIDED
from lptn.report.text import kelvin, signed_kelvin, significant

_CHARTS = "story"  # name of the charts on the page, which the tiles pick from


def looked_through(
    given: Comparison,
    best: Comparison | None = None,
    names: tuple[str, str] = NAMES,
    jobs: Sequence[str] | None = None,
    heat: Sequence[UnexplainedHeat] = (),
) -> dict[str, object]:
    """Every node and run as a reader looks through them: `tiles`, `charts`, and `thinned`, a sentence on their lines.

    Args:
        given: the model as given.
        best: the model as it is now, where it is another; its errors are then the tiles'.
        names: of the two models.
        jobs: what each run was used as, where that is shown.
        heat: of the first so many runs, the fitted ones.
    """
    labels: list[str] = []
    for number, (job, prediction) in enumerate(zip_longest(jobs or (), given.predictions)):
        label = f"{prediction.segment.run.name} ({job})" if job else prediction.segment.run.name
        labels.append(f"{label} {number + 1}" if label in labels else label)
    fitted = [job == "fitted" for job in jobs or [""] * len(labels)]
    charts, thinned = _time_charts(labels, fitted, given, best, names, heat)
    return {"tiles": _tiles(labels, best or given), "charts": charts.html(_CHARTS), "thinned": thinned}


# --- tiles: node by run ---------------------------------------------------------------------------------------


def _tiles(labels: Sequence[str], comparison: Comparison) -> dict[str, Any]:
    """A table of errors, a tile for each node and run; pale where they are like the noise."""
    errors = {
        (node, label): own
        for node in comparison.model.nodes
        for label, prediction in zip(labels, comparison.predictions, strict=True)
        if (own := comparison.node(node, prediction)).count
    }
    beyond = {key: own.rmse for key, own in errors.items() if own.rmse > NOISE_BAND * comparison.floor(key[0])}
    most = max(beyond.values(), default=1.0)

    def tile(node: str, run: str) -> dict[str, str] | None:
        own = errors.get((node, run))
        if own is None:
            return None
        sizes = f"RMSE {kelvin(own.rmse)}, mean {signed_kelvin(own.mean)}, largest {kelvin(own.max)}"
        return {
            "look": "even" if abs(own.mean) < ONE_SIDED * own.rmse else "hot" if own.mean > 0 else "cold",
            "share": f"{beyond.get((node, run), 0.0) / most:.2f}",
            "pick": json.dumps([node, run], ensure_ascii=False),
            "title": f"{node}, {run}: {sizes}",
            "text": significant(own.rmse, 2),
        }

    nodes = dict.fromkeys(node for node, _ in errors)
    rows = [{"node": node, "cells": [tile(node, run) for run in labels]} for node in nodes]
    return {"charts": _CHARTS, "heads": labels, "rows": rows}


# --- lines over time ------------------------------------------------------------------------------------------


_HEAT = ChartPanel(
    "heat [W]",
    "W",
    (
        Line("from", "95 % band from", "soft"),
        Line("to", "to", "soft"),
        Line("heat", "heat that the model lacks", "heat"),
    ),
    130,
    zero=True,
    band=("from", "to"),
)


def _time_charts(
    labels: Sequence[str],
    fitted: Sequence[bool],
    given: Comparison,
    best: Comparison | None,
    names: tuple[str, str],
    heat: Sequence[UnexplainedHeat],
) -> tuple[Charts, str]:
    """Measured and predicted temperatures, errors and unexplained heat of every node measured in every run.

    With a sentence on how the lines were thinned.
    """
    runs = [prediction.segment.run for prediction in given.predictions]
    starts = [float(run.elapsed[0]) for run in runs]
    stops = [
        min(prediction.segment.evaluation[1] - run.origin, run.elapsed[-1]) if own else float(run.elapsed[-1])
        for prediction, run, own in zip(given.predictions, runs, fitted, strict=True)
    ]
    unit, label = time_unit(max(np.subtract(stops, starts)))
    values: dict[str, FloatArray] = {}
    rmse: dict[tuple[str, ...], float] = {}
    views, longest = [], 0.0
    for number, (called, prediction, start, stop) in enumerate(
        zip(labels, given.predictions, starts, stops, strict=True)
    ):
        run = prediction.segment.run
        inside = (run.elapsed >= start) & (run.elapsed <= stop)
        if inside.sum() > POINTS:
            longest = max(longest, (stop - start) / (POINTS // 2))
        counted = prediction.segment.evaluation[0] - run.origin
        shaded = [(start / unit, counted / unit)] if counted > start else []
        for row, node in enumerate(given.model.nodes):
            if not np.isfinite(prediction.bound.measured[row, inside]).any():
                continue
            lines = _lines(prediction, row, "given")
            if best is not None and node in best.model.nodes:
                lines |= _lines(best.predictions[number], best.model.nodes.index(node), "best")
            at, thin = thinned(run.elapsed[inside], np.array(list(lines.values()))[:, inside], POINTS)
            drawn = dict(zip(lines, thin, strict=True)) | _heat_lines(heat[number : number + 1], node, at)
            values[called], shown = at / unit, best or given
            rmse[node, called] = shown.node(node, shown.predictions[number]).rmse
            title = f"{node}, {called}: RMSE {kelvin(rmse[node, called])}"
            floor = NOISE_BAND * given.floor(node)
            views.append(View((node, called), title, called, drawn, shaded, floor, run.began))
    temperatures = Line("measured", "measured", "measured"), *_of_models("", names, best)
    panels = (
        ChartPanel("temperature [°C]", "°C", temperatures, 250),
        ChartPanel("error [K]", "K", _of_models("error ", names, best), 150, zero=True),
        _HEAT,
    )
    order = {"node": list(dict.fromkeys(view.keys[0] for view in views)), "run": list(labels)}
    views.sort(key=lambda view: -rmse[view.keys])
    said = f"Of every {float(f'{longest:.3g}'):g} s at most, each line keeps its smallest and its largest reading."
    return Charts(label, panels, views, values, order), said if longest else ""


def _of_models(what: str, names: tuple[str, str], best: Comparison | None) -> tuple[Line, ...]:
    given = Line(f"{what}given", names[0] if best is not None else "model", "given")
    return (given, Line(f"{what}best", names[1], "best")) if best is not None else (given,)


def _lines(prediction: Prediction, row: int, name: str) -> dict[str, FloatArray]:
    measured, readings = prediction.bound.measured[row], prediction.readings[row]
    return {"measured": measured, name: readings, f"error {name}": readings - measured}


def _heat_lines(heat: Sequence[UnexplainedHeat], node: str, at: FloatArray) -> dict[str, FloatArray]:
    """Of a fitted run, at these times [s]."""
    found = {}
    for own in heat:
        if node in own.nodes:
            line, band = own.heat[own.nodes.index(node)], own.sure_band[own.nodes.index(node)]
            for name, edge in (("heat", line), ("from", line - band), ("to", line + band)):
                found[name] = np.interp(at, own.time - own.origin, edge, left=np.nan, right=np.nan)
    return found


# --- the network at its hottest -----------------------------------------------------------------------------


def network_picture(comparison: Comparison) -> Picture:
    """The network, coloured and drawn as heat flows when a node of the shown runs is hottest."""
    drawing, when = hottest_moment(comparison)
    caption = (
        f"The network {when}: boxes are coloured by the temperature "
        "that the model predicts, lines are as wide as the heat that flows through them. A short line with a bar leads "
        "to the surroundings; numbers name what acts there."
    )
    return Picture(caption, Markup(drawing))
