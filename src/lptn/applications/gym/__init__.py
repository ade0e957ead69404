"""Gymnasium environments on a thermal network, for reinforcement learning; they want the extra `rl`.

Importing this package registers `lptn/Torque-v0`.
"""

from lptn.basics.errors import InputError

try:
    import gymnasium
except ModuleNotFoundError as error:
    raise InputError("lptn.applications.gym", "gymnasium", "not installed", "pip install 'lptn[rl]'") from error

from .task import Task
from .torque import TorqueEnv, TorqueVectorEnv
from .wrapper import ThermalWrapper, mujoco_columns

__all__ = ["ID", "Task", "ThermalWrapper", "TorqueEnv", "TorqueVectorEnv", "mujoco_columns"]

ID = "lptn/Torque-v0"
if ID not in gymnasium.registry:
    gymnasium.register(
        ID, entry_point="lptn.applications.gym:TorqueEnv", vector_entry_point="lptn.applications.gym:TorqueVectorEnv"
    )
