"""A mission planned once beside the same one planned anew while the robot does it.

Run it with ``python -m tests.benchmarks.mission_replanning --robots 6``. Each robot is one of `lptn.virtual`; every
parameter of its model is off by 10 to 20 %, up or down; its torques are up to 6 % off the gait's tables, joint by
joint; the air changes by up to 8 K, up or down, in ten minutes of the first half. Readings have noise of 0.1 K, and are
rounded to 1 K with ``--resolution 1``. The mission is `examples/plan/mission_deliveries.toml` with 500 m and 8 kg in
place of 350 m and 6 kg, without its deadline.

For each robot a line, and the means: how long it took, and by how much a joint passed its limit at worst, of

- *fixed*: the plan of the wrong model, whatever happens,
- *replanned*: `MissionControl`,
- *known*: the plan of one who knows robot, torques and the mean of the air: the least time there is, roughly.

At the end the fixed plans with limits lower by as much as the worst of these robots passed them, known only afterwards.
"""

from __future__ import annotations

import argparse
import time
import tomllib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from lptn.applications.replanning import MissionControl, Order
from lptn.basics.arrays import FloatArray
from lptn.model.model import Model
from lptn.planners.mission import Mission, plan_kind, plan_mission
from lptn.virtual import Balance, Forcing, Robot
from tests.planners.truth import model_of, true_robot

MISSION = Path(__file__).parents[2] / "examples" / "plan" / "mission_deliveries.toml"
SAMPLE, NOISE, SCATTER, CHANGE = 5.0, 0.1, 0.06, 8.0  # s, K, relative, K
_LONGEST = 3 * 3600.0  # s


@dataclass
class Walker:
    """A virtual quadruped that does what it is ordered; states are those of `lptn.virtual`.

    Args:
        robot: the truth.
        mission: whose gaits say what the joints do, before the robot's own factors.
        seed: of the factors, the air and the readings.
        resolution: of the readings [K].
    """

    robot: Robot
    mission: Mission
    seed: int
    resolution: float = 0.0

    def __post_init__(self) -> None:
        random = np.random.default_rng(1000 + self.seed)
        self.factors = 1 + random.uniform(-SCATTER, SCATTER, self.robot.joints)
        self.change, self.begins = random.uniform(-CHANGE, CHANGE), random.uniform(0, 900)
        self.network = Balance(self.robot, self.mission.ambient)
        self.state = self.network.start(self.mission.start[: len(self.robot.nodes)].copy())
        self.clock, self._random = 0.0, random

    def air(self, at: float) -> float:
        """Temperature of the air [degC]."""
        return float(self.mission.ambient + self.change * np.clip((at - self.begins) / 600, 0, 1))

    def inputs(self, order: Order) -> dict[str, float]:
        """The model's inputs as they truly are while an order is followed."""
        gaits = {activity.do: activity.gait for activity in self.mission.activities} | {"rest": self.mission.rest}
        gait, inputs = gaits[order.do], {}
        assert gait is not None
        for column, value in zip(self.mission.model.inputs, gait.at(order.speed, order.load), strict=True):
            quantity, _, place = column.partition(".")
            factor = self.factors[self.robot.nodes.index(place)] if quantity == "torque" else 1.0
            inputs[column] = factor * float(value)
        return inputs | {"temperature.ambient": self.air(self.clock), "speed.base": order.speed}

    def follow(self, order: Order, seconds: int) -> FloatArray:
        """Do it; the joints' temperatures in each second [degC], shape (seconds, joints)."""
        robot, given, joints = self.robot, self.inputs(order), slice(0, self.robot.joints)
        of = {
            quantity: np.array([given.get(f"{quantity}.{node}", 0.0) for node in robot.nodes])
            for quantity in ("torque", "velocity", "velocity_rms", "powered", "power")
        }
        copper = np.zeros(len(robot.nodes))
        copper[joints] = robot.resistance[joints] * (of["torque"][joints] / robot.torque_constant[joints]) ** 2
        other = robot.coulomb * of["velocity"] + robot.viscous * of["velocity_rms"] ** 2
        other = other + robot.drive * of["powered"] + of["power"]
        to_air = robot.to_air * (1 + robot.forced_convection * order.speed)
        shift = np.array([self.air(self.clock + k + 0.5) - self.mission.ambient for k in range(seconds)])
        each_second = (seconds, 1)
        acting = Forcing(np.tile(copper, each_second), np.tile(other, each_second), np.tile(to_air, each_second), shift)
        path = self.network.solve(acting, self.state)
        self.state, self.clock = path[-1], self.clock + seconds
        return np.asarray(path[1:, joints])

    def read(self) -> dict[str, float | None]:
        """Readings [degC]."""
        exact = self.state[: len(self.robot.nodes)] + NOISE * self._random.standard_normal(len(self.robot.nodes))
        if self.resolution:
            exact = self.resolution * np.round(exact / self.resolution)
        return dict(zip(self.robot.nodes, exact.tolist(), strict=True))


