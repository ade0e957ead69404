"""The heated block: exact answer, five networks, order, transients.

Source: [BlockLPTN, eq. 1 to 9; sec. 1.3, 2.1, 2.2, 2.3]; the expected numbers are ours.
"""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import minimize_scalar

from exact_block import (
    HALVED,
    NEGATIVE,
    PEAK,
    PLAIN,
    SHIFTED,
    HeatedBlock,
    Method,
    block_network,
    order,
    steady_errors,
)

EQUAL, UNEQUAL, STEEP = HeatedBlock(left=20.0), HeatedBlock(left=40.0), HeatedBlock(left=80.0)
blocks = st.builds(
    HeatedBlock,
    heat=st.floats(1e3, 1e6),
    left=st.floats(-20.0, 120.0),
    right=st.floats(-20.0, 120.0),
    length=st.floats(0.005, 0.3),
    conductivity=st.floats(0.2, 300.0),
)


# --- the exact answer ------------------------------------------------------------------------------------


@given(blocks)
def test_the_profile_solves_poissons_equation_between_its_ends(block: HeatedBlock) -> None:
    """[BlockLPTN, eq. 1 to 4]: k T'' = -q by second differences, exact for a parabola; heat out is heat in."""
    h = block.length / 8.0
    T = block.temperature(np.linspace(0.0, block.length, 9))
    size = float(np.abs(T).max())
    assert (T[0], T[-1]) == pytest.approx((block.left, block.right), abs=1e-10 * size)
    curvature = (T[2:] - 2.0 * T[1:-1] + T[:-2]) / h**2
    np.testing.assert_allclose(
        block.conductivity * curvature, -block.heat, rtol=0, atol=1e-11 * size * 9 / h**2 * block.conductivity
    )


@given(blocks)
def test_the_mean_is_the_integral_of_the_profile(block: HeatedBlock) -> None:
    """[BlockLPTN, eq. 8] by Simpson's rule, which is exact for a parabola."""
    T = block.temperature(np.array([0.0, block.length / 2.0, block.length]))
    assert block.mean == pytest.approx(float(T @ [1.0, 4.0, 1.0]) / 6.0, rel=1e-12, abs=1e-10)


@given(blocks)
def test_the_maximum_lies_where_the_gradient_vanishes_or_at_the_hotter_end(block: HeatedBlock) -> None:
    """[BlockLPTN, eq. 5] corrected: the parabola through three of its points, scaled, to 1e-9 of the length."""
    a, b, _ = np.polyfit([0.0, 0.5, 1.0], block.temperature(block.length * np.array([0.0, 0.5, 1.0])), 2)
    steep = abs(block.left - block.right) + 1.0
    if -a < 1e-4 * steep:
        return  # hardly a parabola: three rounded points do not say where its top is
    expected = min(max(-b / (2.0 * a), 0.0), 1.0)
    assert block.hottest_place / block.length == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("block", "place", "maximum"), [(EQUAL, 0.05, 32.5), (UNEQUAL, 0.03, 44.5), (STEEP, 0.0, 80.0)]
)
def test_hottest_places_of_the_source_table(block: HeatedBlock, place: float, maximum: float) -> None:
    assert block.hottest_place == pytest.approx(place, abs=1e-9)
    assert block.maximum == pytest.approx(maximum, abs=1e-9)
    minimum = minimize_scalar(lambda x: -float(block.temperature(x)), bounds=(0.0, block.length), method="bounded")
    assert block.maximum >= -minimum.fun - 1e-9


def test_the_printed_place_is_wrong_but_for_one_difference() -> None:
    """[BlockLPTN, eq. 5] as printed: zero for equal ends, outside for T1 < T2, right at (√2 - 1) q L²/(2k) alone."""
    assert EQUAL.printed_hottest_place == 0.0
    assert HeatedBlock(left=10.0).printed_hottest_place < 0.0
    lucky = HeatedBlock(left=20.0 + (2**0.5 - 1.0) * 4.0 * EQUAL.rise)
    assert lucky.printed_hottest_place == pytest.approx(lucky.hottest_place, abs=1e-15)
    for block, share in ((EQUAL, -1.0), (HeatedBlock(left=25.0), -0.52), (HeatedBlock(left=60.0), -0.48)):
        off = float(block.temperature(block.printed_hottest_place)) - block.maximum
        assert off / block.rise == pytest.approx(share, abs=0.006)


