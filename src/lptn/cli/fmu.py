"""The commands `lptn fmu` and `lptn cosim`."""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, cast

from cyclopts import Parameter as Option

from lptn.basics.errors import InputError
from lptn.cli.options import Json, Map, Output, check_outputs, needs_logs

if TYPE_CHECKING:
    from lptn.fmu.compile import Compiler
    from lptn.fmu.cosim import Cosimulation
    from lptn.fmu.exporter import Exported


Platforms = Annotated[
    str | None,
    Option(
        name="--platforms",
        help="Comma-separated: linux64, linux-aarch64, win64, darwin-x86_64, darwin-arm64; source for sources alone. "
        "By default this machine.",
    ),
]
Limit = Annotated[
    list[str] | None,
    Option(name="--limit", help="Limit in degC, of all nodes or as NODE=90; may be given again.", negative=""),
]
Admissible = Annotated[
    bool,
    Option(
        name="--admissible",
        help="Add each joint's admissible torque for 10 s, 60 s, 300 s and for ever as outputs; it keeps the --limit.",
        negative="",
    ),
]
CurrentLimit = Annotated[
    list[str] | None,
    Option(
        name="--current-limit",
        help="With --admissible: limit in A, of all joints or as JOINT=30; may be given again.",
        negative="",
    ),
]
Outputs = Annotated[
    Path | None,
    Option(name=["--output", "-o"], help="File to write all outputs at the ends of steps to: .csv or .parquet."),
]


def fmu(
    model: Path,
    /,
    *,
    output: Output,
    fmi: Annotated[int, Option(help="Version of the standard: 2 or 3.")] = 3,
    platforms: Platforms = None,
    solver: Annotated[str, Option(help="Of Co-Simulation: rk4, or ros2 for stiff networks.")] = "rk4",
    step: Annotated[float | None, Option(help="Longest inner step in s; by default one that fits the model.")] = None,
    limit: Limit = None,
    admissible: Admissible = False,
    current_limit: CurrentLimit = None,
    compiler: Annotated[str, Option(help="auto, zig or cc.")] = "auto",
    json: Json = None,
) -> None:
    """Write a model as an FMU: Model Exchange and Co-Simulation in native code, for other people's simulators.

    Example: lptn fmu fitted.toml -o leg.fmu --fmi 3 --platforms linux64,win64
    """
    from lptn.cli.terminal import progress, write_json
    from lptn.fmu.exporter import export

    check_outputs(output, json)
    check_outputs(json, inputs=(model,))
    if compiler not in ("auto", "zig", "cc"):
        raise InputError("command line", "--compiler", f"'{compiler}'", "auto, zig or cc")
    if current_limit and not admissible:
        raise InputError("command line", "--current-limit", "no --admissible", "both")
    with progress("compiling"):
        done = export(
            model,
            output,
            fmi=fmi,
            platforms=_platforms(platforms),
            solver=solver,
            step=step,
            limits=_limits(limit),
            admissible=admissible,
            current_limits=_limits(current_limit, "--current-limit", "A", "JOINT"),
            compiler=cast("Compiler", compiler),
        )
    _show_export(done)
    write_json(json, done.as_json())


def cosim(
    fmu: Path,  # the file, not the command
    /,
    *logs: Path,
    model: Annotated[Path | None, Option(help="Model file to compare with; by default the one inside the FMU.")] = None,
    ramps: Annotated[
        bool, Option(help="The FMU's inputs go in straight lines from sample to sample; the model's hold.", negative="")
    ] = False,
    trust: Annotated[bool, Option(help="Run the native code of an FMU from elsewhere.", negative="")] = False,
    output: Outputs = None,
    json: Json = None,
    map: Map = None,  # noqa: A002
) -> None:
    """Drive an FMU with logs; compare with its model and with what was measured.

    Example: lptn cosim leg.fmu friday.parquet -o outputs.csv
    """
    from lptn.cli.terminal import progress, write_json
    from lptn.fmu.cosim import cosimulate
    from lptn.fmu.session import FmuError

    needs_logs(logs)
    check_outputs(output, json, inputs=(fmu, *logs, *(() if model is None else (model,))))
    _check_table(output)
    pairs = dict(text.partition("=")[::2] for text in map or ())
    try:
        with progress("co-simulating"):
            done = cosimulate(fmu, logs, model=model, mapped=pairs, ramps=ramps, trust=trust)
    except FmuError as error:
        raise InputError(fmu, "FMU", str(error), "inputs that it takes") from error
    _show_cosimulation(done)
    write_json(json, done.as_json())
    if output is not None:
        _write_outputs(done, output)


