# %% [markdown]
# # Hot knees: five ways to keep a limit, in MuJoCo
#
# The A1 with 6 kg on its back, no joint above 60 degC: it stands on a slope, it trots, and it is asked to trot while
# its joints are 5 K above the limit. Torque is derated by each drive, cut off, scaled by `TorqueMPC` (with floors: what
# holds the robot comes first), or the task is planned anew by `MissionControl`: height, speed, rests.
#
# The planners know the ready model `quadruped`; of the robot every parameter is 10 % off, up or down.

# %%
import argparse
import os
import sys
from pathlib import Path

if sys.platform == "linux" and not os.environ.get("DISPLAY"):
    os.environ.setdefault("MUJOCO_GL", "egl")

import numpy as np

from a1_controllers import (
    LIMIT,
    Controller,
    CutOff,
    Derating,
    Predictive,
    Replanned,
    gait_in,
    mission_of,
    of_another_version,
    run,
    support_first,
    transitions_in,
)
from a1_cosim import Record, Setting
from a1_task import JOINTS, Command
from a1_thermal import quadruped
from lptn.robots.presets import preset_text

parser = argparse.ArgumentParser(description="Temperature limits kept by torque or by task: the A1 in MuJoCo.")
parser.add_argument("--seconds", type=float, default=120.0, help="of each run; recovering takes five times as long")
parser.add_argument("--other", help="Python of another installation of lptn, whose TorqueMPC runs too")
parser.add_argument("--only", nargs="*", default=[], help="slope, trot, recover")
parser.add_argument("--output", type=Path, default=Path("mujoco_a1"), help="folder of the picture")
options = parser.parse_args()
options.output.mkdir(parents=True, exist_ok=True)

nominal = quadruped()
file = options.output / "quadruped.toml"
file.write_text(preset_text("quadruped"), encoding="utf-8")
truth = nominal.with_values(
    nominal.values * (1 + 0.1 * np.random.default_rng(7).choice([-1.0, 1.0], len(nominal.values)))
)
low, tall = 0.24, 0.34  # m

# %% [markdown]
# ## The tasks

# %%
scenarios = {
    "slope": Setting(options.seconds, start=55.0, slope=np.radians(12), task=Command("stand", 0.0, low)),
    "trot": Setting(options.seconds, start=55.0, task=Command("trot", 0.5, 0.27)),
    "recover": Setting(5 * options.seconds, start=LIMIT + 5, task=Command("trot", 0.5, 0.27)),
}

# %% [markdown]
# ## When a robot is down
#
# It has fallen, or its trunk is 8 cm below where it should stand, four seconds after the last change of activity.


# %%
def sunk(record: Record) -> float | None:
    """When [s], or `None`."""
    since = 0.0
    for k, (time, command) in enumerate(zip(record.time, record.command, strict=True)):
        if k and command.activity != record.command[k - 1].activity:
            since = time
        if command.activity != "rest" and time > since + 4.0 and record.position[k][2] < command.height - 0.08:
            return time
    return record.fell


# %% [markdown]
# ## The runs

# %%
records: dict[str, list[Record]] = {}
print(f"{'':8} {'':34} {'fell':>8} {'hottest':>8} {'below limit':>12} {'way':>6} {'on its feet':>12}")
for name, setting in scenarios.items():
    if options.only and name not in options.only:
        continue
    do = setting.task.activity
    speeds = [0.3, 0.5] if do == "trot" else [0.0]
    gait = gait_in(setting, do, speeds, [setting.task.height, tall], nominal)
    middle = gait.at(setting.task.speed, 0.0, [setting.task.height])
    standing = np.array([middle[nominal.inputs.index(f"torque.{joint}")] for joint in JOINTS])
    amount = setting.task.speed * setting.duration if do == "trot" else setting.duration
    transitions = transitions_in(setting, do, tall, nominal)
    for (before, after), transition in transitions.items():
        calf = max(transition.gait.at(0.0, 0.0)[nominal.inputs.index(f"torque.{joint}")] for joint in JOINTS)
        print(f"{before} to {after}: {transition.duration:.1f} s, up to {calf:.0f} N·m (RMS)")
    replanned = Replanned(mission_of(nominal, do, gait, amount, setting.start, transitions), setting.task)
    controllers: dict[str, Controller] = {
        "derating, 50 to 60 degC": Derating(setting.task),
        "cut-off at 60, on at 55 degC": CutOff(setting.task),
        "TorqueMPC, floors": Predictive(setting.task, support_first(nominal, standing)),
        "MissionControl": replanned,
        "MissionControl, rests for nothing": Replanned(
            mission_of(nominal, do, gait, amount, setting.start), setting.task
        ),
    }
    if options.other:
        controllers["TorqueMPC of the other version"] = Predictive(
            setting.task, of_another_version(options.other, file)
        )
    for label, controller in controllers.items():
        record = run(label, setting, truth, controller)
        records.setdefault(name, []).append(record)
        hot = np.array(record.temperature).max(axis=1)
        above = np.flatnonzero(hot > LIMIT)
        until = 0.0 if not above.size else record.time[above[-1]]
        cool = "at the end not" if above.size and above[-1] == len(hot) - 1 else f"from {until:.0f} s"
        feet = 0.5 * sum(command.activity != "rest" for command in record.command)
        down = sunk(record)
        fell = f"{down:.0f} s" if down else "no"
        print(f"{name:8} {label:34} {fell:>8} {record.peak:8.2f} {cool:>12} {record.way:6.0f} {feet:12.0f}", flush=True)
    print(replanned.control.text(), flush=True)

# %% [markdown]
# ## Picture

# %%
from a1_pictures import compared  # noqa: E402

compared(records, LIMIT, options.output / "controllers.png")
