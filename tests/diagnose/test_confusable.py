"""The confusability matrix is what the traces' correlation says."""

from __future__ import annotations

import numpy as np
import pytest

from lptn.diagnose.candidates import Candidate, possible_effects
from lptn.diagnose.scores import Confusability, score
from lptn.effects import catalogue
from lptn.identify.data import split_data
from lptn.identify.validation import fit_segments
from tests.report.two_joints import make_run, robot


def test_the_matrix_holds_the_sizes_of_correlations() -> None:
    keys = [("constant_heat", name) for name in "abc"]
    confusability = Confusability.of(keys, np.array([[1.0, 0.0], [-0.6, 0.8], [-1.0, 0.0]]))
    assert confusability.keys == tuple(keys)
    np.testing.assert_allclose(confusability.matrix, [[1.0, 0.6, 1.0], [0.6, 1.0, 0.6], [1.0, 0.6, 1.0]])
    assert confusability.groups() == [(("constant_heat", "a"), ("constant_heat", "c"))]
    assert [len(group) for group in confusability.groups(0.5)] == [3]


def test_the_best_that_score_at_all_are_compared() -> None:
    run = make_run(robot(), 1, "one")
    fit = fit_segments(robot(), split_data([run]).fit)
    scores = score(fit, possible_effects(fit, run.columns))
    compared = scores.confusability
    assert 1 < len(compared.keys) < len(scores.ranked)
    assert compared.keys == tuple(scored.candidate.key for scored in scores.ranked[: len(compared.keys)])
    np.testing.assert_allclose(np.diag(compared.matrix), 1.0)

    twice = [Candidate(catalogue()["constant_heat"], at, (node,)) for node in fit.model.nodes for at in (node, "*")]
    assert score(fit, twice).confusability.matrix[0, 1] == pytest.approx(1.0)


def test_with_nothing_to_score_nothing_is_compared() -> None:
    run = make_run(robot(), 1, "one")
    empty = score(fit_segments(robot(), split_data([run]).fit), []).confusability
    assert empty.keys == ()
    assert empty.matrix.shape == (0, 0)
    assert not empty.groups()


def test_traces_made_a_block_at_a_time_score_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    run = make_run(robot(), 1, "one")
    fit = fit_segments(robot(), split_data([run]).fit)
    possible = possible_effects(fit, run.columns)
    at_once = score(fit, possible)
    monkeypatch.setattr("lptn.diagnose.scores._BLOCK", 3 * fit.problem.rows)
    in_blocks = score(fit, possible)
    np.testing.assert_allclose(in_blocks.null_gains, at_once.null_gains, rtol=1e-6)
    np.testing.assert_allclose(in_blocks.confusability.matrix, at_once.confusability.matrix, atol=1e-6)
    gains = [{scored.candidate: scored.gain for scored in scores.ranked} for scores in (in_blocks, at_once)]
    assert gains[0] == pytest.approx(gains[1], rel=1e-6, abs=1e-9)
