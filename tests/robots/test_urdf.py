"""A model file from a URDF: driven joints, chains, groups of like joints, and what is no URDF."""

from __future__ import annotations

import re
from importlib import metadata
from pathlib import Path
from typing import get_args

import numpy as np
import pandas as pd
import pytest

import lptn
from lptn.basics.errors import InputError
from lptn.cli.main import main
from lptn.cli.new import Amperes, Resistance
from lptn.effects.copper_loss import CopperLoss
from lptn.model.file import parse_model
from lptn.robots.urdf import read_joints, urdf_model_text
from lptn.virtual import quadruped_logs, write_logs
from tests.truth.plans import trial

LEGS = ("FR", "FL", "RR", "RL")


def joint(name: str, parent: str, child: str, kind: str = "revolute", inside: str = "", at: str = "0.1 0 0") -> str:
    limit = "" if kind == "fixed" else '<limit effort="33.5" velocity="20"/>'
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}"><origin xyz="{at}"/>{ends}{limit}{inside}</joint>'


def robot(*joints: str, name: str = "test") -> str:
    return f'<?xml version="1.0"?>\n<robot name="{name}">{"".join(joints)}</robot>'


def quadruped() -> str:
    """Joints and links named as a Unitree A1's, with a fixed joint between base and trunk and a fixed foot."""
    joints = [joint("floating_base", "base", "trunk", "fixed")]
    for leg in LEGS:
        joints += [
            joint(f"{leg}_hip_joint", "trunk", f"{leg}_hip"),
            joint(f"{leg}_shoulder_fixed", "trunk", f"{leg}_shoulder", "fixed"),
            joint(f"{leg}_thigh_joint", f"{leg}_hip", f"{leg}_thigh", at="0 0.08 0"),
            joint(f"{leg}_calf_joint", f"{leg}_thigh", f"{leg}_calf", at="0 0 -0.2"),
            joint(f"{leg}_foot_fixed", f"{leg}_calf", f"{leg}_foot", "fixed"),
        ]
    return robot(*joints, name="quadruped")


def written(folder: Path, text: str, name: str = "robot.urdf") -> Path:
    file = folder / name
    file.write_text(text)
    return file


