"""The command `lptn diagnose`: which effect is missing, where, how sure, and what else would look the same."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from lptn import report
from lptn.basics.words import few
from lptn.cli import options
from lptn.cli.terminal import is_quiet, progress, show_table, write_json

if TYPE_CHECKING:
    from lptn.diagnose.advice import Advice
    from lptn.diagnose.diagnosis import Diagnosis


def diagnose(
    model: Path,
    /,
    *logs: Path,
    data: options.Data = options.DATA,
    details: options.Details = False,
    json: options.Json = None,
    plot: options.Picture = None,
    jobs: options.Jobs = 1,
) -> None:
    """Name the effects that are missing, and where.

    With size, probability, and what the data can't distinguish from them.

    Example: lptn diagnose leg.toml monday.parquet --holdout friday.parquet --json found.json
    """
    options.needs_logs(logs)
    options.check_outputs(json, pictures=[plot], inputs=(model, *logs, *(data.holdout or ())))
    options.check_inputs(model, *logs, *(data.holdout or ()))
    from lptn.report.sentences import Narrative

    with progress("reading"), options.executor_of(jobs) as executor:
        study = data.opening(model, logs).study(executor)
        diagnosis, advice = study.diagnose(), study.advise()
        said = study.narrative()
    if is_quiet():
        print(said)
    else:
        print(said[0])
        show_answers(diagnosis)
        print(Narrative(sentence for sentence in said[1:] if sentence.label not in IN_TABLE))
    if details:
        show_advice(advice)
    write_json(json, diagnosis.as_json() | advice.as_json())
    options.write_figure(plot, lambda: report.diagnosis_figure(diagnosis, study.shown))


IN_TABLE = ("Findings", "Best candidates", "Structure")


def show_answers(diagnosis: Diagnosis) -> None:
    """A table of what is missing, by the names that `lptn add` takes; without answers, how probable none is."""
    from lptn.diagnose.answers import NOTHING
    from lptn.report.text import named, percent, size_text

    ratios = ", ".join(f"{node} {value:.2g}×" for node, value in diagnosis.lack_of_fit.items())
    print(f"Misfit / noise, of one-minute means: {ratios}.")
    if not diagnosis.steps:
        shares = dict(diagnosis.probabilities)
        others = [f"{named(*key)} {percent(share)}" for key, share in shares.items() if key != NOTHING]
        nothing = "nothing is missing" if diagnosis.verdict == "adequate" else "no effect of the catalogue explains it"
        text = f"Probability that {nothing}, by the fit data: {percent(shares[NOTHING])}"
        print(f"{text}; next: {few(others)}." if others else f"{text}.")
        return
    rows = []
    for missing in sorted(diagnosis.steps, key=lambda step: -step.probability):
        same = ", ".join(f"{effect} at {place}" for effect, place in missing.indistinguishable)
        rows.append((*missing.key, size_text(missing, missing.fit), percent(missing.probability), same))
    show_table(("effect", "at", "size", ">probability", "or"), rows)
    places = " ".join(step.at or "" for step in diagnosis.steps)
    meaning = [
        words for sign, words in (("*", "* is everywhere."), ("@", "NODE@RUN is in that run alone.")) if sign in places
    ]
    if meaning:
        print("at:", *meaning)


_MOST_SEGMENTS = 8  # of unexplained heat, on the terminal


def show_advice(advice: Advice) -> None:
    """What to do next, and every segment in which heat is unexplained."""
    from lptn.report.tables import stretch_table
    from lptn.report.text import for_people

    shown = replace(advice, heat=[]) if len(advice.heat) > 1 else advice  # several are in the table
    for text in shown.sentences:
        print(for_people(text))
    if len(advice.heat) > 1:
        table = stretch_table(advice.heat[:_MOST_SEGMENTS])
        show_table(*table, "Unexplained heat, most significant first (+: the model lacks it):")
        if len(advice.heat) > _MOST_SEGMENTS:
            print(f"and {len(advice.heat) - _MOST_SEGMENTS} more, in the JSON")
