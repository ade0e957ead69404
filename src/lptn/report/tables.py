"""The tables of a report, as rows of text."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from lptn.compare import Comparison
from lptn.evidence import Part
from lptn.identify import Fit
from lptn.ladder import Ladder
from lptn.parameters import Unknown
from lptn.report.certainty import share_by_chance
from lptn.report.conditions import conditions_of
from lptn.report.text import (
    NOTHING,
    duration,
    experiment_for,
    kelvin,
    number,
    place_of,
    short_size,
    title_of,
    unit_text,
    within,
)

_WORST = 12  # conditions listed
_ZERO = 1e-9  # share of the typical size


@dataclass(frozen=True)
class Table:
    """Column heads and rows; `numeric` names the columns that stand to the right."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numeric: tuple[int, ...] = ()


def ladder_table(ladder: Ladder) -> Table:
    """One row for each rung."""
    heads = ("rung", "effect", "place", "free parameters", "RMSE fitted", "RMSE held out", "largest held out")
    proven = any(rung.proof for rung in ladder.rungs)
    rows = []
    for place, rung in enumerate(ladder.rungs):
        holdout, proof = rung.holdout, rung.proof
        cells = [str(place), title_of(rung.effect) if rung.effect else "as given", place_of(rung.at or "")]
        cells += [str(rung.parameters), kelvin(rung.fit.rmse)]
        cells += [kelvin(holdout.rmse if holdout else None), kelvin(holdout.max if holdout else None)]
        rows.append((*cells, kelvin(proof.rmse if proof else None)) if proven else tuple(cells))
    return Table((*heads, "RMSE proof") if proven else heads, tuple(rows), (3, 4, 5, 6, 7))


def refit_table(ladder: Ladder) -> Table:
    """One row for each candidate that the first diagnosis refitted, best first."""
    found = ladder.first
    heads = ("no.", "effect", "place", "size / typical", "RMSE fitted", "RMSE held out", "by chance", "like no.")
    order = {each.key: str(place) for place, each in enumerate(found.findings, start=1)}
    before = kelvin(found.holdout.rmse if found.holdout else None)
    rows = []
    for each in found.findings:
        effect, (_, at) = each.refit.candidate.effect, each.key
        held = NOTHING if each.holdout is None else f"{before} → {kelvin(each.holdout.rmse)}"
        errors = (f"{kelvin(found.rmse_fit)} → {kelvin(each.rmse_fit)}", held, share_by_chance(ladder, each))
        alike = ", ".join(sorted((order[key] for key in each.alike), key=int)) or NOTHING
        size = short_size(each.refit.size)
        rows.append((order[each.key], effect.title, place_of(at), size, *errors, alike, experiment_for(effect)))
    return Table((*heads, "experiment that separates"), tuple(rows), (3, 4, 5, 6))


def node_table(given: Comparison, best: Comparison | None) -> Table:
    """Errors of each node over all runs, before and after."""
    nodes = [node for node in given.model.nodes if given.node(node).count]
    rows = []
    for node in nodes:
        before, after = given.node(node), best.node(node) if best else None
        cells = [kelvin(before.rmse), kelvin(after.rmse if after else None), kelvin(before.max)]
        cells += [kelvin(after.max if after else None), kelvin(given.floor(node), 2)]
        rows.append((node, *cells))
    if best is None:
        return Table(
            ("node", "RMSE", "largest", "noise alone"), tuple((r[0], r[1], r[3], r[5]) for r in rows), (1, 2, 3)
        )
    heads = ("node", "RMSE before", "RMSE after", "largest before", "largest after", "noise alone")
    return Table(heads, tuple(rows), (1, 2, 3, 4, 5))


def parameter_table(best: Fit, given: Fit) -> Table:
    """Free parameters of the best model, beside their values in the given model once fitted."""
    heads: tuple[str, ...] = (
        "parameter",
        "what it is",
        "value",
        "± standard error",
        "unit",
        "in the model as given, fitted",
    )
    known = {given.model.unknowns[index].name: given.model.unknowns[index].value for index in given.problem.free}
    rows = []
    for index in best.problem.free:
        unknown = best.model.unknowns[index]
        error = best.errors[unknown.name]
        spread = short_size(error) if math.isfinite(error) else "not determined"
        before = _value(known[unknown.name], unknown) if unknown.name in known else "new"
        what = unknown.declared.title or NOTHING
        rows.append(
            (unknown.name, what, _value(unknown.value, unknown), spread, unit_text(unknown.declared.unit), before)
        )
    heads = heads if best is not given else heads[:-1]
    return Table(heads, tuple(row[: len(heads)] for row in rows), (2, 3, 5))


def data_table(jobs: Mapping[str, Sequence[Part]]) -> Table:
    """One row for each run and job: what the runs were used for, and the runs."""
    heads = ("run", "file", "fingerprint", "length", "step", "job", "start found in", "counts", "notes")
    rows = [_data_row(job, part) for job, parts in jobs.items() for part in parts]
    return Table(heads, tuple(rows), (3, 4))


def error_table(comparison: Comparison) -> Table:
    """Errors of one model by run and node."""
    heads = ("run", "node", "RMSE", "largest", "mean (predicted − measured)", "noise alone")
    rows = []
    for prediction in comparison.predictions:
        for node in comparison.model.nodes:
            errors = comparison.node(node, prediction)
            if errors.count:
                cells = (kelvin(errors.rmse), kelvin(errors.max), _signed(errors.mean))
                rows.append((prediction.part.run.name, node, *cells, kelvin(comparison.floor(node), 2)))
    return Table(heads, tuple(rows), (2, 3, 4, 5))


def condition_table(comparison: Comparison) -> Table:
    """The conditions in which a model fails worst, worst first."""
    heads = ("node", "condition", "from", "to", "RMSE", "largest", "mean (predicted − measured)", "readings")
    worst = sorted(conditions_of(comparison), key=lambda each: -each.errors.rmse)[:_WORST]
    rows = []
    for each in worst:
        errors = each.errors
        ends = (number(each.lower, 3), number(each.upper, 3))
        cells = (kelvin(errors.rmse), kelvin(errors.max), _signed(errors.mean), str(errors.count))
        rows.append((each.node, each.quantity, *ends, *cells))
    return Table(heads, tuple(rows), (2, 3, 4, 5, 6, 7))


def _data_row(job: str, part: Part) -> tuple[str, ...]:
    run = part.run
    start = "the whole stretch" if part.opening == part.counted else within(part.opening, part)
    notes = " ".join(run.notes) or "nothing found"
    length = duration(len(run) * run.step)
    cells = (run.name, Path(run.source).name, run.fingerprint[:12], length, f"{run.step:g} s", job)
    return (*cells, start, within(part.counted, part), notes)


def _value(value: float, unknown: Unknown) -> str:
    """A fitted value; what a search leaves of a zero is zero."""
    return number(0.0 if abs(value) < _ZERO * unknown.declared.typical else value)


def _signed(value: float) -> str:
    return f"{value:+.2g} K".replace("-", "−")