def _platforms(text: str | None) -> list[str] | None:
    if text is None:
        return None
    return [name.strip() for name in text.split(",") if name.strip() != "source"]


def _limits(
    texts: list[str] | None, option: str = "--limit", unit: str = "degC", place: str = "NODE"
) -> dict[str, float] | None:
    limits = {}
    for text in texts or ():
        node, equals, value = text.rpartition("=")
        try:
            limits[node if equals else "*"] = float(value)
        except ValueError as error:
            raise InputError("command line", option, f"'{text}'", f"a number in {unit}, or {place}=number") from error
    return limits or None


def _show_export(done: Exported) -> None:
    sizes = done.as_json()
    platforms = ", ".join(done.platforms) or "no binaries: sources alone"
    print(f"{done.path}: FMI {done.fmi}, {done.size / 1024:.0f} kB, {platforms}")
    print(", ".join(f"{sizes[kind]} {kind}" for kind in ("states", "inputs", "parameters", "outputs")))
    steps = done.integration
    print(f"Co-Simulation: {steps.solver}, inner steps of at most {steps.step:g} s")
    print(f"Fastest time constant: {steps.fastest:.3g} s")
    for note in steps.notes:
        print(f"Note: {note}.")


def _show_cosimulation(done: Cosimulation) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(
        box=None,
        header_style="bold",
        pad_edge=False,
        title="error = predicted by the FMU − measured",
        title_justify="left",
    )
    for column in ("run", "node", "RMSE", "max |error|", "mean error", "max |FMU − model|"):
        table.add_column(column, justify="left" if column in ("run", "node") else "right", overflow="fold")
    for run in done.runs:
        for row, node in enumerate(run.nodes):
            errors, from_model = run.errors(row), run.from_model(row)
            cells = ["not measured", "", ""]
            if errors.count:
                cells = [f"{errors.rmse:.3g} K", f"{errors.max:.3g} K", f"{errors.mean:+.3g} K"]
            table.add_row(run.run.name, node, *cells, "" if from_model is None else f"{from_model:.2g} K")
    out = Console()
    out.print(table)
    steps, seconds = sum(len(run.run) for run in done.runs), sum(run.seconds for run in done.runs)
    simulated = sum(len(run.run) * run.run.step for run in done.runs)
    speed = simulated / max(seconds, 1e-9)
    out.print(f"FMI {done.fmi}: {steps} steps in {seconds:.3g} s, {speed:.3g} times as fast as the robot.")


def _check_table(path: Path | None) -> None:
    if path is not None and path.suffix not in (".csv", ".parquet"):
        raise InputError(path, "--output", f"a file name ending in '{path.suffix}'", "one ending in .csv or .parquet")


def _write_outputs(done: Cosimulation, path: Path) -> None:
    """All outputs at the ends of steps as a log, temperatures in degC."""
    import pandas as pd

    from lptn.basics.files import write_whole
    from lptn.fmu.variables import ZERO_CELSIUS, is_temperature, to_column

    tables = []
    for run in done.runs:
        columns = {"time": run.run.time + run.run.step}
        for name, values in run.outputs.items():
            columns[to_column(name)] = values - ZERO_CELSIUS if is_temperature(name) else values
        tables.append(pd.DataFrame(columns))
    table = pd.concat(tables, ignore_index=True)
    if path.suffix == ".csv":
        write_whole(path, table.to_csv(index=False, float_format="%.9g"))
    else:
        buffer = io.BytesIO()
        table.to_parquet(buffer, index=False)
        write_whole(path, buffer.getvalue())
