"""The command `lptn diagnose`: which effect is missing, where, how sure, and what else would look the same."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from lptn.cli.options import (
    AmbientError,
    Holdout,
    HoldoutAfter,
    Jobs,
    Json,
    Map,
    Rate,
    SurfaceError,
    TorqueError,
    check_inputs,
    check_outputs,
    column_options,
    executor_of,
    needs_logs,
)

if TYPE_CHECKING:
    from lptn.diagnose.advice import Advice
    from lptn.diagnose.answers import Step
    from lptn.diagnose.diagnosis import Diagnosis, Verdict
    from lptn.diagnose.runs_that_differ import RunDifference
    from lptn.identify.fitting import Fit


def diagnose(
    model: Path,
    /,
    *logs: Path,
    holdout: Holdout = None,
    holdout_after: HoldoutAfter = None,
    ambient_error: AmbientError = None,
    torque_error: TorqueError = None,
    surface_error: SurfaceError = None,
    json: Json = None,
    jobs: Jobs = 1,
    map: Map = None,  # noqa: A002 - the option's name
    rate: Rate = None,
) -> None:
    """Say which effect is missing, where, how sure, and what else would look the same.

    Example: lptn diagnose leg.toml monday.parquet --holdout friday.parquet --json found.json
    """
    needs_logs(logs)
    check_outputs(json, inputs=(model, *logs, *(holdout or ())))
    check_inputs(model, *logs, *(holdout or ()))
    from lptn.cli.terminal import progress, write_json
    from lptn.study import Study

    with progress("reading"), executor_of(jobs) as executor:
        study = Study(
            model,
            logs,
            holdout or (),
            holdout_after=holdout_after,
            columns=column_options(map, rate),
            ambient_error=ambient_error,
            torque_error=torque_error,
            surface_error=surface_error,
            executor=executor,
        )
        diagnosis, advice = study.diagnose(), study.advise()
    show_diagnosis(diagnosis)
    show_advice(advice, diagnosis.verdict)
    write_json(json, diagnosis.as_json() | advice.as_json())


VERDICTS = {
    "adequate": "adequate: what is left is no more than the sensors' noise",
    "missing": "missing something: the catalogue explains most of what the model gets wrong",
    "unexplained": "unexplained: the model is wrong by more than noise, on fitted or held-out runs, and the catalogue "
    "explains little of it",
}
_FEW = 3  # rivals named in a sentence; all of them stand in the JSON and on the page


def show_diagnosis(diagnosis: Diagnosis) -> None:
    """Verdict, and the candidates that were refitted."""
    from lptn.cli.terminal import show_table
    from lptn.report.shown import noise_alone
    from lptn.report.tables import FAR
    from lptn.report.text import kelvin, percent

    held_out = f", {kelvin(diagnosis.holdout.rmse)} on the held-out ones" if diagnosis.holdout else ""
    step = diagnosis.fit.problem.bound_runs[0].run.step
    lack = ", ".join(f"{node} {value:.2g}" for node, value in diagnosis.scores.lack_of_fit.items())
    print(f"The model is {VERDICTS[diagnosis.verdict]}.")
    noise = noise_alone(diagnosis.fit)
    if diagnosis.verdict == "adequate" and diagnosis.holdout and diagnosis.holdout.rmse > FAR * noise:
        print(f"That holds for the fitted runs. The held-out ones are off by more than noise ({kelvin(noise, 2)}):")
        print("they hold something that the fitted runs do not. Fit on runs like them as well.")
    print(f"RMSE {kelvin(diagnosis.fit.rmse)} on the fitted runs{held_out}, in steps of {step:g} s.")
    print(f"Misfit over one-minute means, 1 being the most that noise would leave: {lack}.")
    show_what_runs_have_of_their_own(diagnosis.fit, diagnosis.differing)
    if not diagnosis.helpful:
        _show_that_nothing_helps(diagnosis)
        return
    if diagnosis.verdict == "missing":
        _show_first(diagnosis)
    ranks = {finding.key: str(rank) for rank, finding in enumerate(diagnosis.helpful, start=1)}
    rows = []
    for finding in diagnosis.helpful:
        errors = kelvin(finding.fit.rmse), kelvin(finding.holdout.rmse if finding.holdout else None)
        chance = f"{'≤ ' if _is_finest(diagnosis, finding) else ''}{finding.p_value:.2g}"
        same = " ".join(ranks[key] for key in finding.indistinguishable if key in ranks)
        rows.append((ranks[finding.key], *finding.key, *errors, chance, percent(finding.probability), same))
    show_table(("rank", "effect", "at", ">fit", ">held out", ">p", ">probability", "indistinguishable from"), rows)
    print("fit, held out: RMSE once the effect is added. p: how often chance alone would score as high.")
    print("probability: of being what is missing, if one of these is, by the fitted runs and by what is usual.")
    one_run = any("@" in at for _, at in ranks)
    print(f"at: * is everywhere.{' NODE@RUN is in that run alone.' if one_run else ''} The last column names ranks.")
    if diagnosis.verdict == "missing":
        print("To add it, fit again, and look for more: `lptn improve` with the same model and logs.")


def _show_that_nothing_helps(diagnosis: Diagnosis) -> None:
    """How probable it is by the fitted data that nothing is missing, and what else may be."""
    from lptn.diagnose.answers import NOTHING
    from lptn.report.text import percent

    shares = dict(diagnosis.probabilities)
    if diagnosis.refits or not shares:
        return
    others = [f"{in_words([key])} {percent(share)}" for key, share in shares.items() if key != NOTHING][:_FEW]
    text = f"By the fitted data nothing that matters is missing with a probability of {percent(shares[NOTHING])}"
    print(f"{text}; next: {', '.join(others)}." if others else f"{text}.")


def _show_first(diagnosis: Diagnosis) -> None:
    """The first answer in words: what, where, how much better, how sure."""
    from lptn.report.text import kelvin

    first = diagnosis.helpful[0]
    text = f"Missing first of all: {in_words([first.key])}. With it the RMSE goes from {kelvin(diagnosis.fit.rmse)} to "
    text += f"{kelvin(first.fit.rmse)} on the fitted runs"
    if diagnosis.holdout and first.holdout:
        text += f", from {kelvin(diagnosis.holdout.rmse)} to {kelvin(first.holdout.rmse)} on the held-out ones"
    at_most = "at most " if _is_finest(diagnosis, first) else ""
    text += f". Chance alone would score as high in {at_most}{100 * first.p_value:.2g} % of logs; "
    same = f"these data can't tell it from {in_words(first.indistinguishable)}" if first.indistinguishable else ""
    print(f"{text}{same or 'nothing else in the catalogue explains them as well'}.")


def _is_finest(diagnosis: Diagnosis, finding: Step) -> bool:
    """Whether none of the simulated logs scored as much, so that the share by chance is only an upper bound."""
    return finding.p_value <= (1 + 1e-9) / (1 + len(diagnosis.scores.null_gains))


def show_what_runs_have_of_their_own(
    fit: Fit, differing: Sequence[RunDifference], as_logged: str = "`lptn compare` does without."
) -> None:
    """Which errors each run may have, and which held-out runs a parameter of their own, fitted to each alone.

    Args:
        fit: of the model.
        differing: held-out runs with a parameter of their own.
        as_logged: what to say of predictions without.
    """
    from lptn.basics.words import listed
    from lptn.diagnose.runs_that_differ import nuisances_at_limit
    from lptn.report.text import nuisances_in_words

    for difference in differing:
        print(
            f"{difference.run} is predicted with one parameter of its own, fitted on it; "
            "it judges the rest of the model."
        )
    errors = nuisances_in_words(fit.model)
    if errors:
        print(
            f"Each run, held-out ones too, may have {errors} (standard deviations; at most twice that): fitted to "
            f"that run alone. {as_logged}"
        )
    at_limit = [nuisance.text for nuisance in nuisances_at_limit(fit)]
    if at_limit:
        told, more = listed(at_limit), len(at_limit) - _MOST_AT_LIMIT
        if more > 0:
            told = f"{'; '.join(at_limit[:_MOST_AT_LIMIT])}; and {more} more, in the JSON"
        print(f"That is not enough: {told}. These runs differ, or the model is wrong in another way.")


_MOST_AT_LIMIT = 3  # errors of runs that end at their limits, on the terminal; the JSON has all
_MOST_STRETCHES = 8  # of unexplained heat, on the terminal


def show_advice(advice: Advice, verdict: Verdict) -> None:
    """What to do next, a sentence or two each, and every stretch of unexplained heat.

    Args:
        advice: what to do.
        verdict: on the model that it was worked out for.
    """
    from lptn.cli.terminal import show_table
    from lptn.report.tables import stretch_table
    from lptn.report.text import for_people

    for sentence in advice.sentences:
        print(for_people(sentence))
    if advice.heat and verdict == "adequate":
        print(
            "That is too little to tell on the fitted runs as a whole, where the model is wrong by no more than noise."
        )
    if len(advice.heat) > 1:
        table = stretch_table(advice.heat[:_MOST_STRETCHES])
        show_table(table.columns, table.rows, "Heat that nothing explains, the surest first (+: the model lacks it):")
        if len(advice.heat) > _MOST_STRETCHES:
            print(f"and {len(advice.heat) - _MOST_STRETCHES} more, in the JSON")


def in_words(keys: Sequence[tuple[str, str]]) -> str:
    """Effects and their places; of many the first few."""
    from lptn.report.text import few, named

    return few([named(*key) for key in keys], _FEW)
