# %% [markdown]
# # The learnt policy on robots that are not its model
#
# A policy that was learnt on a network, and judged on the same network with other parameters, may have learnt the
# network. Here the robots are virtual ones whose equations are others (`lptn.virtual`). The ready model with windings
# is fitted to three hours of simulated logs of one of them, six runs in means over 30 s; the policy is learnt on that
# model, its parameters scattered by 10 %, and acts on three other robots. Policies and deratings see their
# temperatures, and nothing is learnt on them.
#
# `python examples/reinforcement/on_virtual_robots.py`

# %%
from __future__ import annotations

import argparse
from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from train import CHOOSE, JOINTS, JUDGE, LIMIT, TASK, Outcome, Policy, derating, learn, learnt, played, views, worth

from lptn.applications.gym import TorqueVectorEnv
from lptn.basics.files import write_whole
from lptn.identify import fit
from lptn.identify.data import load_model
from lptn.model.model import Model
from lptn.robots.presets import preset_text
from lptn.virtual import quadruped, quadruped_logs, write_logs
from lptn.virtual.heat import Balance, Exponential
from lptn.virtual.robot import CASE

FITTED, SCATTER, AVERAGE = 701, 0.1, 30.0  # seed of the robot whose logs are fitted; of its parameters; s
RUNS = ("cooling", "trot_medium", "trot_high", "abd_RF_LR_6Nm", "hip_LF_RR_6Nm", "knee_RF_LR_6Nm")
BANDS = (2.0, 3.0, 5.0, 8.0, 12.0)  # K

# %% [markdown]
# ## The model, and virtual robots in the place of the environment's own


# %%
def fitted(seed: int = FITTED) -> Model:
    """The ready model with windings, fitted to six runs of one virtual robot."""
    with TemporaryDirectory() as folder:
        logs, file = Path(folder, "logs"), Path(folder, "model.toml")
        write_logs(logs, quadruped_logs(seed=seed, runs="protocol", level="none"))
        write_whole(file, preset_text("quadruped", "windings"))
        loaded = load_model(file)
        runs = loaded.runs([path for path in sorted(logs.iterdir()) if path.stem in RUNS])
    averages = [run.coarsen(round(AVERAGE / run.step)) for run in runs]
    return fit(loaded.model, averages, symmetry_penalty=1.0, guess=loaded.model.values, iterations=5).model


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
        self._solver = Exponential(self.network)
        self._seconds = round(period)
        self.values = np.repeat(model.values[:, None], number, axis=1)  # which the environment takes its inputs by
        nodes = self.robot.nodes
        self._seen = [
            nodes.index(state.removesuffix(CASE)) if state.endswith(CASE) else self.network.copper[nodes.index(state)]
            for state in model.states
        ]
        self._truth = np.full((number, len(self.network.capacity)), 25.0)

    @property
    def states(self) -> np.ndarray:
        """Windings, housings, computer and trunk [degC], shape (states, number)."""
        return self._truth[:, self._seen].T

    def draw(self, robot: int, temperature: float, rng: np.random.Generator) -> None:
        """Begin anew with one copy, all of it as warm."""
        self._truth[robot] = temperature

    def advance(self, inputs: np.ndarray) -> None:
        """One period with the inputs held, shape (inputs, number)."""
        for k, column in enumerate(inputs.T.tolist()):
            held = self.network.held(dict(zip(self.model.inputs, column, strict=True)), self._seconds)
            self._truth[k] = self._solver.solve(held, self._truth[k])[-1]


# %% [markdown]
# ## Learnt three times, judged on the robots


# %%
class Trial:
    """A model, its environments, and the virtual robots that judge.

    Args:
        model: on which policies learn.
        seeds: of the virtual robots.
    """

    def __init__(self, model: Model, seeds: Sequence[int]) -> None:
        self.model, self.seeds = model, seeds
        self.view = views(self.robots(1).names)

    def robots(self, number: int) -> TorqueVectorEnv:
        """So many robots under the model, scattered."""
        limits = dict.fromkeys(JOINTS, LIMIT)
        return TorqueVectorEnv(number, model=self.model, limits=limits, task=TASK, spread=SCATTER)

    def on_truth(self, policy: Policy, episodes: int) -> Outcome:
        """So many episodes on each virtual robot."""
        outcomes = []
        for seed in self.seeds:
            env = self.robots(episodes)
            env.robots = VirtualRobots(self.model, seed, episodes, env.period)  # type: ignore[assignment]
            outcomes.append(played(env, policy, JUDGE + 1000 * seed))
        return Outcome(*(np.concatenate(parts) for parts in zip(*outcomes, strict=True)))


def said(name: str, outcome: Outcome) -> str:
    """A line."""
    work, above = outcome
    return f"{name:26s} work {work.mean():.1%}; above the limit {above.mean():.2f} K, at most {above.max():.2f} K"


def main(arguments: Sequence[str] | None = None) -> dict[str, Outcome]:
    """Fit, learn, judge, print."""
    parser = argparse.ArgumentParser(description="Policies learnt on a fitted model, on robots of other physics.")
    parser.add_argument("--robots", type=int, nargs="+", default=[721, 722, 723], help="seeds of virtual robots")
    parser.add_argument("--learn", type=int, nargs="+", default=[1, 2, 3], help="seeds of learning")
    parser.add_argument("--rounds", type=int, default=9, help="of learning")
    parser.add_argument("--episodes", type=int, default=8, help="on each robot")
    given = parser.parse_args(arguments)
    trial = Trial(fitted(), given.robots)
    env, outcomes = trial.robots(64), {}
    chosen = max(BANDS, key=lambda band: worth(played(env, derating(trial.view, band), CHOOSE)).mean())
    for band in BANDS:
        name = f"derating over {band:g} K" + (", the model's best" if band == chosen else "")
        outcomes[name] = trial.on_truth(derating(trial.view, band), given.episodes)
        print(said(name, outcomes[name]), flush=True)
    for seed in given.learn:
        weights, steps = learn(given.rounds, 30, 12, 48, seed=seed, robots=trial.robots)
        for step in steps[:: max(1, given.rounds // 3)]:
            print(said(f"seed {seed}, {step.episodes} episodes", trial.on_truth(learnt(trial.view, step.weights), 3)))
        outcomes[f"learnt, seed {seed}"] = trial.on_truth(learnt(trial.view, weights), given.episodes)
        print(said(f"learnt, seed {seed}", outcomes[f"learnt, seed {seed}"]), flush=True)
    return outcomes


if __name__ == "__main__":
    main()
