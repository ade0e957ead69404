"""The command `lptn motor`: a model file from a motor's drawing."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from lptn.cli import options
from lptn.cli.terminal import write_json


def motor(
    geometry: Path | None = None,
    /,
    *,
    output: options.Beginning = None,
    sample: Literal["inrunner", "outrunner"] | None = None,
    json: options.Json = None,
) -> None:
    """Make a model file from a motor's drawing.

    Without a drawing, write a sample drawing, to be filled with your motor's numbers.

    Example: lptn motor drawing.toml -o motor.toml

    Args:
        sample: Kind of the sample drawing (inrunner by default).
    """
    from lptn.basics.errors import InputError
    from lptn.basics.words import count_of
    from lptn.model.file import parse_model
    from lptn.model.model import Model
    from lptn.robots import motor_drawing as drawings
    from lptn.robots.motor_model import model_text

    if geometry is None:
        if json is not None:
            raise InputError("command line", "--json", "no drawing", "a drawing's file, whose model it can describe")
        path = output or Path("drawing.toml")
        options.check_outputs(path)
        next_ = f"Put your motor's numbers into it, then: lptn motor {path} -o motor.toml"
        options.write_beginning(path, drawings.sample(sample or "inrunner"), f"an {sample or 'inrunner'}, drawn", next_)
        return
    if sample is not None:
        raise InputError("command line", "--sample", f"{sample} beside a drawing", "one of the two")
    path = output or Path("motor.toml")
    options.check_outputs(path, json, inputs=(geometry,))
    text = model_text(drawings.load_geometry(geometry))
    model = Model(parse_model(text, path).network)
    what = f"a model of {geometry.name}: {count_of(len(model.nodes), 'node')}, inputs {', '.join(model.inputs)}"
    next_ = f"See what a log of the motor holds for it: lptn check {path} LOG"
    options.write_beginning(path, text, what, next_, edited=output is None)
    capacity = {name: float(model.values[model.network.capacities[name]]) for name in model.nodes}
    write_json(json, {"nodes": capacity, "inputs": model.inputs, "parameters": len(model.parameters)})
