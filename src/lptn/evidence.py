"""Which stretches of which runs fit, choose and prove a model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from lptn.errors import InputError
from lptn.logs import Run

Window = tuple[float, float]
_OPENING_SHARE = 0.1
_LEAST_OPENING = 60.0  # s
_LEAST_OPENING_STEPS = 10
_LEAST_STEPS_KEPT = 300  # a coarsened run keeps at least so many


@dataclass(frozen=True)
class Part:
    """A run with the window that finds its initial temperatures and the window in which errors count.

    A model's prediction needs a start. On runs that the fit never saw it comes from the run's opening, and
    only what lies behind the opening is counted as predicted.
    """

    run: Run
    opening: Window
    counted: Window

    def coarsened(self, step: float) -> Part:
        """The same part in steps of about `step` seconds, where the run is long enough to spare them."""
        factor = min(round(step / self.run.step), len(self.run) // _LEAST_STEPS_KEPT)
        return self if factor < 2 else replace(self, run=self.run.coarsen(factor))


@dataclass(frozen=True)
class Evidence:
    """Three sets of data with three jobs.

    Args:
        fit: parameters are fitted, and missing effects chosen, on these.
        holdout: say where the ladder ends.
        proof: looked at once, when all is decided.
    """

    fit: tuple[Part, ...]
    holdout: tuple[Part, ...] = ()
    proof: tuple[Part, ...] = ()

    def coarsened(self, step: float) -> Evidence:
        """All parts in steps of about `step` seconds."""
        parts = (self.fit, self.holdout, self.proof)
        return Evidence(*(tuple(part.coarsened(step) for part in group) for group in parts))


def evidence(
    runs: Sequence[Run],
    holdout: Sequence[Run] = (),
    proof: Sequence[Run] = (),
    holdout_after: float | None = None,
) -> Evidence:
    """Arrange runs by their jobs.

    Args:
        runs: to fit.
        holdout: runs held out whole.
        proof: runs looked at once, at the end.
        holdout_after: time [s, in each log's clock] from which the fitted runs themselves are held out.

    Raises:
        InputError: `holdout_after` leaves nothing to fit, or nothing to hold out.
    """
    if holdout_after is None:
        return Evidence(tuple(_whole(run) for run in runs), _predicted(holdout), _predicted(proof))
    fitted = [run for run in runs if (run.time < holdout_after).sum() >= _LEAST_OPENING_STEPS]
    continued = [run for run in fitted if (run.time >= holdout_after).sum() >= _LEAST_OPENING_STEPS]
    if not fitted or not continued:
        span = f"{min(run.time[0] for run in runs):g} to {max(run.time[-1] for run in runs):g} s"
        raise InputError("--holdout-after", f"{holdout_after:g} s", f"logs from {span}", "a time inside a log")
    before, after = (float("-inf"), holdout_after), (holdout_after, float("inf"))
    later = tuple(Part(run, before, after) for run in continued)
    return Evidence(
        tuple(Part(run, before, before) for run in fitted), (*later, *_predicted(holdout)), _predicted(proof)
    )


def predicted(run: Run) -> Part:
    """A run to be predicted: its opening finds the start, the rest counts."""
    length = max(_OPENING_SHARE * len(run) * run.step, _LEAST_OPENING, _LEAST_OPENING_STEPS * run.step)
    # A short run can't spare so much.
    border = run.time[0] + min(length, 0.5 * len(run) * run.step)
    return Part(run, (float("-inf"), border), (border, float("inf")))


def _predicted(runs: Sequence[Run]) -> tuple[Part, ...]:
    return tuple(predicted(run) for run in runs)


def _whole(run: Run) -> Part:
    everything = (float("-inf"), float("inf"))
    return Part(run, everything, everything)
