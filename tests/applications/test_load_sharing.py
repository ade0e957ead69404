"""Load sharing: statics by virtual work, optima by a general optimiser on a heat balance of the test's own."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import null_space
from scipy.optimize import NonlinearConstraint, minimize
from scipy.spatial.transform import Rotation

from lptn.applications.load_sharing import LoadSharing, Sharing, Stance, StanceError, load_body, statics
from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.effects.copper_loss import CopperLoss
from lptn.model.model import Model
from lptn.model.network import LinkDeclaration, Network, NodeDeclaration
from tests.builders import AMBIENT, capacity, effect, resistance

LEGS = ("FR", "FL", "RR", "RL")
JOINTS = [f"{leg}_{part}" for leg in LEGS for part in ("hip", "thigh", "calf")]
CAPACITY, TO_AIR, COPPER = 300.0, 10.0, 0.15 / 0.84**2  # J/K, K/W, W/(N·m)²
LIMIT = 42.0  # degC
_GRID = 2.0  # s
ALONG = {("hip", "thigh"): 3.0, ("thigh", "calf"): 2.0}  # K/W


@lru_cache
def model() -> Model:
    """Twelve joints, copper loss and links: linear in its temperatures."""
    nodes = (*(NodeDeclaration(joint, capacity(CAPACITY)) for joint in JOINTS), AMBIENT)
    links = [LinkDeclaration((joint, "ambient"), resistance(TO_AIR)) for joint in JOINTS]
    links += [
        LinkDeclaration((f"{leg}_{one}", f"{leg}_{other}"), resistance(value))
        for leg in LEGS
        for (one, other), value in ALONG.items()
    ]
    return Model(Network("stand", nodes, tuple(links), (effect("copper_loss"),)))


def true_time(torques: FloatArray, start: FloatArray) -> float:
    """When the first joint is at the limit [s]: the linear heat balance by its eigenvectors, in numpy alone."""
    leg = -np.eye(3) / TO_AIR
    for i, j, value in ((0, 1, 3.0), (1, 2, 2.0)):
        leg[[i, j], [i, j]] -= 1 / value
        leg[[i, j], [j, i]] += 1 / value
    rates, modes = np.linalg.eigh(leg / CAPACITY)
    steady = -np.linalg.solve(leg, COPPER * torques.reshape(4, 3).T ** 2)  # K above the ambient
    begin = modes.T @ (start.reshape(4, 3).T - 25.0 - steady)
    time = np.arange(0.0, 6000.0, _GRID)
    T = 25.0 + steady[None] + np.einsum("ij,tj,jl->til", modes, np.exp(rates * time[:, None]), begin)
    hottest = T.reshape(time.size, -1).max(axis=1)
    over = np.flatnonzero(hottest >= LIMIT)
    if over.size == 0:
        return float("inf")
    k = int(over[0])
    return float(time[k - 1] + _GRID * (LIMIT - hottest[k - 1]) / (hottest[k] - hottest[k - 1])) if k else 0.0


@lru_cache
def sharing() -> LoadSharing:
    return LoadSharing(model(), load_body("a1"), {"*": LIMIT})


def posture(thigh: float = 0.9, hip: float = 0.0) -> FloatArray:
    return np.tile([hip, thigh, -2 * thigh], 4)


POSTURES = {
    "upright": Stance(posture(0.7), load=4.0),
    "bent": Stance(posture(1.1), load=4.0),
    "leaning": Stance(
        posture(0.9) + np.array([0, 0.15, 0] * 2 + [0, -0.1, 0] * 2), load=4.0, load_at=(-0.08, 0.02, 0.1)
    ),
    "on a slope": Stance(posture(0.9), load=4.0, pitch=0.15, roll=-0.05),
}  # fmt: skip
COOL = np.full(12, 25.0)


def starts(uneven: bool) -> FloatArray:
    return np.asarray(COOL + np.array([0, 0, 12.0, 0, 0, 0, 0, 0, 0, 3, 0, 0]) * uneven)


def by_name(start: FloatArray) -> dict[str, float]:
    return dict(zip(JOINTS, start.tolist(), strict=True))


# --- statics ------------------------------------------------------------------------------------


def feet_and_height(angles: FloatArray, up: FloatArray) -> tuple[FloatArray, float]:
    """Feet's lowest points, and the legs' Σ m z along `up`, by scipy's rotations and the URDF's numbers."""
    feet, height = [], 0.0
    for leg, (q1, q2, q3) in zip(LEGS, angles.reshape(4, 3), strict=True):
        front, side = (1 if leg[0] == "F" else -1), (1 if leg[1] == "L" else -1)
        hip = np.array([0.1805 * front, 0.047 * side, 0.0])
        about = Rotation.from_rotvec([q1, 0, 0])
        thigh = hip + about.apply([0, 0.0838 * side, 0])
        upper = about * Rotation.from_rotvec([0, q2, 0])
        knee = thigh + upper.apply([0, 0, -0.2])
        lower = upper * Rotation.from_rotvec([0, q3, 0])
        feet.append(knee + lower.apply([0, 0, -0.2]))
        centres = (
            (0.696, hip + about.apply([-0.003311 * front, 0.000635 * side, 0.000031])),
            (1.013, thigh + upper.apply([-0.003237, -0.022327 * side, -0.027326])),
            (0.166, knee + lower.apply([0.006435, 0.0, -0.107388])),
            (0.06, knee + lower.apply([0, 0, -0.2])),
        )
        height += sum(mass * float(centre @ up) for mass, centre in centres)
    return np.array(feet), height


@pytest.mark.parametrize("stance", POSTURES.values(), ids=list(POSTURES))
def test_torques_follow_from_virtual_work(stance: Stance) -> None:
    """The work of the torques is that of the feet's forces and of the links' weight, angle by angle."""
    equations = statics(load_body(), stance)
    forces = np.random.default_rng(1).normal(0.0, 30.0, (4, 3))
    torques, step = equations.torques(forces), 1e-6
    for k in range(12):
        moved = []
        for side in (1, -1):
            angles = np.array(stance.angles)
            angles[k] += side * step
            feet, height = feet_and_height(angles, equations.up)
            moved.append((feet, height))
        feet = (moved[0][0] - moved[1][0]) / (2 * step)
        # The ground touches a foot at its lowest point, which turns about the foot's middle with the leg.
        axis = _axis(np.asarray(stance.angles), k)
        feet[k // 3] += np.cross(axis, -0.02 * equations.up)
        work = 9.81 * (moved[0][1] - moved[1][1]) / (2 * step) - float((feet * forces).sum())
        assert torques[k] == pytest.approx(work, abs=2e-5)


def _axis(angles: FloatArray, k: int) -> FloatArray:
    return (
        np.array([1.0, 0, 0]) if k % 3 == 0 else Rotation.from_rotvec([angles[k - k % 3], 0, 0]).apply([0.0, 1.0, 0.0])
    )


@pytest.mark.parametrize("stance", POSTURES.values(), ids=list(POSTURES))
def test_the_forces_hold_the_robot(stance: Stance) -> None:
    forces = sharing().share(stance, 25.0).forces
    up = Rotation.from_euler("xyz", [stance.roll, stance.pitch, 0.0]).inv().apply([0.0, 0.0, 1.0])
    total = 6.001 + 4 * (0.696 + 1.013 + 0.166 + 0.06) + stance.load
    np.testing.assert_allclose(forces.sum(axis=0), total * 9.81 * up, atol=1e-6)
    equations = statics(load_body(), stance)
    np.testing.assert_allclose(equations.balance @ forces.ravel(), equations.weight, atol=1e-6)


# --- optima -------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("uneven", [False, True], ids=["cool", "one knee hot"])
@pytest.mark.parametrize("stance", POSTURES.values(), ids=list(POSTURES))
def test_no_other_sharing_lasts_longer(stance: Stance, uneven: bool) -> None:
    """A general optimiser over all forces, on the test's own heat balance, finds nothing better."""
    start = starts(uneven)
    best, equations = sharing().share(stance, by_name(start)), statics(load_body(), stance)
    assert best.time == pytest.approx(true_time(best.torques, start), rel=1e-3)

    free = null_space(equations.balance)  # along these directions the robot stays in balance

    def forces(z: FloatArray) -> FloatArray:
        return np.asarray(best.forces.ravel() + free @ z).reshape(4, 3)

    def room(z: FloatArray) -> FloatArray:
        normal = forces(z) @ equations.up
        along = np.linalg.norm(forces(z) - np.outer(normal, equations.up), axis=1)
        return np.concatenate([stance.friction * normal - along, normal - stance.least_normal])

    def lasting(z: FloatArray) -> float:
        return -min(true_time(equations.torques(forces(z)), start), 6000.0)

    rng, compared = np.random.default_rng(0), 0
    for _ in range(2):
        inside = NonlinearConstraint(room, 0.0, np.inf)
        optimum = minimize(lasting, rng.normal(0.0, 3.0, 6), method="SLSQP", constraints=[inside], tol=1e-3)
        if room(optimum.x).min() > -0.01:
            compared += 1
            assert lasting(optimum.x) >= -best.time * (1 + 2e-3)
    assert compared > 0


