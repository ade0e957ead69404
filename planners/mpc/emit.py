"""The controller as C files for a robot: solver, model, settings and a small program that runs it."""

from __future__ import annotations

import math
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

from lptn.basics.arrays import FloatArray
from lptn.basics.files import write_folder

if TYPE_CHECKING:
    from .controller import TorqueMPC

_NUMBERS_IN_A_LINE = 8


def emit(mpc: TorqueMPC, folder: Path, start: FloatArray, asked: FloatArray, conditions: FloatArray) -> list[Path]:
    """Write a controller's C code into a folder, made where it is missing.

    Args:
        mpc: the controller; its step there gives the same digits as here.
        folder: where to.
        start: temperatures of the example [degC], shape (states,).
        asked: requests of the example, shape (steps, joints).
        conditions: the model's other inputs in the example, shape (steps, conditions).

    Returns:
        The files, in the order in which a person reads them.

    Raises:
        InputError: the folder can't be written.
    """
    model = mpc.model
    names = [f"temperature.{node} [degC]" for node in model.nodes]
    names += [f"{mpc.heating.request}.{joint} [{mpc.heating.unit}]" for joint in mpc.joints]
    names += list(mpc.conditions)
    rows = [[*start[: len(model.nodes)], *row, *around] for row, around in zip(asked, conditions, strict=True)]
    content = {
        "main.c": files("lptn.planners.mpc").joinpath("c", "main.c").read_text(encoding="utf-8"),
        "settings.h": settings_header(mpc),
        "names.txt": "\n".join([*names, ""]),
        "example.txt": "\n".join([*(" ".join(f"{value:.10g}" for value in row) for row in rows), ""]),
        **mpc.sources,
    }
    return write_folder(folder, content)


def settings_header(mpc: TorqueMPC) -> str:
    """The controller's settings as a C constant."""
    told = mpc.filled
    lines = []
    for name, *_ in told._fields_:
        value = getattr(told, name)
        lines.append(f"    .{name} = {_list(list(value)) if hasattr(value, '__len__') else _number(value)},")
    return "\n".join(
        ["/* Limits, weights, stages and the model's parameters: lptn_mpc.h says what each is. */",
         "static const lptn_mpc_settings lptn_mpc_default = {", *lines, "};", ""]
    )  # fmt: skip


def _number(value: float) -> str:
    """An integer stays one; a double keeps all its digits."""
    return "INFINITY" if math.isinf(value) else repr(value)


def _list(values: list[float]) -> str:
    words = [_number(value) for value in values]
    rows = [", ".join(words[k : k + _NUMBERS_IN_A_LINE]) for k in range(0, len(words), _NUMBERS_IN_A_LINE)]
    return "{" + ",\n        ".join(rows) + "}"
