# %% [markdown]
# # A residual policy that keeps the A1 below its limits
#
# The A1 trots at 0.5 m/s with 3 kg on its back. Its knees pass 60 °C after some eight minutes. A policy that sees the
# joints' temperatures adds a residual to the command: slower, taller, feet a little off the shoulders, which moves load
# between the legs and between knees and thighs.
#
# Gait and heat have time scales apart, 0.5 s and minutes, so the simulator isn't in the training loop. It measures what
# the joints are asked for at 100 commands; thousands of thermal networks are trained on that in NumPy; the policy is
# judged in MuJoCo again, on virtual robots whose equations are others than the network's.
#
# `python examples/mujoco_a1/residual.py --judge 721 722 723`; `pip install 'lptn[robots]'`

# %%
from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

import lptn.batch
from a1_cosim import CoSimulation, Record, Setting
from a1_governor import Unmoved
from a1_task import JOINTS, LEGS, Command, FloatArray
from a1_thermal import VirtualThermal, quadruped

LIMIT, AIR, SEEN = 60.0, 25.0, 40.0  # degC; degC; K below the limit from which on margins are seen
PAYLOAD, HOUR = 3.0, 3600.0  # kg; s, of an episode
NOMINAL = Command("trot", 0.5, 0.27)
TALL = replace(NOMINAL, height=0.36)
"""What is always taller and sees nothing, for comparison."""
KNOBS = ("speed", "height", "ahead", "left", "splay")
LEAST = np.array([0.3, 0.27, -0.05, -0.02, -0.03])  # m/s and m
MOST = np.array([0.5, 0.36, 0.01, 0.02, 0.01])  # nearer to its full reach of 0.37 m a leg shakes
PERIOD = 20.0  # s between two decisions in training; in MuJoCo one follows each look at the temperatures
WINDOW = 500  # simulator steps between two looks, 1 s, which stands for 5 s of heat at a `--pace` of 5
PRICE = np.array([0.6, 0.2, 0.0, 0.0, 0.0])  # of a residual from the nominal command to the farthest one, a second
MODEL = quadruped("windings")
HEAT = lptn.batch.functions(MODEL, "numpy", limits=dict.fromkeys(JOINTS, LIMIT))


def command_of(knobs: FloatArray) -> Command:
    """The command of one row of numbers, in the order of `KNOBS`."""
    return replace(NOMINAL, **dict(zip(KNOBS, knobs.tolist(), strict=True)))


# %% [markdown]
# ## What the joints are asked for
#
# The inputs of the network, squares for RMS values, as a quadratic surface of the command. A robot is the same seen in
# a mirror, so each run counts twice.


# %%
class Noted:
    """Takes the inputs of each thermal step in the place of a thermal network."""

    columns = MODEL.inputs
    temperature, scale = np.full(12, AIR), np.ones(12)

    def __init__(self) -> None:
        self.inputs: list[FloatArray] = []

    def advance(self, inputs: FloatArray, dt: float) -> None:
        """Note them."""
        self.inputs.append(inputs)


def squares(knobs: FloatArray) -> FloatArray:
    """Products of up to two knobs, each from -1 to 1, shape (..., 21)."""
    unit = np.concatenate([np.ones_like(knobs[..., :1]), 2 * (knobs - LEAST) / (MOST - LEAST) - 1], axis=-1)
    first, second = np.triu_indices(unit.shape[-1])
    product: FloatArray = unit[..., first] * unit[..., second]
    return product


def mirrored(column: str) -> str:
    """The column of the other side."""
    for one, other in (("R_", "L_"), ("L_", "R_")):
        if one in column:
            return column.replace(one, other)
    return column


