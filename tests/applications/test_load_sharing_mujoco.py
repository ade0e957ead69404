"""Load sharing beside a simulator: MuJoCo's Unitree A1 stands by the planned torques, on the planned forces."""

from __future__ import annotations

import numpy as np
import pytest

from lptn.applications.load_sharing import Sharing, Stance, load_body, statics
from tests.applications.test_load_sharing import POSTURES, posture, sharing

# These packages are in the extra `robots`, not in `dev`: the robot's description alone takes 440 MB.
pytest.importorskip("mujoco", reason="needs the extra `robots`")
try:
    from tests.benchmarks import load_sharing_stand as stand

    stand.urdf()
except ModuleNotFoundError as error:
    pytest.skip(str(error), allow_module_level=True)


@pytest.mark.parametrize("seed", range(4))
def test_statics_are_those_of_the_urdf_in_mujoco(seed: int) -> None:
    """Inverse dynamics at rest, for any posture and any forces: torques and what is left over at the trunk."""
    rng = np.random.default_rng(seed)
    roll, pitch = rng.normal(0.0, 0.1, 2)
    stance = Stance(posture() + rng.normal(0.0, 0.3, 12), roll=roll, pitch=pitch)
    equations, forces = statics(load_body(), stance), rng.normal(0.0, 30.0, (4, 3))
    trunk, torques = stand.at_rest(stance, forces)
    np.testing.assert_allclose(equations.torques(forces), torques, atol=1e-6)
    np.testing.assert_allclose(equations.weight - equations.balance @ forces.ravel(), trunk, atol=1e-5)


@pytest.mark.parametrize("name", ["upright", "bent"])
def test_the_robot_stands_by_the_planned_torques_on_the_planned_forces(name: str) -> None:
    """Forward simulation on a floor: the drives hold the planned torques, contacts give the planned forces."""
    stance = POSTURES[name]
    solution: Sharing = sharing().share(stance, 25.0)
    forces, torques = stand.stands(stance, solution.torques)
    np.testing.assert_allclose(forces, solution.forces, atol=0.4)
    np.testing.assert_allclose(torques, solution.torques, atol=0.1)
