"""The confusability matrix is what the traces' correlation says."""

from __future__ import annotations

import numpy as np
import pytest

from lptn.diagnose.candidates import Candidate
from lptn.diagnose.fit_statistics import NoiseLevel
from lptn.diagnose.scores import Score, Scores, confusability
from lptn.effects import catalogue


def _score(at: str, gain: float, direction: list[float]) -> Score:
    candidate = Candidate(catalogue()["constant_heat"], at, (at,))
    return Score(candidate, gain, 1.0, None, np.array(direction), 1.0)


def _scores(*ranked: Score) -> Scores:
    return Scores(list(ranked), np.ones(20), NoiseLevel({}, {}), {}, 0.0)


def test_the_matrix_holds_the_sizes_of_correlations() -> None:
    found = confusability(
        _scores(_score("a", 9.0, [1.0, 0.0]), _score("b", 5.0, [-0.6, 0.8]), _score("c", 2.0, [-1.0, 0.0]))
    )
    assert found.keys == (("constant_heat", "a"), ("constant_heat", "b"), ("constant_heat", "c"))
    np.testing.assert_allclose(found.matrix, [[1.0, 0.6, 1.0], [0.6, 1.0, 0.6], [1.0, 0.6, 1.0]])
    ((one, other, share),) = found.indistinguishable()
    assert (one[1], other[1]) == ("a", "c")
    assert share == pytest.approx(1.0)
    assert len(found.indistinguishable(0.5)) == 3
    assert found.groups() == [(("constant_heat", "a"), ("constant_heat", "c"))]
    assert [len(group) for group in found.groups(0.5)] == [3]


def test_what_scores_nothing_is_left_out_and_the_best_come_first() -> None:
    found = confusability(_scores(*(_score(f"n{row}", 9.0 - row, [1.0, row]) for row in range(10))), most=4)
    assert [at for _, at in found.keys] == ["n0", "n1", "n2", "n3"]
    empty = confusability(_scores(_score("a", 0.0, [0.0, 0.0])))
    assert empty.keys == ()
    assert empty.matrix.shape == (0, 0)
    assert not empty.indistinguishable()
    assert not empty.groups()
