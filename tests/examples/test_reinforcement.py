"""The example of reinforcement learning: virtual robots in the place of the environment's own."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.robots.presets import preset_text

pytest.importorskip("gymnasium")


@pytest.mark.long
def test_virtual_robots_warm_up_under_the_environments_torques() -> None:
    example = import_module("on_virtual_robots")
    model = Model(parse_model(preset_text("quadruped", "windings"), Path("quadruped.toml")).network)
    env = example.Trial(model, [5]).robots(2)
    env.robots = example.VirtualRobots(model, 5, 2, env.period)
    env.reset(seed=0)
    env.robots.draw(0, 25.0, np.random.default_rng(0))
    env.robots.draw(1, 25.0, np.random.default_rng(0))
    inputs = np.zeros((len(model.inputs), 2))
    inputs[model.inputs.index("temperature.ambient")] = 25.0
    inputs[model.inputs.index("torque.FR_calf"), 1] = 8.0
    env.robots.advance(inputs)
    warmer = dict(zip(model.states, env.robots.states[:, 1] - env.robots.states[:, 0], strict=True))
    # 0.211 W/(N·m)² into a winding of some 80 J/K, of which a little has gone into the housing after 5 s.
    assert warmer["FR_calf"] == pytest.approx(0.211 * 8.0**2 * 5.0 / 80.0, rel=0.2)
    assert 0.0 < warmer["FR_calf_case"] < 0.1 * warmer["FR_calf"]
    _, reward, *_ = env.step(np.ones((2, 12)))
    assert np.isfinite(reward).all()


@pytest.mark.parametrize("seed", [1, 11, 21])
def test_no_policy_learns_on_the_episodes_that_choose_or_judge_it(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    example = import_module("train")
    kinds = ("margin", "asked", "asked_60s", "asked_300s", "asked_1200s")
    learnt_on: list[int] = []

    def played(env: SimpleNamespace, _policy: object, seeds: int | list[int]) -> object:
        learnt_on.extend(seeds if isinstance(seeds, list) else [])
        return example.Outcome(np.zeros(env.num_envs), np.zeros(env.num_envs))

    monkeypatch.setattr(example, "played", played)
    names = [f"{kind}.{joint}" for kind in kinds for joint in example.JOINTS]
    example.learn(2, 5, 3, seed=seed, robots=lambda number: SimpleNamespace(num_envs=number, names=names))
    assert len(set(learnt_on)) == 2 * 3
    assert max(learnt_on) < min(example.CHOOSE, example.JUDGE)
