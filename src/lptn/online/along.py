"""An estimator led along a whole run."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from lptn.arrays import FloatArray
from lptn.online.estimate import Estimate
from lptn.online.estimator import Estimator
from lptn.simulate import Drive


def along(estimator: Estimator, driven: Drive, measured: FloatArray | None = None) -> Iterator[Estimate]:
    """Estimates at each of a run's n readings, in order of time.

    A reading that is the mean over its step is taken in at the middle of it.

    Args:
        estimator: fresh, or at the state in which the run begins.
        driven: the run as the model sees it.
        measured: readings [degC], shape (nodes, n), that stand for the run's own.
    """
    model, step = estimator.model, driven.run.step
    readings = driven.measured if measured is None else measured
    last: dict[str, float] = {}
    before = 0.0
    for k in range(len(driven)):
        inputs = _named(model.inputs, driven.inputs[:, k])
        present = {model.nodes[row]: float(readings[row, k]) for row in np.flatnonzero(np.isfinite(readings[:, k]))}
        if driven.run.averaged:
            if before:
                estimator.advance(last, before)
            yield estimator.update(inputs, present, step / 2 if estimator.running else 0.0)
            last, before = inputs, step / 2
        else:
            yield estimator.update(last if before else inputs, present, before)
            last, before = inputs, step


def _named(columns: list[str], values: FloatArray) -> dict[str, float]:
    return dict(zip(columns, values.tolist(), strict=True))
