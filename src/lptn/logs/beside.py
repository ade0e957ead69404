"""What becomes of doubts about a log: one that another run settles, and those that leave nothing to conclude.

What is only doubted is read as it stands, since machines are of many kinds: a fit is made, and says what looks wrong.
But what such a log would say of physics may be the logger's doing, and is not concluded from it.
"""

from __future__ import annotations

from collections.abc import Sequence

from lptn.basics.errors import InputError
from lptn.logs.columns import AMBIENT
from lptn.logs.plausible import OVER
from lptn.logs.run import Run

_LIKE = 15.0  # K, by which rooms of one robot's runs may differ


def refuse_other_units(runs: Sequence[Run]) -> None:
    """Refuse one of a robot's runs whose surroundings, doubted to be in degF, are so what they are in another in degC.

    Raises:
        InputError: there is such a run.
    """
    for run in runs:
        doubted = [issue for issue in run.issues if issue.corrected is not None and issue.corrected.unit == "degF"]
        room = _room(run)
        for other in runs if doubted and room is not None else ():
            there, in_doubt = _room(other), {issue.key for issue in other.issues}
            if room is None or there is None or in_doubt & {issue.key for issue in doubted}:
                continue
            if room - there > OVER and abs((room - 32) / 1.8 - there) < _LIKE:
                place, problem, remedy = doubted[0].error
                raise InputError(
                    run.source, place, f"{problem}, since {other.source} begins at {there:.3g} degC", remedy
                )


_DECIDES = ("unit", "counts", "offset", "follows", "exchanged")
"""Kinds of issues by which all readings of a channel are other numbers, or those of another place: to the data an
offset from the first row on is a constant heat; of air that a joint warms, what leaves to the room looks like a second
mass, a larger surface, surroundings that lag. A sign turned round
leaves losses as they are: it is said, and conclusions are drawn."""


def refuse_doubtful(runs: Sequence[Run]) -> None:
    """Refuse to conclude from runs of which a whole channel may be something else than it is read as.

    Raises:
        InputError: there is one; its remedies are the entry that corrects it, and the one that says it is right.
    """
    for run in runs:
        for issue in run.issues:
            # Of two sensors that read alike neither is used; the heat of a joint is.
            is_load = issue.kind == "duplicate" and not issue.key.startswith("temperature.")
            if issue.kind not in _DECIDES and not is_load:
                continue
            place, problem, remedy = issue.error
            raise InputError(run.source, place, problem, f"a log that conclusions can be drawn from: {remedy}")


def _room(run: Run) -> float | None:
    """Temperature of the surroundings where a run begins [degC]; where they have no sensor, of the coldest other."""
    readings = [value for key, value in run.beginning.items() if key.startswith("temperature.")]
    return run.beginning.get(AMBIENT, min(readings, default=None))
