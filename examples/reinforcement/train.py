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
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import matplotlib.pyplot as plt
import numpy as np

from lptn.basics.files import write_whole
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.planners.gym import Task, TorqueVectorEnv
from lptn.robots.presets import preset_text

LIMIT, LAST = 60.0, 0.1  # degC; the drive's own derating over the last 1 K (in tens of kelvins) keeps it for any policy
TASK = Task(load=(1.0, 5.0))
SEEDS = {"learn": 1, "choose": 10**6, "judge": 2 * 10**6}  # episodes to learn on, to choose the best iterate, and to judge it

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
    """So many robots, parameters scattered by 5 %."""
    model = Model(parse_model(preset_text("quadruped"), Path("quadruped.toml")).network)
    return TorqueVectorEnv(number, model=model, limits={"*_*": LIMIT}, task=TASK, spread=0.05)


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
    """Shape (robots, joints, features), each of some size 1: margins in tens of kelvins, what is asked over the rated."""
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
# The cross-entropy method draws weights from a normal distribution, keeps the best tenth, and moves there. Each iterate
# sees other episodes. A kelvin above the limit costs a tenth of all work.


# %%
class Step(NamedTuple):
    """The distribution's mean after so many episodes, on the episodes that choose."""

    episodes: int
    seconds: float
    work: float
    above: float


def worth(outcome: Outcome) -> np.ndarray:
    """What is learnt on."""
    return outcome.work - 0.1 * outcome.above


def learn(rounds: int, drawn: int = 40, episodes: int = 12, chosen: int = 64) -> tuple[np.ndarray, list[Step]]:
    """Weights that did best on the episodes that choose, and the course of learning."""
    rng = np.random.default_rng(SEEDS["learn"])
    env, judge = robots(drawn * episodes), robots(chosen)
    view, size = views(env.names), 9
    mean, spread = np.zeros(size), np.full(size, 0.7)
    best, steps, began = (-np.inf, mean), [], time.process_time()
    for number in range(rounds + 1):
        outcome = played(judge, learnt(view, mean), SEEDS["choose"])
        value = float(worth(outcome).mean())
        best = max(best, (value, mean), key=lambda each: each[0])
        steps.append(Step(number * drawn * episodes, time.process_time() - began, outcome.work.mean(), outcome.above.max()))
        print(f"round {number}: work {steps[-1].work:.3f}, at most {steps[-1].above:.2f} K above, {steps[-1].seconds:.0f} s")
        if number == rounds:
            break
        weights = mean + spread * rng.standard_normal((drawn, size))
        # Each robot has the weights of its draw: one batch of episodes for all draws.
        seeds = [*range(1000 * number, 1000 * number + episodes)] * drawn  # the same episodes for all
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
    values = [float(worth(played(chooser, derating(view, band), SEEDS["choose"])).mean()) for band in bands]
    tuned = bands[int(np.argmax(values))]
    policies = {
        "everything asked": lambda seen: np.ones((len(seen), len(view.margin))),
        "derating over 10 K": derating(view, 10.0),
        f"derating, best band ({tuned:g} K)": derating(view, tuned),
        "learnt": learnt(view, weights),
    }
    return {name: played(env, policy, SEEDS["judge"]) for name, policy in policies.items()}


def picture(steps: Sequence[Step], against: dict[str, Outcome], output: Path) -> None:
    """The learning curve, with the others as lines."""
    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    axes.plot([each.episodes for each in steps], [100 * each.work for each in steps], marker="o", label="learnt (mean of the search)")
    for (name, outcome), style in zip(against.items(), ("", "--", "-.", ":"), strict=True):
        if style:
            axes.axhline(100 * outcome.work.mean(), linestyle=style, color="0.3", label=f"{name}: {outcome.work.mean():.1%}")
    axes.set(xlabel="episodes of 30 min", ylabel="work, % of what was asked")
    axes.legend(loc="lower right")
    figure.savefig(output, dpi=120)


def main(arguments: Sequence[str] | None = None) -> dict[str, Any]:
    """Learn, compare, print, draw."""
    parser = argparse.ArgumentParser(description="A policy for torque under temperature limits, learnt in minutes.")
    parser.add_argument("--rounds", type=int, default=30, help="of the cross-entropy method")
    parser.add_argument("-o", "--output", type=Path, help="picture of the learning curve")
    given = parser.parse_args(arguments)
    weights, steps = learn(given.rounds)
    against = compare(weights)
    for name, outcome in against.items():
        print(f"{name:32s} work {outcome.work.mean():.1%}, hottest {outcome.above.max():.2f} K above the limit")
    better = against["learnt"].work - list(against.values())[2].work
    print(f"learnt less best derating: {better.mean():+.2%} of what was asked, better in {(better > 0).mean():.0%} of episodes")
    if given.output is not None:
        picture(steps, against, given.output)
    return {"weights": weights, "steps": steps, "against": against}


if __name__ == "__main__":
    main()
