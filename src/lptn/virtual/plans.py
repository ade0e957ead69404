"""Find a set of runs by its name."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from .runs import Run, conditions, protocol
from .sessions import forecast, hour, monitor, swing, trial

Plan = Literal["protocol", "tests", "trial", "hour", "swing", "forecast", "monitor"]

PLANS: dict[str, Callable[[int], dict[str, Run]]] = {
    "protocol": protocol,
    "tests": conditions,
    "trial": trial,
    "hour": hour,
    "swing": swing,
    "forecast": forecast,
    "monitor": monitor,
}


def plan(name: Plan, seed: int = 0) -> dict[str, Run]:
    """Return the runs of this name.

    Args:
        name: "protocol" ([QuadrupedLPTN, table 1]), "tests" (table 3 and the multi-gait test), "trial", "hour",
            "swing", "forecast" (application 3) or "monitor" (application 2).
        seed: 0 or above; draws ambients, the order of things, faults.

    Raises:
        ValueError: unknown name, negative seed.
    """
    if name not in PLANS:
        raise ValueError(f"runs: found {name!r}; expected one of {', '.join(PLANS)}")
    return PLANS[name](seed)
