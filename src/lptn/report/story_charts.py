"""All nodes and runs of a story to look through: tiles of errors, lines over time, the network at its hottest."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from markupsafe import Markup

from lptn.basics.arrays import FloatArray
from lptn.basics.lines import thinned, time_unit
from lptn.diagnose.unexplained_heat import UnexplainedHeat
from lptn.identify.comparison import Comparison, Prediction
from lptn.report.charts import POINTS, ChartPanel, Charts, Line, View, sizes_in_words
from lptn.report.comparison_figures import NAMES
from lptn.report.document import Picture
from lptn.report.network_course import hottest_moment
from lptn.report.shown import NOISE_BAND, ONE_SIDED
from lptn.report.text import kelvin, signed_kelvin, significant

_CHARTS = "story"  # name of the charts on the page, which the tiles pick from


@dataclass(frozen=True)
class Shown:
    """One run of the page.

    Args:
        label: what it is called: its name, and what it was used as.
        number: in the comparisons.
        start: where the drawing begins [s, counted from the run's origin].
        stop: where it ends.
        heat: what the model as it is now lacks in it; only fitted runs have it.
    """

    label: str
    number: int
    start: float
    stop: float
    heat: UnexplainedHeat | None = None


def shown_runs(jobs: Sequence[str], comparison: Comparison, heat: Sequence[UnexplainedHeat] = ()) -> list[Shown]:
    """The runs of a comparison as the page calls them.

    Args:
        jobs: what each run was used as; empty for none.
        comparison: of all runs.
        heat: of the first so many runs, the fitted ones.
    """
    runs: list[Shown] = []
    for number, (job, prediction) in enumerate(zip(jobs, comparison.predictions, strict=True)):
        run, window = prediction.segment.run, prediction.segment.evaluation
        label = f"{run.name} ({job})" if job else run.name
        if any(label == earlier.label for earlier in runs):
            label += f" {number + 1}"
        first, last = float(run.elapsed[0]), float(run.elapsed[-1])
        stop = min(window[1] - run.origin, last) if job == "fitted" else last
        runs.append(Shown(label, number, first, stop, heat[number] if number < len(heat) else None))
    return runs


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
    runs = shown_runs(jobs or [""] * len(given.predictions), given, heat)
    charts, thinned = time_charts(runs, given, best, names)
    return {"tiles": tiles(runs, best or given), "charts": charts.html(_CHARTS), "thinned": thinned}


# --- tiles: node by run ---------------------------------------------------------------------------------------


def tiles(runs: Sequence[Shown], comparison: Comparison) -> dict[str, Any]:
    """A table of errors, a tile for each node and run; pale where they are like the noise."""
    errors = {
        (node, run.label): own
        for node in comparison.model.nodes
        for run in runs
        if (own := comparison.node(node, comparison.predictions[run.number])).count
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

    heads = [run.label for run in runs]
    nodes = dict.fromkeys(node for node, _ in errors)
    rows = [{"node": node, "cells": [tile(node, run) for run in heads]} for node in nodes]
    return {"charts": _CHARTS, "heads": heads, "rows": rows}


# --- lines over time ------------------------------------------------------------------------------------------


def time_charts(
    runs: Sequence[Shown], given: Comparison, best: Comparison | None, names: tuple[str, str]
) -> tuple[Charts, str]:
    """Measured and predicted temperatures, errors and unexplained heat of every node measured in every run.

    Args:
        runs: of the comparisons.
        given: the model as given.
        best: the model as it is now, where it is another.
        names: of the two models.

    Returns:
        The charts, and a sentence on how they were thinned.
    """
    unit, label = time_unit(max(run.stop - run.start for run in runs))
    values: dict[str, FloatArray] = {}
    rmse: dict[tuple[str, ...], float] = {}
    views, longest = [], 0.0
    for run in runs:
        prediction = given.predictions[run.number]
        time = prediction.segment.run.elapsed
        inside = (time >= run.start) & (time <= run.stop)
        if inside.sum() > POINTS:
            longest = max(longest, (run.stop - run.start) / (POINTS // 2))
        for row, node in enumerate(given.model.nodes):
            if not np.isfinite(prediction.bound.measured[row, inside]).any():
                continue
            lines = _lines(prediction, row, "given")
            if best is not None and node in best.model.nodes:
                lines |= _lines(best.predictions[run.number], best.model.nodes.index(node), "best")
            at, thin = thinned(time[inside], np.array(list(lines.values()))[:, inside], POINTS)
            drawn = dict(zip(lines, thin, strict=True)) | _heat(run.heat, node, at)
            values[run.label] = at / unit
            shown = best or given
            rmse[node, run.label] = shown.node(node, shown.predictions[run.number]).rmse
            start = prediction.segment.evaluation[0] - prediction.segment.run.origin
            shaded = [(run.start / unit, start / unit)] if start > run.start else []
            floor = NOISE_BAND * given.floor(node)
            title = f"{node}, {run.label}: RMSE {kelvin(rmse[node, run.label])}"
            views.append(View((node, run.label), title, run.label, drawn, shaded, floor, prediction.segment.run.began))
    panels = (
        ChartPanel(
            "temperature [°C]", "°C", (Line("measured", "measured", "measured"), *_of_models("", names, best)), 250
        ),
        ChartPanel("error [K]", "K", _of_models("error ", names, best), 150, zero=True),
        ChartPanel(
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
        ),
    )
    order = {"node": list(dict.fromkeys(view.keys[0] for view in views)), "run": [run.label for run in runs]}
    views.sort(key=lambda view: -rmse[view.keys])
    return Charts(label, panels, views, values, order), sizes_in_words(longest)


def _of_models(what: str, names: tuple[str, str], best: Comparison | None) -> tuple[Line, ...]:
    given = Line(f"{what}given", names[0] if best is not None else "model", "given")
    return (given, Line(f"{what}best", names[1], "best")) if best is not None else (given,)


def _lines(prediction: Prediction, row: int, name: str) -> dict[str, FloatArray]:
    measured, readings = prediction.bound.measured[row], prediction.readings[row]
    return {"measured": measured, name: readings, f"error {name}": readings - measured}


def _heat(heat: UnexplainedHeat | None, node: str, at: FloatArray) -> dict[str, FloatArray]:
    if heat is None or node not in heat.nodes:
        return {}
    row = heat.nodes.index(node)
    lines = {
        "heat": heat.heat[row],
        "from": heat.heat[row] - heat.sure_band[row],
        "to": heat.heat[row] + heat.sure_band[row],
    }
    return {
        name: np.interp(at, heat.time - heat.origin, line, left=np.nan, right=np.nan) for name, line in lines.items()
    }


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
