"""The A1 in MuJoCo beside its thermal network: robot, gait, closed loop, MuJoCo's own one node, and the FMU."""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from a1_task import JOINTS, Command
from a1_thermal import CasadiThermal, quadruped

if TYPE_CHECKING:
    from a1_cosim import Record, Setting

# These packages are in the extra `robots`, not in `dev`: the robot's description alone takes 440 MB.
mujoco = pytest.importorskip("mujoco", reason="needs the extra `robots`")
try:
    from a1_robot import OneNode, a1_urdf, build

    a1_urdf()
except ModuleNotFoundError as error:
    pytest.skip(str(error), allow_module_level=True)

EXAMPLE = Path(__file__).parents[2] / "examples" / "mujoco_a1"
START, LIMIT, SOFT = 56.0, 58.0, 55.0


def thermal() -> CasadiThermal:
    return CasadiThermal(quadruped(), START, LIMIT, SOFT)


@pytest.fixture(scope="module")
def setting() -> Setting:
    from a1_cosim import Setting

    return Setting(duration=40.0, start=START)


@pytest.fixture(scope="module")
def open_loop(setting: Setting) -> Record:
    from a1_cosim import CoSimulation
    from a1_governor import Unmoved

    return CoSimulation("open loop", setting, thermal(), Unmoved(setting.task)).run()


def test_robot_is_the_one_of_the_urdf() -> None:
    bare, loaded = build(OneNode()), build(OneNode(), payload=6.0)
    assert bare.body_mass.sum() == pytest.approx(13.741)
    assert loaded.body_mass.sum() == pytest.approx(19.741)
    assert [bare.actuator(k).name for k in range(bare.nu)] == list(JOINTS)
    assert [bare.joint(k + 1).name for k in range(12)] == [f"{joint}_joint" for joint in JOINTS]
    assert bare.nq == 19  # a free base and twelve joints
    assert (bare.dof_armature[6:] > 0).all()
    assert (bare.dof_frictionloss[6:] > 0).all()


def test_mujocos_motors_have_the_networks_values() -> None:
    model, motor = quadruped(), OneNode()
    values = dict(zip((parameter.name for parameter in model.parameters), model.values, strict=True))
    for joint in JOINTS:
        assert values[f"capacity.{joint}"] == motor.capacity
        assert values[f"resistance.{joint}~ambient"] == motor.resistance
        assert values[f"copper_loss.resistance.{joint}"] == motor.winding
        assert values[f"copper_loss.torque_constant.{joint}"] == motor.torque_constant
        assert values[f"resistance_rise.alpha.{joint}"] == motor.alpha
        assert values[f"resistance_rise.reference.{joint}"] == motor.reference


def test_open_loop_trots_on_and_passes_the_limit(open_loop: Record) -> None:
    assert open_loop.fell is None
    assert open_loop.way == pytest.approx(0.5 * 40, abs=1.0)
    assert max(abs(position[1]) for position in open_loop.position) < 0.2
    assert open_loop.peak > LIMIT + 1


def test_closed_loop_keeps_every_joint_below_its_limit(setting: Setting) -> None:
    from a1_cosim import CoSimulation
    from a1_governor import Governor

    record = CoSimulation("closed loop", setting, thermal(), Governor(setting.task)).run()
    assert record.fell is None
    assert record.peak < LIMIT
    assert record.way > 5.0


def test_a_torque_that_is_simply_cut_drops_the_robot(setting: Setting) -> None:
    from a1_cosim import CoSimulation
    from a1_governor import Unmoved, cut

    record = CoSimulation("cut", setting, thermal(), Unmoved(setting.task), cut).run()
    assert record.fell is not None


def test_mujocos_one_node_follows_its_equation(open_loop: Record) -> None:
    motor, joint = open_loop.setting.motor, JOINTS.index("RR_calf")
    squares = np.array(open_loop.torque)[:, joint] ** 2

    def rate(time: float, temperature: np.ndarray) -> np.ndarray:
        square = squares[min(int(time / 0.5), len(squares) - 1)]
        resistance = motor.winding * (1 + motor.alpha * (temperature - motor.reference))
        heat = square / motor.torque_constant**2 * resistance - (temperature - motor.ambient) / motor.resistance
        return np.asarray(heat / motor.capacity)

    solved = solve_ivp(rate, (0.0, 40.0), [START], max_step=0.5, rtol=1e-8)
    assert open_loop.one_node[-1][joint] == pytest.approx(solved.y[0, -1], abs=0.01)


