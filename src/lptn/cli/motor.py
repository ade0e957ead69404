"""The command `lptn motor`: a model file from a motor's drawing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter as Option

from lptn.cli.options import Json, OptionalOutput, check_outputs, write_beginning


def motor(
    geometry: Path | None = None,
    /,
    *,
    output: OptionalOutput = None,
    sample: Annotated[
        Literal["inrunner", "outrunner"] | None, Option(help="Kind of the sample drawing (inrunner by default).")
    ] = None,
    json: Json = None,
) -> None:
    """Make a model file from a motor's drawing.

    Without a drawing, print a drawing's file to begin with.

    Example: lptn motor drawing.toml -o motor.toml
    """
    from lptn.basics.files import write_whole
    from lptn.cli.terminal import print_file, write_json
    from lptn.model.file import parse_model
    from lptn.model.model import Model
    from lptn.robots import motor_drawing as drawings
    from lptn.robots.motor_model import model_text

    check_outputs(output, json, inputs=() if geometry is None else (geometry,))
    _check(geometry, sample, json)
    text = drawings.sample(sample or "inrunner") if geometry is None else model_text(drawings.load_geometry(geometry))
    if output is None:
        print_file(text)
    elif geometry is None:
        write_beginning(output, text)
    else:
        write_whole(output, text)
    if json is not None and geometry is not None:
        model = Model(parse_model(text, output or geometry).network)
        capacity = {name: float(model.values[model.network.capacities[name]]) for name in model.nodes}
        write_json(json, {"nodes": capacity, "inputs": model.inputs, "parameters": len(model.parameters)})


def _check(geometry: Path | None, sample: str | None, json: Path | None) -> None:
    """Options that would do nothing are mistakes."""
    from lptn.basics.errors import InputError

    if geometry is None:
        if json is not None:
            raise InputError("command line", "--json", "no drawing", "a drawing's file, whose model it can describe")
        return
    if sample is not None:
        raise InputError("command line", "--sample", f"{sample} beside a drawing", "one of the two")
