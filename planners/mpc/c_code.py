"""The controller's C code: sizes and model by code generation, the solver as it is in `c/`, its structs in Python."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any, NamedTuple

import casadi as ca

from lptn.logs import resampling
from lptn.online import living_sensors

from ..compiled import c_code, compiled
from ..heating import Heating

SOLVER = ("lptn_mpc.h", "lptn_mpc.c", "linear.inc", "living.inc", "observe.inc", "bounds.inc", "newton.inc",
          "interior.inc", "lptn_loop.h", "lptn_loop.c")  # fmt: skip
_D, _I = ctypes.c_double, ctypes.c_int
_LIVING = ("STANDS", "SHORTEST", "LEAST_CHANCE", "COARSEST", "ERROR", "BELOW", "BELOW_IF_LOST", "MISLEADS", "ABOVE",
           "NOISE", "LEAST", "LEAST_SHARE", "FEWEST")  # fmt: skip
_GLUE = """\
#define LPTN_WIDE
#include "lptn_mpc.c"
#include "lptn_loop.c"
long long lptn_mpc_sizes(int which) {
    const long long sizes[] = {sizeof(lptn_mpc_settings), sizeof(lptn_mpc_state), sizeof(lptn_mpc_result),
                               sizeof(lptn_mpc_work), sizeof(lptn_loop)};
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
    slope, heated = function.sparsity_out(1), function.sparsity_out(2)  # transposed: CasADi lists them row by row
    states, joints = heating.x.numel(), len(heating.joints)
    sizes = {
        "NX": states,
        "NN": len(heating.model.nodes),
        "NU": joints,
        "ND": len(heating.conditions),
        "NP": heating.p.numel(),
        "NL": limits,
        "N": stages,
        # Iterations between linearisations: more where only the temperatures make the problem not linear.
        "REPEAT": 4 if heating.in_squares else 1,
        "W": _padded(states + joints),
        "NXP": _padded(states),
        "NA": slope.nnz(),
        "NB": heated.nnz(),
        "HEAT_OUT": states + slope.nnz() + 2 * heated.nnz() + joints,
        "HEAT_ARG": function.sz_arg(),
        "HEAT_RES": function.sz_res(),
        "HEAT_IW": function.sz_iw(),
        "HEAT_W": function.sz_w(),
    }
    solver = {name: files("lptn.planners.mpc").joinpath("c", name).read_text(encoding="utf-8") for name in SOLVER}
    defined = [f"#define LPTN_{name} {value}" for name, value in sizes.items()]
    living = [f"#define LIVING_{name} {getattr(living_sensors, name)!r}" for name in _LIVING]
    hidden = "#define CASADI_SYMBOL_EXPORT static __attribute__((unused))"
    return {
        "sizes.h": "\n".join(["/* Sizes of one model's controller. */", *defined, ""]),
        "pattern.h": _pattern(slope, heated),
        "living.h": "\n".join(
            ["/* When a sensor is alive: the constants of lptn.online.living_sensors. */", *living, ""]
        ),
        "conditions.h": _kinds(heating.conditions),
        "heat.inc": f"/* The model: made by CasADi from its equations. */\n{hidden}\n{c_code(function, 'heat.inc')}",
        **solver,
    }


def python_library(made: Mapping[str, str]) -> ctypes.CDLL:
    """These sources compiled for Python and loaded, with `lptn_mpc_sizes` to check the structs by.

    Raises:
        OSError: no C compiler.
        subprocess.CalledProcessError: the compiler failed.
    """
    return compiled({**made, "glue.c": _GLUE}, "glue.c")


def _padded(width: int) -> int:
    """A row's width in whole vectors of four."""
    return -(-width // 4) * 4


def _pattern(slope: ca.Sparsity, heated: ca.Sparsity) -> str:
    lines = ["/* Where a state's rate depends on another state, and which joint heats which state. */"]
    for name, transposed in (("slope", slope), ("heated", heated)):
        columns, rows = transposed.get_triplet()
        lines += [f"static const int {name}_row[] = {_list([*rows, 0])};",
                  f"static const int {name}_column[] = {_list([*columns, 0])};"]  # fmt: skip
    return "\n".join([*lines, ""])


def _kinds(conditions: Sequence[str]) -> str:
    """How samples of each condition become one number, as where logs are read."""
    names = {resampling.MEAN_ABS: "LPTN_ABSOLUTE", resampling.RMS: "LPTN_RMS"}
    kinds = [
        "LPTN_TEMPERATURE" if column.startswith("temperature.")
        else names.get(resampling.feature(column).reduction, "LPTN_MEAN")
        for column in conditions
    ]  # fmt: skip
    lines = [f"    {kind}, /* {column} */" for kind, column in zip(kinds, conditions, strict=True)]
    return "\n".join(
        ["/* How samples of the model's other inputs become one number. */", "#ifndef LPTN_CONDITIONS_H",
         "#define LPTN_CONDITIONS_H",
         "enum { LPTN_MEAN, LPTN_ABSOLUTE, LPTN_RMS, LPTN_TEMPERATURE }; /* of the last the mean, too */",
         "static const int lptn_condition_kind[] = {", *lines, "    LPTN_MEAN};", "#endif", ""]
    )  # fmt: skip


# --- structs ------------------------------------------------------------------------------------


class Structs(NamedTuple):
    """Classes of the structs."""

    settings: type[ctypes.Structure]
    state: type[ctypes.Structure]
    result: type[ctypes.Structure]


def structs(heating: Heating, limits: int, stages: int) -> Structs:
    """Classes for one model: names and order are those of `c/lptn_mpc.h`."""
    nodes = len(heating.model.nodes)
    x, u, d, p = heating.x.numel(), len(heating.joints), len(heating.conditions), heating.p.numel()
    settings = [
        ("stage", _D * stages),
        ("limit", _D * limits),
        ("node", _I * limits),
        ("owner", _I * x),
        *((name, _D * u) for name in ("weight", "most", "rate", "floor")),
        ("p", _D * (p + 1)),
        ("recovery", _D * limits),
        *((name, _D) for name in ("smoothing", "linear", "quadratic", "noise", "grain", "sigmas")),
        ("doubt", _D * x),
        ("gain_doubt", _D * x),
        ("settles", _D * nodes),
        ("tolerance", _D),
        *((name, _I) for name in ("iterations", "warm", "lost_sensor")),
    ]
    elements = x + 2 * nodes
    sensors = [
        ("clock", _D),
        *((name, _D * nodes) for name in
          ("last", "since", "evidence", "grain", "moves", "due", "agreed_for")),
        ("regression", _D * 6 * nodes),
        *((name, _D * nodes) for name in ("contradicted_for", "last_seen")),
        *((name, _I * nodes) for name in ("stands", "agrees", "proven", "trusted", "lost")),
    ]  # fmt: skip
    reference = [
        ("x", _D * x),
        *((name, _D * nodes) for name in ("bias", "gain")),
        *((name, _D * x) for name in ("raised", "deviation")),
        ("lacks", _D * 3 * nodes),
    ]
    state = [
        *((name, _D * x) for name in ("x", "bias", "gain")),
        ("spread", _D * elements * elements),
        ("made", _D * nodes),
        *((name, _struct("Reference", reference)) for name in ("model", "recent")),
        ("renewed", _D),
        ("woken", _D * nodes),
        ("hotter", _D * x),
        ("returns", _D * nodes),
        *((name, _I * nodes) for name in ("read", "guessed", "once_trusted", "used")),
        ("applied", _D * u),
        ("conditions", _D * (d + 1)),
        ("scale", _D * u * stages),
        ("asked", _D * u),
        ("share", _D * u),
        ("started", _I),
        ("sensors", _struct("Sensors", sensors)),
    ]
    result = [
        ("admitted", _D * u),
        ("plan", _D * u * stages),
        ("x", _D * x * (stages + 1)),
        ("slack", _D * limits * stages),
        ("margin", _D * limits),
        *((name, _D) for name in ("cost", "worst", "error", "gap")),
        *((name, _I) for name in ("iterations", "linearisations", "status")),
        ("doubt", _D * nodes),
        ("sensor", _I * nodes),
    ]
    return Structs(_struct("Settings", settings), _struct("State", state), _struct("Result", result))


def _struct(name: str, fields: list[Any]) -> type[ctypes.Structure]:
    return type(name, (ctypes.Structure,), {"_fields_": fields})


def settings_header(settings: ctypes.Structure) -> str:
    """The controller's settings as a constant, in words that C and C++ have in common."""
    lines = []
    for name, *_ in settings._fields_:
        value = getattr(settings, name)
        lines.append(f"    /* {name} */ {_list(list(value)) if hasattr(value, '__len__') else _number(value)},")
    return "\n".join(
        ["/* Limits, weights, stages and the model's parameters: lptn_mpc.h says what each is. */",
         "#ifndef LPTN_SETTINGS_H", "#define LPTN_SETTINGS_H", "#include <math.h>", '#include "lptn_mpc.h"',
         "static const lptn_mpc_settings lptn_mpc_default = {", *lines, "};", "#endif", ""]
    )  # fmt: skip


def _number(value: float) -> str:
    """An integer stays one; a double keeps all its digits."""
    return "INFINITY" if math.isinf(value) else repr(value)


def _list(values: list[float]) -> str:
    words = [_number(value) for value in values]
    rows = [", ".join(words[k : k + 8]) for k in range(0, len(words), 8)]
    return "{" + ",\n        ".join(rows) + "}"
