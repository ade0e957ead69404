"""Elements as nodes of a network: links at faces, faces eliminated, laws that are not linear at a face."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import pairwise

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.parameters import Parameter
from lptn.effects.radiation import STEFAN_BOLTZMANN, ZERO_CELSIUS
from lptn.model.bodies import Annulus, Cuboid, Cylinder, Element, Shape
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, LinkDeclaration, Network, NodeDeclaration
from tests.builders import AMBIENT, capacity, effect, link, node
from tests.model.volumes import Answer, Face, Grid, refined

FACES: dict[str, Face] = {"x0": (0, 0), "x1": (0, 1), "y0": (1, 0), "y1": (1, 1), "z0": (2, 0), "z1": (2, 1)}


def _element(shape: Shape, *values: float) -> Element:
    parameters = {
        direction: Parameter(f"conductivity_{direction}", value, "W/(m*K)", (1e-4, 1e4), fixed=True)
        for direction, value in zip(shape.directions, values, strict=True)
    }
    return Element(shape, parameters)


def _body(name: str, shape: Shape, *values: float, heat: float = 300.0) -> NodeDeclaration:
    return NodeDeclaration(name, capacity(heat), element=_element(shape, *values))


def _held(name: str, temperature: float) -> NodeDeclaration:
    return NodeDeclaration(name, temperature=Parameter("temperature", temperature, "degC", fixed=True))


def _touching(one: str, other: str) -> LinkDeclaration:
    return LinkDeclaration((one, other), None)


def _network(
    nodes: Sequence[NodeDeclaration], links: Sequence[LinkDeclaration], effects: Sequence[EffectDeclaration] = ()
) -> Network:
    return Network("bodies", tuple(nodes), tuple(links), tuple(effects))


def _steady(model: Model, u: Sequence[float] = ()) -> FloatArray:
    x = np.zeros(len(model.states))
    slope = model.state_jacobian(x, list(u), model.values).full()
    return np.asarray(-np.linalg.solve(slope, model.rhs(x, list(u), model.values).full().ravel()))


def _conductance(model: Model) -> FloatArray:
    """Minus the heat into each node by the temperature of each [W/K]."""
    p, u = model.values, [20.0] * len(model.inputs)
    heat = np.array([p[model.network.capacities[name]] for name in model.nodes])
    return np.asarray(-heat[:, None] * model.state_jacobian([20.0] * len(model.nodes), u, p).full())


# --- exact ------------------------------------------------------------------------------------------------


@settings(max_examples=20)
@given(st.lists(st.floats(-20.0, 20.0), min_size=6, max_size=6), st.lists(st.floats(0.1, 9.0), min_size=6, max_size=6))
def test_a_box_behind_six_resistances_has_its_mean_exact(heat: list[float], ohms: list[float]) -> None:
    """Heat in evenly through six faces, from surroundings whose temperatures follow from the finite volumes."""
    box, k = Cuboid(0.02, 0.05, 0.01), (0.8, 20.0, 3.0)
    fed = {face: heat[number] for number, face in enumerate(FACES.values())}
    grids = [Grid([np.linspace(0.0, s, n + 1) for s in (0.02, 0.05, 0.01)], k) for n in (5, 10)]
    truth = refined(grids, -sum(heat), {}, fed)
    nodes, links = [_body("box", box, *k)], []
    for number, (name, face) in enumerate(FACES.items()):
        nodes.append(_held(f"air_{name}", truth.faces[face] + heat[number] * ohms[number]))
        links.append(link(f"box.{name}", f"air_{name}", ohms[number]))
    source = replace(effect("constant_heat", "box"), parameters=(Parameter("power", -sum(heat), "W"),))
    model = Model(_network(nodes, links, [source]))
    size = max(abs(value - truth.mean) for value in truth.faces.values()) + max(map(abs, heat)) * max(ohms)
    assert _steady(model)[0] == pytest.approx(truth.mean, abs=1e-8 * size + 1e-9)


@settings(max_examples=20)
@given(st.floats(-20.0, 120.0), st.floats(-20.0, 120.0), st.floats(0.0, 90.0))
def test_a_ring_between_held_faces_has_its_mean_exact(inside: float, outside: float, power: float) -> None:
    ring = Annulus(0.02, 0.045, 0.03)
    edges = [[np.linspace(0.02, 0.045, 24 * m + 1), np.array([0.0, math.tau]), np.array([0.0, 0.03])] for m in (1, 2)]
    held: dict[Face, float] = {(0, 0): inside, (0, 1): outside}
    truth: Answer = refined([Grid(edge, (4.0, 1.0, 1.0), ring=True) for edge in edges], power, held, {})
    nodes = [_body("ring", ring, 4.0, 1.0), _held("inside", inside), _held("outside", outside)]
    links = [_touching("ring.inner", "inside"), _touching("ring.outer", "outside")]
    model = Model(_network(nodes, links, [effect("constant_heat", "ring", power=power)]))
    assert _steady(model)[0] == pytest.approx(truth.mean, abs=1e-5 * (abs(inside - outside) + power / 10.0) + 1e-9)


def test_one_cooled_side_is_a_third_of_the_length_away() -> None:
    """R = L/(3kA) from the mean to one end, the other insulated; L/(12kA) to both; time constant of 291.7 s."""
    box = Cuboid(0.1, 0.1, 0.01)
    one = Model(_network([_body("box", box, 10.0, 10.0, 10.0), AMBIENT], [_touching("box.x0", "ambient")]))
    assert _conductance(one)[0, 0] == pytest.approx(3.0 * 10.0 * 1e-3 / 0.1, rel=1e-12)
    ends = [_touching("box.x0", "ambient"), _touching("box.x1", "ambient")]
    both = Model(_network([_body("box", box, 10.0, 10.0, 10.0, heat=350.0), AMBIENT], ends))
    assert -1.0 / both.state_jacobian([0.0], [0.0], both.values).full()[0, 0] == pytest.approx(350.0 / 1.2, rel=1e-12)


def test_a_box_cut_in_three_that_touch_is_the_chain_of_three() -> None:
    """Interior joints in perfect contact; the mean of the pieces is that of the whole, for any ends."""
    nodes = [_body(f"b{i}", Cuboid(0.1 / 3, 0.1, 0.01), 10.0, 10.0, 10.0, heat=117.0) for i in range(3)]
    links = [_touching("b0.x0", "hot"), _touching("b0.x1", "b1.x0"), _touching("b2.x0", "b1.x1")]
    nodes += [_held("hot", 40.0), _held("cold", 20.0)]
    network = _network(nodes, [*links, _touching("cold", "b2.x1")], [effect("constant_heat", power=10.0 / 3)])
    assert len(network.massless) == 2
    steady = _steady(Model(network))
    assert steady.mean() == pytest.approx(30.0 + 25.0 / 3.0, abs=1e-9)
    assert steady[0] > steady[2]


# --- sound ---------------------------------------------------------------------------------------------------


@st.composite
def _stacks(draw: st.DrawFn) -> Network:
    """A shaft, rings around it and boxes beside them, joined at random, some faces open to the ambient."""
    k, size, ohm = st.floats(0.2, 300.0), st.floats(0.003, 0.08), st.floats(0.01, 20.0)
    nodes = [_body("a", Cylinder(draw(size), draw(size)), draw(k), draw(k), heat=draw(st.floats(5.0, 500.0)))]
    for name in "bcd"[: draw(st.integers(1, 3))]:
        inner = draw(size)
        ring, box = Annulus(inner, inner * draw(st.floats(1.1, 3.0)), draw(size)), Cuboid(draw(size), draw(size), 0.01)
        shape = draw(st.sampled_from([ring, box]))
        values = [draw(k) for _ in shape.directions]
        nodes.append(_body(name, shape, *values, heat=draw(st.floats(5.0, 500.0))))
    faces = [f"{n.pattern}.{face}" for n in nodes if n.element for face in n.element.shape.faces]
    links = [link("a.front", "ambient", draw(ohm))]
    for before, here in pairwise(nodes):
        ends = [draw(st.sampled_from([f for f in faces if f[0] == n.pattern])) for n in (before, here)]
        links.append(_touching(ends[0], ends[1]) if draw(st.booleans()) else link(ends[0], ends[1], draw(ohm)))
    taken = {end for one in links for end in one.between}
    links += [link(face, "ambient", draw(ohm)) for face in faces if face not in taken and draw(st.booleans())]
    return _network([*nodes, AMBIENT], links, [effect("constant_heat", power=draw(st.floats(0.0, 50.0)))])


@settings(max_examples=40)
@given(_stacks())
def test_no_heat_is_lost_and_no_work_taken_in(network: Network) -> None:
    """Reduced conductances are symmetric and positive definite; what the ambient gives is what the nodes lose."""
    model = Model(network)
    assert model.is_linear
    matrix = _conductance(model)
    np.testing.assert_allclose(matrix, matrix.T, rtol=1e-8, atol=1e-9 * np.abs(matrix).max())
    values = np.linalg.eigvalsh((matrix + matrix.T) / 2)
    assert values[0] > 0
    heat = np.array([model.values[network.capacities[name]] for name in model.nodes])
    x, u, p = np.full(len(model.nodes), 35.0), [35.0], model.values
    power = model.values[[name.startswith("constant_heat") for name in (v.name for v in model.parameters)]]
    np.testing.assert_allclose(heat * model.rhs(x, u, p).full().ravel(), power, rtol=1e-6, atol=1e-6)
    assert np.linalg.eigvals(model.state_jacobian(x, u, p).full()).real.max() < 0


def test_a_free_conductivity_fits_like_any_parameter_and_an_unused_one_is_left_out() -> None:
    ring = replace(_body("ring", Annulus(0.02, 0.04, 0.03), 4.0, 1.0))
    model = Model(_network([ring, AMBIENT], [link("ring.outer", "ambient", 2.0)]))
    names = [parameter.name for parameter in model.parameters]
    assert "conductivity_radial.ring" in names
    assert "conductivity_axial.ring" not in names
    x, h = [80.0], 1e-6
    by_ad = model.parameter_jacobian(x, [20.0], model.values).full()[0, names.index("conductivity_radial.ring")]
    moved = [model.values + sign * h * np.eye(len(names))[names.index("conductivity_radial.ring")] for sign in (1, -1)]
    by_difference = np.subtract(*(model.rhs(x, [20.0], p).full().item() for p in moved)) / (2 * h)
    assert by_ad == pytest.approx(by_difference, rel=1e-6)


def test_the_right_hand_side_is_explicit_and_compiles_to_c() -> None:
    network = _network(
        [_body("a", Cylinder(0.01, 0.05), 40.0, 40.0), _body("b", Annulus(0.01, 0.03, 0.05), 2.0, 9.0), AMBIENT],
        [_touching("a.outer", "b.inner"), link("b.outer", "ambient", 3.0), link("b.back", "a.back", 1.0)],
    )
    rhs = Model(network).rhs
    assert rhs.is_a("SXFunction")
    generator = ca.CodeGenerator("bodies")
    generator.add(rhs)
    assert "newton" not in generator.dump().lower()


# --- laws that are not linear at a face ------------------------------------------------------------------------


@pytest.mark.parametrize("mean", [30.0, 80.0, 150.0])
def test_radiation_from_a_face_is_solved_without_a_loop(mean: float) -> None:
    """Against a root finder: heat through the face = convection + radiation, at the face's own temperature."""
    box = _body("box", Cuboid(0.02, 0.05, 0.05), 0.5, 0.5, 0.5)
    radiation = effect("radiation", "box.x0", area=0.02)
    model = Model(_network([box, AMBIENT], [link("box.x0", "ambient", 5.0)], [radiation]))
    inside = 3.0 * 0.5 * 0.05**2 / 0.02

    def out(face: float) -> float:
        glow = STEFAN_BOLTZMANN * 0.02 * ((face + ZERO_CELSIUS) ** 4 - (20.0 + ZERO_CELSIUS) ** 4)
        return (face - 20.0) / 5.0 + glow

    face = brentq(lambda face: inside * (mean - face) - out(face), 20.0, mean, xtol=1e-13)
    rate = model.rhs([mean], [20.0], model.values).full().item()
    assert -rate * 300.0 == pytest.approx(out(face), abs=1e-9)


