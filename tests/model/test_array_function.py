"""CasADi's functions on NumPy's memory."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import casadi as ca
import numpy as np
import pytest

from lptn.model.array_function import ArrayFunction

X, P = ca.SX.sym("x", 2), ca.SX.sym("p", 3)
PRODUCT = ca.Function("product", [X, P], [ca.vertcat(X[0] * P[0], X[1] + P[1], ca.sin(P[2]), X[0] - X[1])])


def test_it_gives_the_numbers_of_the_function_to_the_last_bit() -> None:
    x, p = np.random.default_rng(0).normal(size=(2, 50)), np.array([1.5, -2.0, 0.3])
    expected = PRODUCT.map(50)(x, np.repeat(p[:, None], 50, axis=1)).full()
    assert np.array_equal(ArrayFunction(PRODUCT, 50, common=(1,))(x, p), expected)
    assert np.array_equal(ArrayFunction(PRODUCT, 50, common=(1,))(np.asfortranarray(x), p), expected)
    assert np.array_equal(ArrayFunction(PRODUCT)(x[:, 3], p)[:, 0], expected[:, 3])


def test_threads_share_it() -> None:
    p, shared = np.array([1.5, -2.0, 0.3]), ArrayFunction(PRODUCT, 2000, common=(1,))
    points = np.random.default_rng(1).normal(size=(40, 2, 2000))
    with ThreadPoolExecutor(4) as threads:
        together = list(threads.map(lambda x: shared(x, p), points))
    assert all(np.array_equal(got, shared(x, p)) for got, x in zip(together, points, strict=True))


def test_arguments_of_another_size_and_sparse_results_are_refused() -> None:
    with pytest.raises(ValueError, match=r"\[2, 2\] numbers in place of \[2, 3\]"):
        ArrayFunction(PRODUCT)(np.zeros(2), np.zeros(2))
    with pytest.raises(ValueError, match="sparse"):
        ArrayFunction(ca.Function("diagonal", [X], [ca.diag(X)]))