def test_without_heat_the_hotter_end_is_hottest() -> None:
    assert HeatedBlock(heat=0.0, left=10.0).hottest_place == pytest.approx(0.1)
    assert HeatedBlock(heat=0.0, left=30.0).hottest_place == 0.0


# --- the five networks -------------------------------------------------------------------------------------

# method, n -> T_max and mean error at equal ends, T_max error at T1 = T2 + 20, heat that arrives
ROWS = [
    (PLAIN, 1, 12.5, 16.667, 10.5, 1.0),
    (PLAIN, 2, 0.0, 4.167, 3.0, 1.0),
    (PLAIN, 3, 1.389, 1.852, 0.5, 1.0),
    (PLAIN, 4, 0.0, 1.042, 0.5, 1.0),
    (PLAIN, 8, 0.0, 0.2604, 0.1875, 1.0),
    (PLAIN, 16, 0.0, 0.0651, 0.03125, 1.0),
    (PLAIN, 64, 0.0, 0.00407, 0.00195, 1.0),
    (HALVED, 1, 0.0, 4.167, -2.0, 0.5),
    (HALVED, 4, -6.25, -3.646, -3.875, 0.5),
    (SHIFTED, 1, 0.0, 4.167, 0.0, 0.5),
    (NEGATIVE, 1, -4.167, 0.0, -6.167, 1.0),
    (NEGATIVE, 4, -1.042, 0.0, -0.5417, 1.0),
    (NEGATIVE, 64, -0.00407, 0.0, -0.00212, 1.0),
]


@pytest.mark.parametrize(("method", "n", "top", "mean", "unequal", "heat"), ROWS)
def test_steady_errors_of_the_source_table(
    method: Method, n: int, top: float, mean: float, unequal: float, heat: float
) -> None:
    errors, other = (steady_errors(block_network(block, n, method)) for block in (EQUAL, UNEQUAL))
    assert errors.maximum == pytest.approx(top, abs=5e-4)
    assert errors.mean == pytest.approx(mean, abs=5e-4)
    assert other.maximum == pytest.approx(unequal, abs=5e-4)
    if not method.shifted:
        assert other.mean == pytest.approx(errors.mean, abs=1e-9)
    assert (errors.heat, other.heat) == pytest.approx((heat, heat), abs=1e-10)


@given(blocks, st.integers(1, 9))
def test_the_negative_resistance_makes_the_mean_exact(block: HeatedBlock, n: int) -> None:
    """[BlockLPTN, eq. 9] for every n and any ends; all heat arrives."""
    errors = steady_errors(block_network(block, n, NEGATIVE))
    assert errors.mean == pytest.approx(0.0, abs=1e-10 * (block.rise + abs(block.left) + abs(block.right)))
    assert errors.heat == pytest.approx(1.0, abs=1e-7 * (1.0 + abs(block.left - block.right) / block.rise))


@given(blocks)
def test_half_the_heat_at_the_right_place_makes_the_maximum_exact(block: HeatedBlock) -> None:
    """[BlockLPTN, sec. 2.1], node shifted to a maximum inside; not shifted: exact at the node's own place."""
    if not 0.0 < block.hottest_place < block.length:
        with pytest.raises(ValueError, match="inside"):
            block_network(block, 1, SHIFTED)
        return
    errors = steady_errors(block_network(block, 1, SHIFTED))
    assert errors.maximum == pytest.approx(0.0, abs=1e-12 * (block.rise + abs(block.left) + abs(block.right)) * 10)
    assert errors.heat == pytest.approx(0.5, abs=1e-6 * (1.0 + abs(block.left - block.right) / block.rise))


