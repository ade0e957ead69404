# %% [markdown]
# # From a fitted model to a running controller
#
# A leg swings a weight, and its motors get hot. A thermal controller in the leg's fast loop multiplies each torque by a
# scale from 0 to 1, so that no motor passes 60 °C: `ControlLoop` sums squares at every tick, and every five seconds
# `TorqueMPC` solves for the next ones. On the robot the same numbers come from C: `mpc.emit(folder, …)` writes it.
#
# `python leg_in_loop.py better.toml` takes a model that was fitted; without one it is the ready leg, whose every value
# is 10 % off the leg that swings here. The leg moves in MuJoCo where that is installed (`pip install mujoco`), else its
# torques are those that hold the weight on a given course.

# %%
import argparse
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from lptn import load_model
from lptn.planners import ControlLoop, TorqueMPC
from lptn.robots import preset_text

parser = argparse.ArgumentParser(description="A leg whose torques a thermal controller scales at every tick.")
parser.add_argument("model", nargs="?", type=Path, help="a fitted model of a leg, better.toml")
parser.add_argument("--duration", type=float, default=300.0, help="s that are simulated")
parser.add_argument("--plain", action="store_true", help="without MuJoCo")
options = parser.parse_args()
TICK, LIMIT, AMBIENT, START = 0.005, 60.0, 25.0, 55.0  # s, degC

# %% [markdown]
# ## The model, and the leg as it truly is
#
# The truth is three heat capacities with copper loss, in plain NumPy. Its winding of the calf has 20 % more resistance
# than the model says, and the calf's temperature sensor sticks for the second half.

# %%
if options.model is None:
    options.model = Path("leg.toml")
    options.model.write_text(preset_text("leg"), encoding="utf-8")
model = load_model(options.model).model

CAPACITY, TO_AIR, ALONG = np.array([270.0, 330.0, 270.0]), np.array([11.0, 9.0, 11.0]), np.array([3.3, 2.7])
WINDING, TORQUE_CONSTANT = np.array([0.15, 0.15, 0.18]), 0.84357  # ohm, N·m/A


def warmed(temperature: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """Temperatures one tick on [degC]."""
    heat = WINDING * (torque / TORQUE_CONSTANT) ** 2 - (temperature - AMBIENT) / TO_AIR
    flow = np.diff(temperature) / ALONG
    heat[:2] += flow
    heat[1:] -= flow
    return temperature + TICK * heat / CAPACITY


# %% [markdown]
# ## The leg
#
# Hip, thigh and calf follow a course that swings seven kilograms at the foot.

# %%
AMPLITUDE, MIDDLE, PACE = np.array([0.15, 0.4, 0.5]), np.array([0.2, 0.7, -1.4]), 2 * np.pi * 0.8
MJCF = f"""
<mujoco><option timestep="{TICK}" integrator="implicitfast"/><default><geom type="capsule" size="0.02"/>
<joint damping="0.2" armature="0.02"/></default><worldbody><body name="hip" pos="0 0 1">
<joint name="hip" axis="1 0 0"/><geom fromto="0 0 0 0 -0.08 0" mass="0.7"/>
<body pos="0 -0.08 0"><joint name="thigh" axis="0 1 0"/><geom fromto="0 0 0 0 0 -0.2" mass="1"/>
<body pos="0 0 -0.2"><joint name="calf" axis="0 1 0"/><geom fromto="0 0 0 0 0 -0.2" mass="0.2"/>
<geom type="sphere" size="0.04" pos="0 0 -0.2" mass="7"/></body></body></body></worldbody><actuator>
<motor joint="hip"/><motor joint="thigh"/><motor joint="calf"/></actuator></mujoco>"""


class PlainLeg:
    """Torques that hold the weight on the course, quasi-statically; the leg is taken to follow."""

    def asked(self, time: float) -> np.ndarray:
        hip, thigh, calf = MIDDLE + AMPLITUDE * np.sin(PACE * time)
        forward = np.sin(thigh) * 0.2 + np.sin(thigh + calf) * 0.2
        return 9.81 * np.array([8.0 * 0.4 * np.sin(hip), 8.0 * forward, 7.2 * 0.2 * np.sin(thigh + calf)])

    def velocity(self, time: float) -> np.ndarray:
        return PACE * AMPLITUDE * np.cos(PACE * time)

    def move(self, torque: np.ndarray) -> None:
        pass


class MujocoLeg:
    """The leg in MuJoCo under a position control."""

    def __init__(self) -> None:
        import mujoco

        self._mujoco, self._model = mujoco, mujoco.MjModel.from_xml_string(MJCF)
        self._data = mujoco.MjData(self._model)
        self._data.qpos[:] = MIDDLE

    def asked(self, time: float) -> np.ndarray:
        behind = MIDDLE + AMPLITUDE * np.sin(PACE * time) - self._data.qpos
        return np.clip(120 * behind - 3 * self._data.qvel, -33.5, 33.5)

    def velocity(self, time: float) -> np.ndarray:
        return self._data.qvel.copy()

    def move(self, torque: np.ndarray) -> None:
        self._data.ctrl[:] = torque
        self._mujoco.mj_step(self._model, self._data)


# %% [markdown]
# ## The loop
#
# This is all that a robot's program has to do: what is asked, what the sensors say, and a product. A position control
# that gets less than it asks for asks for more, and the weight sinks: a robot that must not sink gets `floors`, or a
# planner above it that slows it down.

# %%
in_mujoco = find_spec("mujoco") is not None and not options.plain
for controlled in (False, True):
    leg = MujocoLeg() if in_mujoco else PlainLeg()
    loop = ControlLoop(TorqueMPC(model, LIMIT, request="torque", noise=0.1), TICK)
    random = np.random.default_rng(0)
    temperature, read = np.full(3, START), np.full(3, START)
    hottest, given, wanted, messages = START, 0.0, 0.0, set()
    for k in range(round(options.duration / TICK)):
        time = k * TICK
        if k % 20 == 0:  # temperatures come ten times a second
            fresh = temperature + 0.1 * random.standard_normal(3)
            read = np.append(fresh[:2], read[2]) if time > options.duration / 2 else fresh
        asked = leg.asked(time)
        around = {"temperature.ambient": AMBIENT, "speed.base": 0.0}
        for joint, value in zip(model.nodes, leg.velocity(time), strict=True):
            around |= {f"velocity.{joint}": value, f"velocity_rms.{joint}": value}
        conditions = [around[column] for column in loop.mpc.conditions]
        torque = asked * loop.update(asked, read, conditions) if controlled else asked
        leg.move(torque)
        temperature = warmed(temperature, torque)
        hottest, given, wanted = max(hottest, temperature.max()), given + torque @ torque, wanted + asked @ asked
        messages |= set(loop.given_up)
    how = "with the controller" if controlled else "without"
    share = np.sqrt(given / wanted)
    print(f"{how}: hottest motor {hottest:.2f} degC, limit {LIMIT:g}; {share:.0%} of the torque asked")
    if controlled:
        print(*sorted({sentence for sentence in messages if " has read " in sentence})[:1], sep="\n")

# %% [markdown]
# ## For the robot
#
# The same controller in C: `loop.c` shows the calls, `names.txt` the order of the numbers.

# %%
loop.mpc.emit(Path("controller"), np.full(len(model.states), START), np.full((1, 3), 9.0), np.array([conditions]))
print("cd controller && cc -std=c99 -O2 -ftree-vectorize -ffp-contract=off loop.c lptn_loop.c lptn_mpc.c -lm -o loop")
