"""Self-contained HTML pages: the story of a forward selection, one model against logs, one model against another."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from functools import partial
from itertools import compress

from lptn.basics.style import inline_svg, single
from lptn.diagnose.advice import Advice, Detectable, smallest
from lptn.diagnose.improvement import History
from lptn.diagnose.unexplained_heat import stretches
from lptn.effects import catalogue
from lptn.identify.comparison import Comparison, Versus, predict
from lptn.identify.data import DataSplit
from lptn.identify.fitting import Fit
from lptn.references import works_cited
from lptn.report import tables
from lptn.report.comparison_figures import NAMES, condition_figures, predictions_figure, versus_figure
from lptn.report.diagnosis_figures import HISTORY, plot_detectability, plot_history, reach_height
from lptn.report.document import Picture, render
from lptn.report.heat_figures import field_figures
from lptn.report.heat_story import HeatStory, heat_line_picture, heat_map_picture, learned_picture
from lptn.report.narrative import (
    ENDED,
    MORE_THAN_NOISE,
    comparison_narrative,
    content_narrative,
    details,
    largest_error,
    narrative,
    versus_narrative,
)
from lptn.report.shown import MOST, NOISE_BAND, effects_shown, error_fields, initialisation_end, reaches, views
from lptn.report.story_charts import looked_through, network_picture
from lptn.report.text import for_people

# --- the whole story: log, fit, where it fails, what is missing, what tests it --------------------------------


_FEW = 12  # rows of parameters and of unexplained heat that fit into the story
_HEADINGS = {
    "held-out": "Test: the held-out runs",
    "test": "Test: runs that chose nothing",
    "fitted": "Measured against predicted, on the fitted runs only",
}
_JOBS = {"fit": "fitted", "holdout": "held out", "test": "test"}
_PALE = 5.0  # multiples of the noise that the colours of errors reach at least


def story_html(
    history: History, data: DataSplit, title: str, commands: Sequence[str] = (), advice: Advice | None = None
) -> str:
    """One self-contained HTML page that tells what is missing in a model, how sure that is, and what tests it.

    All nodes and runs can be looked through on it, zoomed and hovered, without a server; on paper it is whole as well.

    Args:
        history: the result of `lptn.diagnose.improvement.improve`.
        data: the runs it was given.
        title: heads the page, such as the model's name.
        commands: what was typed, shown at the end.
        advice: what to do next, where it was worked out.

    Returns:
        HTML text; the same arguments give the same text, but for the day and the versions at its end.
    """
    first, last = history.steps[0], history.best
    jobs = [(job, segment) for job, group in data.by_job.items() for segment in group]
    all_given = _compared(first.fit, data)
    all_best = _compared(last.fit, data) if len(history.steps) > 1 else None
    which = "held-out" if data.holdout else "test" if data.test else "fitted"
    wanted = [_JOBS[job] == which.replace("-", " ") for job, _ in jobs]
    given, best = _only(all_given, wanted), _only(all_best, wanted) if all_best else None
    heat = HeatStory.of(history)
    left = stretches(heat.best or heat.given)
    said = narrative(history.steps, history.last, advice)
    searched, fitted = (fit.problem.bound_runs[0].run.step for fit in (history.first.fit, first.fit))
    # Of the given and of the best model, what was refused, and what would have shown, each once.
    networks = (step.fit.model.network for step in (first, last))
    named = [step.key[0] for step in (*effects_shown(history), *history.last.refused)]
    named += [one.candidate.effect.key for one in history.last.weighed]
    of_models = [type(declared.effect) for network in networks for declared in network.effects]
    effects = list(dict.fromkeys([*of_models, *(catalogue()[key] for key in named)]))
    works = [cited.reference.full for cited in works_cited(effect.source for effect in effects)]
    titles = [
        "In short",
        "The log",
        "The model as given, fitted",
        "Where the model fails",
        "What was missing",
        _HEADINGS[which],
        "What to do next",
        f"Parameters of the {'best model' if all_best else 'model'}",
        *(["References"] if works else []),
    ]
    return render(
        "story.html.j2",
        title=title,
        titles=titles,
        said=said,
        details=details(history, data),
        contents_of_logs=content_narrative(
            first.fit.model, list({id(segment.run): segment.run for _, segment in jobs}.values())
        ),
        network=network_picture(all_given),
        best_network=network_picture(all_best) if all_best else None,
        **looked_through(all_given, all_best, NAMES, [_JOBS[job] for job, _ in jobs], heat.best or heat.given),
        history=tables.history_table(history),
        fall=_fall(history) if all_best else None,
        conditions=conditions_picture(given, best, which),
        errors=_errors(given, best, which),
        nodes=tables.node_table(given, best),
        which=which,
        heat_map=heat_map_picture(heat),
        heat_line=heat_line_picture(heat),
        learned=learned_picture(advice.learned if advice else None),
        stretches=tables.stretch_table(left[:_FEW]),
        more_stretches=max(len(left) - _FEW, 0),
        hiding=heat.hiding,
        more_than_noise=MORE_THAN_NOISE if history.remaining != "adequate" else "",
        predictions=_predictions(given, best, which, {segment.run.name for segment in data.fit}),
        told=tables.effects_table(history),
        refused=tables.refused_table(history),
        coarse=searched if searched > fitted else None,
        detectability=detectability_picture(smallest(history.last.weighed)),
        experiment=for_people(advice.experiment.text()) if advice and advice.experiment else None,
        few=_FEW,
        parameters_given=tables.parameter_table(first.fit),
        parameters=tables.parameter_table(last.fit, first.fit if last is not first else None),
        warnings=last.fit.uncertainty.warnings,
        status=ENDED[last.fit.status],
        data=tables.data_table({"fit": data.fit, "held out": data.holdout, "test": data.test}),
        commands=commands,
        sources=tables.source_table(effects),
        works=works,
    )


def _compared(fit: Fit, data: DataSplit) -> Comparison:
    """A fitted model on all runs."""
    return Comparison(fit.model, tuple(predict(fit.model, segment) for segment in data.segments), fit.noise)


def _only(comparison: Comparison, wanted: Sequence[bool]) -> Comparison:
    """A comparison of some of its runs."""
    return replace(comparison, predictions=tuple(compress(comparison.predictions, wanted)))


def conditions_picture(given: Comparison, best: Comparison | None, which: str) -> Picture | None:
    """Where a model fails, by node and operating condition; none where too few readings are."""
    drawings = [inline_svg(figure, "RMSE by node and condition") for figure in condition_figures(given, best)]
    text = f"RMSE in K on the {which} runs by node and operating condition; the small numbers are each bin's range."
    for model, comparison in (("model as given" if best else "model", given), ("best model", best)):
        if comparison is not None:
            text += f" Worst place of the {model}: {largest_error(comparison).text}"
    return Picture(text, *drawings) if drawings else None


def _errors(given: Comparison, best: Comparison | None, which: str) -> Picture:
    noise = max(given.floor(node) for node in given.model.nodes)
    figures = field_figures(error_fields(given), error_fields(best) if best else [], "K", _PALE * noise)
    text = f"Error (predicted − measured) on the {which} runs: red where the model is too hot, blue where too cold"
    drawings = (inline_svg(figure, "errors by node and time") for figure in figures)
    return Picture(f"{text} (hatched where clearly so).", *drawings)


def _fall(history: History) -> Picture:
    drawing = inline_svg(
        single(HISTORY, partial(plot_history, history.steps)), "RMSE of each step on fit, held-out and test data"
    )
    held = "judge it by the held-out errors" if history.best.holdout else "no data were held out to test it"
    best = f"the best model (step {len(history.steps) - 1}, green)"
    return Picture(f"RMSE from the model as given (step 0, blue) to {best}; {held}.", drawing)


def _predictions(
    given: Comparison,
    best: Comparison | None = None,
    which: str = "compared",
    fitted: Collection[str] = (),
    names: tuple[str, str] | None = None,
) -> Picture:
    """Measured and predicted temperatures; `fitted` are the names of runs that the model was fitted to."""
    blue, green = names or ("the model as given", "the best model")
    lines = f"The blue line is {blue}, the green one {green}" if best else "The blue line is the model"
    below = f"below, the error (predicted − measured), and ±{NOISE_BAND:g} times the sensor noise in grey"
    text = f"Temperatures on the {which} runs. {lines}; {below}."
    if any(initialisation_end(prediction) is not None for prediction in given.predictions):
        same = all(prediction.segment.run.name in fitted for prediction in given.predictions)
        shaded = "the shaded time, which was fitted," if same else "the shaded time"
        text += f" Readings in {shaded} only set the initial temperatures; what follows is predicted freely."
    else:
        text += " The initial temperatures were fitted to all of these readings, so this is no test."
    count = len(views(given))
    chosen = f"the worst {MOST} of {count}" if count > MOST else "all measured"
    figure = predictions_figure(given, best, names=names or NAMES)
    drawing = inline_svg(figure, "measured and predicted temperatures, and errors")
    return Picture(f"{text} Shown are {chosen} nodes and runs.", drawing)


def detectability_picture(sizes: Sequence[Detectable]) -> Picture | None:
    """What the data could have shown; none without a candidate."""
    if not sizes:
        return None
    drawing = inline_svg(
        single(reach_height(sizes), partial(plot_detectability, sizes)), "smallest size of each effect that would show"
    )
    rows = reaches(sizes)
    hidden = sum(reach.easiest.share_of_typical >= 1 for reach in rows)
    text = (
        "The dot is the place where the smallest effect would be detected, the end of the line the place where only "
        "the largest would. An effect that was not found is smaller, or absent. Right of the dashed line even one of "
        f"typical size could be missed ({hidden} of {len(rows)} effects wherever they are)."
    )
    return Picture(text, drawing)


# --- one model against logs: where it fails, without a diagnosis ----------------------------------------------


def comparison_html(comparison: Comparison, title: str) -> str:
    """One self-contained HTML page on a comparison.

    Args:
        comparison: the result of `lptn.identify.comparison.compare`.
        title: heads the page, such as the model's name.

    Returns:
        HTML text; the same arguments give the same text.
    """
    return render(
        "comparison.html.j2",
        title=title,
        network=network_picture(comparison),
        **looked_through(comparison),
        said=comparison_narrative(comparison),
        predictions=_predictions(comparison),
        maps=conditions_picture(comparison, None, "compared"),
        errors=tables.error_table(comparison),
        conditions=tables.condition_table(comparison),
        data=tables.data_table({"compared": tuple(prediction.segment for prediction in comparison.predictions)}),
    )


# --- two models and the same logs: who is better, by class of joints and by condition -------------------------


def versus_html(result: Versus, title: str) -> str:
    """One self-contained HTML page on a model against another.

    Args:
        result: of `lptn.identify.comparison.versus`.
        title: heads the page.

    Returns:
        HTML text; the same arguments give the same text.
    """
    bars = (
        "Mean absolute error by class of joints (left) and largest error by run (right): "
        f"{result.names[0]} (green, plain) beside {result.names[1]} (blue, hatched)."
    )
    # The other model's worst nodes and runs, with the model's own lines where it has those nodes too.
    both = set(result.other.model.nodes) <= set(result.model.model.nodes)
    given, best = (result.other, result.model) if both else (result.model, None)
    names = result.names[1], result.names[0]
    return render(
        "versus.html.j2",
        title=title,
        **looked_through(given, best, names),
        names=result.names,
        said=versus_narrative(result),
        bars=Picture(bars, inline_svg(versus_figure(result), "errors of both models by class of joints and by run")),
        predictions=_predictions(given, best, names=names),
        classes=tables.versus_table("joints", result.classes),
        runs=tables.versus_table("run", result.runs),
        data=tables.data_table({"compared": tuple(prediction.segment for prediction in result.model.predictions)}),
    )
