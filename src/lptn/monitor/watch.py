"""The statistical detector's eye: an estimator led along a run, with suspicions against each sensor."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lptn.arrays import FloatArray
from lptn.logs import Run
from lptn.model import Model
from lptn.monitor.suspicion import Best, Suspicions
from lptn.noise import Noise
from lptn.online import Estimator, ModelError
from lptn.online.along import along
from lptn.simulate import Drive, drive

STEP = 10.0
"""s; the statistical detector looks so often"""
_FEWEST = 20  # steps that a short run keeps


def estimator_of(model: Model, noise: Noise, error: ModelError) -> Estimator:
    """A filter for a run in coarse steps; rounding enters as white noise, since the ratios are of Gaussians."""
    floor = dict(zip(model.nodes, noise.floor.tolist(), strict=True))
    return Estimator(model, noise=floor, error=error)


def watch(estimator: Estimator, driven: Drive, measured: FloatArray) -> Iterator[tuple[float, Best]]:
    """Time [s] of each reading and the suspicions by then.

    Args:
        measured: readings [degC] as they are to be believed, shape (nodes, n).
    """
    step = driven.run.step
    delay = step if driven.run.averaged else 0.0  # a mean is known at the end of its step
    suspicions: Suspicions | None = None
    for k, _ in enumerate(along(estimator, driven, measured)):
        if suspicions is None:
            suspicions = Suspicions(len(measured), estimator.size, step)
        time = float(driven.run.time[k]) + delay
        yield time, suspicions.update(time, estimator.last, np.isfinite(measured[:, k]))


def coarse_drive(model: Model, run: Run, step: float) -> Drive:
    """A run in steps of about so many seconds, where it is long enough for it."""
    factor = min(max(1, round(step / run.step)), max(1, len(run) // _FEWEST))
    return drive(model, run.coarsen(factor))
