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
    check_outputs,
    executor_of,
    needs_logs,
)

if TYPE_CHECKING:
    from lptn.diagnose.advice import Advice
    from lptn.diagnose.diagnosis import Diagnosis, Step
    from lptn.diagnose.unexplained_heat import HeatPeak
    from lptn.identify.fitting import Fit


def diagnose(
    model: Path,
    /,
    *logs: Path,
    holdout: Holdout = None,
    holdout_after: HoldoutAfter = None,
    ambient_error: AmbientError = 0.0,
    json: Json = None,
    jobs: Jobs = 1,
    map: Map = None,  # noqa: A002 - the option's name
) -> None:
    """Say which effect is missing, where, how sure, and what else would look the same.

    Example: lptn diagnose leg.toml monday.parquet --holdout friday.parquet --json found.json
    """
    from lptn.cli.terminal import progress, write_json
    from lptn.study import Study

    needs_logs(logs)
    check_outputs(json, inputs=(model, *logs, *(holdout or ())))
    with progress("reading"), executor_of(jobs) as executor:
        study = Study(
            model,
            logs,
            holdout or (),
            holdout_after=holdout_after,
            columns=map or (),
            ambient_error=ambient_error,
            executor=executor,
        )
        diagnosis, advice = study.diagnose(), study.advise()
        heat = study.unexplained_stretches()
    show_diagnosis(diagnosis)
    show_advice(advice, heat)
    write_json(json, diagnosis.as_json() | advice.as_json() | as_json(heat, diagnosis.refits))


VERDICTS = {
    "adequate": "adequate",
    "missing": "missing something: the catalogue explains most of what the model gets wrong",
    "unexplained": "unexplained",
}
_MOST_STRETCHES = 8  # of unexplained heat, on the terminal


def show_diagnosis(diagnosis: Diagnosis) -> None:
    """Verdict, and the candidates that were refitted."""
    from lptn.cli.terminal import show_table
    from lptn.report.text import capitalised, kelvin, percent
    from lptn.report.verdict import of_fitted_data

    step = diagnosis.fit.problem.bound_runs[0].run.step
    lack = ", ".join(f"{node} {value:.2g}" for node, value in diagnosis.scores.lack_of_fit.items())
    print(f"The model is {VERDICTS[diagnosis.verdict]}.")
    print(f"{capitalised(of_fitted_data(diagnosis.verdict, diagnosis, diagnosis.probabilities))}.")
    print(f"RMSE {kelvin(diagnosis.fit.rmse)} on the fitted runs, in steps of {step:g} s.")
    if diagnosis.holdout:
        print(f"Held-out runs: RMSE {kelvin(diagnosis.holdout.rmse)}; they decide nothing here.")
    print(f"Misfit over one-minute means, 1 being the most that noise would leave: {lack}.")
    show_ambient_bias(diagnosis.fit)
    if not diagnosis.helpful:
        return
    if diagnosis.verdict == "missing":
        _show_first(diagnosis)
    ranks = {finding.key: str(rank) for rank, finding in enumerate(diagnosis.helpful, start=1)}
    rows = []
    for finding in diagnosis.helpful:
        errors = kelvin(finding.fit.rmse), kelvin(finding.holdout.rmse if finding.holdout else None)
        same = " ".join(ranks[key] for key in finding.indistinguishable if key in ranks)
        rows.append((ranks[finding.key], *finding.key, *errors, percent(finding.probability), same))
    show_table(("rank", "effect", "at", ">fit", ">held out", ">probability", "indistinguishable from"), rows)
    print(
        "fit, held out: RMSE once the effect is added. probability: of being what is missing, by the fitted runs alone."
    )
    one_run = any("@" in at for _, at in ranks)
    print(f"at: * is everywhere.{' NODE@RUN is in that run alone.' if one_run else ''} The last column names ranks.")
    if diagnosis.verdict == "missing":
        print("To add it, fit again, and look for more: `lptn improve` with the same model and logs.")


def _show_first(diagnosis: Diagnosis) -> None:
    """The first answer in words: what, where, how sure, how plausible its size, how much better."""
    from lptn.report.text import kelvin, named
    from lptn.report.verdict import certainty, sizes_of

    first = diagnosis.helpful[0]
    print(f"Missing first of all: {named(*first.key)}; {certainty(first, diagnosis.probabilities)}.")
    size = sizes_of(first).get(first.key)
    if size:
        print(f"Its size: {size.text()}.")
    text = f"With it the RMSE goes from {kelvin(diagnosis.fit.rmse)} to {kelvin(first.fit.rmse)} on the fitted runs"
    if diagnosis.holdout and first.holdout:
        text += f", from {kelvin(diagnosis.holdout.rmse)} to {kelvin(first.holdout.rmse)} on the held-out ones"
    print(f"{text}.")


def show_ambient_bias(fit: Fit) -> None:
    """That each run has an error of its ambient sensor of its own, where it has."""
    spreads = {parameter.declared.prior for parameter in fit.model.parameters if parameter.declared.prior is not None}
    for spread in spreads:
        print(f"Each run, held-out ones too, may have its ambient sensor off by {spread:g} K (standard deviation).")


def show_advice(advice: Advice, heat: Sequence[HeatPeak]) -> None:
    """What to do next, a sentence or two each; before it, where and when heat is unexplained."""
    from lptn.cli.terminal import show_table
    from lptn.report.tables import stretch_table
    from lptn.report.text import for_people

    for differing in advice.differing:
        print(for_people(differing.text()))
    if heat:
        table = stretch_table(heat[:_MOST_STRETCHES])
        show_table(table.columns, table.rows, "Heat that nothing explains, the surest first (+: the model lacks it):")
        if len(heat) > _MOST_STRETCHES:
            print(f"and {len(heat) - _MOST_STRETCHES} more, in the JSON")
    if advice.experiment is not None:
        print(for_people(f"Next experiment: {advice.experiment.text()}"))


def as_json(heat: Sequence[HeatPeak], steps: Sequence[Step]) -> dict[str, object]:
    """All stretches of unexplained heat, and how plausible each step's size is, as other tools read them."""
    from lptn.report.verdict import sizes_of

    # An effect that a later step has too has its size from there.
    sizes = {key: size for step in steps for key, size in sizes_of(step).items() if key in {each.key for each in steps}}
    return {
        "unexplained_stretches": [each.as_json() for each in heat],
        "sizes": [size.as_json() for size in sizes.values()],
    }
