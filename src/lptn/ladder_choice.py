"""Which of the ladders that were followed is kept, how far, and without which rungs."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from lptn.arrays import FloatArray
from lptn.compare import Prediction
from lptn.diagnose import MUCH_WORSE, TIE, continued, tied, worse_by
from lptn.ladder_climb import WORTH, Climb

_BLOCK = 120.0  # s; held-out errors further apart than this count as independent
_CLEAR = 2.0  # standard errors


def chosen(paths: Sequence[Climb]) -> Climb:
    """The shortest ladder that reaches the best error; of equally long ones the clearly better, else the first."""
    if paths[0].holdout is None:
        best = paths[0]
        for path in paths[1:]:
            if worse_by(best.fit, path.fit) > 0:
                best = path
        return best
    least = min(path.rank for path in paths)
    enough = [path for path in paths if path.rank <= least * (1 + WORTH)]
    depth = min(len(path.steps) for path in enough)
    level = _plausible_first([path for path in paths if len(path.steps) == depth])
    best = next(path for path in level if path in enough)
    near = [path for path in level if path is best or path.rank <= MUCH_WORSE * best.rank]
    return next(path for path in near if path is best or not _clearly_worse(path, best))


def _plausible_first(paths: Sequence[Climb]) -> list[Climb]:
    """By misfit; of those that the fitted data can't tell from the best, typical sizes, then few parameters, first."""
    least = min(paths, key=lambda each: each.fit.cost)

    def order(path: Climb) -> tuple[bool, int, int, float]:
        level = tied(path.fit, least.fit)
        unusual, free = sum(step.refit.unusual for step in path.steps), len(path.fit.problem.free)
        return (not level, unusual if level else 0, free if level else 0, path.fit.cost)

    return sorted(paths, key=order)


def _clearly_worse(path: Climb, than: Climb) -> bool:
    """Whether held-out errors differ by more than their own scatter."""
    differences = np.concatenate(
        [
            _block_squares(one) - _block_squares(other)
            for one, other in zip(path.predictions, than.predictions, strict=True)
        ]
    )
    if differences.size < 2:
        return path.rank > than.rank
    scatter = float(differences.std(ddof=1)) / np.sqrt(differences.size)
    return bool(differences.mean() > _CLEAR * scatter)


def _block_squares(prediction: Prediction) -> FloatArray:
    """Mean squared error of each block of held-out time that counts."""
    size = max(1, round(_BLOCK / prediction.drive.run.step))
    squares = prediction.error**2
    squares = squares[:, np.isfinite(squares).any(axis=0)]
    whole = squares.shape[1] // size * size
    return np.asarray(np.nanmean(squares[:, :whole].reshape(len(squares), -1, size), axis=(0, 2)))


def pruned(path: Climb, report: Callable[[str], None]) -> Climb:
    """The ladder less the rungs that later ones made superfluous."""
    for step in path.steps[:-1]:
        rest = tuple(other for other in path.steps if other is not step)
        network = path.fit.model.network.without_effect(*step.key)
        shorter = Climb(continued(path.fit, network), rest, path.data)
        cheaper = worse_by(shorter.fit, path.fit) < TIE
        if cheaper and shorter.rank <= path.rank * (1 + WORTH):
            report(f"{step.key[0]} at {step.key[1]} is no longer needed")
            return pruned(shorter, report)
    return path