def test_a_drive_that_logs_no_torque(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    urdf, path = written(tmp_path, quadruped()), tmp_path / "model.toml"
    words = ["--current", "--resistance-of", "line_to_line", "--amperes", "rms"]
    with pytest.raises(SystemExit) as ended:
        main(["new", "--urdf", str(urdf), *words, "-o", str(path)])
    assert ended.value.code == 0
    model = lptn.load_model(path).model
    assert "current.FR_calf" in model.inputs
    assert not [column for column in model.inputs if column.startswith("torque")]
    networks = parse_model(path.read_text(), path).network, parse_model(urdf_model_text(urdf), urdf).network
    heat, by_torque = (network.effects[0] for network in networks)
    assert isinstance(heat.effect, CopperLoss)
    assert heat.effect.factor == 1.5
    assert 1.5 * heat.resolved["resistance"].value == pytest.approx(by_torque.resolved["resistance"].value, rel=1e-2)
    with pytest.raises(SystemExit) as ended:
        main(["new", "leg", "--amperes", "rms", "-o", str(tmp_path / "leg.toml")])
    assert ended.value.code == 2
    assert "--amperes: found no --urdf" in capsys.readouterr().err


@pytest.mark.parametrize(("option", "kinds"), [("resistance_of", Resistance), ("amperes", Amperes)])
def test_the_command_has_the_words_of_the_effect(option: str, kinds: object) -> None:
    assert get_args(kinds) == CopperLoss.options[option]


def test_a_quadruped_is_fitted_from_its_urdf_alone(tmp_path: Path) -> None:
    (tmp_path / "model.toml").write_text(urdf_model_text(written(tmp_path, quadruped())))
    loaded = lptn.load_model(tmp_path / "model.toml")
    assert loaded.model.nodes == [f"{leg}_{part}" for leg in LEGS for part in ("hip", "thigh", "calf")]
    edges = [link.ends for link in loaded.model.network.resistors]
    assert ("FR_hip", "FR_thigh") in edges
    assert ("FR_thigh", "FR_calf") in edges
    assert ("FR_hip", "FL_hip") not in edges
    logs = quadruped_logs(seed=3, runs=trial(3), physics="plain")
    files = write_logs(tmp_path, {name: logs[name].iloc[::10] for name in ("fit1", "fit2", "holdout")})
    *walked, held_out = loaded.runs(files)
    as_written = lptn.compare(loaded.model, [held_out]).all.rmse
    # Starts are off by factors; what they are a start of predicts a run that it has not seen.
    assert lptn.compare(lptn.fit(loaded.model, walked).model, [held_out]).all.rmse < 0.5 * as_written


def chain_logs(names: list[str], before: list[str | None], torque: dict[str, float]) -> dict[str, pd.DataFrame]:
    """Two runs of a robot whose joints lose heat to the air and along the chains, in steps of 2 s, by forward Euler."""
    random, count = np.random.default_rng(5), len(names)
    capacity, to_air = (mean * random.uniform(0.6, 1.6, count) for mean in (500.0, 0.3))
    kinds = {limit: random.uniform(150.0, 500.0) for limit in sorted(set(torque.values()))}  # W of loss at the limit
    loss = np.array([kinds[torque[name]] for name in names])
    flow = np.diag(to_air)
    for row, carrier in enumerate(before):
        if carrier is not None:
            ends = [row, names.index(carrier)]
            flow[np.ix_(ends, ends)] += 0.4 * np.array([[1.0, -1.0], [-1.0, 1.0]])  # W/K
    logs = {}
    for run in ("fit", "holdout"):
        shares = np.repeat(random.uniform(0.05, 0.3, (8, count)) * (random.random((8, count)) < 0.7), 150, axis=0)
        rise, rises = np.zeros(count), []
        for share in shares:
            rises.append(rise)
            rise = rise + 2.0 * (loss * share**2 - flow @ rise) / capacity
        log = {"time": 2.0 * np.arange(len(shares)), "temperature.ambient": np.full(len(shares), 21.0)}
        log |= {f"torque.{name}": torque[name] * share for name, share in zip(names, shares.T, strict=True)}
        warm = 21.0 + np.array(rises) + 0.1 * random.standard_normal(shares.shape)
        logs[run] = pd.DataFrame(
            log | {f"temperature.{name}": column for name, column in zip(names, warm.T, strict=True)}
        )
    return logs


def shipped(file: str) -> Path:
    """A URDF of the package example-robot-data, which the extra `robots` installs."""
    try:
        matches = [path for path in metadata.files("example-robot-data") or [] if path.name == file]
    except metadata.PackageNotFoundError:
        matches = []
    if not matches:
        pytest.skip(f"no {file}: pip install 'lptn[robots]'")
    return Path(str(matches[0].locate()))


@pytest.mark.long
@pytest.mark.parametrize(
    ("file", "nodes", "chains"),
    [("a1.urdf", 12, 4), ("go1.urdf", 12, 4), ("ur5_robot.urdf", 6, 1), ("panda.urdf", 8, 1)],
)
def test_a_real_robot_is_checked_drawn_and_fitted(file: str, nodes: int, chains: int, tmp_path: Path) -> None:
    urdf, model = shipped(file), tmp_path / "model.toml"
    joints = read_joints(urdf)[1]
    assert len(joints) == nodes
    assert sum(axis.before is None for axis in joints) == chains
    limits = {axis.name: axis.effort for axis in joints}
    logs = chain_logs([axis.name for axis in joints], [axis.before for axis in joints], limits)
    files = write_logs(tmp_path, logs)
    for words in (
        ["new", "--urdf", str(urdf), "-o", str(model)],
        ["check", str(model), str(files[0]), "--drawing", str(tmp_path / "model.svg")],
    ):
        with pytest.raises(SystemExit) as stop:
            main(words)
        assert stop.value.code == 0
    drawing = (tmp_path / "model.svg").read_text()
    assert all(f'data-node="{name}"' in drawing for name in limits)
    loaded = lptn.load_model(model)
    fitted, held_out = loaded.runs(files)
    as_written = lptn.compare(loaded.model, [held_out]).all.rmse
    # Only one kind of motor is held, so that the others find losses of their own.
    assert lptn.compare(lptn.fit(loaded.model, [fitted]).model, [held_out]).all.rmse < 0.1 * as_written


def test_a_sliding_joint_has_a_force(tmp_path: Path) -> None:
    text = robot(joint("elbow", "base", "arm"), joint("finger", "arm", "tip", "prismatic"))
    turning, sliding = read_joints(written(tmp_path, text))[1]
    assert (turning.slides, sliding.slides) == (False, True)
    assert sliding.torque < 0.1 * turning.torque  # 33.5 N of a finger want a smaller motor than 33.5 N·m of an elbow
    made = urdf_model_text(tmp_path / "robot.urdf")
    assert "# --- finger: 33.5 N ---" in made
    assert "# --- elbow: 33.5 N·m ---" in made


def test_a_limit_that_is_not_stated_is_said_to_be_assumed(tmp_path: Path) -> None:
    """Many URDFs state 0, which would make a motor of no size."""
    stated = joint("elbow", "base", "arm")
    written(tmp_path, robot(stated, joint("wrist", "arm", "hand").replace('effort="33.5"', 'effort="0"')))
    assert "The URDF states no limit of wrist; taken for it: 20 N·m" in urdf_model_text(tmp_path / "robot.urdf")
    written(tmp_path, robot(stated))
    assert "states no limit" not in urdf_model_text(tmp_path / "robot.urdf")


@pytest.mark.parametrize(
    ("kind", "effort", "said"),
    [
        ("revolute", "1e9", "1e+09 N·m"),
        ("revolute", "1e300", "1e+300 N·m"),
        ("continuous", "1e-9", "1e-09 N·m"),
        ("prismatic", "1e12", "1e+12 N"),
        ("revolute", "-3", "-3 N·m"),
        ("continuous", "nan", "nan N·m"),
    ],
)
def test_a_limit_that_no_motor_has_is_none_and_the_joint_is_named(
    kind: str, effort: str, said: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    wrist = joint("wrist", "arm", "hand", kind).replace("33.5", effort)
    made = urdf_model_text(written(tmp_path, robot(joint("elbow", "base", "arm"), wrist)))
    none = urdf_model_text(written(tmp_path, robot(joint("elbow", "base", "arm"), wrist.replace(effort, "0"))))
    assert made == none
    assert f"robot.urdf: joint wrist: effort {said}, which no motor has; taken as no limit, like 0" in caplog.text


@pytest.mark.parametrize("kind", ["revolut", "Revolute", "ball", ""])
def test_a_joint_of_a_type_that_a_urdf_does_not_have_is_named(
    kind: str, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    made = urdf_model_text(written(tmp_path, robot(joint("elbow", "base", "arm"), joint("wrist", "arm", "hand", kind))))
    assert "wrist" not in made
    assert f"robot.urdf: joint wrist: type '{kind}'; taken as fixed" in caplog.text


def test_what_a_drawing_program_got_wrong_is_said_of_the_joint(tmp_path: Path) -> None:
    for at, said in (("1e200 1e300 0", "1e+300 m"), ("0 nan 0", "nan m"), ("0 2500 0", "2500 m")):
        with pytest.raises(InputError, match=r"joint elbow: found .*" + re.escape(said)):
            urdf_model_text(written(tmp_path, robot(joint("elbow", "base", "arm", at=at))))


def test_a_chain_of_three_thousand_joints_is_refused_at_once(tmp_path: Path) -> None:
    chain = [joint(f"j{k}", f"l{k}", f"l{k + 1}") for k in range(3000)]
    with pytest.raises(InputError, match=r"3,000 nodes; expected at most 500"):
        urdf_model_text(written(tmp_path, robot(*chain)))
    assert len(read_joints(written(tmp_path, robot(*chain[:180])))[1]) == 180


def test_joints_that_nothing_drives_are_passed_over(tmp_path: Path) -> None:
    text = robot(
        joint("shoulder_joint", "base", "upper"),
        joint("spring", "upper", "sprung", at="0.3 0 0"),
        joint("elbow_joint", "sprung", "fore", at="0.2 0 0"),
        joint("finger_joint", "fore", "finger", "prismatic", '<mimic joint="elbow_joint"/>'),
        *(
            f'<transmission name="{motor}"><joint name="{motor}_joint"/></transmission>'
            for motor in ("shoulder", "elbow")
        ),
    )
    name, joints = read_joints(written(tmp_path, text))
    assert name == "test"
    assert [(axis.name, axis.before) for axis in joints] == [("shoulder", None), ("elbow", "shoulder")]
    assert joints[1].distance == pytest.approx(0.5)


def test_names_stay_apart_and_legal(tmp_path: Path) -> None:
    text = robot(joint("a_joint", "base", "1"), joint("a_motor", "1", "2"), joint("wrist roll", "2", "3"))
    assert [axis.name for axis in read_joints(written(tmp_path, text))[1]] == ["a_joint", "a_motor", "wrist_roll"]


def test_joints_with_other_limits_have_sections_of_their_own(tmp_path: Path) -> None:
    weak = joint("FR_calf_joint", "b", "c").replace("33.5", "10")
    text = robot(joint("FR_hip_joint", "trunk", "a"), joint("FL_hip_joint", "trunk", "b"), weak)
    (tmp_path / "model.toml").write_text(made := urdf_model_text(written(tmp_path, text)))
    assert '[nodes."*_hip"]' in made
    assert "FR_hip, FL_hip sit on trunk" in made
    model = lptn.load_model(tmp_path / "model.toml").model
    values = {parameter.name: parameter.value for parameter in model.parameters}
    assert values["capacity.FR_hip"] / values["capacity.FR_calf"] == pytest.approx(3.35, rel=0.01)
    assert values["resistance.FR_calf~ambient"] > values["resistance.FR_hip~ambient"]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "no XML"),
        ("<robot", "no XML"),
        ("<mujoco/>", "<mujoco> outermost"),
        (robot(), "no joint that moves"),
        (robot(joint("a", "b", "c", "fixed")), "no joint that moves"),
        (robot(joint("a", "b", "c"), joint("a", "c", "d")), "a name twice"),
        (robot('<joint name="a" type="revolute"><child link="c"/></joint>'), "no <parent link=…>"),
        (robot(joint("a", "b", "c", at="0 zero 0")), "found 'zero'; expected a number"),
        (robot(joint("a", "b", "c").replace("33.5", "strong")), "found 'strong'; expected a number"),
        ('<!DOCTYPE r [<!ENTITY a "x"><!ENTITY b "&a;&a;">]><robot name="&b;"/>', "no joint that moves"),
    ],
)
def test_what_is_no_urdf_is_one_line(tmp_path: Path, text: str, words: str) -> None:
    file = written(tmp_path, text)
    with pytest.raises(InputError) as refused:
        urdf_model_text(file)
    assert words in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_chain_that_bites_its_tail_ends(tmp_path: Path) -> None:
    text = robot(joint("a", "1", "2"), joint("held", "3", "1", "fixed"), joint("back", "1", "3", "fixed"))
    assert [axis.before for axis in read_joints(written(tmp_path, text))[1]] == [None]


@pytest.mark.parametrize(
    "words", [("leg", "--urdf", "{urdf}"), ("--urdf", "{urdf}", "-o", "{urdf}"), ("--urdf", "none.urdf")]
)
def test_what_would_lose_or_mean_nothing_is_refused(tmp_path: Path, words: tuple[str, ...]) -> None:
    file = written(tmp_path, quadruped())
    with pytest.raises(SystemExit) as stop:
        main(["new", *(word.format(urdf=file) for word in words)])
    assert stop.value.code == 2
    assert file.read_text() == quadruped()


def test_the_command(tmp_path: Path) -> None:
    model = tmp_path / "model.toml"
    for words in (["new", "--urdf", str(written(tmp_path, quadruped())), "-o", str(model)], ["check", str(model)]):
        with pytest.raises(SystemExit) as stop:
            main(words)
        assert stop.value.code == 0
