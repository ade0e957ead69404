"""The command `lptn motor`: a model file from a motor's drawing."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from cyclopts import Parameter as Option

from lptn.cli_support import Json, OptionalOutput, check_outputs


def motor(
    geometry: Path | None = None,
    /,
    *,
    output: OptionalOutput = None,
    sample: Annotated[Literal["inrunner", "outrunner"], Option(help="Geometry file that is printed without one.")] = (
        "inrunner"
    ),
    json: Json = None,
) -> None:
    """Make a model file from a motor's drawing; without one, print a drawing's file to begin with.

    Example: lptn motor drawing.toml -o motor.toml
    """
    from lptn.files import write_whole
    from lptn.model import Model
    from lptn.model_file import parse_model
    from lptn.motor_geometry import geometry as drawings
    from lptn.motor_geometry.template import model_text
    from lptn.terminal import write_json

    check_outputs(output, json)
    text = drawings.sample(sample) if geometry is None else model_text(drawings.load_geometry(geometry))
    if output is None:
        print(text, end="")
    else:
        write_whole(output, text)
    if json is not None and geometry is not None:
        model = Model(parse_model(text, output or geometry).network)
        capacity = {name: float(model.values[model.network.capacities[name]]) for name in model.nodes}
        write_json(json, {"nodes": capacity, "inputs": model.inputs, "parameters": len(model.unknowns)})