@pytest.mark.parametrize("stance", POSTURES.values(), ids=list(POSTURES))
def test_it_lasts_longer_than_its_peers_in_truth(stance: Stance) -> None:
    start = starts(True)
    shared, equal, least = (
        getattr(sharing(), how)(stance, by_name(start)) for how in ("share", "equal", "least_torque")
    )
    assert true_time(shared.torques, start) > 1.05 * true_time(equal.torques, start)
    assert true_time(shared.torques, start) > true_time(least.torques, start)


def test_a_hot_leg_is_relieved() -> None:
    stance = POSTURES["upright"]
    cool, hot = (sharing().share(stance, by_name(starts(uneven))) for uneven in (False, True))
    knee = JOINTS.index("FR_calf")
    assert abs(hot.torques[knee]) < 0.98 * abs(cool.torques[knee])
    assert abs(hot.torques[knee]) < np.abs(hot.torques[[5, 8, 11]]).min()


@pytest.mark.parametrize("friction", [0.1, 0.3])
def test_friction_and_torque_limits_hold(friction: float) -> None:
    solution = sharing().share(Stance(posture(1.1), load=8.0, friction=friction), 25.0)
    assert solution.grip <= 1 + 1e-6
    assert solution.effort <= 1 + 1e-6
    rougher = sharing().share(Stance(posture(1.1), load=8.0, friction=0.6), 25.0)
    assert rougher.time > solution.time


