# %% [markdown]
# # A quadruped that knows how hot its joints are
#
# The Unitree A1 walks in MuJoCo 4 with a load on its back. Its joint torques and speeds go into a thermal network of
# thirteen nodes, an FMU that `lptn.fmu.export` writes; its temperatures and the torque that a thermal limiter would
# allow come back.
#
# Three runs of the same task:
#
# - *open loop*: the robot walks, however hot it is;
# - *closed loop*: a governor changes the task by the FMU's torque scales, so that no joint passes its limit: the
#   robot stands taller, which straightens its knees, and lies down when that is not enough;
# - *torque cut*: the drives cut the torque by the same scales, and nobody changes the task: the robot falls.
#
# `python walk.py` takes about four minutes and simulates 20 min three times, in real thermal time: nothing is
# accelerated. `python walk.py --fast` starts warm and simulates 30 s. `--film` writes an animated GIF too.

# %%
import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path

if sys.platform == "linux" and not os.environ.get("DISPLAY"):
    os.environ.setdefault("MUJOCO_GL", "egl")  # MuJoCo reads it when it is imported: render without a screen

import numpy as np

from a1_cosim import WINDOW, CoSimulation, Record, Setting
from a1_fmu import FmuThermal
from a1_governor import Governor, Unmoved, cut, leave
from a1_pictures import film, overview
from a1_robot import TIME_STEP
from a1_task import JOINTS
from a1_thermal import quadruped
from lptn.batch.motors import motors
from lptn.fmu import export

parser = argparse.ArgumentParser(description="The Unitree A1 in MuJoCo beside its thermal network.")
parser.add_argument("--fast", action="store_true", help="30 s from a warm start instead of 20 min from cold")
parser.add_argument("--film", action="store_true", help="write the closed loop as an animated GIF too")
parser.add_argument("--output", type=Path, default=Path("mujoco_a1"), help="folder of the FMU and the pictures")
options = parser.parse_args()
options.output.mkdir(parents=True, exist_ok=True)

# %% [markdown]
# ## The task
#
# Trot at 0.5 m/s with the body low, at 0.27 m, and 6 kg on the back. No joint may pass 60 °C; the limiter begins to act
# 10 K below. In the fast mode the joints are at 56 °C when it starts, and the limit lies at 58 °C.

# %%
setting = Setting(duration=30.0, start=56.0) if options.fast else Setting(duration=1200.0, start=25.0)
limit, soft = (58.0, 55.0) if options.fast else (60.0, 50.0)

# %% [markdown]
# ## The thermal network as an FMU
#
# The ready model `quadruped`: motors coupled along each leg, hips to their neighbours and to the computer, copper
# loss that grows with the winding's temperature, friction, drive heat, natural and forced convection. Its values are
# plausible ones, not those of a real A1.

# %%
fmu = options.output / "quadruped.fmu"
export(quadruped(), fmu, fmi=3)

# %% [markdown]
# ## The three runs

# %%
records: list[Record] = []
for label, governor, limiter in (
    ("open loop", Unmoved(setting.task), leave),
    ("closed loop", Governor(setting.task), leave),
    ("torque cut", Unmoved(setting.task), cut),
):
    with FmuThermal(fmu, setting.start, limit, soft) as thermal:
        record = CoSimulation(label, setting, thermal, governor, limiter, film=limiter is leave).run()
        heat = thermal.heat("RR_calf")
    records.append(record)
    end = f"falls at {record.fell:.0f} s" if record.fell else "stays on its feet"
    print(f"{label}: hottest joint {record.peak:.2f} degC, limit {limit:g}; {record.way:.0f} m; {end}")
    print(f"  {record.clock}")
    if label == "open loop":
        print("  RR_calf at the end:", ", ".join(f"{name} {value:+.1f} W" for name, value in heat.items()))

# %% [markdown]
# ## MuJoCo's own motor temperature
#
# The twelve actuators are MuJoCo's `<dcmotor thermal="R C tau alpha Tref Tamb">`. Each keeps the temperature of one
# node, with the network's own resistance to the air and heat capacity, on the same torques in the same run. It knows
# no neighbours, no friction, no drive heat and no wind. `lptn export --to mujoco` writes attributes that a joint's
# response in the network has, and that know of the drives.

# %%
exported = {motor.joint: motor for motor in motors(quadruped())}
for joint in JOINTS[6:9]:
    network, one_node = records[0].joint(joint)[-1], records[0].joint(joint, "one_node")[-1]
    better = setting.start
    for torque in records[0].joint(joint, "torque"):
        better = float(exported[joint].after(better, torque, WINDOW * TIME_STEP))
    print(f"{joint}: network {network:.1f} degC, one node {one_node:.1f} degC, one node as exported {better:.1f} degC")

# %% [markdown]
# ## What it costs, and what the long thermal step loses
#
# Ten seconds of the open loop, once with a thermal step of 0.5 s and once with one at every step of MuJoCo.

# %%
ends = []
for window in (WINDOW, 1):
    with FmuThermal(fmu, setting.start, limit, soft) as thermal:
        short = replace(setting, duration=4.0 if options.fast else 10.0, window=window)
        record = CoSimulation("cost", short, thermal, Unmoved(setting.task)).run()
    print(f"thermal step {window * TIME_STEP:g} s: {record.clock}")
    ends.append(record.temperature[-1])
print(f"the two end within {1000 * np.abs(ends[0] - ends[1]).max():.2f} mK of each other")

# %% [markdown]
# ## Pictures

# %%
last = setting.duration
shots = [(0, 0.0), (0, last), (1, 0.5 * last), (1, last)]
lying = [time for time, command in zip(records[1].time, records[1].command, strict=True) if command.activity == "rest"]
if lying:
    shots[3] = (1, min(lying[0] + 10.0, last))
overview(records, limit, options.output / "overview.png", shots)
if options.film:
    scenes = [(2.0, 4.0), (0.5 * last, 0.5 * last + 2.0)]
    if lying:
        scenes.append((lying[0] - 1.0, min(lying[0] + 6.0, last)))
    film(records[1], limit, options.output / "closed_loop.gif", scenes)
