"""Hidden effects that make heat."""

from __future__ import annotations

from .registry import JOINT, NODE, Catalogue, entry, scaled
from .robot import Robot

HEAT: Catalogue = {}


@entry(HEAT, JOINT)
def resistance_rise(robot: Robot, node: int, size: float) -> None:
    """Copper: the winding's resistance × (1 + 0.00393 (T - 25)) ([QuadrupedLPTN, eq. 6])."""
    robot.resistance_rise[node] += 0.00393 * size


@entry(HEAT, JOINT)
def torque_constant_drop(robot: Robot, node: int, size: float) -> None:
    """Magnets: the torque constant × (1 - 0.0012 (T - 25))."""
    robot.torque_constant_drop[node] += 0.0012 * size


@entry(HEAT, JOINT, signed=True, single=True)
def loss_scale(robot: Robot, node: int, size: float) -> None:
    """Wrong torque constant: the copper loss is 1.2 times what torque, data sheet and resistance say.

    Raises:
        ValueError: less than a tenth of the loss would be left.
    """
    robot.torque_constant[node] /= scaled("loss_scale", size, 0.2) ** 0.5


@entry(HEAT, JOINT)
def coulomb_friction(robot: Robot, node: int, size: float) -> None:
    """Heat 0.5 |ω|: 0.5 N·m at the joint ([QuadrupedLPTN, eq. 8], as power)."""
    robot.coulomb[node] += 0.5 * size


@entry(HEAT, JOINT)
def viscous_friction(robot: Robot, node: int, size: float) -> None:
    """Heat 0.07 ω²: 0.07 N·m·s at the joint ([QuadrupedLPTN, eq. 8], as power)."""
    robot.viscous[node] += 0.07 * size


@entry(HEAT, JOINT)
def iron_loss(robot: Robot, node: int, size: float) -> None:
    """Heat 0.2 |ω|^1.5."""
    robot.iron[node] += 0.2 * size


@entry(HEAT, JOINT)
def gear_loss(robot: Robot, node: int, size: float) -> None:
    """Heat 0.1 |τ ω|: a tenth of the mechanical power."""
    robot.gear[node] += 0.1 * size


@entry(HEAT, JOINT)
def driver_loss(robot: Robot, node: int, size: float) -> None:
    """Heat 0.5 |τ|, in W and N·m: transistors with a constant voltage, current going with torque."""
    robot.driver[node] += 0.5 * size


@entry(HEAT, NODE, single=True)
def constant_heat(robot: Robot, node: int, size: float) -> None:
    """Heat of 1.5 W, always on."""
    robot.constant[node] += 1.5 * size


@entry(HEAT, JOINT)
def computer_heat(robot: Robot, node: int, size: float) -> None:
    """Heat of 0.1 times the computer's logged power, beside what its own node gets."""
    robot.computer[node] += 0.1 * size


@entry(HEAT, NODE)
def battery_heat(robot: Robot, node: int, size: float) -> None:
    """Heat of 0.01 times the power that the battery gives."""
    robot.battery[node] += 0.01 * size


@entry(HEAT, NODE)
def solar(robot: Robot, node: int, size: float) -> None:
    """The sun on 0.005 m², clouds coming and going."""
    robot.sunlit[node] += 0.005 * size
