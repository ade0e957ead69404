"""Hidden effects on what is read: by the sensors of the nodes, by the ambient's, by their clock."""

from __future__ import annotations

from .registry import AMBIENT, JOINT, LINKED, NODE, WHOLE, Catalogue, entry, limited
from .robot import Robot

READINGS: Catalogue = {}


@entry(READINGS, NODE)
def sensor_lag(robot: Robot, node: int, size: float) -> None:
    """The reading follows the node as a first-order lag of 20 s."""
    robot.lag[node] += 20.0 * size


@entry(READINGS, NODE, signed=True, single=True)
def sensor_offset(robot: Robot, node: int, size: float) -> None:
    """The reading is 2 K too high."""
    robot.offset[node] += 2.0 * size


@entry(READINGS, NODE, signed=True, single=True)
def sensor_drift(robot: Robot, node: int, size: float) -> None:
    """The reading rises by 4 K in an hour, from the true one at each run's beginning."""
    robot.drift[node] += 4.0 / 3600 * size


@entry(READINGS, LINKED)
def sensor_position(robot: Robot, one: int, other: int, size: float) -> None:
    """The reading of "one~other" is 0.8 of the one's temperature and 0.2 of the other's.

    Raises:
        ValueError: a share above 1, or a case where the winding is no mass of its own.
    """
    limited("sensor_position", size, 5.0, robot.nodes[one])
    if other < 0 and not robot.winding[one]:
        raise ValueError(
            f"place of sensor_position: found the case of {robot.nodes[one]}; expected full physics for it"
        )
    robot.positions.append((one, other, 0.2 * size))


@entry(READINGS, JOINT)
def hot_spot(robot: Robot, node: int, size: float) -> None:
    """The sensor sits in the winding, 0.12 K/W of its copper loss above the rest, 3 s behind that loss."""
    robot.hot_spot[node] += 0.12 * size


@entry(READINGS, AMBIENT, signed=True, single=True)
def ambient_offset(robot: Robot, size: float) -> None:
    """The true ambient is 2.5 K above the logged one."""
    robot.ambient_offset += 2.5 * size


@entry(READINGS, AMBIENT)
def ambient_lag(robot: Robot, size: float) -> None:
    """The true ambient follows the logged one as a first-order lag of 1200 s (walls, the body's own air).

    The robot goes out of doors and in again, 8 K apart unless the run says how far.
    """
    if size > 0:
        robot.ambient_lag += 1200.0 * size
        robot.ambient_swing = 8.0


@entry(READINGS, WHOLE, signed=True, single=True)
def clock_offset(robot: Robot, size: float) -> None:
    """The temperatures' clock is wrong: what their rows show was so 30 s before the row's time."""
    robot.clock += 30.0 * size
