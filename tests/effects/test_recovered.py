"""Effects of the catalogue come back, with their size, from runs of a plain Euler simulation in small steps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from lptn.identify.fitting import fit
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network
from tests.builders import AMBIENT, bound_runs, effect, link, make_run, node

N, PARTS, NOISE = 2400, 5, 0.03  # s, Euler steps a second, K
TRUTH = {
    "capacity.a": 150.0,
    "capacity.b": 220.0,
    "resistance.a~ambient": 5.0,
    "resistance.ambient~b": 4.0,
    "resistance.a~b": 3.0,
}


@dataclass
class World:
    """What the truth may have beyond two nodes with copper loss and links."""

    air_factor: float = 1.0  # on the conductances to the air
    air_offset: float = 0.0  # K
    loss: float = 1.0  # factor on the copper loss
    trunk: float = 0.0  # W/K to a mass that both share
    late: float = 0.0  # share of the ambient that follows with 600 s
    hot: float = 0.0  # K/W over the mass at the sensor of a, with 5 s
    mix: float = 0.0  # share of b in the reading of a
    air: float = 0.0  # share of the air in what a bead of 20 s, the sensor of b, comes to read
    drift: float = 0.0  # K/h at the sensor of b
    delay: int = 0  # s by which all readings come late


def _run(name: str, world: World, seed: int, start: float = 24.0) -> Run:
    rng = np.random.default_rng(seed)
    torque = {place: rng.uniform(0.0, 12.0, N // 60).repeat(60) for place in ("a", "b")}
    air = 24.0 + 6.0 * np.sin(2 * np.pi * np.arange(N) / 2000.0)
    ta, tb, trunk, wall, spot, bead = start, start, start, air[0], 0.0, start
    h, readings = 1.0 / PARTS, np.empty((2, N))
    for k in range(N):
        of_b = bead if world.air else tb
        readings[:, k] = (1 - world.mix) * ta + world.mix * tb + world.hot * spot, of_b + world.drift * k / 3600
        for _ in range(PARTS):
            heat = [world.loss * 0.15 * (torque[place][k] / 0.84) ** 2 for place in ("a", "b")]
            felt = air[k] + world.air_offset + world.late * (wall - air[k])
            across = (tb - ta) / 3.0
            da = (heat[0] - world.air_factor * (ta - felt) / 5.0 + across + world.trunk * (trunk - ta)) / 150.0
            db = (heat[1] - world.air_factor * (tb - felt) / 4.0 - across + world.trunk * (trunk - tb)) / 220.0
            dtrunk = ((ta + tb) / 2 - trunk - 0.5 * (trunk - felt)) / 700.0
            bead += h * (tb + world.air * (air[k] - tb) - bead) / 20.0
            wall, spot = wall + h * (air[k] - wall) / 600.0, spot + h * (heat[0] - spot) / 5.0
            ta, tb, trunk = ta + h * da, tb + h * db, trunk + h * dtrunk
    readings = readings[:, np.clip(np.arange(N) - world.delay, 0, N - 1)] + rng.normal(0.0, NOISE, readings.shape)
    columns = {f"torque.{place}": values for place, values in torque.items()}
    columns |= {"temperature.ambient": air, "temperature.a": readings[0], "temperature.b": readings[1]}
    return make_run(columns, name=name)


def _network(added: EffectDeclaration) -> Network:
    links = (link("a", "ambient", 6.0), link("b", "ambient", 6.0), link("a", "b", 5.0))
    return Network("two", (node("a", 200.0), node("b", 200.0), AMBIENT), links, (effect("copper_loss"), added))


def _only(key: str, at: str, run: str = "", **values: float) -> EffectDeclaration:
    """One amplitude for all places, as a candidate has it."""
    declared = replace(effect(key, at, **values), run=run)
    return replace(declared, parameters=tuple(replace(parameter, share="all") for parameter in declared.parameters))


Case = tuple[EffectDeclaration, World, World, str, float]
CASES: list[Case] = [
    (_only("surface_scale", "*", "hot"), World(), World(air_factor=2.0), "surface_scale.change.*@hot", 1.0),
    (_only("loss_scale", "*", "hot"), World(), World(loss=0.7), "loss_scale.change.*@hot", -0.3),
    (_only("ambient_offset", "*", "hot"), World(), World(air_offset=3.0), "ambient_offset.offset.*@hot", 3.0),
    (_only("ambient_offset", "*"), World(air_offset=-2.0), World(air_offset=-2.0), "ambient_offset.offset.*", -2.0),
    (_only("clock_offset", "*", "hot"), World(), World(delay=6), "clock_offset.delay.*@hot", 6.0),
    (_only("clock_offset", "*"), World(delay=30), World(delay=30), "clock_offset.delay.*", 30.0),
    (_only("clock_offset", "*", "hot"), World(), World(delay=-15), "clock_offset.delay.*@hot", -15.0),
    (_only("shared_mass", "*"), World(trunk=0.4), World(trunk=0.4), "shared_mass.conductance.*", 0.4),
    (_only("ambient_lag", "*"), World(late=0.8), World(late=0.8), "ambient_lag.fraction.*", 0.8),
    (_only("hot_spot", "a"), World(hot=0.1), World(hot=0.1), "hot_spot.resistance.a", 0.1),
    (_only("sensor_position", "a~b"), World(mix=0.3), World(mix=0.3), "sensor_position.fraction.a~b", 0.3),
    (_only("sensor_loose", "b"), World(air=0.4), World(air=0.4), "sensor_loose.exposure.b", 0.4),
    (_only("sensor_loose", "b"), World(air=0.4), World(air=0.4), "sensor_loose.time_constant.b", 20.0),
    (_only("sensor_drift", "b"), World(drift=3.0), World(drift=3.0), "sensor_drift.rate.b", 3.0),
]


@pytest.mark.parametrize(("added", "cool", "hot", "name", "size"), CASES, ids=[case[3] for case in CASES])
def test_its_size_is_found_and_the_rest_with_it(
    added: EffectDeclaration, cool: World, hot: World, name: str, size: float
) -> None:
    model = Model(_network(added))
    result = fit(model, bound_runs(model, [_run("cool", cool, 1), _run("hot", hot, 2, start=26.0)]))
    values = {parameter.name: parameter.value for parameter in result.model.parameters}
    assert result.rmse == pytest.approx(NOISE, rel=0.15)
    assert values[name] == pytest.approx(size, rel=0.1)
    assert abs(values[name] - size) < 5 * result.standard_errors[name] + 0.02 * abs(size)
    for other, truth in TRUTH.items():
        assert values[other] == pytest.approx(truth, rel=0.1), other
