"""The command `lptn fit`: the free parameters of a model, from logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from lptn.basics.errors import InputError
from lptn.basics.words import FEW
from lptn.cli import options
from lptn.cli.terminal import is_quiet, progress, show_table, show_written, write_json

if TYPE_CHECKING:
    from lptn.identify.fitting import Checkpoint


def fit(
    model: Path,
    /,
    *logs: Path,
    output: options.OptionalOutput = None,
    held: options.HeldOut = options.HELD_OUT,
    symmetry_penalty: options.SymmetryPenalty = 0.0,
    details: options.Details = False,
    json: options.Json = None,
) -> None:
    """Fit the free parameters of a model.

    Ctrl-C keeps the best point so far; the same command continues from it.

    Example: lptn fit leg.toml monday.parquet --holdout friday.parquet -o fitted.toml
    """
    options.needs_logs(logs)
    holdout = held.holdout or []
    options.check_outputs(output, json, inputs=(*logs, *holdout))
    options.check_outputs(json, inputs=(model,))  # only the fitted model may take its place
    options.check_inputs(model, *logs, *holdout)
    from lptn.identify.fitting import Checkpoint, fingerprint_of
    from lptn.report.narrative import fit_narrative
    from lptn.report.tables import parameter_table
    from lptn.report.text import kelvin
    from lptn.study import Study

    with progress("reading"):
        study = Study(model, logs, holdout, holdout_after=held.holdout_after, columns=held.texts)
    given, segments = study.model, study.data.fit
    if not given.free:
        raise InputError(model, "parameters", "none that is free", "one at least without fixed = true")
    digests = [(segment.run.name, segment.run.fingerprint) for segment in segments]
    text, choices = study.file.text, {"map": held.texts, "holdout_after": held.holdout_after}

    def checkpoint(penalty: float) -> Checkpoint:
        kept = Checkpoint(fingerprint_of(text, digests, choices | {"mirror_weight": penalty}))
        if kept.load(given, len(segments)) is not None:
            print("This fit was stopped before; it continues from the best saved point.")
        return kept

    with progress("fitting"):
        done = study.fit(symmetry_penalty=symmetry_penalty, checkpoint=checkpoint)
    held_out, most, trials = study.steps[-1].holdout, None if details else FEW, study.symmetry_trials
    print(fit_narrative(study.steps[-1], most))
    if not is_quiet():
        if trials:
            rows = [(f"{one.symmetry_penalty:g}", kelvin(one.fit.rmse), kelvin(one.holdout.rmse)) for one in trials]
            show_table((">symmetry penalty", ">fit", ">held out"), rows)
        if most is not None and len(done.free) > most:
            print(f"The {most} least certain of {len(done.free)} parameters:")
        table = parameter_table(done, most=most)
        kept = [place for place, head in enumerate(table.columns) if head != "what it is"]
        show_table([table.columns[place] for place in kept], [[row[place] for place in kept] for row in table.rows])
    if output is not None:
        study.save(output)
    show_written({"the fitted model": output})
    tried = [{"weight": trial.symmetry_penalty, "rmse_holdout": trial.holdout.rmse} for trial in trials]
    more = {"rmse_holdout": held_out.rmse if held_out else None, "symmetry_trials": tried}
    write_json(json, done.as_json() | more)
