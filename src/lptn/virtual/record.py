"""Let the quadruped live through its runs: true temperatures, second by second."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from .events import event_heat
from .exponential import Exponential
from .forcing import Common, Drive, Means, act
from .layouts import PC
from .motion import Motion, draw_motion
from .quadruped_truth import PC_IDLE, Level, draw_errors
from .robot import Array, Robot
from .runs import Run
from .solve import Network
from .streams import stream
from .surroundings import Ambient, ambient, fan, sun

TOO_HOT = 150.0  # degC: beyond it no sum of effects means anything


@dataclass(frozen=True)
class Record:
    """What happened in one run.

    robot: with this run's hidden errors. states: degC at 0, 1, … s, of shape (seconds + 1, states), as ``network``
    orders them.
    """

    name: str
    run: Run
    robot: Robot
    network: Network
    ambient: Ambient
    motion: Motion
    states: Array

    @property
    def sensed(self) -> Array:
        """The true temperatures at the sensors, degC, of shape (seconds + 1, nodes with a sensor)."""
        temperatures: Array = self.states[:, self.network.sensed]
        return temperatures

    def truth(self) -> pd.DataFrame:
        """Return what no log holds, once a second.

        Columns: time, temperature.<node> without noise (the winding's), housing.<joint> where it is a mass of its own,
        temperature.trunk where there is one, temperature.ambient as it really was.
        """
        states, nodes = self.states[:-1], self.robot.nodes
        columns = {"time": np.arange(len(states), dtype=float)}
        columns |= {f"temperature.{node}": states[:, k] for node, k in zip(nodes, self.network.copper, strict=True)}
        columns |= {f"housing.{nodes[k]}": states[:, k] for k in self.network.wound}
        columns["temperature.ambient"] = self.ambient.true[:-1].copy()
        return pd.DataFrame(columns)


def live(robot: Robot, runs: Mapping[str, Run], seed: int, level: Level) -> Iterator[Record]:
    """Let the runs happen, one after the other.

    Raises:
        ValueError: effects so large that the robot passes 150 degC.
    """
    state: Array | None = None
    for name, run in runs.items():
        own, error = draw_errors(robot.in_run(name), level, seed, name)
        air = ambient(own, run.ambient, error, run.swing, run.seconds, seed, name)
        network = Network(own, float(air.true[0]))
        solver = Exponential(network)
        if state is None or not run.carried:
            start = network.ambient if run.start is None else run.start
            state = network.start(np.full(len(own.nodes), start))
        elif run.gap:
            state = solver.solve(_resting(own, np.zeros((run.gap, len(own.nodes)))), state)[-1]
        if run.lead:
            before = Run(run.lead, cutout=run.cutout)
            lead = draw_motion(run.lead, stream(seed, "lead", name))
            state = _happen(solver, lead, np.zeros((before.seconds, len(own.nodes))), state, before)[1][-1]
        motion = draw_motion(run.segments, stream(seed, "movement", name))
        motion = replace(motion, fan=fan(run.seconds, seed, name), sun=sun(run.seconds, seed, name))
        extra = event_heat(own, run.seconds, seed, name)
        motion, states = _happen(solver, motion, extra, state, run, air.shift)
        if not np.all(states < TOO_HOT):
            raise ValueError(f"hidden: the robot passes {TOO_HOT:g} degC in {name}; expected smaller sizes")
        state = states[-1]
        yield Record(name, run, own, network, air, motion, states)


def _resting(robot: Robot, extra: Array, motion: Motion | None = None) -> Drive:
    """Return what acts while all drives are off; the motion says what fan and sun do."""
    still, none = np.zeros((len(extra), robot.joints)), np.zeros((len(extra), 1))
    blows, shines = (none, none) if motion is None else (motion.fan, motion.sun)
    common = Common(none + PC_IDLE, none + PC_IDLE, blows, shines)
    means = Means(still, still, still, still, still, still, none, still, common)
    return act(robot, means, _with_pc(robot, extra, np.full(len(extra), PC_IDLE)))


def _with_pc(robot: Robot, extra: Array, power: Array) -> Array:
    heat = extra.copy()
    heat[:, robot.nodes.index(PC)] += power
    return heat


def _happen(
    solver: Exponential, motion: Motion, extra: Array, start: Array, run: Run, shift: Array | None = None
) -> tuple[Motion, Array]:
    """Return the movement with the cut-outs in it, and the states; ``shift`` is the ambient's, second by second."""
    robot, on = solver.network.robot, np.ones(run.seconds)
    moving = act(robot, motion.means(robot.wind_exponent), _with_pc(robot, extra, motion.pc)).shifted(shift)
    resting = _resting(robot, extra, motion).shifted(shift)
    off_at = np.inf if run.cutout is None else run.cutout
    on_at = -np.inf if run.resume is None else run.resume
    pieces, lasted = [start[None]], 0
    while lasted < run.seconds:
        if on[lasted]:
            piece = solver.solve(moving.since(lasted), pieces[-1][-1], above=off_at)
        else:
            piece = solver.solve(resting.since(lasted), pieces[-1][-1], below=on_at)
        pieces.append(piece[1:])
        lasted += len(piece) - 1
        on[lasted:] = 1 - on[lasted - 1]
    return motion.only(on), np.concatenate(pieces)
