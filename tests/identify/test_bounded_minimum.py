"""The least of a quadratic within bounds, against SciPy's search, also where guesses go round in a circle."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from lptn.basics.arrays import FloatArray
from lptn.identify import bounded_minimum as module
from lptn.identify.bounded_minimum import bounded_minimum

SIZE = 30


def problem(seed: int, decades: float) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """A quadratic whose eigenvalues span so many decades, and bounds around 0."""
    rng = np.random.default_rng(seed)
    vectors, _ = np.linalg.qr(rng.normal(size=(SIZE, SIZE)))
    hessian = (vectors * 10.0 ** np.linspace(0.0, -decades, SIZE)) @ vectors.T
    lower, upper = -rng.uniform(0.0, 1.0, SIZE), rng.uniform(0.0, 1.0, SIZE)
    return hessian @ rng.normal(0.0, 3.0, SIZE), 0.5 * (hessian + hessian.T), lower, upper


def height(x: FloatArray, gradient: FloatArray, hessian: FloatArray) -> float:
    return float(gradient @ x + 0.5 * x @ hessian @ x)


@pytest.mark.parametrize("decades", [1.0, 4.0, 8.0, 12.0])
@pytest.mark.parametrize("seed", range(6))
def test_no_point_within_the_bounds_is_lower(seed: int, decades: float) -> None:
    gradient, hessian, lower, upper = problem(seed, decades)
    found = bounded_minimum(gradient, hessian, lower, upper)
    assert np.all((lower <= found) & (found <= upper))
    factor = np.linalg.cholesky(hessian)
    theirs = lsq_linear(factor.T, np.linalg.solve(factor, -gradient), (lower, upper), method="bvls", tol=1e-14).x
    least = height(np.clip(theirs, lower, upper), gradient, hessian)
    assert height(found, gradient, hessian) <= least + 1e-9 * abs(least)


def test_guesses_that_go_round_in_a_circle_end_on_the_faces(monkeypatch: pytest.MonkeyPatch) -> None:
    """So that the comparison above is one of the second way, too."""
    taken, along_faces = [], module._along_faces

    def counted(*given: FloatArray) -> FloatArray:
        taken.append(given)
        return along_faces(*given)

    monkeypatch.setattr(module, "_along_faces", counted)
    for seed in range(6):
        bounded_minimum(*problem(seed, 8.0))
    assert taken


@pytest.mark.parametrize("seed", range(4))
def test_an_unknown_without_room_stays_and_the_others_find_their_minimum(seed: int) -> None:
    gradient, hessian, lower, upper = problem(seed, 8.0)
    lower[:5] = upper[:5] = 0.0
    others = bounded_minimum(gradient[5:], hessian[5:, 5:], lower[5:], upper[5:])
    by_guesses = bounded_minimum(gradient, hessian, lower, upper)
    by_faces = module._along_faces(np.zeros(SIZE), gradient, hessian, lower, upper)
    for found in (by_guesses, by_faces):
        np.testing.assert_array_equal(found[:5], 0.0)
        np.testing.assert_allclose(found[5:], others, atol=1e-6)


def test_without_bounds_it_is_the_step_of_newton() -> None:
    gradient, hessian, lower, upper = problem(0, 4.0)
    found = bounded_minimum(gradient, hessian, np.full_like(lower, -np.inf), np.full_like(upper, np.inf))
    np.testing.assert_allclose(found, np.linalg.solve(hessian, -gradient), rtol=1e-9)