def test_three_legs_can_stand() -> None:
    stance = Stance(posture(0.9), load_at=(-0.05, 0.05, 0.1), load=4.0, standing=("FL", "RR", "RL"))
    solution = sharing().share(stance, 25.0)
    assert np.abs(solution.forces[0]).max() == 0.0
    assert solution.time > 0


def test_what_never_gets_hot_lasts_for_ever_with_the_margin_said() -> None:
    light = LoadSharing(model(), load_body(), {"*": 200.0})
    solution = light.share(POSTURES["upright"], 25.0)
    assert np.isinf(solution.time)
    assert solution.first is None
    assert solution.margin > 50.0


def test_above_the_limit_the_coolest_way_on_is_found() -> None:
    solution = sharing().share(POSTURES["bent"], by_name(COOL + 36.0))
    equal = sharing().equal(POSTURES["bent"], by_name(COOL + 36.0))
    assert solution.time == 0.0
    assert solution.margin > equal.margin


# --- mistakes -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "stance",
    [
        Stance(posture(0.9), load=4.0, load_at=(0.9, 0.0, 0.0), friction=0.3),
        Stance(posture(1.3), load=300.0),
        Stance(posture(0.9), pitch=1.2, friction=0.2),
    ],
    ids=["beside its feet", "too heavy", "too steep"],
)
def test_a_stance_that_nothing_holds_is_refused(stance: Stance) -> None:
    with pytest.raises(StanceError, match="no forces within friction cones and torque limits"):
        sharing().share(stance, 25.0)


