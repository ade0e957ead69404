"""The limiter as C files for a robot."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from lptn.basics.arrays import FloatArray
from lptn.basics.files import write_folder

from .limiter import Limiter

_HEADER = """\
/* Admissible {request} of each joint now, for {horizons}.
 *
 * The largest constant RMS value [{unit}] with which no limited node passes its limit in that time, the other joints
 * going on at their load. No heap, no globals, a fixed number of operations. */
#ifndef ADMISSIBLE_H
#define ADMISSIBLE_H
#ifdef __cplusplus
extern "C" {{
#endif
#define LPTN_NX {states}
#define LPTN_NU {joints}
#define LPTN_ND {conditions}
#define LPTN_HORIZONS {count}

typedef struct {{
    const double *arguments[{sz_arg}];
    double *results[{sz_res}];
    long long integers[{sz_iw}];
    double doubles[{sz_w}];
}} lptn_limiter_memory;

/* x: LPTN_NX temperatures of the states [degC]. load: LPTN_NU. conditions: LPTN_ND. admissible: for each joint its
 * LPTN_HORIZONS values. A value that is no number makes what depends on it 0. */
void lptn_admissible(lptn_limiter_memory *memory, const double *x, const double *load, const double *conditions,
                     double *admissible);
#ifdef __cplusplus
}}
#endif
#endif
"""
_SOURCE = """\
/* The limiter of admissible.h: constants, and the function that CasADi made of the model. */
#define CASADI_SYMBOL_EXPORT static __attribute__((unused))
#include "limiter.inc"
#include "admissible.h"

static const double parameters[] = {{{parameters}}};
static const double limits[] = {{{limits}}};
static const double most[] = {{{most}}};

void lptn_admissible(lptn_limiter_memory *memory, const double *x, const double *load, const double *conditions,
                     double *admissible) {{
    const double *given[] = {{x, load, conditions, parameters, limits, most}};
    for (int i = 0; i < 6; i++) memory->arguments[i] = given[i];
    memory->results[0] = admissible;
    lptn_limiter(memory->arguments, memory->results, memory->integers, memory->doubles, 0);
}}
"""


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
    header = _HEADER.format(
        request=heat.request,
        unit=heat.unit,
        horizons=", ".join("ever" if seconds == float("inf") else f"{seconds:g} s" for seconds in limiter.horizons),
        states=len(x),
        joints=len(load),
        conditions=len(conditions),
        count=len(limiter.horizons),
        sz_arg=function.sz_arg(),
        sz_res=function.sz_res(),
        sz_iw=max(1, function.sz_iw()),
        sz_w=max(1, function.sz_w()),
    )
    numbers = {"parameters": limiter.model.values, "limits": limiter.limits, "most": limiter.most}
    source = _SOURCE.format(**{name: ", ".join(map(repr, values.tolist())) for name, values in numbers.items()})
    content = {
        "main.c": files("lptn.planners.limiter").joinpath("c", "main.c").read_text(encoding="utf-8"),
        "admissible.h": header,
        "admissible.c": source,
        "limiter.inc": limiter.c_code(),
        "names.txt": "\n".join([*names, ""]),
        "example.txt": " ".join(f"{value:.17g}" for value in [*x, *load, *conditions]) + "\n",
    }
    return write_folder(folder, content)
