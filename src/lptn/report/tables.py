"""The tables of reports and of the terminal, as rows of text."""

from __future__ import annotations

import math
import sys
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from lptn.basics.lines import time_unit
from lptn.basics.parameters import ParameterInstance
from lptn.basics.words import short_size
from lptn.diagnose.unexplained_heat import HeatPeak
from lptn.effects import Effect, catalogue
from lptn.identify.comparison import Comparison, Condition, Errors, Pair
from lptn.identify.data import Segment
from lptn.identify.fitting import Fit
from lptn.references import cite, works_cited
from lptn.report.shown import effects_shown
from lptn.report.text import (
    NOTHING,
    bin_text,
    experiment_for,
    kelvin,
    named,
    number,
    percent,
    place_of,
    signed_kelvin,
    size_text,
    time_span,
    title_of,
    unit_text,
    window_text,
)

if TYPE_CHECKING:
    from lptn.diagnose.improvement import History
    from lptn.online.forecasting import Forecast, NodeForecast


class ReportTable(NamedTuple):
    """A table of text.

    Args:
        columns: heads; those of columns of numbers begin with ">".
        rows: the cells.
    """

    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]

    @property
    def heads(self) -> tuple[str, ...]:
        """The heads as they are shown."""
        return tuple(column.removeprefix(">") for column in self.columns)


# --- a comparison -----------------------------------------------------------------------------------------


def error_table(comparison: Comparison, most: int | None = None) -> ReportTable:
    """Errors of one model by run and node; of more than `most` rows the largest RMSE first."""
    rows: list[tuple[float, tuple[str, ...]]] = []
    for prediction in comparison.predictions:
        for node in comparison.model.nodes:
            errors, noise = comparison.node(node, prediction), kelvin(comparison.floor(node), 2)
            if errors.count:
                rows.append((errors.rmse, (prediction.segment.run.name, node, *error_cells(errors), noise)))
    if most is not None and len(rows) > most:
        rows.sort(key=lambda one: -one[0])
    heads = ("run", "node", ">RMSE", ">max |error|", ">mean error", ">noise alone")
    return ReportTable(heads, tuple(row for _, row in rows))


def error_cells(errors: Errors) -> tuple[str, ...]:
    """RMSE, largest and mean error."""
    return kelvin(errors.rmse), kelvin(errors.max), signed_kelvin(errors.mean)


_CONDITIONS = 12  # rows


def condition_table(comparison: Comparison) -> ReportTable:
    """The conditions in which a model fails worst, worst first."""
    worst = sorted(conditions_of(comparison), key=lambda condition: -condition.errors.rmse)[:_CONDITIONS]
    rows = ((one.node, bin_text(one.quantity, one.lower, one.upper), *error_cells(one.errors)) for one in worst)
    return ReportTable(("node", "condition", ">RMSE", ">max |error|", ">mean error"), tuple(rows))


def conditions_of(comparison: Comparison) -> list[Condition]:
    """`Comparison.conditions` with times in the unit in which a person reads them."""
    conditions = comparison.conditions()
    longest = max((condition.upper for condition in conditions if condition.quantity.endswith("[s]")), default=0.0)
    unit, label = time_unit(longest)
    return [
        replace(one, quantity=f"{one.quantity[:-3]}{label[5:]}", lower=one.lower / unit, upper=one.upper / unit)
        if one.quantity.endswith("[s]")
        else one
        for one in conditions
    ]


def conditions_by_quantity(comparison: Comparison) -> dict[str, list[Condition]]:
    """`conditions_of` by their quantity; one that no node splits into bins only repeats the node's own error."""
    cells = conditions_of(comparison)
    count = Counter((cell.quantity, cell.node) for cell in cells)
    quantities = dict.fromkeys(cell.quantity for cell in cells if count[cell.quantity, cell.node] > 1)
    return {quantity: [cell for cell in cells if cell.quantity == quantity] for quantity in quantities}


