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
    from lptn.diagnose.diagnosis import Diagnosis, Verdict


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
    _show_heat(advice)
    write_json(json, diagnosis.as_json() | advice.as_json())


VERDICTS = {
    "adequate": "adequate",
    "missing": "missing something: the catalogue explains most of what the model gets wrong",
    "unexplained": "unexplained: wrong by more than noise, on fitted or held-out runs, and the catalogue does not "
    "explain most of it",
}
_FEW = 3  # rivals named in a sentence; all of them stand in the JSON and on the page


def show_diagnosis(diagnosis: Diagnosis) -> None:
    """Verdict, and what is missing."""
    from lptn.cli.terminal import show_table
    from lptn.effects.learned_heat import UNNAMED, goes_with
    from lptn.report.outcome import log_errors_in_words
    from lptn.report.text import kelvin, named, percent, size_told

    held_out = f", {kelvin(diagnosis.holdout.rmse)} on the held-out ones" if diagnosis.holdout else ""
    step = diagnosis.fit.problem.bound_runs[0].run.step
    lack = ", ".join(f"{node} {value:.2g}" for node, value in diagnosis.lack_of_fit.items())
    left = f": what is left is no more than {log_errors_in_words(diagnosis)}" if diagnosis.verdict == "adequate" else ""
    print(f"The model is {VERDICTS[diagnosis.verdict]}{left}.")
    print(f"RMSE {kelvin(diagnosis.fit.rmse)} on the fitted runs{held_out}, in steps of {step:g} s.")
    print(f"Misfit over one-minute means, 1 being the most that noise would leave: {lack}.")
    for one in diagnosis.learned:
        column = goes_with(one.effect, one.driven_by or one.at)
        print(f"Heat at {one.where} is {UNNAMED}{column}: learned, without a name.")
    if not diagnosis.steps:
        _show_that_nothing_helps(diagnosis)
        return
    rows = []
    for missing in diagnosis.steps:
        same = ", ".join(named(*key) for key in missing.indistinguishable)
        rows.append((*missing.key, size_told(missing, missing.fit), percent(missing.probability), same))
    show_table(("effect", "at", "size", ">probability", "or"), rows)
    one_run = any("@" in (step.at or "") for step in diagnosis.steps)
    print(f"at: * is everywhere.{' NODE@RUN is in that run alone.' if one_run else ''}")
    _show_errors_with_all(diagnosis)
    print("To add all of it and fit at full resolution: `lptn improve` with the same model and logs.")


def _show_that_nothing_helps(diagnosis: Diagnosis) -> None:
    """How probable it is by the fitted data that nothing is missing, and what else may be."""
    from lptn.diagnose.answers import NOTHING
    from lptn.report.text import percent

    shares = dict(diagnosis.probabilities)
    others = [f"{in_words([key])} {percent(share)}" for key, share in shares.items() if key != NOTHING][:_FEW]
    text = f"By the fitted data nothing that matters is missing with a probability of {percent(shares[NOTHING])}"
    print(f"{text}; next: {', '.join(others)}." if others else f"{text}.")


def _show_errors_with_all(diagnosis: Diagnosis) -> None:
    """How much better the model is with all that was found."""
    from lptn.report.text import kelvin

    last = diagnosis.steps[-1]
    before, after = diagnosis.fit.rmse, last.fit.rmse
    text = f"With all of it the RMSE goes from {kelvin(before)} to {kelvin(after)} on the fitted runs"
    if diagnosis.holdout and last.holdout:
        text += f", from {kelvin(diagnosis.holdout.rmse)} to {kelvin(last.holdout.rmse)} on the held-out ones"
    print(f"{text}.")


def show_advice(advice: Advice, verdict: Verdict) -> None:
    """What to do next, a sentence or two each.

    Args:
        advice: what to do.
        verdict: on the model that it was worked out for.
    """
    from lptn.report.text import for_people

    for sentence in advice.sentences:
        print(for_people(sentence))
    if advice.heat and verdict == "adequate":
        print(
            "That is too little to tell on the fitted runs as a whole, where the model is wrong by no more than noise."
        )


_MOST_STRETCHES = 8  # of unexplained heat, on the terminal


def _show_heat(advice: Advice) -> None:
    """Every stretch in which heat is unexplained, where there are several."""
    from lptn.cli.terminal import show_table
    from lptn.report.tables import stretch_table

    if len(advice.heat) > 1:
        table = stretch_table(advice.heat[:_MOST_STRETCHES])
        show_table(table.columns, table.rows, "Heat that nothing explains, the surest first (+: the model lacks it):")
        if len(advice.heat) > _MOST_STRETCHES:
            print(f"and {len(advice.heat) - _MOST_STRETCHES} more, in the JSON")


def in_words(keys: Sequence[tuple[str, str]]) -> str:
    """Effects and their places; of many the first few."""
    from lptn.report.text import few, named

    return few([named(*key) for key in keys], _FEW)
