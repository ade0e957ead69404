"""The controller's C code: sizes and model by code generation, the solver as it is in `c/`, its structs in Python."""

from __future__ import annotations

import ctypes
import math
import re
from collections.abc import Mapping, Sequence
from typing import Any

import casadi as ca
import numpy as np

from lptn.logs.resampling import feature
from lptn.online import living_sensors

from ..compiled import c_code, c_files, compiled
from ..heating import Heating

SOLVER = ("lptn_mpc.h", "lptn_mpc.c", "linear.inc", "living.inc", "filter.inc", "observe.inc", "bounds.inc",
          "newton.inc", "interior.inc", "lptn_loop.h", "lptn_loop.c")  # fmt: skip
_LIVING = ("STANDS", "SHORTEST", "LEAST_CHANCE", "COARSEST", "BELOW", "BELOW_IF_LOST", "MISLEADS", "ABOVE",
           "NOISE", "LEAST", "LEAST_SHARE", "FOLLOWS", "FEWEST")  # fmt: skip
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


def unsure(heating: Heating) -> list[int]:
    """Parameters that a robot has of its own: those that heat flows depend on, but for temperatures of reference."""
    depends = ca.which_depends(ca.sum1(heating.rates), heating.p, 1, False)
    units = [parameter.declared.unit for parameter in heating.model.parameters]
    return [index for index, (used, unit) in enumerate(zip(depends, units, strict=True)) if used and unit != "degC"]


def surroundings(heating: Heating) -> list[int]:
    """Conditions that are temperatures: the air's, and those of nodes that are given."""
    return [row for row, column in enumerate(heating.conditions) if column.startswith("temperature.")]


def _functions(heating: Heating, power: bool) -> tuple[ca.Function, ...]:
    """`Heating.function`, the slopes of its rates at the heat in what is unsure, transposed, and `power_function`.

    Their parameters end with what says by how much each of the surroundings is warmer than told [K].
    """
    around, count = surroundings(heating), heating.p.numel()
    heat, warmer = ca.SX.sym("heat", len(heating.joints)), ca.SX.sym("warmer", len(around))
    d, p = ca.SX(heating.d), ca.vertcat(heating.p, warmer)
    d[around] += warmer
    rates = heating.rate_function()(heating.x, heat, d, heating.p)
    by = ca.jacobian(rates, p)[:, [*unsure(heating), *range(count, count + len(around))]]
    given = [heating.x, heat, heating.d, p]
    point = [heating.x, heat, d, heating.p]
    parts = {"lptn_heat": heating.function().call(point), "lptn_slopes": [ca.cse(by.T)]}
    if power:
        parts["lptn_power"] = heating.power_function().call(point)
    return tuple(ca.Function(name, given, found) for name, found in parts.items())


