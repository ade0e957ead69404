"""The limiter as C files for a robot."""

from __future__ import annotations

from importlib.resources import files
from math import isinf
from pathlib import Path

from lptn.basics.arrays import FloatArray
from lptn.basics.files import write_folder

from .limiter import Limiter


def emit(limiter: Limiter, folder: Path, x: FloatArray, load: FloatArray, conditions: FloatArray) -> list[Path]:
    """Write a limiter's C code into a folder, made where it is missing; the arrays are its example.

    Returns:
        The files, in the order in which a person reads them.

    Raises:
        InputError: the folder can't be written.
    """
    function, heat = limiter.function, limiter.heating
    names = [f"temperature.{state} [degC]" for state in limiter.model.states]
    names += [f"{heat.request}.{joint} [{heat.unit}]" for joint in limiter.joints] + list(limiter.conditions)
    lasting = ", ".join("ever" if isinf(seconds) else f"{seconds:g} s" for seconds in limiter.horizons)
    sizes = {
        "NX": len(x), "NU": len(load), "ND": len(conditions), "HORIZONS": len(limiter.horizons),
        "ARGUMENTS": function.sz_arg(), "RESULTS": function.sz_res(), "INTEGERS": max(1, function.sz_iw()),
        "DOUBLES": max(1, function.sz_w()),
    }  # fmt: skip
    numbers = {"parameters": limiter.model.values, "limits": limiter.limits, "most": limiter.most}
    return write_folder(folder, {
        **{name: files("lptn.planners.limiter").joinpath("c", name).read_text(encoding="utf-8")
           for name in ("main.c", "admissible.h", "admissible.c")},
        "limiter_sizes.h": "\n".join([
            f"/* Sizes of one model's limiter: admissible {heat.request} [{heat.unit}] for {lasting}. */",
            *(f"#define LPTN_{name} {value}" for name, value in sizes.items()), "",
        ]),
        "limiter_numbers.h": "\n".join([
            "/* The model's parameters; limits of its places [degC] and of the joints' currents [A]. */",
            *(f"static const double {name}[] = {{{', '.join(map(repr, values.tolist()))}}};"
              for name, values in numbers.items()), "",
        ]),
        "limiter.inc": limiter.c_code(),
        "names.txt": "\n".join([*names, ""]),
        "example.txt": " ".join(f"{value:.17g}" for value in [*x, *load, *conditions]) + "\n",
    })  # fmt: skip
