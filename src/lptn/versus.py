"""Two models on the same logs: mean error by class of joints, largest and mean square error by condition."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from lptn.arrays import FloatArray
from lptn.compare import Comparison, Prediction, compare
from lptn.errors import InputError
from lptn.evidence import Part
from lptn.model import Model
from lptn.places import class_of


@dataclass(frozen=True)
class Pair:
    """Errors of two models on the same readings [K].

    Args:
        what: the class of joints, or the run, that the readings are of.
        mean: mean absolute errors.
        square: mean square errors [K²].
        max: largest absolute errors.
    """

    what: str
    mean: tuple[float, float]
    square: tuple[float, float]
    max: tuple[float, float]

    @classmethod
    def of(cls, what: str, errors: tuple[FloatArray, FloatArray]) -> Pair:
        """From predicted minus measured [K], NaN where nothing counts."""
        finite = [np.abs(error[np.isfinite(error)]) for error in errors]
        mean, square, largest = zip(
            *((float(e.mean()), float((e**2).mean()), float(e.max())) for e in finite), strict=True
        )
        return cls(what, mean, square, largest)

    @property
    def figures(self) -> tuple[tuple[float, float, str], ...]:
        """Mean, largest and mean square error of both models, with the unit."""
        return ((*self.mean, "K"), (*self.max, "K"), (*self.square, "K²"))

    @property
    def reduction(self) -> float:
        """By how much of the second model's largest error the first one's is smaller."""
        return 1.0 - self.max[0] / self.max[1]

    @property
    def square_reduction(self) -> float:
        """By how much of the second model's mean square error the first one's is smaller."""
        return 1.0 - self.square[0] / self.square[1]


@dataclass(frozen=True)
class Versus:
    """A model against another on the nodes and runs that both predict.

    Source: [QuadrupedLPTN, table 2, 3] (classes, conditions); "error reduction" in table 3 is that of the
    largest error.
    """

    model: Comparison
    other: Comparison

    @property
    def names(self) -> tuple[str, str]:
        """What the two models are called; by their files where they have one name."""
        one, other = self.model.model.network, self.other.model.network
        return (one.name, other.name) if one.name != other.name else (Path(one.origin).name, Path(other.origin).name)

    @cached_property
    def nodes(self) -> list[str]:
        """Nodes that both models have."""
        return [node for node in self.model.model.nodes if node in self.other.model.nodes]

    @cached_property
    def classes(self) -> list[Pair]:
        """Errors of each class of like nodes over all runs, then of all nodes."""
        groups: dict[str, list[str]] = {}
        for node in self.nodes:
            groups.setdefault(class_of(node), []).append(node)
        found = [self._pair(name, members, range(len(self.model.predictions))) for name, members in groups.items()]
        return [*found, self._pair("all", self.nodes, range(len(self.model.predictions)))]

    @cached_property
    def runs(self) -> list[Pair]:
        """Errors of all nodes in each run."""
        runs = [prediction.part.run.name for prediction in self.model.predictions]
        return [self._pair(name, self.nodes, [number]) for number, name in enumerate(runs)]

    def _pair(self, what: str, nodes: Sequence[str], runs: Sequence[int]) -> Pair:
        return Pair.of(what, (_errors(self.model, nodes, runs), _errors(self.other, nodes, runs)))

    def as_json(self) -> dict[str, object]:
        """Both models' errors as other tools read them, in kelvin; the given model first, then the other."""

        def written(pairs: Sequence[Pair]) -> dict[str, object]:
            return {
                pair.what: {
                    "mean_abs": list(pair.mean),
                    "mean_square": list(pair.square),
                    "max": list(pair.max),
                    "max_reduction": pair.reduction,
                }
                for pair in pairs
            }

        return {"models": list(self.names), "classes": written(self.classes), "runs": written(self.runs)}


def versus(model: Model, other: Model, parts: Sequence[Part], other_parts: Sequence[Part] | None = None) -> Versus:
    """Predict each run with both models.

    Args:
        model: the model in question.
        other: the one to compare it with.
        parts: the runs.
        other_parts: the same runs as the other model reads them (it may name columns otherwise).

    Raises:
        InputError: a run lacks an input of one of them, or they have no node in common.
    """
    found = Versus(compare(model, parts), compare(other, parts if other_parts is None else other_parts))
    if not found.nodes:
        expected = f"at least one of {', '.join(model.nodes)}"
        raise InputError(other.network.origin, "nodes", "none that both models have", expected)
    return found


def _errors(comparison: Comparison, nodes: Sequence[str], runs: Sequence[int]) -> FloatArray:
    rows = [comparison.model.nodes.index(node) for node in nodes]
    chosen: list[Prediction] = [comparison.predictions[number] for number in runs]
    return np.concatenate([prediction.error[rows].ravel() for prediction in chosen])