def sources(heating: Heating, limits: int, stages: int, power: bool) -> dict[str, str]:
    """Contents by file name of everything that a controller step is made of.

    Args:
        heating: the model.
        limits: number of limited nodes.
        stages: of the horizon.
        power: whether that of all joints together is limited.
    """
    functions = function, slopes, *_ = _functions(heating, power)
    slope, heated = function.sparsity_out(1), function.sparsity_out(2)  # transposed: CasADi lists them row by row
    states, joints = heating.x.numel(), len(heating.joints)
    powered = heating.power_function().jac_sparsity(0, 2).T if power else ca.Sparsity(len(heating.conditions), joints)
    sizes = {
        "NX": states,
        "NN": len(heating.model.nodes),
        "NU": joints,
        "ND": len(heating.conditions),
        "NP": function.numel_in(3),
        "NK": len(unsure(heating)) + len(surroundings(heating)),
        "NT": len(surroundings(heating)),
        "NL": limits,
        "NR": limits + power,  # of a stage: temperatures, and the power
        "N": stages,
        # Iterations between linearisations: more where only the temperatures make the problem not linear.
        "REPEAT": 4 if heating.in_squares and not power else 1,
        "W": -(-(states + joints) // 4) * 4,  # a row's width in whole vectors of four
        "NXP": -(-states // 4) * 4,
        "NA": slope.nnz(),
        "NB": heated.nnz(),
        "NQ": slopes.nnz_out(0),
        "NV": powered.nnz(),
        "HEAT_OUT": states + slope.nnz() + 2 * heated.nnz() + joints,
        "HEAT_ARG": max(each.sz_arg() for each in functions),
        "HEAT_RES": max(each.sz_res() for each in functions),
        "HEAT_IW": max(each.sz_iw() for each in functions),
        "HEAT_W": max(each.sz_w() for each in functions),
    }
    defined = [f"#define LPTN_{name} {value}" for name, value in sizes.items()]
    living = [f"#define LIVING_{name} {getattr(living_sensors, name)!r}" for name in _LIVING]
    hidden = "#define CASADI_SYMBOL_EXPORT static __attribute__((unused))"
    return {
        "sizes.h": "\n".join(["/* Sizes of one model's controller. */", *defined, ""]),
        "pattern.h": _pattern(slope, heated, slopes.sparsity_out(0), powered),
        "living.h": "\n".join(
            ["/* When a sensor is alive: the constants of lptn.online.living_sensors. */", *living, ""]
        ),
        "conditions.h": _kinds(heating.conditions),
        "heat.inc": f"/* The model: made by CasADi from its equations. */\n{hidden}\n{c_code('heat.inc', *functions)}",
        **c_files("mpc", SOLVER),
    }


def python_library(made: Mapping[str, str]) -> ctypes.CDLL:
    """These sources compiled for Python and loaded, with `lptn_mpc_sizes` to check the structs by.

    Raises:
        OSError: no C compiler.
        subprocess.CalledProcessError: the compiler failed.
    """
    return compiled({**made, "glue.c": _GLUE}, "glue.c")


def _pattern(slope: ca.Sparsity, heated: ca.Sparsity, unsure: ca.Sparsity, powered: ca.Sparsity) -> str:
    lines = [
        "/* Which state, joint and unsure parameter a state's rate depends on, and which condition a joint's power. */"
    ]
    for name, transposed in (("slope", slope), ("heated", heated), ("unsure", unsure), ("powered", powered)):
        columns, rows = transposed.get_triplet()
        lines += [f"static const int {name}_row[] = {_list([*rows, 0])};",
                  f"static const int {name}_column[] = {_list([*columns, 0])};"]  # fmt: skip
    return "\n".join([*lines, ""])


def _kinds(conditions: Sequence[str]) -> str:
    """How samples of each condition become one number, as where logs are read."""
    names: dict[object, str] = {np.abs: "LPTN_ABSOLUTE", np.square: "LPTN_RMS"}
    kinds = [
        "LPTN_TEMPERATURE" if column.startswith("temperature.")
        else names.get(feature(column).before, "LPTN_MEAN")
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


def structs(made: Mapping[str, str]) -> dict[str, type[Any]]:
    """Classes of the structs that `lptn_mpc.h` declares, by name, for the sizes of these sources."""
    numbers = re.findall(r"#define LPTN_(\w+) (\d+)", made["sizes.h"] + made["lptn_mpc.h"])
    sizes = {name: int(value) for name, value in numbers}
    sizes["NE"] = sizes["NN"] + sizes["NK"]
    sizes["NS"] = sizes["NX"] + sizes["NE"]
    declared = re.sub(r"/\*.*?\*/", "", made["lptn_mpc.h"], flags=re.DOTALL)
    kinds: dict[str, Any] = {"double": ctypes.c_double, "int": ctypes.c_int}
    for body, name in re.findall(r"typedef struct \{(.*?)\} (\w+);", declared, re.DOTALL):
        fields = []
        for line in body.split(";")[:-1]:  # such as `double p[LPTN_NP + 1], scale[LPTN_N][LPTN_NU]`
            kind, members = line.split(maxsplit=1)
            for member in members.split(","):
                field, *lengths = re.findall(r"[^\[\]]+", member.strip())
                array = kinds[kind]
                for length in reversed(lengths):
                    terms = (term.strip().removeprefix("LPTN_") for term in length.split("+"))
                    array *= sum(sizes[term] if term in sizes else int(term) for term in terms)
                fields.append((field, array))
        kinds[name] = type(name, (ctypes.Structure,), {"_fields_": fields})
    return kinds


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


def _list(values: list[Any]) -> str:
    words = [_list(list(value)) if hasattr(value, "__len__") else _number(value) for value in values]
    rows = [", ".join(words[k : k + 8]) for k in range(0, len(words), 8)]
    return "{" + ",\n        ".join(rows) + "}"
