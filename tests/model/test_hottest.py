"""The hottest point of an element: the exact profiles of a block, a ring and a rod, and finite volumes in time."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.linalg import solve_banded

from exact_block import HeatedBlock
from lptn.basics.errors import InputError
from lptn.cli.main import main
from lptn.model.bodies import RingProfile, RodProfile, SlabProfile
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.robots.presets import presets
from tests.model import slot

BLOCK = presets()["heated-block"]


def _block(text: str = BLOCK) -> Model:
    return Model(parse_model(text, Path("block.toml")).network)


@pytest.mark.parametrize("left", [20.0, 40.0, 69.0, 71.0, 120.0, -30.0])
def test_steady_the_hottest_point_of_a_block_is_exact_whatever_its_ends(left: float) -> None:
    """[BlockLPTN, eq. 4, 5], corrected; beyond 70 degC the hottest point is the warm end."""
    model = _block(BLOCK.replace("temperature = 40", f"temperature = {left}"))
    assert model.places == ["block", "block.hottest"]
    end = model.run(1000)([20.0, 20.0], np.zeros((0, 1000)), model.values, 15.0).full()[:, -1]
    exact = HeatedBlock(left=left)
    assert end == pytest.approx([exact.mean, exact.maximum], abs=1e-9)


RINGS = [(20.0, 20.0, 1e6), (20.0, 60.0, 1e6), (90.0, 20.0, 4e5), (50.0, 20.0, 0.0)]


@pytest.mark.parametrize(("low", "high", "heat"), RINGS)
def test_steady_the_hottest_radius_of_a_ring(low: float, high: float, heat: float) -> None:
    """By finite volumes: (1/r) (r T')' = -q/k."""
    inner, outer, k, n = 0.01, 0.03, 2.0, 2000
    edges = np.linspace(inner, outer, n + 1)
    middles, gap = (edges[1:] + edges[:-1]) / 2, (outer - inner) / n
    g = k * edges / gap * np.where((edges == inner) | (edges == outer), 2.0, 1.0)  # the outermost are half as thick
    side = heat * middles * gap
    side[0], side[-1] = side[0] + g[0] * low, side[-1] + g[-1] * high
    T = solve_banded((1, 1), np.vstack([-g[:-1], g[:-1] + g[1:], -g[1:]]), side)
    mean = (T * middles).sum() / middles.sum()
    hottest = float(RingProfile(inner, outer).hottest(float(mean), (low, high)))
    assert hottest == pytest.approx(max(T.max(), low, high), abs=1e-4 * max(T.max(), 20.0))


def test_a_thin_ring_is_a_slab_and_a_rod_is_hottest_on_its_axis() -> None:
    ring, slab = RingProfile(1.0, 1.001), SlabProfile(0.001)
    assert float(ring.hottest(50.0, (40.0, 43.0))) == pytest.approx(float(slab.hottest(50.0, (40.0, 43.0))), abs=5e-3)
    assert float(RodProfile(0.01).hottest(50.0, (40.0,))) == 60.0
    assert float(RodProfile(0.01).hottest(40.0, (50.0,))) == 50.0, "cooling down it is hottest outside"


@pytest.mark.parametrize("profile", [SlabProfile(0.1), RingProfile(0.01, 0.03)])
def test_a_body_that_is_cooler_inside_is_hottest_at_a_face(profile: SlabProfile | RingProfile) -> None:
    for faces in ((40.0, 40.0), (40.0, 45.0), (45.0, 40.0)):
        assert float(profile.hottest(20.0, faces)) == max(faces)
    assert float(profile.hottest(40.0, (40.0, 40.0))) == 40.0


def test_a_winding_cooled_on_one_side_is_19_7_k_above_its_mean_at_35_a() -> None:
    currents = np.full(1000, 35.0)
    solution = slot.truth(currents, 3.0)
    model = slot.model()
    inputs = np.vstack([np.full(1000, slot.AIR if name.startswith("temp") else 35.0) for name in model.inputs])
    course = model.run(1000)(np.full(3, slot.AIR), inputs, model.values, 3.0).full()
    assert course[model.states.index("winding.hottest"), -1] - course[0, -1] == pytest.approx(19.7, abs=0.05)
    for place, tolerance in (("winding", 0.01), ("iron", 0.01), ("winding.hottest", 0.02)):
        assert course[model.states.index(place), -1] == pytest.approx(solution[place][-1], abs=tolerance)


def test_in_time_the_hottest_point_follows_the_heat_equation_and_its_mean_delay_is_exact() -> None:
    """A step of the current: never off by 3 % of its rise, and the integral of the error nearly vanishes."""
    step, n = 1.0, 3000
    solution, model = slot.truth(np.full(n, 20.0), step), slot.model()
    inputs = np.vstack([np.full(n, slot.AIR if name.startswith("temp") else 20.0) for name in model.inputs])
    course = model.run(n)(np.full(3, slot.AIR), inputs, model.values, step).full()
    above_iron = solution["winding.hottest"][-1] - solution["iron"][-1]
    error = course[model.states.index("winding.hottest")] - solution["winding.hottest"]
    assert np.abs(error).max() < 0.03 * above_iron
    one_node = course[0] - solution["winding"]
    assert abs(error.sum()) < 0.01 * abs(one_node.sum()), "what the mean alone is off by, in time"


def test_it_stands_in_the_predicted_log(tmp_path: Path) -> None:
    solution, n = slot.truth(np.full(300, 20.0), 1.0), 300
    columns = {f"temperature.{node}": np.append(slot.AIR, solution[node][:-1]) for node in slot.model().nodes}
    columns |= {"current.winding": np.full(n, 20.0), "temperature.ambient": np.full(n, slot.AIR)}
    pd.DataFrame({"time": np.arange(float(n)), **columns}).to_csv(tmp_path / "log.csv", index=False)
    (tmp_path / "slot.toml").write_text(slot.TEXT)
    with pytest.raises(SystemExit) as ended:
        main(["simulate", str(tmp_path / "slot.toml"), str(tmp_path / "log.csv"), "-o", str(tmp_path / "p.csv")])
    assert not ended.value.code
    written = pd.read_csv(tmp_path / "p.csv")["temperature.winding.hottest"].to_numpy()
    assert written[-1] == pytest.approx(solution["winding.hottest"][-2], rel=0.01)


def test_several_axes_add_and_the_quickest_leads() -> None:
    """Ends of all three axes held: each profile as by itself, with its share of the heat."""
    links = "".join(
        f'[[links]]\nbetween = ["block.{axis}{side}", "cold_end"]\nperfect = true\n' for axis in "xyz" for side in "01"
    )
    head, _, tail = BLOCK.partition('[[links]]\nbetween = ["block.x0", "warm_end"]')
    model = _block(head + links + tail[tail.index("[[effects]]") :])
    end = model.run(4000)([20.0, 20.0], np.zeros((0, 4000)), model.values, 0.5).full()[:, -1]
    assert end[1] - 20.0 == pytest.approx((end[0] - 20.0) * (1 + 3 * 0.5), rel=1e-6)


def test_a_thin_metal_has_no_state_quicker_than_a_second() -> None:
    thin = BLOCK.replace("length_x = { value = 10, unit", "length_x = { value = 0.1, unit")
    model = _block(thin.replace("conductivity = 10 ", "conductivity = 400 "))
    jacobian = model.state_jacobian([30.0, 30.0], [], model.values).full()
    assert jacobian[1, 1] == pytest.approx(-1.0)


def test_it_is_true_or_false_and_named_in_the_file() -> None:
    with pytest.raises(InputError, match=r"hottest.*true or false"):
        parse_model(BLOCK.replace("hottest = true", "hottest = 3"), Path("block.toml"))
    assert _block(BLOCK.replace("hottest = true", "hottest = false")).places == ["block"]
    assert math.isfinite(float(_block().rhs([20.0, 20.0], [], _block().values)[1]))
