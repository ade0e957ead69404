"""One order of joints, the model file's, in all arrays: whatever patterns and tables the file is written with."""

from __future__ import annotations

import json
from collections.abc import Callable
from itertools import permutations
from pathlib import Path

import numpy as np
import pytest

from lptn import load_model
from lptn.applications.load_sharing.sharing import StandingTemperatures
from lptn.basics.arrays import FloatArray
from lptn.cli.main import main
from lptn.fmu import Session, export
from lptn.model.model import Model
from lptn.model.network import Network
from lptn.planners import ControlLoop, Limiter, TorqueMPC
from lptn.robots.urdf import urdf_model_text
from tests.builders import AMBIENT, effect, link, node

LEG_BY_LEG = [f"{leg}_{part}" for leg in ("FL", "FR") for part in ("hip", "thigh", "calf")]
WARM = {name: 30.0 + 3 * number for number, name in enumerate(LEG_BY_LEG)}
ASKED = {name: 4.0 + number for number, name in enumerate(LEG_BY_LEG)}
JOINTS = "".join(
    f"""
[nodes."{at}"]
capacity = {capacity}
[[links]]
between = ["{at}", "ambient"]
resistance = {to_air}
[[effects]]
kind = "copper_loss"
at = "{at}"
resistance = {ohm}
[[effects]]
kind = "viscous_friction"
at = "{at}"
"""
    for at, capacity, to_air, ohm in [("*_calf", 250, 4, 0.2), ("*_hip", 300, 6, 0.15), ("*_thigh", 350, 5, 0.1)]
)


def head(joints: list[str]) -> str:
    return f'[model]\njoints = {json.dumps(joints)}\nambient = "temperature.ambient"\n'


def by_classes(joints: list[str]) -> str:
    """Nodes, losses and links of one class after the other, the classes in the alphabet's order."""
    return head(joints) + JOINTS


def by_names(joints: list[str]) -> str:
    """Each joint by its name, from the last in the alphabet to the first."""
    table = '[nodes.{0}]\ncapacity = 300\n[[links]]\nbetween = ["{0}", "ambient"]\nresistance = 5\n'
    table += '[[effects]]\nkind = "copper_loss"\nat = "{0}"\nresistance = 0.15\n'
    return head(joints) + "".join(table.format(name) for name in sorted(joints, reverse=True))


def unlisted(joints: list[str]) -> str:
    """No list of joints: the nodes as they stand; the losses stand in another order."""
    nodes = "".join(f"[nodes.{name}]\ncapacity = 300\n" for name in joints)
    loss = '[[effects]]\nkind = "copper_loss"\nat = "{}"\nresistance = 0.15\n'
    losses = "".join(map(loss.format, sorted(joints)))
    air = "".join(f'[[links]]\nbetween = ["{name}", "ambient"]\nresistance = 5\n' for name in reversed(joints))
    return f'[model]\nambient = "temperature.ambient"\n{nodes}{air}{losses}'


def with_a_computer(joints: list[str]) -> str:
    """A node that is no joint stands first in the file; it comes behind the joints."""
    board = '[nodes.board]\ncapacity = 400\n[[links]]\nbetween = ["board", "ambient"]\nresistance = 3\n'
    return head(joints) + board + JOINTS


ORDERS = {"leg by leg": LEG_BY_LEG, "part by part": sorted(LEG_BY_LEG, key=lambda name: name[3:]),
          "mixed": [LEG_BY_LEG[k] for k in (3, 0, 5, 1, 4, 2)]}  # fmt: skip


def model_of(text: str, folder: Path) -> Model:
    (folder / "model.toml").write_text(text, encoding="utf-8")
    return load_model(folder / "model.toml").model


def given(names: list[str] | tuple[str, ...], values: dict[str, float]) -> FloatArray:
    """An array in the order of the names, other places at 30."""
    return np.array([values.get(name, 30.0) for name in names])


def air(columns: tuple[str, ...]) -> FloatArray:
    """Conditions of a room, joints at different speeds."""
    speeds = {f"velocity_rms.{name}": 0.5 * number for number, name in enumerate(LEG_BY_LEG)}
    return np.array([25.0 if column == "temperature.ambient" else speeds[column] for column in columns])


