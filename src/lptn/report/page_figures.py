"""The figures of the pages as SVG: a model against measurements, where and when it fails, two models' errors."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from math import ceil

import numpy as np
from markupsafe import Markup

from lptn.basics.arrays import FloatArray
from lptn.basics.lines import decimated, time_axis
from lptn.diagnose.learned_heat import LearnedCurve
from lptn.diagnose.unexplained_heat import HeatPeak, UnexplainedHeat
from lptn.identify.comparison import Comparison, Condition, Pair, Prediction, Versus
from lptn.logs.run import Run
from lptn.report.shown import MOST, NOISE_BAND, Field, InputLink, View, initialisation_end, worst_runs, worst_views
from lptn.report.svg import LETTER, WIDE, Drawing, Panel, margin, strength
from lptn.report.tables import conditions_of
from lptn.report.text import for_people, kelvin, short, significant, unit_of

NAMES = ("model as given", "best model")
"""What two models are called in a figure unless they have names."""
ERROR = "error [K]"
"""The label of every axis of errors; error = predicted − measured."""

_ON_DARK = 0.55  # strength of a colour from which writing on it takes the paper's colour
_LEFT = 56.0  # px left of a panel, for its numbers and label
_POINTS = 500  # a line in a panel of some 250 px


# --- measured and predicted in time, the error below ---------------------------------------------------------


def predictions(
    given: Comparison, best: Comparison | None = None, most: int = MOST, names: tuple[str, str] = NAMES
) -> Markup:
    """Measured and predicted temperature [°C] with the error [K] below, for each node and run.

    Args:
        given: the given model's comparison.
        best: the best model's on the same runs.
        most: how many at most; the given model's worst are chosen.
        names: of the two models.
    """
    chosen = worst_views(given, most)
    columns = 2 if len(chosen) in (2, 4) else min(len(chosen), 3)
    rows = ceil(len(chosen) / columns)
    high, width = 250.0, WIDE / columns
    draw = Drawing(26 + rows * high)
    entries = [("line-measured", "measured"), ("line-given", names[0] if best else "model")]
    entries += [("line-best", names[1])] if best else []
    if any(initialisation_end(prediction) is not None for prediction in given.predictions):
        entries.append(("shade", "finds the start"))
    draw.legend(_LEFT, 14, [*entries, ("noise", "sensor noise")])
    for place, view in enumerate(chosen):
        corner = (place % columns) * width, 26 + (place // columns) * high
        _prediction(draw, corner, width, view, given, best)
    return draw.svg(f"measured and predicted temperatures and errors of {len(chosen)} nodes and runs")


def _prediction(
    draw: Drawing, corner: tuple[float, float], width: float, view: View, given: Comparison, best: Comparison | None
) -> None:
    (left, top), (run, node) = corner, view
    prediction = given.predictions[run]
    row = given.model.nodes.index(node)
    time, label = time_axis(prediction.segment.run.elapsed)
    both = [
        (comparison, look)
        for comparison, look in ((given, "line-given"), (best, "line-best"))
        if comparison is not None
    ]
    measured = prediction.bound.measured[row]
    lines = [
        (comparison.predictions[run].readings[comparison.model.nodes.index(node)], look) for comparison, look in both
    ]
    errors = [
        (comparison.predictions[run].error[comparison.model.nodes.index(node)], look) for comparison, look in both
    ]
    band = NOISE_BAND * given.floor(node)
    ends = float(time[0]), float(time[-1])
    boxes = [
        (left + _LEFT, top + 22, left + width - 10, top + 132),
        (left + _LEFT, top + 142, left + width - 10, top + 208),
    ]
    upper = Panel(draw, boxes[0], ends, margin(*_extent([measured, *(line for line, _ in lines)])))
    lower = Panel(draw, boxes[1], ends, margin(*_extent([*(error for error, _ in errors), np.array([-band, band])])))
    shown = f"{node}, run {prediction.segment.run.name}"
    draw.text(left + _LEFT - 4, top + 13, _fitting(shown, width - _LEFT - 10), look="title")
    for panel in (upper, lower):
        _shade(panel, prediction)
    lower.level(-band, band, "noise")
    upper.line(*decimated(time, measured, _POINTS), "line-measured")
    for panel, series in ((upper, lines), (lower, errors)):
        for values, look in series:
            panel.line(*decimated(time, values, _POINTS), look)
    upper.frame(label, "temperature [°C]" if corner[0] == 0 else "", numbers=False)
    lower.frame(label, ERROR if corner[0] == 0 else "")
    rmse = ", ".join(kelvin(comparison.node(node, comparison.predictions[run]).rmse) for comparison, _ in both)
    draw.text(left + width - 10, top + 30, f"RMSE {rmse}".replace(",", " →"), "end", "halo")


def _shade(panel: Panel, prediction: Prediction) -> None:
    end = initialisation_end(prediction)
    if end is not None:
        unit = 60.0 if time_axis(prediction.segment.run.time)[1].endswith("[min]") else 1.0
        panel.span(panel.across[0], end / unit, "shade")


def _extent(series: Sequence[FloatArray]) -> tuple[float, float]:
    """The smallest and the largest value of all."""
    finite = [values[np.isfinite(values)] for values in series]
    pooled = np.concatenate(finite)
    return (float(pooled.min()), float(pooled.max())) if pooled.size else (0.0, 1.0)


def _fitting(words: str, width: float) -> str:
    """Words cut to a width [px]."""
    most = int(width / LETTER)
    return words if len(words) <= most else f"{words[: most - 1]}…"


# --- maps of nodes by time: where and when a model fails, and where and when it lacks heat ------------------


_ROW = 20.0  # px, a node's row
_HATCHED = 0.2  # share of the colour scale from which blue is hatched, so that it can be told from red in grey


def fields(given: Sequence[Field], best: Sequence[Field], unit: str, least: float) -> list[Markup]:
    """The worst runs of the given model, one drawing each, the best model's beside them on one colour scale.

    Args:
        given: of the given model.
        best: of the best model on the same runs; empty where there is none.
        unit: of the values.
        least: what the colour scale reaches at least, so that noise stays pale.
    """
    most = max(least, *(float(np.nanmax(np.abs(field.values), initial=0.0)) for field in [*given, *best]))
    names = [node for field in given for node in field.nodes]
    left = min(LETTER * max(map(len, names)) + 14, 190.0)
    drawn = []
    chosen = worst_runs(given)
    for place in chosen:
        high = _ROW * len(given[place].nodes)
        last = place == chosen[-1]
        draw = Drawing(high + 56 + 24 * last)
        width = (WIDE - left - 12) / (2 if best else 1)
        for column, field in enumerate([given[place], *best[place : place + 1]]):
            begin = left + column * (width + 6)
            _field(draw, field, (begin, 20.0, begin + width - 6, 20.0 + high), most)
            if best:
                draw.text(begin + width - 6, 14, NAMES[column], "end", "of-best" if column else "of-given")
        for row, node in enumerate(given[place].nodes):
            draw.text(left - 6, 20 + _ROW * (row + 0.7), _fitting(node, left - 8), "end")
        if last:
            _scale(draw, left, high + 60, most, unit)
        drawn.append(draw.svg(f"map of nodes by time, run {given[place].run}"))
    return drawn


def _field(draw: Drawing, field: Field, box: tuple[float, float, float, float], most: float) -> None:
    stop = field.start + field.seconds * field.values.shape[1]
    ends, label = time_axis(np.array([field.start, stop]))
    draw.text(box[0], 14, f"run {field.run}")
    width = (box[2] - box[0]) / field.values.shape[1]
    cells: dict[tuple[str, float], list[tuple[float, float, float, float]]] = {}
    for row, values in enumerate(field.values):
        top = box[1] + _ROW * row
        shares = np.array(
            [np.nan if np.isnan(value) else np.sign(value) * strength(abs(value) / most) for value in values]
        )
        edges = np.flatnonzero(np.append(True, ~((shares[1:] == shares[:-1]) | np.isnan(shares[1:] + shares[:-1]))))
        edges = np.unique(np.append(edges, np.flatnonzero(np.diff(np.isnan(shares))) + 1))
        for start, end in zip(edges, [*edges[1:], values.size], strict=True):
            share = float(shares[start])
            look = "unknown" if np.isnan(share) else "hot" if share > 0 else "cold"
            place = (box[0] + start * width, top, (end - start) * width, _ROW - 1)
            if share != 0:
                cells.setdefault((look, abs(share) if share == share else 1.0), []).append(place)
            if share < -_HATCHED:
                cells.setdefault(("hatch", 1.0), []).append(place)
    for (look, share), places in sorted(cells.items(), key=lambda item: item[0][0] == "hatch"):
        draw.boxes(places, look, share)
    bottom = box[3]
    for x, anchor, value in ((box[0], "start", ends[0]), (box[2], "end", ends[1])):
        draw.text(x, bottom + 14, short(float(value)), anchor)
    draw.text((box[0] + box[2]) / 2, bottom + 14, label, "middle")
    draw.line(box[0], bottom, box[2], bottom, "axis")


def _scale(draw: Drawing, left: float, top: float, most: float, unit: str) -> None:
    """The colours and what they stand for."""
    steps = [-1.0, -0.5, -0.25, 0.25, 0.5, 1.0]
    for place, share in enumerate(steps):
        x = left + 62 * place
        look = "hot" if share > 0 else "cold"
        draw.rect(x, top, 16, 12, look, share=abs(share))
        if share < -_HATCHED:
            draw.rect(x, top, 16, 12, "hatch")
        draw.text(x + 20, top + 10, f"{share * most:+.2g}".replace("-", "−"))
    draw.text(left + 62 * len(steps) + 6, top + 10, unit)


# --- one node's unexplained heat over time, above the inputs that it goes with ------------------------------


def heat_line(
    run: Run,
    given: UnexplainedHeat,
    node: str,
    best: UnexplainedHeat | None = None,
    peak: HeatPeak | None = None,
    links: Sequence[InputLink] = (),
) -> Markup:
    """Heat [W] with its 95 % band at one node, and below it the inputs, in one run.

    Args:
        run: the run.
        given: the heat that the model as given lacks in it.
        node: the node.
        best: the heat that the best model lacks.
        peak: the interval to shade.
        links: the inputs to draw, closest first.
    """
    draw = Drawing(236 + 92 * len(links))
    time, label = time_axis(given.time - given.origin)
    unit = 60.0 if label.endswith("[min]") else 1.0
    ends = float(time[0]), float(time[-1])
    shown = [
        (estimate, look)
        for estimate, look in ((given, "given"), (best, "best"))
        if estimate is not None and node in estimate.nodes
    ]
    rows = [
        (
            (estimate.time - estimate.origin) / unit,
            estimate.heat[estimate.nodes.index(node)],
            estimate.sure_band[estimate.nodes.index(node)],
            look,
        )
        for estimate, look in shown
    ]
    right = WIDE - 10
    panel = Panel(
        draw,
        (_LEFT, 24, right, 198),
        ends,
        margin(*_extent([heat + side * band for _, heat, band, _ in rows for side in (-1, 1)])),
    )
    names = {"given": f"{NAMES[0] if best else 'model'} with its 95 % band", "best": f"{NAMES[1]} with its 95 % band"}
    draw.text(_LEFT - 4, 14, f"{node}, run {given.run}", look="title")
    draw.legend(None, 14, [(f"line-{look}", names[look]) for *_, look in rows])
    if peak is not None:
        panel.span(peak.elapsed[0] / unit, peak.elapsed[1] / unit, "shade")
    for at, heat, band, look in rows:
        draw.area(panel.x(at), panel.y(heat - band), panel.y(heat + band), f"band-{look}")
    panel.level(0.0, 0.0, "zero")
    for at, heat, _, look in rows:
        panel.line(at, heat, f"line-{look}")
    panel.frame(label, "unexplained heat [W]", numbers=not links)
    for number, link in enumerate(links):
        top = 222 + 92 * number
        values = run.columns[link.column]
        below = Panel(draw, (_LEFT, top + 6, right, top + 74), ends, margin(*_extent([values])))
        if peak is not None:
            below.span(peak.elapsed[0] / unit, peak.elapsed[1] / unit, "shade")
        inside = (run.time >= given.time[0]) & (run.time <= given.time[-1])
        below.line(*decimated(run.elapsed[inside] / unit, values[inside]), "line-input")
        what = f"{link.column}, whose square" if link.squared else f"{link.column}, which"
        draw.text(_LEFT, top, for_people(f"{what} correlates with the heat by {link.correlation:+.2f}"))
        below.frame(label, f"[{unit_of(link.column)}]", numbers=number == len(links) - 1)
    return draw.svg(f"unexplained heat of {node} over time, and inputs")


def heat_curve(curve: LearnedCurve) -> Markup:
    """Unexplained heat [W] as a curve over the input that it goes with, with its 95 % band."""
    draw = Drawing(236)
    low, high = curve.heat - curve.band, curve.heat + curve.band
    ends = float(curve.values[0]), float(curve.values[-1])
    panel = Panel(draw, (_LEFT, 24, WIDE - 10, 198), ends, margin(*_extent([low, high])))
    draw.text(_LEFT - 4, 14, curve.inputs[0].node, look="title")
    draw.legend(None, 14, [("line-best", "learned, with its 95 % band")])
    draw.area(panel.x(curve.values), panel.y(low), panel.y(high), "band-best")
    panel.level(0.0, 0.0, "zero")
    panel.line(curve.values, curve.heat, "line-best")
    column = curve.inputs[0].column
    panel.frame(f"{column} [{unit_of(column)}]", "unexplained heat [W]")
    return draw.svg(f"unexplained heat over {column}")


# --- where a model fails: RMSE by node and operating condition ----------------------------------------------


_CELL = 30.0  # px, a node's row
_NOISE_IS_LIGHT = 2.0  # multiples of the noise up to which the colour scale reaches at least; it begins at the noise


def conditions(given: Comparison, best: Comparison | None = None) -> list[Markup]:
    """Maps of RMSE [K], one drawing for each quantity: the given model left, the best right, on one colour scale.

    Args:
        given: the given model's comparison.
        best: the best model's on the same runs; without it two quantities stand side by side.

    Returns:
        None where nothing can be binned.
    """
    left = _panels(given)
    if not left:
        return []
    nodes = list(dict.fromkeys(cell.node for cells in left.values() for cell in cells))
    right = _panels(best) if best else {}
    every = [cell for cells in [*left.values(), *right.values()] for cell in cells]
    noise = {cell.node: given.floor(cell.node) for cell in every}
    shares = {id(cell): math.sqrt(max(cell.errors.rmse**2 - noise[cell.node] ** 2, 0.0)) for cell in every}
    most = max(*shares.values(), _NOISE_IS_LIGHT * max(noise.values()))
    shares = {number: strength(share / most) for number, share in shares.items()}
    quantities = list(left)
    rows = (
        [[(q, left[q]), (q, right[q])] for q in quantities]
        if best
        else [[(q, left[q]) for q in quantities[place : place + 2]] for place in range(0, len(quantities), 2)]
    )
    names = min(LETTER * max(map(len, nodes)) + 14, 190.0)
    width = (WIDE - names - 24) / 2
    drawn = []
    for row in rows:
        draw = Drawing(24 + _CELL * len(nodes))
        for number, node in enumerate(nodes):
            draw.text(names - 6, 20 + _CELL * (number + 0.6), _fitting(node, names - 8), "end")
        for column, (quantity, cells) in enumerate(row):
            begin = names + column * (width + 24)
            unit = "" if "[" in quantity else " [as logged]"
            draw.text(begin, 14, f"{quantity}{unit}, low to high")
            if best:
                draw.text(begin + width, 14, NAMES[column], "end", "of-best" if column else "of-given")
            _cells(draw, begin, width, cells, nodes, shares)
        drawn.append(draw.svg(f"RMSE by node and {row[0][0]}"))
    return drawn


def _panels(comparison: Comparison) -> dict[str, list[Condition]]:
    """The conditions by quantity."""
    cells = conditions_of(comparison)
    # A quantity that no node splits into bins (a load that is on or off) only repeats the node's own error.
    count = Counter((cell.quantity, cell.node) for cell in cells)
    quantities = dict.fromkeys(cell.quantity for cell in cells if count[cell.quantity, cell.node] > 1)
    return {quantity: [cell for cell in cells if cell.quantity == quantity] for quantity in quantities}


def _cells(
    draw: Drawing, left: float, width: float, cells: Sequence[Condition], nodes: Sequence[str], shares: dict[int, float]
) -> None:
    for row, node in enumerate(nodes):
        of_node = [cell for cell in cells if cell.node == node]
        for place, cell in enumerate(of_node):
            wide = width / len(of_node)
            x, y = left + place * wide, 20 + _CELL * row
            share = shares[id(cell)]
            draw.rect(x, y, wide - 1, _CELL - 1, "bad", share=share)
            look = "on" if share > _ON_DARK else ""
            draw.text(x + wide / 2, y + 13, significant(cell.errors.rmse, 2), "middle", look)
            ends = f"{short(cell.lower)} to {short(cell.upper)}"
            draw.text(x + wide / 2, y + 25, ends, "middle", f"tiny {look}".strip())


# --- two models: who is better, by class of joints and by run -----------------------------------------------


def versus_bars(result: Versus) -> Markup:
    """Mean absolute error by class and largest error by run, both models side by side."""
    rows = max(len(result.classes), len(result.runs))
    draw = Drawing(80 + 34 * rows)
    draw.legend(_LEFT, 14, [("bar-best", result.names[0]), ("bar-given", result.names[1])])
    half = WIDE / 2
    _bars(
        draw,
        (0.0, half - 20),
        result.classes,
        [pair.mean for pair in result.classes],
        "mean |predicted − measured| [K]",
    )
    _bars(draw, (half, WIDE - 10), result.runs, [pair.max for pair in result.runs], "max |predicted − measured| [K]")
    return draw.svg(f"errors of {result.names[0]} and {result.names[1]} by class of joints and by run")


def _bars(
    draw: Drawing, ends: tuple[float, float], pairs: Sequence[Pair], sizes: Sequence[tuple[float, float]], label: str
) -> None:
    left = ends[0] + min(LETTER * max(len(pair.what) for pair in pairs) + 14, 170.0)
    most = max(max(size) for size in sizes) * 1.15 or 1.0
    bottom = 28 + 34.0 * len(pairs)
    panel = Panel(draw, (left, 24, ends[1], bottom), (0.0, most), (0.0, 1.0))
    for row, (pair, size) in enumerate(zip(pairs, sizes, strict=True)):
        top = 28 + 34 * row
        draw.text(left - 6, top + 18, _fitting(pair.what, left - ends[0] - 8), "end")
        for which, (value, look) in enumerate(zip(size, ("bar-best", "bar-given"), strict=True)):
            width = float(panel.x(value)) - left
            draw.rect(left, top + 14 * which, width, 13, look)
            if which:
                draw.rect(left, top + 14 * which, width, 13, "hatch")
            draw.text(left + width + 4, top + 14 * which + 10, f"{value:.2f}")
    panel.frame(label, rows=True)
