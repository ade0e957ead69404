"""The command `lptn export`: a model as a module for thousands of robots at once."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from lptn.cli import options
from lptn.cli.terminal import show_written, write_json


def export(
    model: Path,
    /,
    *,
    to: Literal["jax", "torch", "numpy", "c", "mujoco"],
    output: options.Output,
    limit: options.NodeLimits = None,
    json: options.Json = None,
) -> None:
    """Write a model as pure functions over many robots, for learning with JAX or PyTorch, or as MuJoCo's motors.

    The module needs neither lptn nor CasADi. Its docstring says names, units and how its functions are called. For
    MuJoCo each joint is one node, a dcmotor; the file says what that costs in K.

    Example: lptn export fitted.toml --to jax --limit 80 -o heat.py

    Args:
        to: What the file is made of.
    """
    options.check_outputs(output, json, inputs=(model,))
    options.check_inputs(model)
    from lptn.batch import export as write
    from lptn.identify.data import load_model

    loaded = load_model(model).model
    write(loaded, output, to, limits=options.limits_of(limit, "*") or None)
    counts = {what: len(getattr(loaded, what)) for what in ("states", "inputs", "parameters")}
    write_json(json, {"file": str(output), "to": to, **counts, "standard_errors": len(loaded.standard_errors)})
    show_written({", ".join(f"{number} {what}" for what, number in counts.items()): output})
