"""Effects that are confined to a run which none of the logs is: a slip of the pen would switch them off in silence."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from lptn.logs import Run
from lptn.network import Network
from lptn.places import is_of_run


def absent_runs(network: Network, runs: Iterable[Run]) -> list[str]:
    """What to say of each name of a run, or glob of names, that no log answers to; nothing without logs.

    Args:
        network: its effects name the runs that they act in.
        runs: all runs that were opened, whatever for.
    """
    names = list(dict.fromkeys(run.name for run in runs))
    if not names:
        return []
    asked = {effect.run: effect for effect in network.effects if effect.run}
    return [
        f'{effect.effect.key} at {effect.at} acts only in run "{pattern}", and no log is that run '
        f"(here: {_listed(names)}): it is off"
        for pattern, effect in asked.items()
        if not any(is_of_run(name, pattern) for name in names)
    ]


def say_absent_runs(network: Network, runs: Iterable[Run]) -> None:
    """Say it on standard output, a line each."""
    for told in absent_runs(network, runs):
        print(f"Warning: {told}.")


def _listed(names: Sequence[str], most: int = 8) -> str:
    return ", ".join(names[:most]) + (f" and {len(names) - most} more" if len(names) > most else "")