def node_table(given: Comparison, best: Comparison | None) -> ReportTable:
    """Errors of each node over all runs, with the model as given and with the best one."""
    rows = []
    for node in given.model.nodes:
        before, after = given.node(node), best.node(node) if best else None
        if before.count:
            cells = (before.rmse, after.rmse, before.max, after.max) if after else (before.rmse, before.max)
            rows.append((node, *map(kelvin, cells), kelvin(given.floor(node), 2)))
    heads = (">RMSE before", ">RMSE after", ">max |error| before", ">max |error| after")
    return ReportTable(("node", *(heads if best else (">RMSE", ">max |error|")), ">noise alone"), tuple(rows))


def versus_table(what: str, pairs: Sequence[Pair]) -> ReportTable:
    """Two models' errors by class of nodes or by run, and the reduction of the largest."""
    rows = []
    for pair in pairs:
        mean, largest, square = (f"{mine:.2f} / {others:.2f} {unit}" for mine, others, unit in pair.figures)
        rows.append((pair.what, mean, largest, f"{pair.reduction:.0%}".replace("-", "−"), square))
    return ReportTable((what, ">mean |error|", ">max |error|", ">reduction", ">mean square"), tuple(rows))


def data_table(jobs: Mapping[str, Sequence[Segment]]) -> ReportTable:
    """One row for each segment: its run, and what it was used for."""
    rows = []
    clocked = any(segment.run.began for segments in jobs.values() for segment in segments)
    for job, segments in jobs.items():
        for segment in segments:
            run = segment.run
            whole = segment.initialisation == segment.evaluation
            start = "all counted readings" if whole else window_text(segment.initialisation, segment)
            size = time_span(len(run) * run.step), f"{run.step:g} s"
            cells = [run.name, Path(run.source).name, run.fingerprint[:12]]
            if clocked:
                cells.append(f"{run.began:%Y-%m-%d %H:%M} UTC" if run.began else "–")
            notes = " ".join(run.notes) or "none"
            rows.append((*cells, *size, job, start, window_text(segment.evaluation, segment), notes))
    names = ("run", "file", "fingerprint", "began") if clocked else ("run", "file", "fingerprint")
    heads = (*names, ">length", ">step", "used as", "initialised on", "errors counted", "notes")
    return ReportTable(heads, tuple(rows))


# --- a forecast -------------------------------------------------------------------------------------------


def forecast_table(ahead: Forecast, most: int | None = None) -> ReportTable:
    """Each node with a limit: its temperature, when it reaches the limit, and where it settles; of more than `most`
    nodes the next to reach it first.
    """
    every = list(ahead.nodes.values())
    nodes = every if most is None or len(every) <= most else ahead.soonest
    rows = []
    for one in nodes:
        times = time_to_limit(one), interval_to_limit(one)
        rows.append((one.node, f"{one.now:.1f} °C", f"{one.limit:g} °C", *times, settling_temperature(one)))
    heads = ("node", ">now", ">limit", ">time to limit", f">{percent(ahead.coverage)} interval", ">settles at [°C]")
    return ReportTable(heads, tuple(rows))


def time_to_limit(one: NodeForecast) -> str:
    """When a node reaches its limit, `passed` or `never`."""
    if one.time_to_limit == 0:
        return "passed"
    return time_span(one.time_to_limit) if one.reaches else "never"


def interval_to_limit(one: NodeForecast) -> str:
    """The interval of that time; of `never` its probability."""
    if one.time_to_limit == 0:
        return ""
    if not math.isfinite(one.low):
        return f"never ({percent(1 - one.chance)})"
    return f"{time_span(one.low)} to {time_span(one.high) if math.isfinite(one.high) else 'never'}"


def settling_temperature(one: NodeForecast) -> str:
    """Where a temperature settles, with its interval [°C]."""
    if not math.isfinite(one.steady):
        return "runs away"
    return f"{one.steady:.0f} ({one.steady_low:.0f} to {one.steady_high:.0f})".replace("-", "−")


# --- a forward selection ----------------------------------------------------------------------------------