def test_natural_and_forced_convection_at_a_face() -> None:
    box = _body("box", Cuboid(0.02, 0.05, 0.05), 0.5, 0.5, 0.5)
    bare = _network([box, AMBIENT], [link("box.x0", "ambient", 5.0)])
    assert bare.surroundings == {"box.x0": ("box.x0", "ambient")}
    cold = Model(bare)
    wind = Model(bare.with_effects([effect("forced_convection", "box.x0", gamma=0.5)]))
    assert wind.is_linear
    columns = {"temperature.ambient": 20.0, "speed.base": 3.0}
    windy = wind.rhs([80.0], [columns[c] for c in wind.inputs], wind.values).full().item()
    inside = 3.0 * 0.5 * 0.05**2 / 0.02
    assert -300.0 * windy == pytest.approx(60.0 / (1.0 / inside + 5.0 / 2.5), rel=1e-12)
    hot = Model(bare.with_effects([effect("natural_convection", "*", beta=0.01)]))
    drop = hot.rhs([80.0], [20.0], hot.values).full().item() / cold.rhs([80.0], [20.0], cold.values).full().item()
    face = brentq(lambda f: inside * (80.0 - f) - (f - 20.0) / 5.0 * math.exp(0.01 * (f - 20.0)), 20.0, 80.0)
    assert drop == pytest.approx((80.0 - face) * inside / (60.0 / (1.0 / inside + 5.0)), rel=1e-10)


