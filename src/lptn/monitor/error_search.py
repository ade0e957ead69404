"""How wrong a model is on healthy runs: the sizes of its errors under which the innovations are likeliest."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from lptn.model import Model
from lptn.monitor.watch import estimator_of
from lptn.noise import Noise
from lptn.online import ModelError
from lptn.online.along import along
from lptn.places import class_of
from lptn.simulate import Drive

Report = Callable[[str], None]
Sizes = dict[str, float]

_FACTOR = 2.0
_GAIN = 2e-3  # of log-likelihood a reading; less than that is not worth another trial
_SAID = "learning what is healthy: sizes of the model's errors, trial"
_BEGIN = {"heat": 0.5, "change": 0.5, "bias": 0.5}


def likeliest(model: Model, noise: Noise, drives: Sequence[Drive], report: Report = lambda _: None) -> ModelError:
    """The model errors under which the innovations on healthy runs are likeliest, to a factor of two.

    Nodes of a class (all calves) share their sizes: a model is as wrong about one as about the other.
    """
    classes = {node: class_of(node) for node in model.nodes}
    air = [column for column in model.inputs if column.startswith("temperature.")]

    def error(sizes: Sizes) -> ModelError:
        def of(kind: str) -> Sizes:
            return {node: sizes[f"{kind} {name}"] for node, name in classes.items()}

        inputs = {column: sizes[column] for column in air}
        return ModelError(of("heat"), sizes["heat_time"], of("change"), of("bias"), sizes["air"], inputs)

    best = {"heat_time": 100.0, "air": 0.1, **dict.fromkeys(air, 1.0)}
    for name in dict.fromkeys(classes.values()):
        best |= {f"{kind} {name}": size for kind, size in _BEGIN.items()}
    tried: dict[tuple[float, ...], float] = {}

    def value(sizes: Sizes) -> float:
        key = tuple(sizes.values())
        if key not in tried:
            report(f"{_SAID} {len(tried) + 1}")
            tried[key] = mean_log_likelihood(model, noise, error(sizes), drives)
        return tried[key]

    while (better := _round(best, value)) != best:
        best = better
    return error(best)


def mean_log_likelihood(model: Model, noise: Noise, error: ModelError, drives: Sequence[Drive]) -> float:
    """Logarithm of the innovations' likelihood, per reading, up to a constant."""
    total, count = 0.0, 0
    for driven in drives:
        estimator = estimator_of(model, noise, error)
        for _ in along(estimator, driven):
            met = estimator.last
            if met is not None:
                root = np.linalg.cholesky(met.covariance)
                white = np.linalg.solve(root, met.innovation)
                total -= 0.5 * float(white @ white) + float(np.log(np.diag(root)).sum())
                count += len(white)
    return total / max(count, 1)


def _round(best: Sizes, value: Callable[[Sizes], float]) -> Sizes:
    """Each size in turn made larger or smaller, as far as that helps."""
    for name in best:
        for times in (_FACTOR, 1 / _FACTOR):
            while value(trial := best | {name: best[name] * times}) > value(best) + _GAIN:
                best = trial
    return best
