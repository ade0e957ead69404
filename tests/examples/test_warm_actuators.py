"""Actuators that warm up: derating and heat as NumPy has them, in stand-ins for Isaac Lab's and mjlab's classes."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from lptn.batch import functions
from lptn.model.model import Model
from lptn.model.network import Network
from tests.builders import AMBIENT, effect, link, node

torch = pytest.importorskip("torch", reason="PyTorch is not installed: pip install 'lptn[torch]'")

EXAMPLE = Path(__file__).parents[2] / "examples" / "reinforcement" / "warm_actuators.py"
JOINTS = ("hip", "wheel", "knee")  # a wheel that the network lacks
OTHERS = {"temperature.ambient": 20.0}


def _model() -> Model:
    """A hip and a knee that know nothing of each other, the knee with friction."""
    loss = effect("copper_loss", "*", resistance=0.2, torque_constant=1.0)
    nodes = (node("hip", 300.0), node("knee", 200.0), AMBIENT)
    links = (link("hip", "ambient", 10.0), link("knee", "ambient", 5.0))
    return Model(Network("two", nodes, links, (loss, effect("coulomb_friction", "knee", torque=0.5))))


def _motors(robots: int = 3, **options: Any) -> Any:
    heat = functions(_model(), "torch", limits=60.0)
    return import_module("warm_actuators").WarmMotors(heat, JOINTS, robots, 2.0, OTHERS, **options)


def test_torque_is_taken_back_and_what_is_left_warms_the_joints() -> None:
    motors, heat = _motors(start=(55.0, 55.0)), functions(_model(), limits=60.0)
    asked = torch.tensor([[4.0, 1.0, 0.0], [0.0, 1.0, 8.0], [0.0, 0.0, 0.0]])
    velocity = torch.tensor([[0.0, 9.0, -3.0]]).tile(3, 1)
    given = motors.give(asked, velocity)
    np.testing.assert_allclose(given, asked * torch.tensor([0.5, 1.0, 0.5]), rtol=1e-5)
    inputs = np.zeros((3, len(heat.INPUTS)))
    values = {"temperature.ambient": 20.0, "torque.hip": given[:, 0], "torque.knee": given[:, 2], "velocity.knee": 3.0}
    for column, value in values.items():
        inputs[:, heat.INPUTS.index(column)] = value
    params = np.tile(heat.VALUES, (3, 1))
    expected = heat.step(heat.initial(params, 55.0), inputs, params, 2.0).temperature
    np.testing.assert_allclose(motors.state.temperature, expected, rtol=1e-6)
    np.testing.assert_allclose(motors.margins, 60.0 - expected, rtol=1e-4)


def test_robots_begin_anew_each_on_its_own() -> None:
    torch.manual_seed(0)
    motors = _motors(start=(20.0, 50.0), errors=[0.1 * value for value in _model().values])
    params, state = motors.params.clone(), motors.state.temperature.clone()
    assert len(np.unique(state[:, 0])) == len(np.unique(params[:, 0])) == 3
    motors.reset(torch.tensor([1]))
    for now, before in ((motors.params, params), (motors.state.temperature, state)):
        np.testing.assert_array_equal((now != before).any(dim=1), [False, True, False])
    motors.reset()
    assert (motors.state.temperature != state).all()
    with pytest.raises(KeyError, match=r"temperature\.ambient"):
        import_module("warm_actuators").WarmMotors(motors.heat, JOINTS, 1, 2.0, {})


class _Given:
    """In the place of a simulator's PD actuator, which answers with the torque that it is asked for."""

    joint_names = target_names = JOINTS
    applied_effort = None

    def __init__(self, cfg: Any, robots: int) -> None:
        self.cfg, self._num_envs, self._device = cfg, robots, "cpu"
        self.begun: list[Any] = []

    def initialize(self, *_: Any) -> None: ...

    def compute(self, command: Any, *_: Any) -> Any:
        return command if hasattr(command, "joint_efforts") else command.effort_target

    def reset(self, env_ids: Any = None) -> None:
        self.begun.append(env_ids)


def test_the_simulators_classes_give_what_motors_give() -> None:
    source = "\n".join(line[2:] for line in EXAMPLE.read_text(encoding="utf-8").splitlines() if line[:2] == "# ")
    (code,) = re.findall(r"```python\n(.*?)```", source, re.DOTALL)
    example = import_module("warm_actuators")
    made: dict[str, Any] = {
        "heat": functions(_model(), "torch", limits=60.0),
        "WarmMotors": example.WarmMotors,
        "isaaclab": SimpleNamespace(actuators=SimpleNamespace(IdealPDActuator=_Given)),
        "mjlab": SimpleNamespace(actuator=SimpleNamespace(IdealPdActuator=_Given)),
    }
    exec(code, made)
    asked, still = torch.ones(2, 3), torch.zeros(2, 3)
    cfg = SimpleNamespace(seconds=2.0, others=OTHERS)
    of_isaac, of_mjlab = made["WarmIsaacLabActuator"](cfg, 2), made["WarmMjlabActuator"](cfg, 2)
    of_mjlab.initialize(SimpleNamespace(opt=SimpleNamespace(timestep=2.0)), None, SimpleNamespace(nworld=2), "cpu")
    for actuator in (of_isaac, of_mjlab):
        actuator.motors.state = _at(actuator, 58.0)
    action = of_isaac.compute(SimpleNamespace(joint_efforts=asked), still, still)
    np.testing.assert_allclose(action.joint_efforts[0], [0.2, 1.0, 0.2], rtol=1e-4)
    assert of_isaac.applied_effort is action.joint_efforts
    np.testing.assert_allclose(of_mjlab.compute(SimpleNamespace(effort_target=asked, vel=still)), action.joint_efforts)
    for actuator in (of_isaac, of_mjlab):
        actuator.reset([1])
        np.testing.assert_allclose(actuator.motors.margins[:, 0], [2.0, 35.0], atol=0.1)
        assert actuator.begun == [[1]]


def _at(actuator: Any, temperature: float) -> Any:
    return actuator.motors.heat.initial(actuator.motors.params, temperature)


def test_a_load_is_held_until_derating() -> None:
    given = import_module("warm_actuators").main(robots=64, minutes=20.0, seconds=10.0)
    assert given[:, 0].mean() > 1.9
    assert 4.0 < given[:, 2].mean() < 7.9
