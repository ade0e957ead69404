# %% [markdown]
# # A policy that plans its heat, learnt in minutes
#
# A quadruped is asked for phases of torque that it can't give for ever. Derating, what drives do, gives all until a
# winding is nearly at its limit and then less and less of it. A policy that sees temperatures and what is coming can
# give a little less early instead of much less late. Here one is learnt by the cross-entropy method in NumPy, over
# robots whose parameters scatter by 5 % about the model's.
#
# `python examples/reinforcement/train.py -o learning.png`; `pip install 'lptn[rl]'`

# %%
from __future__ import annotations

import argparse
import io
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from lptn.applications.gym import Task, TorqueVectorEnv
from lptn.basics.files import write_whole
from lptn.basics.style import BEST, GIVEN, dress, new_figure
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.robots.presets import preset_text

LIMIT, LAST = (
    60.0,
    0.1,
)  # degC; the last 1 K, in tens of kelvins, over which the drive itself derates, whatever is asked
JOINTS = [f"{leg}_{part}" for leg in ("FR", "FL", "RR", "RL") for part in ("hip", "thigh", "calf")]
TASK = Task(load=(1.0, 5.0))
CHOOSE, JUDGE = 10**6, 2 * 10**6  # seeds of the episodes that choose the best iterate, and of those that judge it

Robots = Callable[[int], TorqueVectorEnv]
Policy = Callable[[np.ndarray], np.ndarray]

# %% [markdown]
# ## Episodes
#
# All robots are stepped in one call. What counts is the work as a share of what was asked, and the hottest moment.


# %%
class Outcome(NamedTuple):
    """Of each robot: work as a share of what was asked, largest kelvins above the limit."""

    work: np.ndarray
    above: np.ndarray


def robots(number: int) -> TorqueVectorEnv:
    """So many robots of the ready model of a quadruped, parameters scattered by 5 %."""
    network = parse_model(preset_text("quadruped"), Path("quadruped.toml")).network
    return TorqueVectorEnv(number, model=Model(network), limits=dict.fromkeys(JOINTS, LIMIT), task=TASK, spread=0.05)


def played(env: TorqueVectorEnv, policy: Policy, seed: int | list[int]) -> Outcome:
    """One episode on each robot."""
    seen, _ = env.reset(seed=seed)
    asked = [name.startswith("asked.") for name in env.names]
    work, most, above = np.zeros(env.num_envs), np.zeros(env.num_envs), np.zeros(env.num_envs)
    alive = np.ones(env.num_envs, dtype=bool)
    for _ in range(env.steps):
        most += alive * (seen[:, asked] ** 2).mean(axis=1)  # an episode that was cut off loses what it would have given
        seen, reward, cut_off, _, info = env.step(policy(seen))
        work += alive * reward
        above = np.maximum(above, alive * info["cost"])
        alive &= ~cut_off
    return Outcome(work / np.maximum(most, 1e-9), above)


# %% [markdown]
# ## Policies
#
# Derating: all below a band under the limit, none at the limit. The learnt one has the same weights for each joint: its
# own margin, that of its leg's hottest joint, what is asked of it now and over the next one and five minutes.


# %%
class Views(NamedTuple):
    """Where the numbers of an observation stand, each for the joints in order."""

    margin: Sequence[int]
    minute: Sequence[int]
    five: Sequence[int]
    twenty: Sequence[int]


def views(names: list[str]) -> Views:
    """Joints are named alike in all parts of an observation."""
    joints = [name.removeprefix("asked.") for name in names if name.startswith("asked.")]
    kinds = ("margin", "asked_60s", "asked_300s", "asked_1200s")
    return Views(*([names.index(f"{kind}.{joint}") for joint in joints] for kind in kinds))


def derating(view: Views, band: float) -> Policy:
    """From all to nothing over the last `band` kelvins."""
    return lambda seen: (seen[:, view.margin] * 10.0 / band).clip(0.0, 1.0)


def learnt(view: Views, weights: np.ndarray) -> Policy:
    """Share 1/(1 + price of heat), the best there is if heat has a price; its logarithm is linear in what is seen.

    Within the drive's own last kelvin, which no policy gets past.
    """

    def policy(seen: np.ndarray) -> np.ndarray:
        price = np.exp(_products(features(view, seen), weights).clip(-20.0, 20.0))
        return np.minimum(1 / (1 + price), (seen[:, view.margin] / LAST).clip(0.0, 1.0))

    return policy


