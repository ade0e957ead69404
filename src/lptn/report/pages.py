"""Self-contained HTML pages: tables and whole documents from an improvement or a comparison."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lptn.basics.parameters import ParameterInstance
from lptn.basics.style import BEST, GIVEN, SMALL, TEXT, dress, new_figure, plain
from lptn.diagnose.improvement import History
from lptn.diagnose.scores import confusability, smallest
from lptn.effects import Effect, catalogue
from lptn.identify.comparison import Comparison, Pair, Versus, predict
from lptn.identify.data import DataSplit, Segment
from lptn.identify.fitting import Fit
from lptn.references import cite, works_cited
from lptn.report import words
from lptn.report.diagnosis_figures import candidates_shown, confusion, detectability, ladder_curve, ranking
from lptn.report.figures import conditions_of, error_maps, predictions_figure
from lptn.report.heat_figures import (
    Picture,
    error_fields,
    heat_line_picture,
    heat_map_picture,
    heat_story,
    hiding,
    node_time_map,
    picture,
    render,
)
from lptn.report.text import (
    NOTHING,
    experiment_for,
    for_people,
    kelvin,
    number,
    place_of,
    short_size,
    time_span,
    title_of,
    unit_text,
    window_text,
)
from lptn.report.words import (
    Proposal,
    fitted_in_words,
    in_short,
    next_step,
    noise_alone,
    share_by_chance,
    story_in_words,
)

# --- The tables of a report, as rows of text ------------------------------------------------------


_WORST = 12  # conditions listed
_ZERO = 1e-9  # share of the typical size


@dataclass(frozen=True)
class Table:
    """Column heads and rows; `numeric` names the columns that stand to the right."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    numeric: tuple[int, ...] = ()


def ladder_table(history: History) -> Table:
    """One row for each rung."""
    heads = ("rung", "effect", "place", "free parameters", "RMSE fitted", "RMSE held out", "largest held out")
    proven = any(step.test for step in history.steps)
    rows = []
    for place, step in enumerate(history.steps):
        holdout, test = step.holdout, step.test
        cells = [str(place), title_of(step.effect) if step.effect else "as given", place_of(step.at or "")]
        cells += [str(step.parameters), kelvin(step.fit.rmse)]
        cells += [kelvin(holdout.rmse if holdout else None), kelvin(holdout.max if holdout else None)]
        rows.append((*cells, kelvin(test.rmse if test else None)) if proven else tuple(cells))
    return Table((*heads, "RMSE proof") if proven else heads, tuple(rows), (3, 4, 5, 6, 7))


def refit_table(history: History) -> Table:
    """One row for each candidate that the first diagnosis refitted, best first."""
    found = history.first
    heads = ("no.", "effect", "place", "size / typical", "RMSE fitted", "RMSE held out", "by chance", "like no.")
    order = {each.key: str(place) for place, each in enumerate(found.refits, start=1)}
    before = kelvin(found.holdout.rmse if found.holdout else None)
    rows = []
    for each in found.refits:
        key, at = each.key
        effect = catalogue()[key]
        held = NOTHING if each.holdout is None else f"{before} → {kelvin(each.holdout.rmse)}"
        errors = (f"{kelvin(found.fit.rmse)} → {kelvin(each.fit.rmse)}", held, share_by_chance(history, each))
        indistinguishable = ", ".join(sorted((order[key] for key in each.indistinguishable), key=int)) or NOTHING
        size = short_size(each.size)
        rows.append(
            (order[each.key], effect.title, place_of(at), size, *errors, indistinguishable, experiment_for(effect))
        )
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
    known = {given.model.parameters[index].name: given.model.parameters[index].value for index in given.problem.free}
    rows = []
    for index in best.problem.free:
        parameter = best.model.parameters[index]
        error = best.standard_errors[parameter.name]
        spread = short_size(error) if math.isfinite(error) else "not determined"
        before = _value(known[parameter.name], parameter) if parameter.name in known else "new"
        what = parameter.declared.title or NOTHING
        rows.append(
            (
                parameter.name,
                what,
                _value(parameter.value, parameter),
                spread,
                unit_text(parameter.declared.unit),
                before,
            )
        )
    heads = heads if best is not given else heads[:-1]
    return Table(heads, tuple(row[: len(heads)] for row in rows), (2, 3, 5))