def history_table(history: History) -> ReportTable:
    """One row for each step, the model as given first."""
    tested = any(step.test for step in history.steps)
    rows = []
    for place, step in enumerate(history.steps):
        errors = [step.fit.rmse, *((step.holdout.rmse, step.holdout.max) if step.holdout else (None, None))]
        errors += [step.test.rmse if step.test else None] if tested else []
        what = title_of(step.effect) if step.effect else "as given"
        rows.append((str(place), what, place_of(step.at or ""), str(step.parameters), *map(kelvin, errors)))
    heads = ("step", "effect", "place", ">parameters", ">RMSE fitted", ">held out", ">max held out")
    return ReportTable((*heads, ">test") if tested else heads, tuple(rows))


def effects_table(history: History) -> ReportTable:
    """One row for each effect that was added, or is the answer where nothing was yet."""
    added = effects_shown(history)
    rows = []
    for place, step in enumerate(added, start=1):
        key, at = step.key
        kind = "chosen" if not step.probability else "structure" if step.is_structure else "finding"
        same = ", ".join(named(*other) for other in step.indistinguishable) or NOTHING
        sure = percent(step.probability) if step.probability else NOTHING
        about = title_of(key), place_of(at), kind, size_text(step, added[-1].fit) or NOTHING, sure
        rows.append((str(place), *about, same, experiment_for(catalogue()[key])))
    heads = ("no.", "effect", "place", "kind", ">size", ">probability", "can't be told from")
    return ReportTable((*heads, "experiment that separates"), tuple(rows))


def refused_table(history: History) -> ReportTable:
    """One row for each effect that was fitted beside all that was added, and was not added."""
    rows = (
        (title_of(step.key[0]), place_of(step.key[1]), size_text(step, step.fit), percent(step.probability))
        for step in history.last.refused
    )
    return ReportTable(("effect", "place", ">size", ">probability"), tuple(rows))


def stretch_table(stretches: Sequence[HeatPeak]) -> ReportTable:
    """One row for each stretch of unexplained heat, in the order given."""
    rows = []
    for one in stretches:
        watts = [f"{'−' if x < 0 else '+'}{short_size(abs(x))}" for x in one.heat + one.band * np.array([0, -1, 1])]
        rows.append((one.run, one.node, *(f"{time:.0f}" for time in one.elapsed), *watts))
    heads = ("run", "node", ">from [s]", ">to [s]", ">heat [W]", ">at least [W]", ">at most [W]")
    return ReportTable(heads, tuple(rows))


_ZERO = 1e-9  # share of the typical size; what a search leaves of a zero


def parameter_table(best: Fit, given: Fit | None = None, most: int | None = None) -> ReportTable:
    """Free parameters with their standard errors, beside their values in the model as given, once fitted; of more than
    `most` the least certain.
    """
    before = {}
    if given is not None:
        parameters = (given.model.parameters[index] for index in given.free)
        before = {parameter.name: _value(parameter.value, parameter) for parameter in parameters}
    rows = []
    free = [best.model.parameters[index] for index in best.free]
    if most is not None and len(free) > most:
        doubt = {one.name: best.standard_errors[one.name] / max(abs(one.value), sys.float_info.min) for one in free}
        free = sorted(free, key=lambda one: -doubt[one.name])[:most]
    for parameter in free:
        error = best.standard_errors[parameter.name]
        spread = short_size(error) if math.isfinite(error) else "not determined"
        what = parameter.name, parameter.declared.title or NOTHING, _value(parameter.value, parameter)
        row = (*what, spread, unit_text(parameter.declared.unit))
        rows.append(row if given is None else (*row, before.get(parameter.name, "new")))
    heads = ("parameter", "what it is", ">value", ">± standard error", "unit")
    return ReportTable(heads if given is None else (*heads, ">in the model as given, fitted"), tuple(rows))


def _value(value: float, parameter: ParameterInstance) -> str:
    return number(0.0 if abs(value) < _ZERO * parameter.declared.typical else value)


def source_table(effects: Sequence[type[Effect]]) -> ReportTable:
    """Where the equations come from: one row for each effect that cites a work."""
    rows = ((effect.title, cite(effect.source)) for effect in effects if works_cited([effect.source]))
    return ReportTable(("effect", "source"), tuple(rows))