@pytest.mark.parametrize("block", [EQUAL, UNEQUAL, STEEP])
def test_node_and_mean_converge_with_order_two(block: HeatedBlock) -> None:
    """[BlockLPTN, sec. 2.3]: error × n² is constant to 1e-4: q L²/(8k) at every node, q L²/(6k) in the mean."""
    n = np.array([1, 3, 5, 9, 17, 33])
    errors = [steady_errors(block_network(block, int(count))) for count in n]
    node, mean = np.array([one.node for one in errors]), np.array([one.mean for one in errors])
    np.testing.assert_allclose(node * n**2, block.rise, rtol=1e-4)
    np.testing.assert_allclose(mean * n**2, 4.0 / 3.0 * block.rise, rtol=1e-4)
    assert order(n, node) == pytest.approx(2.0, abs=1e-6)


def test_a_maximum_on_the_end_converges_with_order_one() -> None:
    """[BlockLPTN, sec. 1.3]: the network is not always too hot; at T1 = 80 degC one node is 5 K too cold."""
    n = np.array([1, 3, 5, 9, 17, 33])
    top = np.array([steady_errors(block_network(STEEP, int(count))).maximum for count in n])
    assert top[0] == pytest.approx(-5.0)
    assert order(n, top) == pytest.approx(1.0, abs=1e-3)


# --- in time ----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def switched_on() -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times, mean and middle of 200 finite volumes after the heat is switched on."""
    t = np.linspace(0.0, 10.0 * EQUAL.time_constant, 501)
    volumes = EQUAL.slices(200, t)
    return t, volumes.mean(axis=1), volumes[:, 99:101].mean(axis=1)


@pytest.mark.parametrize(
    ("method", "seconds", "mean", "middle"),
    [(PLAIN, 875.0, 16.2, 12.0), (HALVED, 875.0, 3.94, 3.93), (NEGATIVE, 291.7, 0.55, 4.17), (PEAK, 437.5, 4.16, 0.84)],
)
def test_one_node_in_time_against_200_finite_volumes(
    switched_on: tuple[np.ndarray, np.ndarray, np.ndarray],
    method: Method,
    seconds: float,
    mean: float,
    middle: float,
) -> None:
    t, volume_mean, volume_middle = switched_on
    network = block_network(EQUAL, 1, method)
    node = network.after(t)[:, 0]
    assert -1.0 / network.rates()[0] == pytest.approx(seconds, abs=0.05)
    assert np.abs(node - volume_mean).max() == pytest.approx(mean, abs=0.07)
    assert np.abs(node - volume_middle).max() == pytest.approx(middle, abs=0.07)


def test_the_finite_volumes_end_at_the_exact_answer(
    switched_on: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    _, mean, middle = switched_on
    assert EQUAL.time_constant == pytest.approx(354.6, abs=0.05)
    assert mean[-1] == pytest.approx(EQUAL.mean, abs=2e-3)
    assert middle[-1] == pytest.approx(EQUAL.maximum, abs=2e-3)


def test_many_nodes_with_the_negative_resistance_follow_the_mean(
    switched_on: tuple[np.ndarray, np.ndarray, np.ndarray],
) -> None:
    t, mean, _ = switched_on
    path = block_network(EQUAL, 8, NEGATIVE).after(t).mean(axis=1)
    assert np.abs(path - mean).max() < 0.05


@pytest.mark.parametrize("n", [1, 2, 3, 5, 16])
def test_the_negative_resistance_is_safe_with_a_massless_star_point(n: int) -> None:
    """Every rate is negative; conductances between nodes are negative from n = 3; steps are three times shorter."""
    network, plain = block_network(EQUAL, n, NEGATIVE), block_network(EQUAL, n, PLAIN)
    assert network.rates()[-1] < 0
    assert network.rates()[0] == pytest.approx(3.0 * plain.rates()[0], rel=1e-6)
    off = network.matrix - np.diag(np.diag(network.matrix))
    assert (off.max() > 1e-6) == (n >= 3)


@pytest.mark.parametrize("share", [0.01, 0.1, 0.5, 0.9])
@pytest.mark.parametrize("n", [1, 3])
def test_any_capacity_on_the_star_point_makes_it_unstable(share: float, n: int) -> None:
    assert block_network(EQUAL, n, Method("", foot=-1 / 6, star=share)).rates()[-1] > 1e-3
