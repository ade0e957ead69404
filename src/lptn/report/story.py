"""The whole story on one page: log, fit, where it fails, what is missing, what proves it."""

from __future__ import annotations

from collections.abc import Sequence

from lptn.compare import Comparison, predict
from lptn.evidence import Evidence, Part
from lptn.identify import Fit
from lptn.ladder import Ladder
from lptn.report import captions
from lptn.report.heatmap import error_maps
from lptn.report.ladder_curve import ladder_curve
from lptn.report.page import Picture, picture, render
from lptn.report.ranking import candidates_shown, ranking
from lptn.report.tables import data_table, ladder_table, parameter_table, refit_table
from lptn.report.timeseries import predictions_figure
from lptn.report.words import noise_alone, story_in_words


def story_html(ladder: Ladder, data: Evidence, title: str, commands: Sequence[str] = ()) -> str:
    """One self-contained HTML page that tells what was found.

    Args:
        ladder: the result of `lptn.ladder.improve`.
        data: the runs it was given.
        title: heads the page, such as the model's name.
        commands: what was typed, shown at the end.

    Returns:
        HTML text; the same arguments give the same text.
    """
    which, parts = _shown(data)
    given = _compared(ladder.rungs[0].fit, parts)
    best = _compared(ladder.best.fit, parts) if len(ladder.rungs) > 1 else None
    predictions = captions.of_predictions(given, best, data, which)
    return render(
        "story.html.j2",
        title=title,
        verdict=ladder.verdict,
        words=story_in_words(ladder, data),
        ladder=ladder_table(ladder),
        fall=_fall(ladder),
        maps=_maps(given, best, which),
        predictions=picture(predictions, predictions_figure(given, best)),
        ranking=_ranking(ladder),
        refits=refit_table(ladder),
        coarse=_coarse_step(ladder),
        parameters=parameter_table(ladder.best.fit, ladder.rungs[0].fit),
        warnings=ladder.best.fit.uncertainty.warnings,
        status=ladder.best.fit.status,
        data=data_table({"fitted": data.fit, "held out": data.holdout, "proof": data.proof}),
        commands=commands,
    )


def _shown(data: Evidence) -> tuple[str, Sequence[Part]]:
    """The runs that show best what a model is worth: those that no fit saw, where there are any."""
    if data.holdout:
        return "held-out", data.holdout
    return ("proof", data.proof) if data.proof else ("fitted", data.fit)


def _compared(fit: Fit, parts: Sequence[Part]) -> Comparison:
    """A fitted model on runs, weighed as in the fit, so that the page's numbers agree with the ladder's."""
    predictions = tuple(predict(fit.model, part, fit.problem.sigma) for part in parts)
    return Comparison(fit.model, predictions, fit.noise)


def _coarse_step(ladder: Ladder) -> float | None:
    """The step of the search [s], `None` where it is that of the fits."""
    searched, fitted = (fit.problem.drives[0].run.step for fit in (ladder.first.fit, ladder.rungs[0].fit))
    return searched if searched > fitted else None


def _fall(ladder: Ladder) -> Picture | None:
    if len(ladder.rungs) == 1:
        return None
    return picture(captions.of_ladder(ladder), ladder_curve(ladder, noise_alone(ladder.best.fit)))


def _maps(given: Comparison, best: Comparison | None, which: str) -> Picture | None:
    figures = error_maps(given, best)
    return picture(captions.of_maps(given, best, which), *figures) if figures else None


def _ranking(ladder: Ladder) -> Picture | None:
    if not candidates_shown(ladder.first):
        return None
    added = frozenset((rung.effect, rung.at) for rung in ladder.rungs if rung.effect and rung.at)
    return picture(captions.of_ranking(ladder), ranking(ladder.first, added))