@pytest.mark.parametrize(("write", "order"), [
    (by_classes, "leg by leg"), (by_classes, "part by part"), (by_classes, "mixed"),
    (by_names, "mixed"), (unlisted, "mixed"), (with_a_computer, "mixed"),
])  # fmt: skip
def test_arrays_hold_each_joints_value_in_the_files_order(
    write: Callable[[list[str]], str], order: str, tmp_path: Path
) -> None:
    joints = ORDERS[order]
    model, other = (model_of(write(names), tmp_path) for names in (joints, LEG_BY_LEG))
    assert model.nodes[:6] == model.places[:6] == model.states[:6] == joints
    quantities = [column.partition(".") for column in model.inputs]
    for quantity in {word for word, _, _ in quantities} - {"temperature"}:
        assert [place for word, _, place in quantities if word == quantity] == joints

    def answers(of: Model) -> list[FloatArray]:
        """For each joint of the list what MPC, loop, limiter and standing robot say of it."""
        mpc = TorqueMPC(of, 60.0, period=5, horizon=300)
        limiter, loop = Limiter(of, 60.0), ControlLoop(TorqueMPC(of, 60.0, period=5, horizon=300), tick=5.0)
        asked, warm = 3 * given(mpc.joints, ASKED), given(of.nodes, WARM)
        plan = mpc.step(warm, asked, air(mpc.conditions))
        loop.update(asked, warm, air(mpc.conditions))
        scale = loop.update(asked, warm, air(mpc.conditions))
        most = limiter.admissible(warm, asked, air(limiter.conditions))
        named = limiter.admissible(dict(zip(of.nodes, warm, strict=True)), dict(zip(mpc.joints, asked, strict=True)),
                                   dict(zip(limiter.conditions, air(limiter.conditions), strict=True)))  # fmt: skip
        assert np.array_equal(most, named)
        standing = StandingTemperatures(of, joints).at(warm[of.owners], given(joints, ASKED), 60.0)[0]
        rows = [np.column_stack([plan.admitted, scale, most])[[mpc.joints.index(name) for name in joints]]]
        return [*rows, standing[[of.nodes.index(name) for name in joints]]]

    assert list(TorqueMPC(model, 60.0).joints) == list(Limiter(model, 60.0).joints) == joints
    for one, two in zip(answers(model), answers(other), strict=True):
        assert one == pytest.approx(two, rel=1e-6)
        assert len(np.unique(np.round(one, 6), axis=0)) == 6  # so that a swap of two joints would be seen


@pytest.mark.parametrize("joints", list(permutations(["a", "c", "b"]))[::2])
def test_a_network_of_a_script_keeps_the_order_of_its_nodes(joints: tuple[str, ...]) -> None:
    links = tuple(link(name, "ambient") for name in sorted(joints))
    losses = tuple(effect("copper_loss", name) for name in sorted(joints, reverse=True))
    model = Model(Network("three", (*map(node, joints), AMBIENT), links, losses))
    assert tuple(model.nodes) == TorqueMPC(model, 60.0).joints == joints


def urdf(robots: int) -> str:
    """Robots beside each other, four joints in a row each; the efforts set the shoulders apart from the rest."""
    text = '<robot name="several"><link name="base"/>'
    for robot in range(robots):
        before = "base"
        for part in ("shoulder", "elbow", "wrist", "finger"):
            name = f"{'zyx'[robot]}_{part}"
            effort = 80 if part == "elbow" else 20
            text += f'<link name="{name}"/><joint name="{name}_joint" type="revolute"><parent link="{before}"/>'
            text += f'<child link="{name}"/><limit lower="-1" upper="1" effort="{effort}" velocity="3"/></joint>'
            before = name
    return text + "</robot>"


@pytest.mark.parametrize("robots", [1, 2, 3])
def test_a_model_of_a_urdf_keeps_the_urdfs_order(robots: int, tmp_path: Path) -> None:
    (tmp_path / "robots.urdf").write_text(urdf(robots), encoding="utf-8")
    model = model_of(urdf_model_text(tmp_path / "robots.urdf"), tmp_path)
    expected = [f"{robot}_{part}" for robot in "zyx"[:robots] for part in ("shoulder", "elbow", "wrist", "finger")]
    assert model.nodes == list(TorqueMPC(model, 60.0).joints) == expected


@pytest.mark.parametrize("order", ["leg by leg", "mixed"])
def test_files_that_commands_write_are_in_the_files_order(order: str, tmp_path: Path) -> None:
    joints = ORDERS[order]
    model_of(by_classes(joints), tmp_path)
    task = '[task]\nkind = "{}"\n[limits]\n"*" = 60\n[start]\n"*" = 40\n[conditions]\n"temperature.ambient" = 25\n'
    task += '"velocity_rms.*" = 1\n'
    (tmp_path / "track.toml").write_text(task.format("track") + '[[phases]]\nduration = 60\ntorque = { "*" = 5 }\n')
    (tmp_path / "limit.toml").write_text(task.format("limit") + '[load]\n"*" = 5\n')
    for kind in ("track", "limit"):
        words = ["plan", str(tmp_path / "model.toml"), str(tmp_path / f"{kind}.toml"), "-o", str(tmp_path / "plan.csv")]
        with pytest.raises(SystemExit) as end:
            main([*words, "--json", str(tmp_path / "plan.json"), "--emit-c", str(tmp_path / kind)])
        assert end.value.code == 0
        names = (tmp_path / kind / "names.txt").read_text(encoding="utf-8").split("\n")
        for quantity in ("temperature", "torque", "velocity_rms"):
            listed = [name.split()[0].partition(".")[2] for name in names if name.startswith(f"{quantity}.")]
            assert [name for name in listed if name != "ambient"] == joints, quantity
        text = (tmp_path / "plan.json").read_text(encoding="utf-8")
        places = [text.find(f'"{name}"') for name in joints]
        assert places == sorted(places)
        rows = (tmp_path / "plan.csv").read_text(encoding="utf-8")
        places = [rows.find(name) for name in joints]
        assert places == sorted(places)


def test_variables_of_an_fmu_are_in_the_files_order(tmp_path: Path) -> None:
    joints = ORDERS["mixed"]
    export(model_of(by_classes(joints), tmp_path), tmp_path / "model.fmu")
    with Session(tmp_path / "model.fmu") as session:
        for quantity in ("torque", "velocity"):
            listed = [name.partition(".") for name in session.input_names]
            assert [place for place, _, what in listed if what == quantity] == joints
