"""The command `lptn cosim`: an FMU driven by logs, beside its model and what was measured."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from lptn.basics.errors import InputError
from lptn.basics.tables import write_table
from lptn.cli import options
from lptn.cli.terminal import progress, show_table, write_json

if TYPE_CHECKING:
    from lptn.fmu.cosim import Cosimulation


def cosim(
    fmu: Path,  # the file, not the command
    /,
    *logs: Path,
    model: Path | None = None,
    ramps: bool = False,
    trust: bool = False,
    parameters: Path | None = None,
    output: Annotated[Path | None, options.WRITES] = None,
    details: options.Details = False,
    plot: options.Picture = None,
    json: options.Json = None,
    columns: options.Columns = options.COLUMNS,
) -> None:
    """Drive an FMU, or connected FMUs, with logs.

    Its outputs are compared with the model and with what was measured. FMUs are connected by an .ssd or .ssp file.
    For an FMU from elsewhere, --map says which column drives an input or is compared with an output.

    Example: lptn cosim leg.fmu friday.parquet -o outputs.csv --plot friday.png

    Example: lptn cosim motor.fmu friday.csv --map tau=torque.knee --map T_case=temperature.knee --trust

    Args:
        model: Model file to compare with; by default the one inside the FMU.
        ramps: Interpolate the FMU's inputs between samples; by default they are constant, as in the model.
        trust: Run native code of an FMU that was not exported on this machine.
        parameters: Parameter values for the FMU: an SSV file, as lptn fmu MODEL -o VALUES.ssv writes it.
        output: File for all outputs at the end of each step: .csv or .parquet.
    """
    options.needs_logs(logs)
    inputs = [fmu, *logs, *filter(None, (model, parameters))]
    if fmu.suffix == ".ssd":
        from lptn.fmu.ssp import opened_system

        with opened_system(fmu) as system:
            inputs += system.components.values()
    options.check_outputs(json, tables=[output], pictures=[plot], inputs=inputs)
    import pandas as pd

    from lptn.fmu.cosim import cosimulate
    from lptn.fmu.session import FmuError

    pairs = dict(text.partition("=")[::2] for text in columns.texts)
    try:
        with progress("co-simulating"):
            done = cosimulate(fmu, logs, model=model, mapped=pairs, ramps=ramps, trust=trust, parameters=parameters)
    except FmuError as error:
        raise InputError(fmu, "FMU", str(error), "inputs that it takes") from error
    _show_cosimulation(done, details)
    write_json(json, done.as_json())
    if output is not None:  # all outputs at the ends of steps as a log, temperatures in degC
        tables = [pd.DataFrame(dict(run.table)) for run in done.runs]
        write_table(output, pd.concat(tables, ignore_index=True), digits=9)
    if plot is not None:
        from lptn.fmu.figure import cosimulation_figure

        options.write_figure(plot, lambda: cosimulation_figure(done))


def _show_cosimulation(done: Cosimulation, details: bool) -> None:
    """Errors of the FMU by run and node, in the answer the largest first, and its speed."""
    from lptn.report.tables import error_cells

    rows: list[tuple[float, list[str]]] = []
    for run in done.runs:
        for row, node in enumerate(run.nodes):
            errors, from_model = run.errors(row), run.from_model(row)
            cells = error_cells(errors) if errors.count else ("not measured", "", "")
            beside = "" if from_model is None else f"{from_model:.2g} K"
            rows.append((errors.rmse if errors.count else 0.0, [run.run.name, node, *cells, beside]))
    if not details:
        rows.sort(key=lambda one: -one[0])
    heads = ("run", "node", ">RMSE", ">max |error|", ">mean error", ">max |FMU − model|")
    title, most = "error = predicted by the FMU − measured", None if details else options.ROWS
    show_table(heads, [cells for _, cells in rows], title, most)
    if kept := dict.fromkeys(name for run in done.runs for name in run.kept):
        print(f"Not in the log, so kept at their start values: {', '.join(kept)}.")
    steps, seconds = sum(len(run.run) for run in done.runs), sum(run.seconds for run in done.runs)
    simulated = sum(len(run.run) * run.run.step for run in done.runs)
    speed = simulated / max(seconds, 1e-9)
    print(f"FMI {done.fmi}: {steps} steps in {seconds:.2g} s, {speed:,.0f} times as fast as the robot.")
