"""One node a joint for MuJoCo: attributes worked by hand, MuJoCo's own temperature, and what a node costs."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest

from lptn.basics.errors import InputError
from lptn.batch import export, functions
from lptn.effects import catalogue
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network
from lptn.robots.presets import preset_text
from tests.builders import AMBIENT, effect, leg, link, node

LOSS = effect("copper_loss", "a", resistance=0.3, torque_constant=0.8)
RISE = effect("resistance_rise", "a", alpha=0.004, reference=20.0)


def _one(*effects: Any) -> Model:
    """300 J/K behind 2 K/W."""
    return Model(Network("one --> & <", (node("a", 300.0), AMBIENT), (link("a", "ambient", 2.0),), effects))


def _written(model: Model, folder: Path) -> str:
    export(model, folder / "motors.xml", "mujoco")
    return (folder / "motors.xml").read_text()


def _attributes(text: str, joint: str = "a") -> tuple[list[float], list[float]]:
    """The electrical ones, K and R, and the thermal ones, in MuJoCo's order."""
    (motor,) = ElementTree.fromstring(text).iterfind(f"actuator/dcmotor[@name='{joint}']")
    assert (motor.get("joint"), motor.get("input")) == (joint, "ff")
    return [float(motor.get(name, "")) for name in ("motorconst", "resistance")], [
        float(number) for number in motor.get("thermal", "").split()
    ]


def _errors(text: str) -> dict[str, tuple[float, float]]:
    rows = re.findall(r"^ +(\S+) +(-?\d+\.\d) +(-?\d+\.\d)$", text, re.MULTILINE)
    return {joint: (float(alone), float(together)) for joint, alone, together in rows}


def test_a_model_of_one_node_is_written_as_it_is(tmp_path: Path) -> None:
    text = _written(_one(LOSS, RISE), tmp_path)
    electrical, thermal = _attributes(text)
    warm = 1 + 0.004 * 5.0  # at 25 degC, for MuJoCo's own reference
    np.testing.assert_allclose(electrical, [0.8, 0.3 * warm], rtol=1e-6)
    np.testing.assert_allclose(thermal, [2.0, 300.0, 0.0, 0.004 / warm, 25.0, 25.0], rtol=1e-6)
    assert _errors(text) == {"a": (0.0, 0.0)}


def test_constant_heat_is_in_the_temperature_without_load(tmp_path: Path) -> None:
    text = _written(_one(LOSS, effect("constant_heat", "a", heat=3.0)), tmp_path)
    assert _attributes(text)[1] == pytest.approx([2.0, 300.0, 0.0, 0.0, 25.0, 25.0 + 3.0 * 2.0])
    assert max(map(abs, _errors(text)["a"])) < 0.05


def test_of_two_nodes_resistance_and_delay_are_those_of_the_pair(tmp_path: Path) -> None:
    network = Network(
        "two", (node("a", 120.0), node("b", 200.0), AMBIENT),
        (link("a", "ambient", 4.0), link("a", "b", 1.0), link("b", "ambient", 2.0)), (LOSS,),
    )  # fmt: skip
    text = _written(Model(network), tmp_path)
    _, (resistance, capacity, *_) = _attributes(text)
    a = 1 / (1 / 4.0 + 1 / (1.0 + 2.0))  # K/W of a for a watt in it
    b = a * 2.0 / (1.0 + 2.0)  # of b
    assert resistance == pytest.approx(a, rel=1e-6)
    assert resistance * capacity == pytest.approx((120.0 * a**2 + 200.0 * b**2) / a, rel=1e-6)  # Elmore's delay
    alone, together = _errors(text)["a"]
    assert alone == together != 0.0  # it has one joint, and settles as one node, but on another way


def test_mujocos_motors_warm_up_as_the_model(tmp_path: Path) -> None:
    mujoco = pytest.importorskip("mujoco", reason="needs the extra `robots`")
    model = _one(LOSS, RISE, effect("constant_heat", "a", heat=3.0))
    _written(model, tmp_path)
    robot = """<mujoco>
        <option timestep="0.01" gravity="0 0 0"/>
        <include file="motors.xml"/>
        <worldbody><body><joint name="a" axis="0 0 1" damping="1e6"/><geom size=".1"/></body></worldbody>
    </mujoco>"""
    (tmp_path / "robot.xml").write_text(robot)
    simulated = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    data, idle = mujoco.MjData(simulated), 25.0 + 3.0 * 2.0
    data.act[0] = 25.0 - idle
    heat = functions(model)
    assert heat.INPUTS == ("temperature.ambient", "torque.a")
    state = heat.initial(np.asarray(heat.VALUES), 25.0)
    for torque in (8.0, 2.0, 10.0):
        data.ctrl[0] = torque
        for _ in range(300):
            squares = 0.0
            for _ in range(100):
                mujoco.mj_step(simulated, data)
                squares += float(data.actuator_force[0] ** 2) / 100
            state = heat.step(state, np.array([25.0, np.sqrt(squares)]), np.asarray(heat.VALUES), 1.0)
        assert idle + data.act[0] == pytest.approx(state.temperature[0], abs=0.02)
    assert state.temperature[0] > 60.0


@pytest.mark.parametrize(("variant", "least", "most"), [("single-node", 0.1, 1.5), (None, 5.0, 20.0)])
def test_a_network_costs_more_than_single_nodes(variant: str | None, least: float, most: float, tmp_path: Path) -> None:
    model = Model(parse_model(preset_text("quadruped", variant), Path("quadruped.toml")).network)
    found = np.abs(list(_errors(_written(model, tmp_path)).values()))
    assert found.shape == (12, 2)
    assert least < found.min() <= found.max() < most


def test_mistakes_are_said(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="limits: found some; expected none"):
        export(_one(LOSS), tmp_path / "motors.xml", "mujoco", limits=60.0)
    by_current = EffectDeclaration(catalogue()["copper_loss"](input="current"), "a", LOSS.parameters)
    for model in (_one(), _one(by_current)):
        with pytest.raises(InputError, match="found no copper loss by torque"):
            export(model, tmp_path / "motors.xml", "mujoco")
    with pytest.raises(InputError, match="links: found heat without a way out"):
        export(Model(leg([effect("copper_loss")], ambient=None)), tmp_path / "motors.xml", "mujoco")
    with pytest.raises(InputError, match="expected jax, torch or numpy"):
        functions(_one(LOSS), "mujoco")
    assert not list(tmp_path.iterdir())