def test_feet_off_the_shoulders_move_load_between_the_legs(setting: Setting) -> None:
    from a1_cosim import CoSimulation
    from a1_governor import Unmoved

    def hind_share(ahead: float) -> float:
        task = replace(setting.task, ahead=ahead)
        short = replace(setting, duration=6.0, task=task, enough=LIMIT + 100.0)
        record = CoSimulation("load", short, thermal(), Unmoved(task)).run()
        assert record.fell is None
        squares = np.square(record.torque[6:]).mean(axis=0)
        return float(squares[6:].sum() / squares.sum())

    assert hind_share(-0.03) < hind_share(0.0) < hind_share(0.03)


def test_a_run_ends_where_a_joint_is_hot_enough(setting: Setting) -> None:
    from a1_cosim import CoSimulation
    from a1_governor import Unmoved

    short = replace(setting, duration=6.0, enough=START - 1.0)
    record = CoSimulation("hot", short, thermal(), Unmoved(setting.task)).run()
    assert record.time == pytest.approx([0.5])


@pytest.mark.long
def test_a_residual_learns_to_stand_tall() -> None:
    import residual

    # Torques that fall with the height and know nothing else.
    rows = np.zeros((21, len(residual.MODEL.inputs)))
    rows[0] = [25.0**2 if "temperature" in column else 1.0 for column in residual.MODEL.inputs]
    for joint in JOINTS:
        rows[[0, 2], residual.MODEL.inputs.index(f"torque.{joint}")] = 20.0, -15.0
    weights = residual.learn(rows, rounds=8, seed=3, drawn=20, episodes=6)
    knobs = dict(zip(residual.KNOBS, residual.knobs_of(weights, np.full(12, 20.0)), strict=True))
    assert knobs["height"] > 0.34
    assert knobs["left"] == pytest.approx(0.0, abs=1e-12)


@pytest.mark.parametrize("payload", [0.0, 6.0])
def test_lies_down_without_torque_and_gets_up_again(setting: Setting, payload: float) -> None:
    from a1_cosim import CoSimulation

    class Nap:
        """Stands, lies, stands, walks: 6 s each."""

        calls = 0

        def command(self, scale: np.ndarray) -> Command:
            self.calls += 1
            activities = ("stand", "rest", "stand", "trot")
            return Command(activities[min(self.calls // 12, 3)])  # type: ignore[arg-type]

    record = CoSimulation("nap", replace(setting, payload=payload, duration=24.0), thermal(), Nap()).run()
    assert record.fell is None
    assert record.torque[22].max() < 1e-9
    assert record.position[22][2] < 0.08
    assert record.position[34][2] > 0.25
    assert record.position[-1][0] > 1.5


def test_the_fmu_gives_the_models_temperatures(tmp_path: Path) -> None:
    from a1_fmu import FmuThermal
    from lptn.fmu import export

    path = tmp_path / "quadruped.fmu"
    export(quadruped(), path, fmi=3)
    model = thermal()
    random = np.random.default_rng(1)
    with FmuThermal(path, START, LIMIT, SOFT) as fmu:
        order = [fmu.columns.index(column) for column in model.columns]
        for _ in range(200):
            inputs = random.uniform(0.0, 8.0, len(fmu.columns))
            fmu.advance(inputs, 0.5)
            model.advance(inputs[order], 0.5)
            assert np.abs(fmu.temperature - model.temperature).max() < 1e-6
            assert np.abs(fmu.scale - model.scale).max() < 1e-6
        heat = fmu.heat("RR_calf")
        rate = fmu.session.read(["der(RR_calf.temperature)"])[0]
    assert sum(heat.values()) == pytest.approx(300.0 * rate, abs=1e-6)


def test_example_runs_in_its_fast_mode(tmp_path: Path) -> None:
    command = [sys.executable, str(EXAMPLE / "walk.py"), "--fast", "--output", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    lines = [line for line in done.stdout.splitlines() if "hottest joint" in line]
    assert [line.split(":")[0] for line in lines] == ["open loop", "closed loop", "torque cut"]
    assert "stays on its feet" in lines[1]
    assert (tmp_path / "overview.png").stat().st_size > 20_000


@pytest.mark.long
def test_hot_drives_that_are_cut_off_drop_a_robot_that_a_mission_lays_down(setting: Setting) -> None:
    from a1_controllers import CutOff, Replanned, gait_in, mission_of, run

    hot, model = replace(setting, start=63.0, duration=6.0), quadruped()
    assert run("cut-off", hot, model, CutOff(hot.task)).fell is not None
    gait = gait_in(hot, "trot", [0.5], [0.27, 0.34], model)
    control = Replanned(mission_of(model, "trot", gait, 20.0, hot.start), hot.task)
    lying = run("mission", hot, model, control)
    assert lying.fell is None
    assert lying.command[-1].activity == "rest"
    assert lying.temperature[-1].max() < 63.3
