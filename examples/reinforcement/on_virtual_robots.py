# %% [markdown]
# # The learnt policy on robots that are not its model
#
# A policy that was learnt on a network, and judged on the same network with other parameters, may have learnt the
# network. Here it acts on virtual robots whose equations are others: windings apart from housings, a trunk, radiation,
# wind to the power 0.8 (`lptn.virtual`). Nothing is fitted to them, and nothing is learnt on them; the policy and the
# deratings see their temperatures.
#
# `python examples/reinforcement/on_virtual_robots.py --seeds 601 602 603`

# %%
from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence

import numpy as np
from train import JUDGE, Outcome, derating, learn, learnt, played, robots, views

from lptn.model.model import Model
from lptn.virtual import quadruped
from lptn.virtual.heat import Balance, Forcing, Means, forcing
from lptn.virtual.robot import PC

BANDS = (5.0, 8.0, 12.0)  # K; the model's best is 8 K


# %% [markdown]
# ## Virtual robots in the environment's place of its own


# %%
class VirtualRobots:
    """As `lptn.applications.gym.torque.Robots`: `states` of the model that is seen, the virtual robot's own physics.

    Args:
        model: whose nodes are observed.
        seed: of the virtual robot.
        number: of copies, each in an episode of its own.
        period: seconds of one `advance`.
    """

    def __init__(self, model: Model, seed: int, number: int, period: float) -> None:
        self.model, self.robot = model, quadruped(seed=seed)
        self.network = Balance(self.robot, 25.0)
        self._seconds = round(period)
        names = list(self.robot.nodes[: self.robot.sensed])
        self._seen = self.network.sensed[[names.index(node) for node in model.nodes]]
        self._rows = {name: row for row, name in enumerate(model.inputs)}
        self._truth = np.full((number, len(self.network.capacity)), 25.0)

    @property
    def states(self) -> np.ndarray:
        """What the robot's sensors sit on [degC], shape (nodes, number)."""
        return self._truth[:, self._seen].T

    def draw(self, robot: int, temperature: float, rng: np.random.Generator) -> None:
        """Begin anew with one copy, all of it as warm."""
        self._truth[robot] = temperature

    def advance(self, inputs: np.ndarray) -> None:
        """One period with the inputs held, shape (inputs, number)."""
        for k, column in enumerate(inputs.T):
            self._truth[k] = self.network.solve(self._forcing(column), self._truth[k])[-1]

    def _forcing(self, inputs: np.ndarray) -> Forcing:
        joints = self.robot.nodes[: self.robot.joints]

        def of(quantity: str) -> np.ndarray:
            return np.array([[inputs[self._rows[f"{quantity}.{joint}"]] for joint in joints]])

        torque, speed, rms = of("torque"), of("velocity"), of("velocity_rms")
        wind = np.array([[abs(inputs[self._rows["speed.base"]]) ** self.robot.wind_exponent]])
        means = Means(torque, torque**2, speed, rms**2, rms**1.5, torque * speed, wind, of("powered"))
        extra = np.zeros((1, len(self.robot.nodes)))
        extra[0, self.robot.nodes.index(PC)] = inputs[self._rows[f"power.{PC}"]]
        shift = np.array([inputs[self._rows["temperature.ambient"]] - self.network.ambient])
        second = forcing(self.robot, means, extra)
        acting = (second.copper, second.other, second.to_air, shift)
        return Forcing(*(np.repeat(term, self._seconds, axis=0) for term in acting))


# %%
def judged(seed: int, weights: np.ndarray, episodes: int) -> Mapping[str, Outcome]:
    """Deratings and the policy on one virtual robot, in the same episodes."""
    env = robots(episodes)
    env.robots = VirtualRobots(env.robots.model, seed, episodes, env.period)  # type: ignore[assignment]
    view = views(env.names)
    policies = {f"derating over {band:g} K": derating(view, band) for band in BANDS}
    policies["learnt"] = learnt(view, weights)
    return {name: played(env, policy, JUDGE) for name, policy in policies.items()}


def main(arguments: Sequence[str] | None = None) -> Mapping[int, Mapping[str, Outcome]]:
    """Learn on the model, judge on the robots, print."""
    parser = argparse.ArgumentParser(description="A policy learnt on a model, on robots of other physics.")
    parser.add_argument("--seeds", type=int, nargs="+", default=[601, 602, 603])
    parser.add_argument("--rounds", type=int, default=25, help="of learning")
    parser.add_argument("--episodes", type=int, default=16, help="on each robot")
    given = parser.parse_args(arguments)
    weights, _ = learn(given.rounds)
    outcomes = {}
    for seed in given.seeds:
        outcomes[seed] = judged(seed, weights, given.episodes)
        for name, (work, above) in outcomes[seed].items():
            said = f"work {work.mean():.1%}; above the limit {above.mean():.2f} K, at most {above.max():.2f} K"
            print(f"robot {seed}, {name:20s} {said}", flush=True)
    return outcomes


if __name__ == "__main__":
    main()