def data_table(jobs: Mapping[str, Sequence[Segment]]) -> Table:
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
                rows.append((prediction.segment.run.name, node, *cells, kelvin(comparison.floor(node), 2)))
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


def source_table(history: History) -> Table:
    """Where the equations come from: one row for each effect that the page names and that cites a work."""
    rows = ((effect.title, cite(effect.source)) for effect in _effects_named(history) if works_cited([effect.source]))
    return Table(("effect", "source"), tuple(rows))


def _effects_named(history: History) -> list[type[Effect]]:
    """The effects of the given and of the best model, and the candidates, each once."""
    networks = (step.fit.model.network for step in (history.steps[0], history.best))
    effects = [type(declared.effect) for network in networks for declared in network.effects]
    return list(dict.fromkeys(effects + [score.candidate.effect for score in candidates_shown(history.first)]))


def _data_row(job: str, part: Segment) -> tuple[str, ...]:
    run = part.run
    start = "the whole stretch" if part.initialisation == part.evaluation else window_text(part.initialisation, part)
    notes = " ".join(run.notes) or "nothing found"
    length = time_span(len(run) * run.step)
    cells = (run.name, Path(run.source).name, run.fingerprint[:12], length, f"{run.step:g} s", job)
    return (*cells, start, window_text(part.evaluation, part), notes)


def _value(value: float, parameter: ParameterInstance) -> str:
    """A fitted value; what a search leaves of a zero is zero."""
    return number(0.0 if abs(value) < _ZERO * parameter.declared.typical else value)


def _signed(value: float) -> str:
    return f"{value:+.2g} K".replace("-", "−")


# --- A short page on one model against logs: where it fails, without a diagnosis ------------------


def comparison_html(comparison: Comparison, title: str) -> str:
    """One self-contained HTML page on a comparison.

    Args:
        comparison: the result of `lptn.identify.comparison.compare`.
        title: heads the page, such as the model's name.

    Returns:
        HTML text; the same arguments give the same text.
    """
    everything, parts = comparison.all, tuple(each.segment for each in comparison.predictions)
    maps = error_maps(comparison)
    return render(
        "comparison.html.j2",
        title=title,
        rmse=kelvin(everything.rmse),
        largest=kelvin(everything.max),
        predictions=picture(
            words.caption_of_predictions(comparison, None, DataSplit(()), "compared"), predictions_figure(comparison)
        ),
        maps=picture(words.caption_of_maps(comparison, None, "compared"), *maps) if maps else None,
        errors=error_table(comparison),
        conditions=condition_table(comparison),
        data=data_table({"compared": parts}),
    )


# --- A page on two models and the same logs: who is better, by class of joints and by condition ---


def versus_figure(result: Versus) -> Figure:
    """Mean absolute error by class and largest error by run, both models side by side."""
    figure = new_figure(1.9 + 0.32 * max(len(result.classes), len(result.runs)))
    left, right = figure.subplots(1, 2, width_ratios=(1.0, 1.5))
    _bars(left, result.classes, [pair.mean for pair in result.classes], result.names)
    _bars(right, result.runs, [pair.max for pair in result.runs], result.names)
    left.set_xlabel("mean absolute error [K]", size=TEXT)
    right.set_xlabel("largest error [K]", size=TEXT)
    bars, names = left.get_legend_handles_labels()
    figure.legend(bars, names, frameon=False, fontsize=SMALL, loc="outside upper center", ncols=2)
    return figure