# --- mistakes ---------------------------------------------------------------------------------------------------

RING = _body("ring", Annulus(0.02, 0.04, 0.03), 4.0, 1.0)
MISTAKES: dict[str, tuple[Sequence[NodeDeclaration], Sequence[LinkDeclaration], str]] = {
    "middle": ([RING, AMBIENT], [link("ring", "ambient")], "ring.inner, ring.outer, ring.front, ring.back"),
    "middle by a pattern": ([RING, AMBIENT], [link("*", "ambient")], "middle of element ring"),
    "no such face": ([RING, AMBIENT], [link("ring.left", "ambient")], "two of ring.inner"),
    "nothing attached": ([RING, node("a"), AMBIENT], [link("a", "ambient")], 'between = ["ring.inner", "ambient"]'),
    "two masses touching": ([node("a"), node("b"), AMBIENT], [_touching("a", "b")], "a face without a fixed"),
    "a face held twice": (
        [RING, _held("h", 3.0), AMBIENT],
        [_touching("ring.inner", "h"), _touching("ring.inner", "ambient")],
        "a face without a fixed",
    ),
    "two links at a face": ([RING, AMBIENT], [link("ring.inner", "ambient")] * 2, "second link"),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line(mistake: str) -> None:
    nodes, links, words = MISTAKES[mistake]
    with pytest.raises(InputError) as caught:
        _network(nodes, links)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_patterns_with_a_dot_mean_faces() -> None:
    legs = [replace(_body(f"{leg}_motor", Annulus(0.02, 0.04, 0.03), 4.0, 1.0)) for leg in ("FL", "FR")]
    network = _network(
        [*legs, AMBIENT], [link("*_motor.outer", "ambient"), _touching("FL_motor.back", "FR_motor.back")]
    )
    assert [one.place for one in network.resistors] == ["FL_motor.outer~ambient", "FR_motor.outer~ambient"]
