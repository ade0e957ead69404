# %% [markdown]
# # The thermal controller between ROS 2 messages
#
# `ThermalFilter` takes the bytes of messages and answers with bytes: `sensor_msgs/msg/JointState` with the torques that
# are asked (`effort`) becomes the same message with those that the temperatures allow. Measured torques and speeds come
# as a JointState too, temperatures as `control_msgs/msg/DynamicJointState`, as ros2_control publishes them. A node has
# to do no more than to hand its serialized messages on. No ROS is needed: the package rosbags knows the types.
#
# `python ros2_loop.py better.toml recorded limited` replays a bag and writes the limited commands into a new one.
# Without arguments it makes a bag for the ready leg first.

# %%
import argparse
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import Reader, Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from lptn import Model, load_model
from lptn.planners import ControlLoop, TorqueMPC
from lptn.robots import preset_text

STATES, COMMANDS, LIMITED, DYNAMIC = "/joint_states", "/joint_commands", "/limited_commands", "/dynamic_joint_states"
JOINT_STATE, DYNAMIC_STATE = "sensor_msgs/msg/JointState", "control_msgs/msg/DynamicJointState"
TYPES = get_typestore(Stores.ROS2_HUMBLE)
TYPES.register(get_types_from_msg("string[] interface_names\nfloat64[] values", "control_msgs/msg/InterfaceValue"))
TYPES.register(
    get_types_from_msg(
        "std_msgs/Header header\nstring[] joint_names\ncontrol_msgs/InterfaceValue[] interface_values", DYNAMIC_STATE
    )
)

# %% [markdown]
# ## The filter


# %%
class ThermalFilter:
    """Commands as the temperatures allow them.

    What is not known yet, or never comes, is missing: the controller says what stood in for it.

    Args:
        loop: the controller; its tick is the time between two commands.
        around: model inputs that no message tells, by column.
    """

    def __init__(self, loop: ControlLoop, around: dict[str, float]) -> None:
        self.loop, self.around = loop, around
        self.measured: dict[str, float] = {}
        self.temperatures: dict[str, float] = {}

    def joint_state(self, raw: bytes) -> None:
        """Measured torques and speeds."""
        message = TYPES.deserialize_cdr(raw, JOINT_STATE)
        self.measured = dict(zip(message.name, message.effort, strict=False))
        for joint, speed in zip(message.name, message.velocity, strict=False):
            self.around |= {f"velocity.{joint}": speed, f"velocity_rms.{joint}": speed}

    def dynamic_joint_state(self, raw: bytes) -> None:
        """Temperatures."""
        message = TYPES.deserialize_cdr(raw, DYNAMIC_STATE)
        for joint, interfaces in zip(message.joint_names, message.interface_values, strict=True):
            values = dict(zip(interfaces.interface_names, interfaces.values, strict=True))
            if "temperature" in values:
                self.temperatures[joint] = values["temperature"]

    def command(self, raw: bytes) -> bytes:
        """Torques that are asked, to torques that are admitted."""
        message, mpc = TYPES.deserialize_cdr(raw, JOINT_STATE), self.loop.mpc
        asked = dict(zip(message.name, message.effort, strict=True))
        scale = self.loop.update(
            {joint: asked.get(joint, np.nan) for joint in mpc.joints},
            {node: self.temperatures.get(node, np.nan) for node in mpc.model.nodes},
            {column: self.around.get(column, np.nan) for column in mpc.conditions},
            {joint: self.measured.get(joint, np.nan) for joint in mpc.joints} if self.measured else None,
        )
        factors = dict(zip(mpc.joints, scale, strict=True))
        message.effort = np.array([value * factors.get(joint, 1.0) for joint, value in asked.items()])
        return bytes(TYPES.serialize_cdr(message, JOINT_STATE))


# %% [markdown]
# ## A bag to try it on
#
# Three minutes at 20 Hz: a leg near its limit, whose drives gave half of what was asked; the calf's temperature stops
# coming after one. The model itself is the truth.