@pytest.mark.parametrize(
    ("stance", "said"),
    [
        (Stance(np.zeros(11)), "12 numbers"),
        (Stance(np.full(12, np.nan)), "12 numbers"),
        (Stance(posture(), load=-1.0), "load: found -1"),
        (Stance(posture(), friction=0.0), "friction: found 0"),
        (Stance(posture(), standing=("FR", "FL")), "three or more"),
        (Stance(posture(), standing=("FR", "FL", "XX")), "found XX"),
    ],
)
def test_a_stance_that_cannot_be_is_named(stance: Stance, said: str) -> None:
    with pytest.raises(ValueError, match=said):
        sharing().share(stance, 25.0)


def test_what_does_not_fit_the_model_is_named() -> None:
    with pytest.raises(InputError, match="no such place"):
        LoadSharing(model(), load_body(), {"knee": 60.0})
    with pytest.raises(InputError, match="no temperature"):
        sharing().share(POSTURES["bent"], {"FR_hip": 30.0})
    with pytest.raises(InputError, match="FL_hip: found no number"):
        sharing().share(POSTURES["bent"], by_name(COOL) | {"FL_hip": float("nan")})


def test_readings_of_other_places_than_nodes_are_ignored() -> None:
    own, stance = {"*": 25.0, "FL_hip": 30.0}, POSTURES["upright"]
    assert sharing().equal(stance, own | {"battery": np.nan}).time == sharing().equal(stance, own).time
    with pytest.raises(InputError, match="no such place"):
        sharing().equal(stance, own | {"*_wheel": 25.0})


def test_a_model_that_is_driven_by_currents_needs_a_torque_constant() -> None:
    torque = next(declaration for declaration in model().network.effects if declaration.effect.key == "copper_loss")
    current = replace(torque, effect=CopperLoss(input="current"))
    bound = Model(replace(model().network, effects=(current,)))
    with pytest.raises(InputError, match="torque_constant in N·m/A"):
        LoadSharing(bound, load_body(), {"*": LIMIT})
    solution = LoadSharing(bound, load_body(), {"*": LIMIT}, torque_constant=0.84).share(POSTURES["bent"], 25.0)
    assert solution.time == pytest.approx(sharing().share(POSTURES["bent"], 25.0).time, rel=1e-3)


def test_a_body_of_ones_own_is_read_and_its_mistakes_are_named(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    text = (Path(__file__).parents[2] / "src" / "lptn" / "applications" / "load_sharing" / "a1.toml").read_text(
        encoding="utf-8"
    )
    path.write_text(
        text.replace('name = "A1"', 'name = "mine"').replace("mass = 6.001", "mass = 9.0"), encoding="utf-8"
    )
    assert (load_body(path).name, load_body(path).mass) == ("mine", 9.0)
    path.write_text(text.replace("mass = 6.001", "mass = -9.0"), encoding="utf-8")
    with pytest.raises(InputError, match=r"line \d+, trunk.mass: found -9.0"):
        load_body(path)
    path.write_text(text.replace('name = "A1"', "name = "), encoding="utf-8")
    with pytest.raises(InputError, match=r"line \d+: found .*; expected TOML"):
        load_body(path)
    with pytest.raises(InputError, match=r'found "spot"'):
        load_body("spot")


def test_peers_are_what_they_say() -> None:
    stance = POSTURES["leaning"]
    equal, least = sharing().equal(stance, 25.0), sharing().least_torque(stance, 25.0)
    equations = statics(load_body(), stance)
    np.testing.assert_allclose(equations.balance @ equal.forces.ravel(), equations.weight, atol=1e-9)

    def worse(other: Sharing) -> bool:
        return float(np.sum(other.torques**2)) >= float(np.sum(least.torques**2)) - 1e-6

    assert worse(equal)
    assert worse(sharing().share(stance, 25.0))