def _products(seen: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Features times weights: one set for all robots, shape (features,), or one for each, shape (robots, features)."""
    return seen @ weights if weights.ndim == 1 else np.einsum("rjf,rf->rj", seen, weights)


def features(view: Views, seen: np.ndarray) -> np.ndarray:
    """Shape (robots, joints, features), each of some size 1: margins in 10 K, what is asked over 2 × rated."""
    margin = seen[:, view.margin].clip(0.0, 4.0)
    leg = margin.reshape(len(seen), 4, 3)  # the joints of a leg heat each other
    hottest = np.repeat(leg.min(axis=2), 3, axis=1)
    body = np.repeat(margin.mean(axis=1)[:, None], margin.shape[1], axis=1)
    minute, five, twenty = seen[:, view.minute] / 2, seen[:, view.five] / 2, seen[:, view.twenty] / 2
    all_twenty = np.repeat(twenty.mean(axis=1)[:, None], margin.shape[1], axis=1)
    near = np.exp(-2 * margin)
    return np.stack([np.ones_like(margin), margin, near, hottest, body, minute, five, twenty, all_twenty], axis=2)


# %% [markdown]
# ## Learning
#
# The cross-entropy method draws weights from a normal distribution, keeps the best fifth, and moves there. Each iterate
# sees other episodes. A kelvin above the limit costs a tenth of all work.


# %%
class Step(NamedTuple):
    """The distribution's mean after so many episodes and seconds of CPU, on the episodes that choose."""

    episodes: int
    seconds: float
    outcome: Outcome
    weights: np.ndarray

    def __str__(self) -> str:
        work, above = self.outcome.work.mean(), self.outcome.above.mean()
        return f"{self.episodes:6d} episodes, {self.seconds:4.0f} s: work {work:.1%}, {above:.2f} K above the limit"


def worth(outcome: Outcome) -> np.ndarray:
    """What is learnt on."""
    return outcome.work - 0.1 * outcome.above


def learn(
    rounds: int, drawn: int = 40, episodes: int = 12, chosen: int = 64, *, seed: int = 1, robots: Robots = robots
) -> tuple[np.ndarray, list[Step]]:
    """Weights that did best on the episodes that choose, and the course of learning."""
    rng, began = np.random.default_rng(seed), time.process_time()
    env, judge = robots(drawn * episodes), robots(chosen)
    view, steps = views(env.names), []
    size = features(view, np.zeros((1, len(env.names)))).shape[2]
    mean, spread = np.zeros(size), np.full(size, 0.7)
    best = (-np.inf, mean)
    for number in range(rounds + 1):
        outcome = played(judge, learnt(view, mean), CHOOSE)
        best = max(best, (float(worth(outcome).mean()), mean), key=lambda candidate: candidate[0])
        steps.append(Step(number * drawn * episodes, time.process_time() - began, outcome, mean))
        print(steps[-1], flush=True)
        if number == rounds:
            break
        # A robot for each draw and episode, all in one batch; every draw meets the same episodes.
        weights = mean + spread * rng.standard_normal((drawn, size))
        first = (1000 * number + 10**5 * (seed - 1)) % CHOOSE  # below those that choose and judge, whatever the seed
        seeds = [*range(first, first + episodes)] * drawn
        values = worth(played(env, learnt(view, np.repeat(weights, episodes, axis=0)), seeds))
        elite = weights[np.argsort(-values.reshape(drawn, episodes).mean(axis=1))[: drawn // 5]]
        mean, spread = elite.mean(axis=0), elite.std(axis=0) + 0.2 * 0.85**number
    return best[1], steps


# %% [markdown]
# ## Against derating
#
# The band of derating is chosen on the same episodes as the policy's iterate; both are judged on others.


# %%
def compare(weights: np.ndarray, number: int = 256) -> dict[str, Outcome]:
    """Outcomes on episodes that chose nothing."""
    env, chooser = robots(number), robots(64)
    view = views(env.names)
    bands = (0.5, 1.0, 2.0, 3.0, 5.0, 8.0, 12.0, 20.0)
    values = [float(worth(played(chooser, derating(view, band), CHOOSE)).mean()) for band in bands]
    tuned = bands[int(np.argmax(values))]
    policies = {
        "everything asked": lambda seen: np.ones((len(seen), len(view.margin))),
        "derating over 10 K": derating(view, 10.0),
        f"derating, best band ({tuned:g} K)": derating(view, tuned),
        "learnt": learnt(view, weights),
    }
    return {name: played(env, policy, JUDGE) for name, policy in policies.items()}


def picture(steps: Sequence[Step], against: dict[str, Outcome], output: Path) -> None:
    """The learning curve beside derating: work, and kelvins above the limit."""
    figure = new_figure(5.0)
    upper, lower = figure.subplots(2, 1, sharex=True)
    episodes = [step.episodes for step in steps]
    upper.plot(episodes, [100 * step.outcome.work.mean() for step in steps], **BEST, marker="o", ms=3, label="learnt")
    lower.plot(episodes, [step.outcome.above.mean() for step in steps], **BEST, marker="o", ms=3)
    for (name, outcome), style in zip(list(against.items())[1:3], (":", "--"), strict=True):
        upper.axhline(100 * outcome.work.mean(), color=GIVEN["color"], ls=style, label=name)
        lower.axhline(outcome.above.mean(), color=GIVEN["color"], ls=style)
    upper.set(ylabel="work, % of what was asked", title="A policy learnt over episodes of 30 min")
    lower.set(xlabel="episodes", ylabel="hottest moment above\nthe limit, mean [K]", ylim=(0, None))
    upper.legend(frameon=False, loc="lower right")
    for ax in (upper, lower):
        dress(ax)
    picture = io.BytesIO()
    figure.savefig(picture, format=output.suffix.removeprefix("."))
    write_whole(output, picture.getvalue())


def main(arguments: Sequence[str] | None = None) -> dict[str, Outcome]:
    """Learn, compare, print, draw."""
    parser = argparse.ArgumentParser(description="A policy for torque under temperature limits, learnt in minutes.")
    parser.add_argument("--rounds", type=int, default=25, help="of the cross-entropy method")
    parser.add_argument("-o", "--output", type=Path, help="picture of the learning curve")
    given = parser.parse_args(arguments)
    weights, steps = learn(given.rounds)
    against = compare(weights)
    for name, (work, above) in against.items():
        print(f"{name:30s} work {work.mean():.1%}; above the limit {above.mean():.2f} K, at most {above.max():.2f} K")
    better = against["learnt"].work - list(against.values())[2].work
    share = (better > 0).mean()
    print(f"learnt less the best derating: {better.mean():+.1%} of what was asked, better in {share:.0%} of episodes")
    if given.output is not None:
        picture(steps, against, given.output)
    return against


if __name__ == "__main__":
    main()