# %%
def make_bag(path: Path, model: Model, joints: tuple[str, ...]) -> None:
    """Write it."""
    most = np.array([5.0, 9.0, 16.0])
    rms = {f"torque.{joint}": value for joint, value in zip(joints, most / 2 / np.sqrt(2), strict=True)}
    inputs = np.array([np.full(180, rms.get(column, 25.0)) for column in model.inputs])
    temperatures = np.array(model.run(180)(np.array([50.0, 55.0, 59.5]), inputs, model.values, 1.0))
    header = TYPES.types["std_msgs/msg/Header"](TYPES.types["builtin_interfaces/msg/Time"](0, 0), "")
    joint_state, none = TYPES.types[JOINT_STATE], np.array([])
    interface, dynamic = TYPES.types["control_msgs/msg/InterfaceValue"], TYPES.types[DYNAMIC_STATE]
    random = np.random.default_rng(0)
    with Writer(path, version=9) as bag:
        topics = {topic: bag.add_connection(topic, JOINT_STATE, typestore=TYPES) for topic in (STATES, COMMANDS)}
        topics[DYNAMIC] = bag.add_connection(DYNAMIC, DYNAMIC_STATE, typestore=TYPES)
        for k in range(3600):
            torque = most * np.sin(k / 3)
            speed = np.array([0.5, 1.0, 2.0]) * np.cos(k / 3)
            state = joint_state(header, list(joints), none, speed, torque / 2)
            bag.write(topics[STATES], 50_000_000 * k, TYPES.serialize_cdr(state, JOINT_STATE))
            if k % 2 == 0:
                hot = joints if k < 1200 else joints[:2]
                values = temperatures[: len(hot), k // 20] + 0.1 * random.standard_normal(len(hot))
                message = dynamic(
                    header, list(hot), [interface(["temperature"], np.array([value])) for value in values]
                )
                bag.write(topics[DYNAMIC], 50_000_000 * k, TYPES.serialize_cdr(message, DYNAMIC_STATE))
            asked = joint_state(header, list(joints), none, none, torque)
            bag.write(topics[COMMANDS], 50_000_000 * k, TYPES.serialize_cdr(asked, JOINT_STATE))


# %% [markdown]
# ## Replay
#
# A node would call the three functions from its subscriptions; here the messages come from the bag.

# %%
parser = argparse.ArgumentParser(description="Torque commands of a ROS 2 bag, limited by temperature.")
parser.add_argument("model", nargs="?", type=Path, help="a fitted model, better.toml")
parser.add_argument("recorded", nargs="?", type=Path, default=Path("recorded"), help="a bag to read")
parser.add_argument("limited", nargs="?", type=Path, default=Path("limited"), help="the bag to write")
parser.add_argument("--rate", type=float, default=20.0, help="Hz, of the commands")
options = parser.parse_args()
made = options.model is None
if made:
    options.model = Path("leg.toml")
    options.model.write_text(preset_text("leg"), encoding="utf-8")
mpc = TorqueMPC(load_model(options.model).model, 60.0, request="torque")
if made:
    make_bag(options.recorded, mpc.model, mpc.joints)
limiter = ThermalFilter(ControlLoop(mpc, 1 / options.rate), {"temperature.ambient": 25.0, "speed.base": 0.0})
least = np.ones(len(mpc.joints))
with Reader(options.recorded) as bag, Writer(options.limited, version=9) as limited:
    out = limited.add_connection(LIMITED, JOINT_STATE, typestore=TYPES)
    for connection, time, raw in bag.messages():
        if connection.topic == STATES:
            limiter.joint_state(raw)
        elif connection.topic == DYNAMIC:
            limiter.dynamic_joint_state(raw)
        elif connection.topic == COMMANDS:
            limited.write(out, time, limiter.command(raw))
            least = np.minimum(least, limiter.loop.scale)
print("least scale:", ", ".join(f"{joint} {value:.2f}" for joint, value in zip(mpc.joints, least, strict=True)))
print(*limiter.loop.given_up, sep="\n")
