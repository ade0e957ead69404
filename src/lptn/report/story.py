"""The whole story on one page: log, fit, where it fails, what is missing, what proves it."""

from __future__ import annotations

from collections.abc import Sequence

from lptn.compare import Comparison, predict
from lptn.diagnose.confusable import confusability
from lptn.diagnose.detectable import smallest
from lptn.evidence import Evidence, Part
from lptn.identify import Fit
from lptn.ladder import Ladder
from lptn.report import captions
from lptn.report.confusion import confusion
from lptn.report.detectability import detectability
from lptn.report.heat_story import heat_line_picture, heat_map_picture, heat_story, hiding
from lptn.report.heatmap import error_maps
from lptn.report.in_short import Proposal, in_short
from lptn.report.ladder_curve import ladder_curve
from lptn.report.node_time import error_fields, node_time_map
from lptn.report.page import Picture, picture, render
from lptn.report.ranking import candidates_shown, ranking
from lptn.report.tables import data_table, ladder_table, node_table, parameter_table, refit_table
from lptn.report.text import for_people
from lptn.report.timeseries import predictions_figure
from lptn.report.words import fitted_in_words, next_step, noise_alone, story_in_words

_FEW = 12  # parameters that may stand before the story
_PROOF = {
    "held-out": "Proof: the held-out runs",
    "proof": "Proof: runs that chose nothing",
    "fitted": "Measured against predicted, on the fitted runs only",
}
_PALE = 5.0  # multiples of the noise that the colours of errors reach at least


def story_html(
    ladder: Ladder,
    data: Evidence,
    title: str,
    commands: Sequence[str] = (),
    proposal: Proposal | None = None,
) -> str:
    """One self-contained HTML page that tells what was found.

    Args:
        ladder: the result of `lptn.ladder.improve`.
        data: the runs it was given.
        title: heads the page, such as the model's name.
        commands: what was typed, shown at the end.
        proposal: of the next experiment, where one was worked out.

    Returns:
        HTML text; the same arguments give the same text.
    """
    which, parts = _shown(data)
    given = _compared(ladder.rungs[0].fit, parts)
    best = _compared(ladder.best.fit, parts) if len(ladder.rungs) > 1 else None
    predictions = captions.of_predictions(given, best, data, which)
    heat = heat_story(ladder)
    return render(
        "story.html.j2",
        title=title,
        verdict=ladder.verdict,
        short=[(label, for_people(text)) for label, text in in_short(ladder, heat, proposal)],
        words=story_in_words(ladder, data),
        ladder=ladder_table(ladder),
        fall=_fall(ladder),
        maps=_maps(given, best, which),
        errors=_error_map(given, best, which),
        nodes=node_table(given, best),
        which=which,
        heat_map=heat_map_picture(heat),
        heat_line=heat_line_picture(heat),
        hiding=hiding(heat),
        predictions=picture(predictions, predictions_figure(given, best)),
        ranking=_ranking(ladder),
        refits=refit_table(ladder),
        coarse=_coarse_step(ladder),
        confusion=_confusion(ladder),
        detectability=_detectability(ladder),
        heading=_PROOF[which],
        proposal=for_people(proposal.text()) if proposal else None,
        next=next_step(ladder),
        fitted=fitted_in_words(ladder),
        few=_FEW,
        parameters_given=parameter_table(ladder.rungs[0].fit, ladder.rungs[0].fit),
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


def _error_map(given: Comparison, best: Comparison | None, which: str) -> Picture:
    noise = max(given.floor(node) for node in given.model.nodes)
    fields = error_fields(given), error_fields(best) if best else []
    return picture(captions.of_error_map(which), node_time_map(*fields, "error [K]", _PALE * noise))


def _confusion(ladder: Ladder) -> Picture | None:
    found = confusability(ladder.first.scores)
    return picture(captions.of_confusion(found), confusion(found)) if len(found.keys) > 1 else None


def _detectability(ladder: Ladder) -> Picture | None:
    found = smallest(ladder.first.scores)
    return picture(captions.of_detectability(found), detectability(found)) if found else None


def _ranking(ladder: Ladder) -> Picture | None:
    if not candidates_shown(ladder.first):
        return None
    added = frozenset((rung.effect, rung.at) for rung in ladder.rungs if rung.effect and rung.at)
    return picture(captions.of_ranking(ladder), ranking(ladder.first, added))