def surface(runs: int, seed: int = 0) -> FloatArray:
    """Coefficients of the mean squares of the network's inputs, shape (21, inputs), from so many runs of MuJoCo."""
    rng, knobs, means = np.random.default_rng(seed), [], []
    other = [MODEL.inputs.index(mirrored(column)) for column in MODEL.inputs]
    for number in range(runs):
        command = rng.uniform(LEAST, MOST)
        noted = Noted()
        setting = Setting(8.0, PAYLOAD, AIR, task=command_of(command))
        record = CoSimulation(str(number), setting, noted, Unmoved(setting.task)).run()
        if record.fell is not None:
            print(f"fell at {dict(zip(KNOBS, command.round(3), strict=True))}")
            continue
        mean = np.mean(np.square(noted.inputs[8:]), axis=0)
        knobs += [command, command * np.where(np.array(KNOBS) == "left", -1.0, 1.0)]
        means += [mean, mean[other]]
    shape, measured = squares(np.array(knobs)), np.array(means)
    found: FloatArray = np.linalg.lstsq(shape, measured, rcond=None)[0]
    knees = [MODEL.inputs.index(f"torque.{leg}_calf") for leg in LEGS]
    off = (shape @ found / measured - 1)[:, knees].std()
    print(f"{len(knobs) // 2} runs of the simulator: squares of the knees' torques to {off:.1%}", flush=True)
    return found


# %% [markdown]
# ## The policy
#
# Each knob lies between its ends by the logistic function of what is seen, linear in it. Left and right are told apart
# by one knob only.


# %%
def seen_of(margin: FloatArray) -> FloatArray:
    """Features, shape (..., 6), of the joints' margins [K], shape (..., 12)."""
    legs = margin.reshape(*margin.shape[:-1], 4, 3).min(axis=-1).clip(0.0, SEEN)
    least = legs.min(axis=-1)
    front, hind, right, left = (legs[..., pair].min(axis=-1) for pair in ((0, 1), (2, 3), (0, 2), (1, 3)))
    return np.stack(
        [
            np.ones_like(least), least / 20, np.exp(-least / 5), legs.mean(axis=-1) / 20,
            (front - hind) / 5, (left - right) / 5,
        ],
        axis=-1,
    )  # fmt: skip


USES = np.array([[knob == "left", *[knob != "left"] * 5][::-1] for knob in KNOBS])
"""Which knob looks at what: `left` at left and right, the others at all else."""


def knobs_of(weights: FloatArray, margin: FloatArray) -> FloatArray:
    """Commands, shape (..., 5), of weights, shape (..., weights), and margins."""
    table = np.zeros((*weights.shape[:-1], *USES.shape))
    table[..., USES] = weights
    share = 1 / (1 + np.exp(-np.einsum("...kf,...f->...k", table, seen_of(margin)).clip(-20, 20)))
    knobs: FloatArray = LEAST + (MOST - LEAST) * share
    return knobs


# %% [markdown]
# ## Training
#
# The cross-entropy method. Robots scatter by 20 % in each parameter, their torques by 10 %: the truth is another one.
# A second below the limit is worth 1, less what is given up of speed and height; at the limit the episode is over.


# %%
class Fleet(NamedTuple):
    """Robots: parameters, factors on their squared torques, temperatures at the start [degC]."""

    params: FloatArray
    torque: FloatArray
    start: FloatArray


def fleet(number: int, rng: np.random.Generator) -> Fleet:
    """So many robots, of which a third begins warm."""
    nominal = np.tile(HEAT.VALUES, (number, 1))
    params = HEAT.randomized(rng, nominal, errors=0.2 * np.abs(nominal))
    warm = np.where(rng.random(number) < 1 / 3, rng.uniform(AIR, 50.0, number), AIR)
    return Fleet(params, np.exp(0.2 * rng.standard_normal((number, 12))), warm)


