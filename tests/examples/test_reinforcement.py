"""The example of reinforcement learning: virtual robots in the place of the environment's own."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path

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