def versus_html(result: Versus, title: str) -> str:
    """One self-contained HTML page on a model against another.

    Args:
        result: of `lptn.identify.comparison.versus`.
        title: heads the page.
    """
    whole = result.classes[-1]
    return render(
        "versus.html.j2",
        title=title,
        names=result.names,
        means=tuple(kelvin(value) for value in whole.mean),
        largest=tuple(kelvin(value) for value in whole.max),
        bars=picture(_bar_caption(result), versus_figure(result)),
        predictions=_predictions(result),
        classes=_table("joints", result.classes),
        runs=_table("run", result.runs),
        data=data_table({"compared": tuple(each.segment for each in result.model.predictions)}),
    )


def _predictions(result: Versus) -> Picture:
    """The other model's worst nodes and runs, with the model's own lines where it has those nodes too."""
    both = set(result.other.model.nodes) <= set(result.model.model.nodes)
    given, best = (result.other, result.model) if both else (result.model, None)
    caption = words.caption_of_predictions(given, best, DataSplit(()), "compared")
    if both:
        caption = caption.replace("the model as given", result.names[1]).replace("the best model", result.names[0])
    return picture(caption, predictions_figure(given, best, names=(result.names[1], result.names[0])))


def _bars(ax: Axes, pairs: Sequence[Pair], sizes: Sequence[tuple[float, float]], names: tuple[str, str]) -> None:
    places = np.arange(len(pairs))[::-1]
    # Hatching tells the two apart on a grey printer.
    styles = ((BEST["color"], "", 0.2), (GIVEN["color"], "////", -0.2))
    for which, (colour, hatch, shift) in enumerate(styles):
        values = [size[which] for size in sizes]
        drawn = ax.barh(
            places + shift, values, 0.38, color=colour, hatch=hatch, edgecolor="white", label=plain(names[which])
        )
        ax.bar_label(drawn, fmt="%.2f", padding=2, fontsize=SMALL)
    ax.set_yticks(places, [plain(pair.what) for pair in pairs], fontsize=SMALL)
    ax.margins(x=0.14)
    dress(ax)


def _table(what: str, pairs: Sequence[Pair]) -> Table:
    both = ("of the other", "less")
    heads = (what, "mean error", both[0], "largest", *both, "mean square [K²]", *both)
    rows = tuple(
        (
            pair.what,
            *(kelvin(value) for value in pair.mean),
            *(kelvin(value) for value in pair.max),
            f"{pair.reduction:.0%}",
            *(f"{value:.2f}" for value in pair.square),
            f"{pair.square_reduction:.0%}",
        )
        for pair in pairs
    )
    return Table(heads, rows, tuple(range(1, len(heads))))


def _bar_caption(result: Versus) -> str:
    better = sum(pair.max[0] < pair.max[1] for pair in result.runs)
    return (
        "Mean absolute error by class of joints (left) and largest error by run (right): "
        f"{result.names[0]} (green, plain) beside {result.names[1]} (blue, hatched). "
        f"Its largest error is the smaller one in {better} of {len(result.runs)} runs."
    )


# --- The whole story on one page: log, fit, where it fails, what is missing, what proves it -------


_FEW = 12  # parameters that may stand before the story
_PROOF = {
    "held-out": "Proof: the held-out runs",
    "proof": "Proof: runs that chose nothing",
    "fitted": "Measured against predicted, on the fitted runs only",
}
_PALE = 5.0  # multiples of the noise that the colours of errors reach at least


