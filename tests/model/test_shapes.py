"""Cuboid, ring and cylinder against finite volumes that share no code with them."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lptn.model.bodies import Annulus, Axis, Cuboid, Cylinder, Shape, langevin
from tests.model.volumes import Answer, Face, Grid, refined

SIZE = st.floats(0.004, 0.1)
CONDUCTIVITY = st.floats(0.3, 300.0)
TEMPERATURE = st.floats(-20.0, 120.0)
FED = st.floats(-20.0, 20.0)
POWER = st.floats(-10.0, 60.0)
CELLS = 6


def _grids(shape: Shape, conductivity: tuple[float, ...], cells: int) -> list[Grid]:
    """The shape in so many cells along each axis that matters, and in twice as many."""
    grids = []
    for n in (cells, 2 * cells):
        if isinstance(shape, Cuboid):
            sizes = (shape.length_x, shape.length_y, shape.length_z)
            grids.append(Grid([np.linspace(0.0, size, n + 1) for size in sizes], conductivity))
        else:
            assert isinstance(shape, Annulus)
            radii = np.linspace(shape.inner_radius, shape.outer_radius, 4 * n + 1)
            edges = [radii, np.array([0.0, shape.angle]), np.linspace(0.0, shape.length, n + 1)]
            grids.append(Grid(edges, (conductivity[0], 1.0, conductivity[1]), ring=True))
    return grids


def _heat_out(axis: Axis, conductivity: float, mean: float, low: float, high: float) -> tuple[float, float]:
    """Heat out through the two faces [W], as an element has it."""
    across = axis.across * (low - high)
    return conductivity * (axis.mean[0] * (mean - low) - across), conductivity * (axis.mean[1] * (mean - high) + across)


def _check_axis(shape: Shape, name: str, conductivity: float, truth: Answer, at: tuple[Face, Face], tol: float) -> None:
    low, high = (truth.faces[face] for face in at)
    heat = _heat_out(shape.axes[name], conductivity, truth.mean, low, high)
    spread = max(abs(truth.mean - low), abs(truth.mean - high), abs(low - high))
    size = conductivity * max(shape.axes[name].mean) * spread + sum(abs(value) for value in truth.heat.values())
    assert heat == pytest.approx([truth.heat[face] for face in at], abs=tol * size)


boxes = st.builds(Cuboid, SIZE, SIZE, SIZE)
rings = st.builds(
    lambda inner, ratio, length, angle: Annulus(inner, inner * ratio, length, angle),
    SIZE,
    st.floats(1.02, 6.0),
    SIZE,
    st.floats(0.2, math.tau),
)


@settings(max_examples=30)
@given(
    boxes, st.tuples(CONDUCTIVITY, CONDUCTIVITY, CONDUCTIVITY), st.tuples(TEMPERATURE, TEMPERATURE), POWER, st.data()
)
def test_a_box_held_at_two_ends_has_its_mean_and_heat_exact(
    box: Cuboid, k: tuple[float, float, float], ends: tuple[float, float], power: float, data: st.DataObject
) -> None:
    """Any temperatures of two opposite faces, any heat spread evenly over the other four."""
    axis = data.draw(st.integers(0, 2))
    held = {(axis, 0): ends[0], (axis, 1): ends[1]}
    fed = {(other, end): data.draw(FED) for other in range(3) for end in (0, 1) if other != axis}
    truth = refined(_grids(box, k, CELLS), power, held, fed)
    _check_axis(box, "xyz"[axis], k[axis], truth, ((axis, 0), (axis, 1)), 1e-8)


@settings(max_examples=30)
@given(rings, st.tuples(CONDUCTIVITY, CONDUCTIVITY), st.tuples(TEMPERATURE, TEMPERATURE), POWER, st.data())
def test_a_ring_held_at_two_faces_has_its_mean_and_heat_exact(
    ring: Annulus, k: tuple[float, float], ends: tuple[float, float], power: float, data: st.DataObject
) -> None:
    """Any temperatures inside and outside (or in front and at the back), any heat through the other two."""
    axis = data.draw(st.sampled_from([0, 2]))
    held = {(axis, 0): ends[0], (axis, 1): ends[1]}
    fed = {(2 - axis, end): data.draw(FED) for end in (0, 1)}
    truth = refined(_grids(ring, k, CELLS), power, held, fed)
    name, conductivity = ("radial", k[0]) if axis == 0 else ("axial", k[1])
    _check_axis(ring, name, conductivity, truth, ((axis, 0), (axis, 1)), 2e-5)


@settings(max_examples=30)
@given(boxes, st.tuples(CONDUCTIVITY, CONDUCTIVITY, CONDUCTIVITY), st.lists(FED, min_size=6, max_size=6))
def test_a_box_fed_through_six_faces_is_exact_in_three_axes_at_once(
    box: Cuboid, k: tuple[float, float, float], heat: list[float]
) -> None:
    fed = {(axis, end): heat[2 * axis + end] for axis in range(3) for end in (0, 1)}
    truth = refined(_grids(box, k, CELLS), -sum(heat), {}, fed)
    for axis in range(3):
        _check_axis(box, "xyz"[axis], k[axis], truth, ((axis, 0), (axis, 1)), 1e-8)


@settings(max_examples=30)
@given(rings, st.tuples(CONDUCTIVITY, CONDUCTIVITY), st.lists(FED, min_size=4, max_size=4))
def test_a_ring_fed_through_four_faces_is_exact_in_both_axes_at_once(
    ring: Annulus, k: tuple[float, float], heat: list[float]
) -> None:
    fed: dict[Face, float] = {(0, 0): heat[0], (0, 1): heat[1], (2, 0): heat[2], (2, 1): heat[3]}
    truth = refined(_grids(ring, k, CELLS), -sum(heat), {}, fed)
    _check_axis(ring, "radial", k[0], truth, ((0, 0), (0, 1)), 2e-5)
    _check_axis(ring, "axial", k[1], truth, ((2, 0), (2, 1)), 2e-5)


@given(st.one_of(boxes, rings, st.builds(Cylinder, SIZE, SIZE)))
def test_no_element_takes_in_work(shape: Shape) -> None:
    """The conductance matrix of mean and two faces: rows sum to zero, no eigenvalue is negative."""
    for axis in shape.axes.values():
        n = len(axis.faces)
        matrix = np.zeros((n + 1, n + 1))
        matrix[0, 1:] = matrix[1:, 0] = [-value for value in axis.mean]
        if n == 2:
            matrix[1, 2] = matrix[2, 1] = -axis.across
        np.fill_diagonal(matrix, -matrix.sum(axis=1))
        values = np.linalg.eigvalsh(matrix)
        assert values[0] > -1e-9 * values[-1]
        assert (values[1:] > 0).all()


def test_a_slab_has_the_eigenvalues_of_the_source_table() -> None:
    """0, 2, 18 in kA/L ([BlockLPTN, eq. 9])."""
    matrix = np.array([[12.0, -6.0, -6.0], [-6.0, 4.0, 2.0], [-6.0, 2.0, 4.0]])
    axis = Cuboid(1.0, 1.0, 1.0).axes["x"]
    assert (axis.mean, axis.across) == ((6.0, 6.0), -2.0)
    np.testing.assert_allclose(np.linalg.eigvalsh(matrix), [0.0, 2.0, 18.0], atol=1e-12)


def test_a_thin_ring_is_a_slab_and_a_ring_without_hole_a_cylinder() -> None:
    thin = Annulus(1.0, 1.0 + 1e-6, 0.1, 0.5).axes["radial"]
    slab = Cuboid(1e-6, 0.5, 0.1).axes["x"]
    np.testing.assert_allclose([*thin.mean, thin.across], [*slab.mean, slab.across], rtol=1e-5)
    full = Annulus(1e-120, 0.02, 0.1).axes["radial"]
    np.testing.assert_allclose(full.mean[1], Cylinder(0.02, 0.1).axes["radial"].mean[0], rtol=5e-3)


@given(st.floats(1e-4, 0.3))
def test_the_series_meets_the_formula(x: float) -> None:
    """coth x - 1/x by 30 terms of its partial fractions' sum, in place of the cancelling difference."""
    terms = np.arange(1, 200_001)
    tail = 2.0 * x / (math.pi**2 * terms[-1])
    assert langevin(x) == pytest.approx(float((2.0 * x / (x**2 + (math.pi * terms) ** 2)).sum()) + tail, rel=1e-9)