def lasted(
    weights: FloatArray, robots: Fleet, found: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Seconds below the limit and what they are worth, of each robot with weights of its own."""
    state = HEAT.initial(robots.params, robots.start)
    torques = [MODEL.inputs.index(f"torque.{joint}") for joint in JOINTS]
    nominal = np.array([getattr(NOMINAL, knob) for knob in KNOBS])
    alive, seconds, worth = np.ones(len(weights), bool), np.zeros(len(weights)), np.zeros(len(weights))
    for _ in range(round(HOUR / PERIOD)):
        margin = LIMIT - state.temperature[:, : len(JOINTS)] + 0.1 * rng.standard_normal((len(weights), 12))
        knobs = knobs_of(weights, margin)
        inputs = (squares(knobs) @ found).clip(min=0.0)
        inputs[:, torques] *= robots.torque
        state = HEAT.step(state, np.sqrt(inputs), robots.params, PERIOD)
        alive &= state.temperature[:, : len(JOINTS)].max(axis=1) < LIMIT
        seconds += PERIOD * alive
        worth += PERIOD * alive * (1 - (np.abs(knobs - nominal) / (MOST - LEAST)) @ PRICE)
    return seconds, worth


def learn(found: FloatArray, rounds: int, seed: int, drawn: int = 40, episodes: int = 20) -> FloatArray:
    """Weights, shape (weights,). What they are worth is printed, on 40 robots that are in no training."""
    rng, began = np.random.default_rng(seed), time.process_time()
    mean, spread = np.zeros(USES.sum()), np.full(USES.sum(), 1.0)
    others = fleet(40, np.random.default_rng(0))

    def tell(number: int) -> None:
        seconds, worth = lasted(np.tile(mean, (40, 1)), others, found, np.random.default_rng(0))
        print(
            f"seed {seed}, {number * drawn * episodes:6d} episodes, {time.process_time() - began:3.0f} s: lasts "
            f"{seconds.mean() / 60:.1f} min, worth {worth.mean() / 60:.1f} min",
            flush=True,
        )

    for number in range(rounds):
        if number % 5 == 0:
            tell(number)
        weights = mean + spread * rng.standard_normal((drawn, len(mean)))
        robots = Fleet(*(np.tile(part, (drawn,) + (1,) * (part.ndim - 1)) for part in fleet(episodes, rng)))
        _, worth = lasted(np.repeat(weights, episodes, axis=0), robots, found, rng)
        best = np.argsort(-worth.reshape(drawn, episodes).mean(axis=1))[: drawn // 5]
        mean, spread = weights[best].mean(axis=0), weights[best].std(axis=0) + 0.2 * 0.85**number
    tell(rounds)
    return mean


# %% [markdown]
# ## Judged in MuJoCo, on robots of other physics
#
# Heat takes minutes and the gait repeats itself: a second of the simulator stands for five of the walk. On a robot that
# walked every second the nominal command lasts as long to a tenth of a minute.


# %%
@dataclass
class Policy:
    """The learnt weights as a governor of the co-simulation."""

    weights: FloatArray

    def command(self, scale: FloatArray) -> Command:
        """The command at these shares of `SEEN`, shape (12,)."""
        return command_of(knobs_of(self.weights, SEEN * scale))


def judged(label: str, seed: int, governor: Policy | Unmoved, pace: int) -> Record:
    """A walk on one virtual robot, until a winding passes the limit."""
    setting = Setting(HOUR / pace, PAYLOAD, AIR, task=NOMINAL, window=WINDOW, enough=LIMIT)
    thermal = VirtualThermal(seed, MODEL.inputs, AIR, LIMIT, LIMIT - SEEN, pace=pace)
    record = CoSimulation(label, setting, thermal, governor).run()
    end = "falls" if record.fell is not None else f"hottest {record.peak:.1f} degC"
    seconds, way = pace * record.time[-1], pace * record.way
    height = np.mean([place[2] for place in record.position])
    print(
        f"robot {seed}, {label:8s} {seconds / 60:5.1f} min, {way:5.0f} m, {way / seconds:.2f} m/s, "
        f"base at {height:.3f} m; {end}",
        flush=True,
    )
    return record


def main(arguments: Sequence[str] | None = None) -> None:
    """Measure, learn, judge, print."""
    parser = argparse.ArgumentParser(description="A residual policy that keeps MuJoCo's A1 below its limits.")
    parser.add_argument("--runs", type=int, default=100, help="of the simulator, that measure the gait")
    parser.add_argument("--rounds", type=int, default=25, help="of the cross-entropy method")
    parser.add_argument("--seeds", type=int, nargs="*", default=[1], help="of learning")
    parser.add_argument("--judge", type=int, nargs="*", default=[721, 722, 723], help="seeds of virtual robots")
    parser.add_argument("--pace", type=int, default=5, help="the simulator walks a second for so many, 1 for all")
    given = parser.parse_args(arguments)
    found = surface(given.runs)
    governors: dict[str, Policy | Unmoved] = {"nominal": Unmoved(NOMINAL), "tall": Unmoved(TALL)}
    governors |= {f"learnt {seed}": Policy(learn(found, given.rounds, seed)) for seed in given.seeds}
    for robot in given.judge:
        for label, governor in governors.items():
            judged(label, robot, governor, given.pace)


if __name__ == "__main__":
    main()