def story_html(
    history: History,
    data: DataSplit,
    title: str,
    commands: Sequence[str] = (),
    proposal: Proposal | None = None,
) -> str:
    """One self-contained HTML page that tells what was found.

    Args:
        ladder: the result of `lptn.diagnose.improvement.improve`.
        data: the runs it was given.
        title: heads the page, such as the model's name.
        commands: what was typed, shown at the end.
        proposal: of the next experiment, where one was worked out.

    Returns:
        HTML text; the same arguments give the same text.
    """
    which, parts = _shown(data)
    given = _compared(history.steps[0].fit, parts)
    best = _compared(history.best.fit, parts) if len(history.steps) > 1 else None
    predictions = words.caption_of_predictions(given, best, data, which)
    heat = heat_story(history)
    return render(
        "story.html.j2",
        title=title,
        verdict=history.verdict,
        short=[(label, for_people(text)) for label, text in in_short(history, heat, proposal)],
        words=story_in_words(history, data),
        history=ladder_table(history),
        fall=_fall(history),
        maps=_maps(given, best, which),
        errors=_error_map(given, best, which),
        nodes=node_table(given, best),
        which=which,
        heat_map=heat_map_picture(heat),
        heat_line=heat_line_picture(heat),
        hiding=hiding(heat),
        predictions=picture(predictions, predictions_figure(given, best)),
        ranking=_ranking(history),
        refits=refit_table(history),
        coarse=_coarse_step(history),
        confusion=_confusion(history),
        detectability=_detectability(history),
        heading=_PROOF[which],
        proposal=for_people(proposal.text()) if proposal else None,
        next=next_step(history),
        fitted=fitted_in_words(history),
        few=_FEW,
        parameters_given=parameter_table(history.steps[0].fit, history.steps[0].fit),
        parameters=parameter_table(history.best.fit, history.steps[0].fit),
        warnings=history.best.fit.uncertainty.warnings,
        status=history.best.fit.status,
        data=data_table({"fitted": data.fit, "held out": data.holdout, "proof": data.test}),
        commands=commands,
        sources=source_table(history),
        works=[cited.reference.full for cited in works_cited(effect.source for effect in _effects_named(history))],
    )


def _shown(data: DataSplit) -> tuple[str, Sequence[Segment]]:
    """The runs that show best what a model is worth: those that no fit saw, where there are any."""
    if data.holdout:
        return "held-out", data.holdout
    return ("proof", data.test) if data.test else ("fitted", data.fit)


def _compared(fit: Fit, parts: Sequence[Segment]) -> Comparison:
    """A fitted model on runs, weighed as in the fit, so that the page's numbers agree with the ladder's."""
    predictions = tuple(predict(fit.model, part, fit.problem.sigma) for part in parts)
    return Comparison(fit.model, predictions, fit.noise)


def _coarse_step(history: History) -> float | None:
    """The step of the search [s], `None` where it is that of the fits."""
    searched, fitted = (fit.problem.bound_runs[0].run.step for fit in (history.first.fit, history.steps[0].fit))
    return searched if searched > fitted else None


def _fall(history: History) -> Picture | None:
    if len(history.steps) == 1:
        return None
    return picture(words.caption_of_ladder(history), ladder_curve(history, noise_alone(history.best.fit)))


def _maps(given: Comparison, best: Comparison | None, which: str) -> Picture | None:
    figures = error_maps(given, best)
    return picture(words.caption_of_maps(given, best, which), *figures) if figures else None


def _error_map(given: Comparison, best: Comparison | None, which: str) -> Picture:
    noise = max(given.floor(node) for node in given.model.nodes)
    fields = error_fields(given), error_fields(best) if best else []
    return picture(words.caption_of_error_map(which), node_time_map(*fields, "error [K]", _PALE * noise))


def _confusion(history: History) -> Picture | None:
    found = confusability(history.first.scores)
    return picture(words.caption_of_confusion(found), confusion(found)) if len(found.keys) > 1 else None


def _detectability(history: History) -> Picture | None:
    found = smallest(history.first.scores)
    return picture(words.caption_of_detectability(found), detectability(found)) if found else None


def _ranking(history: History) -> Picture | None:
    if not candidates_shown(history.first):
        return None
    added = frozenset((step.effect, step.at) for step in history.steps if step.effect and step.at)
    return picture(words.caption_of_ranking(history), ranking(history.first, added))