@pytest.mark.parametrize(("axes", "excess"), [((0, 1), 0.186), ((0, 1, 2), 0.377)])
def test_faces_of_several_axes_held_alike_make_the_mean_too_high(axes: tuple[int, ...], excess: float) -> None:
    """Its limit, said in the module: heat crowds at edges between held faces."""
    box = Cuboid(0.02, 0.02, 0.02)
    held = {(axis, end): 0.0 for axis in axes for end in (0, 1)}
    truth = refined(_grids(box, (5.0, 5.0, 5.0), 8), 10.0, held, {})
    element = 10.0 / (5.0 * sum(sum(box.axes["xyz"[axis]].mean) for axis in axes))
    assert element / truth.mean - 1.0 == pytest.approx(excess, abs=0.01)


def test_count_and_angle_scale_volume_and_conductances() -> None:
    one, six = Cuboid(0.01, 0.02, 0.03), Cuboid(0.01, 0.02, 0.03, count=6)
    assert six.volume == pytest.approx(6 * one.volume)
    assert six.axes["y"].mean[0] == pytest.approx(6 * one.axes["y"].mean[0])
    ring, arc = Annulus(0.01, 0.02, 0.03), Annulus(0.01, 0.02, 0.03, math.pi / 6, count=12)
    assert arc.volume == pytest.approx(ring.volume)
    assert arc.axes["radial"].across == pytest.approx(ring.axes["radial"].across)
