"""The structs of `c/lptn_mpc.h` as ctypes sees them, for one model's sizes."""

from __future__ import annotations

import ctypes
from typing import Any, NamedTuple

from .heat import Heating

_D, _I = ctypes.c_double, ctypes.c_int


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
        *((name, _D * u) for name in ("weight", "most", "rate")),
        ("p", _D * (p + 1)),
        *((name, _D) for name in ("recovery", "linear", "quadratic", "noise")),
        ("doubt", _D * x),
        *((name, _D) for name in ("gain_doubt", "tolerance")),
        ("iterations", _I),
    ]
    state = [
        ("x", _D * x),
        ("bias", _D * x),
        ("gain", _D * x),
        ("spread", _D * 3 * 3 * nodes),
        ("applied", _D * u),
        ("conditions", _D * (d + 1)),
        ("scale", _D * u * stages),
        ("started", _I),
    ]
    result = [
        ("admitted", _D * u),
        ("plan", _D * u * stages),
        ("x", _D * x * (stages + 1)),
        ("slack", _D * limits * stages),
        *((name, _D) for name in ("cost", "worst", "error", "gap")),
        *((name, _I) for name in ("iterations", "linearisations", "status")),
    ]
    return Structs(_struct("Settings", settings), _struct("State", state), _struct("Result", result))


def _struct(name: str, fields: list[Any]) -> type[ctypes.Structure]:
    return type(name, (ctypes.Structure,), {"_fields_": fields})