def fixed(walker: Walker, mission: Mission) -> tuple[float, float]:
    """The plan made at the start: time of the whole [s], worst above the limit [K]."""
    plan, worst = plan_mission(mission, explain=False), -np.inf
    for segment, seconds, speed, load, _ in plan.pieces:
        order = Order(segment.name, segment.gait.name, speed, load)
        whole = max(1, round(seconds))
        for begin in range(0, whole, int(SAMPLE)):
            worst = max(worst, _over(walker, walker.follow(order, min(int(SAMPLE), whole - begin))))
    return walker.clock if plan.verdict == "met" else np.nan, worst


def replanned(walker: Walker, mission: Mission) -> tuple[float, float, MissionControl, float]:
    """`MissionControl`: time of the whole [s], worst above the limit [K], the control, CPU [s]."""
    control, worst = MissionControl(mission, noise=NOISE, resolution=walker.resolution), -np.inf
    idle = Order("rest", "rest")
    cpu = time.process_time()
    order = control.update(walker.read(), walker.inputs(idle), 0.0)
    spent = time.process_time() - cpu
    while not order.finished and walker.clock < _LONGEST:
        seconds = int(np.clip(round(order.seconds), 1, SAMPLE))
        inputs = walker.inputs(order)
        worst = max(worst, _over(walker, walker.follow(order, seconds)))
        cpu = time.process_time()
        order = control.update(walker.read(), inputs, float(seconds))
        spent += time.process_time() - cpu
    return walker.clock, worst, control, spent


def known(walker: Walker, model: Model, mission: Mission) -> float:
    """Least time of one who knows robot and torques, in air at the mean of its course [s]."""
    gaits = {}
    for activity in mission.activities:
        cells = activity.gait.cells.copy()
        for row, column in enumerate(model.inputs):
            if column.startswith("torque."):
                cells[..., row] *= walker.factors[walker.robot.nodes.index(column.partition(".")[2])]
        gaits[activity.do] = replace(activity.gait, cells=cells)
    activities = tuple(replace(activity, gait=gaits[activity.do]) for activity in mission.activities)
    mean = float(np.mean([walker.air(at) for at in range(2400)]))
    plan = plan_mission(replace(mission, model=model, activities=activities, ambient=mean), explain=False)
    return plan.total if plan.verdict == "met" else np.nan


def _over(walker: Walker, path: FloatArray) -> float:
    limits = np.array([walker.mission.limits[node] for node in walker.robot.nodes[: walker.robot.joints]])
    return float((path - limits).max())


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", type=int, default=6)
    parser.add_argument("--seed", type=int, default=71)
    parser.add_argument("--resolution", type=float, default=0.0)
    parser.add_argument("--plans", action="store_true", help="print each plan that took the place of another")
    arguments = parser.parse_args()
    table = tomllib.loads(MISSION.read_text(encoding="utf-8"))
    del table["task"]["deadline"]
    table["task"]["carry"] = 8.0
    table["activities"] = [a | {"distance": 500} if "distance" in a else a for a in table["activities"]]
    rows = []
    print(f"{'robot':>5} {'error':>6} {'air K':>6} {'fixed min':>10} {'K':>6} {'replanned':>10} {'K':>6} {'known':>6} "
          f"{'plans':>5} {'CPU s':>6}")  # fmt: skip
    for number in range(arguments.robots):
        seed, error = arguments.seed + number, 0.10 + 0.10 * number / max(1, arguments.robots - 1)
        robot = true_robot(seed)
        mission = plan_kind.read(table, str(MISSION), model_of(robot, error, seed))
        walkers = [Walker(robot, mission, seed, arguments.resolution) for _ in range(3)]
        least = known(walkers[2], model_of(robot, 0.0, seed), mission)
        one = fixed(walkers[0], mission)
        two = replanned(walkers[1], mission)
        rows.append((robot, mission, one, two, least, seed))
        print(
            f"{seed:5d} {error:6.0%} {walkers[0].change:+6.1f} {one[0] / 60:10.1f} {one[1]:6.2f} {two[0] / 60:10.1f} "
            f"{two[1]:6.2f} {least / 60:6.1f} {len(two[2].replanned):5d} {two[3]:6.1f}",
            flush=True,
        )
        if arguments.plans:
            print(two[2].text(), flush=True)
    margin = max(0.0, *(one[1] for _, _, one, _, _, _ in rows))
    careful = []
    for robot, mission, *_, seed in rows:
        lower = replace(mission, limits={node: limit - margin for node, limit in mission.limits.items()})
        careful.append(fixed(Walker(robot, mission, seed, arguments.resolution), lower))
    said = ", ".join(f"{seconds / 60:.1f} min ({over:+.2f} K)" for seconds, over in careful)
    print(f"fixed with limits {margin:.2f} K lower: {said}")
    columns = {
        "fixed": [row[2][0] for row in rows],
        "fixed with that margin": [seconds for seconds, _ in careful],
        "replanned": [row[3][0] for row in rows],
        "known": [row[4] for row in rows],
    }
    print("mean: " + ", ".join(f"{name} {np.nanmean(times) / 60:.1f} min" for name, times in columns.items()))


if __name__ == "__main__":
    main()
