"""What to do after a diagnosis: the next experiment, where to look, what could not have been seen."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from math import log, log1p, sqrt

from scipy.special import ndtri

from lptn.basics.words import short_size
from lptn.diagnose.answers import Report
from lptn.diagnose.candidates import OCCAM, USUAL, log_priors
from lptn.diagnose.diagnosis import Diagnosis
from lptn.diagnose.evidence import Evidence, FirstOrder
from lptn.diagnose.experiment import POWER, Experiment, propose
from lptn.diagnose.learned_heat import LearnedCurve, learned_curve
from lptn.diagnose.refits import unless_interrupted
from lptn.diagnose.runs_that_differ import RunDifference, runs_that_differ
from lptn.diagnose.unexplained_heat import HeatPeak, WanderingHeat, stretches
from lptn.identify.data import DataSplit, Segment
from lptn.identify.fitting import Fit
from lptn.identify.validation import fit_segments, holdout_errors
from lptn.logs.reading import ROWS_UNKNOWN


@dataclass(frozen=True)
class Detectable:
    """The smallest size of one effect at one place that these data would show, four times out of five.

    Args:
        effect: its key.
        at: its place.
        smallest: the size, in the amplitude's unit.
        unit: of the amplitude.
        share_of_typical: the size as a share of the typical one.
    """

    effect: str
    at: str
    smallest: float
    unit: str
    share_of_typical: float


def smallest(candidates: Sequence[FirstOrder]) -> list[Detectable]:
    """For each candidate the size that would be more probable than nothing, the easiest to see first.

    To first order, by the standard error that its size has beside all else (Laplace): the size at which the evidence
    outweighs the prior odds and the width of the prior, and what noise takes off in one log of five.

    Args:
        candidates: all that a model may lack, as `weighed` gives them.
    """
    sizes, priors = [], log_priors([one.candidate for one in candidates]).tolist()
    for one, prior in zip(candidates, priors, strict=True):
        typical, sides = one.candidate.typical, 2.0 if one.candidate.amplitude.one_sided else 1.0
        against = 0.5 * log1p((USUAL * typical / one.standard_error) ** 2) - log(sides) - prior
        size = (sqrt(2.0 * max(against, 0.0)) + float(ndtri(POWER))) * one.standard_error
        effect, at = one.candidate.key
        sizes.append(Detectable(effect, at, size, one.candidate.amplitude.unit, size / typical))
    return sorted(sizes, key=lambda limit: limit.share_of_typical)


@dataclass(frozen=True, repr=False)
class Advice:
    """What a diagnosis leaves to be done.

    Args:
        experiment: the run that best tells the names of one answer apart; `None` for one name, or where no run is
            possible.
        heat: each interval in which the last model significantly lacks heat or has too much, the clearest first.
        detectable: the smallest size of each effect that the data would show, the easiest to see first.
        differing: held-out runs in which one parameter seems to differ.
        learned: what the unexplained heat goes with, and the curve; `None` where all is explained, no heat is sure, or
            it goes with nothing that is logged.
        rows: what slow rows seem to be that nobody spoke of, and how to say so; empty where the data don't tell.
    """

    experiment: Experiment | None
    heat: list[HeatPeak]
    detectable: list[Detectable]
    differing: list[RunDifference]
    learned: LearnedCurve | None = None
    rows: str = ""

    def __repr__(self) -> str:
        return f"<Advice: {' '.join(self.sentences) or 'nothing to do'}>"

    @property
    def sentences(self) -> list[str]:
        """Sentences for people, the most urgent first; `heat` has every interval, not only the most significant."""
        sentences = [*([self.rows] if self.rows else []), *(difference.text() for difference in self.differing)]
        if self.heat:
            sentences.append(f"Unexplained heat, most significant {self.heat[0].text()}.")
        if self.learned is not None:
            sentences.append(self.learned.text())
        if self.experiment is not None:
            sentences.append(f"Next experiment: {self.experiment.text()}")
        return sentences

    def as_json(self) -> dict[str, object]:
        """The advice as other tools read it."""
        return {
            "experiment": self.experiment.as_json() if self.experiment else None,
            "rows": self.rows or None,
            "unexplained_heat": self.heat[0].text() if self.heat else None,
            "unexplained_stretches": [peak.as_json() for peak in self.heat],
            "learned_heat": self.learned.as_json() if self.learned else None,
            "runs_that_differ": [difference.as_json() for difference in self.differing],
            "detectable": [asdict(limit) for limit in self.detectable],
        }


def advise(first: Diagnosis, last: Diagnosis, data: DataSplit, report: Report = lambda _: None) -> Advice:
    """Work out what to do next.

    Args:
        first: of the model as given.
        last: of the model that it led to, or the same.
        data: the runs, in the steps of the search.
        report: called with a sentence on what is being done.
    """
    report("looking for unexplained heat, and for the next experiment")
    # A missing effect also shows in held-out runs: runs are compared only once all effects have been added.
    added = last is not first or first.verdict != "missing"
    heat = WanderingHeat(last.fit)
    return Advice(
        propose(first.rivals),
        stretches(heat.unexplained),
        smallest(last.weighed),
        runs_that_differ(last.fit, data.holdout) if added else [],
        learned_curve(first, last, data, heat),
        _rows_as_means(last.fit, data),
    )


def _rows_as_means(last: Fit, data: DataSplit) -> str:
    """Slow rows that were read as samples and are clearly more probable as means, in held-out runs as well.

    Half a row late is what a lag looks like, too, so that this is for those to decide who know the logger.
    """
    runs = [segment.run for segment in data.fit]
    if (note := next((note for run in runs for note in run.notes if note.startswith(ROWS_UNKNOWN)), None)) is None:
        return ""
    others = DataSplit(_as_means(data.fit), _as_means(data.holdout))
    samples, means = (unless_interrupted(fit_segments(last.model, own.fit, last.point)) for own in (data, others))
    base = Evidence(samples, (), held_out=data.holdout)
    if Evidence(means, (), beside=base, held_out=others.holdout).log_evidence - base.log_evidence < log(OCCAM):
        return ""
    words = [
        f"Read as means, these slow rows are met to {short_size(means.rmse)} K in place of {short_size(samples.rmse)} K"
    ]
    before, after = holdout_errors(samples, data.holdout), holdout_errors(means, others.holdout)
    if before and after:
        words.append(f"held-out ones to {short_size(after.rmse)} K in place of {short_size(before.rmse)} K")
    return f"{', '.join(words)}: {note.partition('; ')[2]}"


def _as_means(segments: Sequence[Segment]) -> tuple[Segment, ...]:
    """The same runs, with slow rows whose kind is not stated read as means."""
    return tuple(
        replace(one, run=replace(one.run, averaged=True))
        if any(note.startswith(ROWS_UNKNOWN) for note in one.run.notes)
        else one
        for one in segments
    )
