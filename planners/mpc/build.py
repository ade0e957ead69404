"""The controller's C code: sizes and model by code generation, the solver as it stands in `c/`; compiled for Python."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path

import casadi as ca

from ..native import library
from .heat import Heating

SOLVER = ("lptn_mpc.h", "lptn_mpc.c", "linear.c", "observe.c", "bounds.c", "newton.c", "interior.c")
_GLUE = """\
#define LPTN_WIDE
#include "lptn_mpc.c"
long long lptn_mpc_sizes(int which) {
    const long long sizes[] = {sizeof(lptn_mpc_settings), sizeof(lptn_mpc_state), sizeof(lptn_mpc_result),
                               sizeof(lptn_mpc_work)};
    return sizes[which];
}
"""


def sources(heating: Heating, limits: int, stages: int) -> dict[str, str]:
    """Contents by file name of everything that a controller step is made of.

    Args:
        heating: the model.
        limits: number of limited nodes.
        stages: of the horizon.
    """
    function = heating.function()
    generator = ca.CodeGenerator("heat.c", {"with_header": False, "casadi_int": "long long"})
    generator.add(function)
    states, joints = heating.x.numel(), len(heating.joints)
    sizes = {
        "NX": states,
        "NN": len(heating.model.nodes),
        "NU": joints,
        "ND": len(heating.conditions),
        "NP": heating.p.numel(),
        "NL": limits,
        "N": stages,
        "W": _padded(states + joints),
        "NXP": _padded(states),
        "HEAT_OUT": states + states * states + states * joints + joints,
        "HEAT_ARG": function.sz_arg(),
        "HEAT_RES": function.sz_res(),
        "HEAT_IW": function.sz_iw(),
        "HEAT_W": function.sz_w(),
    }
    solver = {name: files("lptn.planners.mpc").joinpath("c", name).read_text(encoding="utf-8") for name in SOLVER}
    return {"sizes.h": _header(sizes), "heat.c": _heat(generator.dump()), **solver}


def python_library(made: Mapping[str, str]) -> Path:
    """A shared library of these sources for Python.

    Raises:
        OSError: no compiler.
        subprocess.CalledProcessError: it failed.
    """
    return library({**made, "glue.c": _GLUE}, "glue.c")


def _padded(width: int) -> int:
    """A row's width in whole vectors of four."""
    return -(-width // 4) * 4


def _header(sizes: Mapping[str, int]) -> str:
    lines = [f"#define LPTN_{name} {value}" for name, value in sizes.items()]
    return "\n".join(["/* Sizes of one model's controller. */", *lines, ""])


def _heat(code: str) -> str:
    hidden = "#define CASADI_SYMBOL_EXPORT static __attribute__((unused))"
    return f"/* The model: made by CasADi from its equations. */\n{hidden}\n{code}"
