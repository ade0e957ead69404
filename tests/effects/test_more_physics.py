"""Hand-written numbers, energy balances and simulations in plain numpy and scipy for the rest of the catalogue."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray
from lptn.effects import catalogue
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network, NodeDeclaration
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import simulate
from tests.builders import AMBIENT, effect, link, make_run, node, two_nodes

CA, CB, RA, RB = 120.0, 250.0, 4.0, 7.0  # of `two_nodes`
N, STEP = 900, 1.0


def _columns(seed: int = 2) -> dict[str, FloatArray]:
    """Every input feature of a joint and of the robot, jumping once a minute, and an ambient that rises."""
    rng = np.random.default_rng(seed)

    def jumping(least: float, most: float) -> FloatArray:
        return rng.uniform(least, most, N // 60).repeat(60)

    place = {
        "torque.a": jumping(-6, 6),
        "torque_abs.a": jumping(0, 6),
        "current_abs.a": jumping(0, 9),
        "mechanical_power.a": jumping(0, 40),
        "velocity_rms.a": jumping(0, 8),
        "fan.a": jumping(0, 1),
        "irradiance.a": jumping(0, 900),
        "power.pc": jumping(5, 40),
        "power.computer": jumping(5, 40),
        "power.battery": jumping(-50, 400),
        "speed.fan": jumping(0, 3),
        "irradiance.global": jumping(0, 900),
        "velocity.a": jumping(0, 8),
        "current.a": jumping(-9, 9),
        "speed.base": jumping(0, 3),
    }
    return place | {"temperature.ambient": 20.0 + 8.0 * np.arange(N) / N}


COLUMNS = _columns()
RUN = make_run(COLUMNS | {"temperature.a": np.full(N, 30.0), "temperature.b": np.full(N, 24.0)}, step=STEP)


def _readings(effects: Sequence[EffectDeclaration], run: Run = RUN) -> FloatArray:
    model = Model(two_nodes(effects))
    return simulate(model, bind(model, run)).readings


Rates = Callable[[FloatArray, dict[str, float]], Sequence[float]]


def _solved(rates: Rates, start: Sequence[float]) -> FloatArray:
    """States at the steps by an adaptive integrator that stops at each jump of the inputs, shape (states, N)."""
    x, path = np.array(start), []
    for k in range(N):
        path.append(x)
        now = {name: float(values[k]) for name, values in COLUMNS.items()}
        x = solve_ivp(lambda _, y: rates(y, now), (0.0, STEP), x, rtol=1e-9, atol=1e-9).y[:, -1]  # noqa: B023
    return np.array(path).T


def _two(
    heat: Callable[[dict[str, float]], float], surface: Callable[[dict[str, float]], float] = lambda _: 1.0
) -> Rates:
    """Two nodes, each with its way to the ambient; a heat into the first and a factor on its surface."""

    def rates(x: FloatArray, u: dict[str, float]) -> list[float]:
        air = u["temperature.ambient"]
        return [(heat(u) - surface(u) * (x[0] - air) / RA) / CA, -(x[1] - air) / RB / CB]

    return rates


def _chosen(key: str, word: str, **values: float) -> EffectDeclaration:
    declared = effect(key, "a", **values)
    return EffectDeclaration(catalogue()[key](input=word), "a", declared.parameters)


HEATS: list[tuple[EffectDeclaration, Callable[[dict[str, float]], float]]] = [
    (effect("gear_loss", "a", fraction=0.15), lambda u: 0.15 * u["mechanical_power.a"]),
    (effect("driver_loss", "a", voltage=2.0, torque_constant=0.8), lambda u: 2.0 * u["torque_abs.a"] / 0.8),
    (_chosen("driver_loss", "current_abs", voltage=2.0), lambda u: 2.0 * u["current_abs.a"]),
    (effect("iron_loss", "a", gain=0.3, exponent=1.3), lambda u: 0.3 * u["velocity_rms.a"] ** 1.3),
    (effect("computer_heat", "a", fraction=0.2), lambda u: 0.2 * u["power.pc"]),
    (_chosen("computer_heat", "computer_power", fraction=0.2), lambda u: 0.2 * u["power.computer"]),
    (effect("battery_heat", "a", fraction=0.05), lambda u: 0.05 * abs(u["power.battery"])),
    (effect("solar", "a", area=0.01), lambda u: 0.01 * u["irradiance.a"]),
    (_chosen("solar", "global_irradiance", area=0.01), lambda u: 0.01 * u["irradiance.global"]),
]


@pytest.mark.parametrize(
    ("declared", "heat"),
    HEATS,
    ids=[f"{declared.effect.key} {declared.effect.chosen.get('input', '')}" for declared, _ in HEATS],
)
def test_heat_into_a_node(declared: EffectDeclaration, heat: Callable[[dict[str, float]], float]) -> None:
    expected = _solved(_two(heat), [30.0, 24.0])
    np.testing.assert_allclose(_readings([declared]), expected, atol=2e-4)
    assert np.abs(expected[0] - _readings([])[0]).max() > 0.5


SURFACES: list[tuple[EffectDeclaration, Callable[[dict[str, float]], float]]] = [
    (effect("fan", "a", gamma=1.5), lambda u: 1 + 1.5 * u["fan.a"]),
    (_chosen("fan", "fan_speed", gamma=0.6), lambda u: 1 + 0.6 * u["speed.fan"]),
    (effect("surface_scale", "a", change=-0.4), lambda _: 0.6),
    (effect("surface_scale", "a", change=2.0), lambda _: 3.0),
]


@pytest.mark.parametrize(("declared", "factor"), SURFACES, ids=lambda value: "")
def test_loss_to_the_surroundings(declared: EffectDeclaration, factor: Callable[[dict[str, float]], float]) -> None:
    expected = _solved(_two(lambda _: 3.0, factor), [30.0, 24.0])
    np.testing.assert_allclose(_readings([effect("constant_heat", "a", power=3.0), declared]), expected, atol=2e-4)


def test_a_torque_constant_a_tenth_too_high_is_a_loss_scale_of_23_percent() -> None:
    def heat(u: dict[str, float]) -> float:
        return 0.15 * (u["torque.a"] / (0.9 * 0.84)) ** 2

    copper = effect("copper_loss", "a", resistance=0.15, torque_constant=0.84)
    readings = _readings([copper, effect("loss_scale", "a", change=0.9**-2 - 1)])
    np.testing.assert_allclose(readings, _solved(_two(heat), [30.0, 24.0]), atol=2e-4)


def test_ambient_offset_moves_the_air_of_all_nodes() -> None:
    def rates(x: FloatArray, u: dict[str, float]) -> list[float]:
        air = u["temperature.ambient"] - 3.0
        return [-(x[0] - air) / RA / CA, -(x[1] - air) / RB / CB]

    readings = _readings([effect("ambient_offset", "ambient", offset=-3.0)])
    np.testing.assert_allclose(readings, _solved(rates, [30.0, 24.0]), atol=2e-4)


def test_ambient_lag_starts_at_the_ambient_and_follows_it() -> None:
    def rates(x: FloatArray, u: dict[str, float]) -> list[float]:
        air = u["temperature.ambient"] + 0.8 * (x[2] - u["temperature.ambient"])
        late = (u["temperature.ambient"] - x[2]) / 400.0
        return [-(x[0] - air) / RA / CA, -(x[1] - air) / RB / CB, late]

    readings = _readings([effect("ambient_lag", "ambient", fraction=0.8, time_constant=400.0)])
    np.testing.assert_allclose(readings, _solved(rates, [30.0, 24.0, 20.0])[:2], atol=2e-4)


def test_air_that_drifts_rises_evenly_from_where_it_started() -> None:
    hours: FloatArray = np.asarray((np.arange(N) + 0.5) * STEP / 3600.0, dtype=float)
    still, rises = (
        make_run({**RUN.columns, "temperature.ambient": 20.0 + rate * hours}, step=STEP) for rate in (0.0, 6.0)
    )
    drifting = _readings([effect("ambient_drift", "ambient", rate=6.0)], still)
    np.testing.assert_allclose(drifting, _readings([], rises), atol=1e-3)
    assert np.abs(drifting - _readings([], still)).max() > 0.3


def test_only_air_that_nobody_logs_may_drift() -> None:
    drift = catalogue()["ambient_drift"]
    logged, guessed = (
        Network("one", (node("a"), NodeDeclaration("ambient", temperature=source)), (link("a", "ambient"),))
        for source in ("temperature.ambient", "start")
    )
    assert not drift.makes_a_difference("ambient", logged, ())
    assert drift.makes_a_difference("ambient", guessed, ())


def test_shared_mass_starts_at_the_mean_of_its_nodes() -> None:
    g, t, leak = 0.7, 300.0, 0.4

    def rates(x: FloatArray, u: dict[str, float]) -> list[float]:
        air = u["temperature.ambient"]
        trunk = (0.5 * (x[0] + x[1]) - x[2] - leak * (x[2] - air)) / t
        return [(-(x[0] - air) / RA + g * (x[2] - x[0])) / CA, (-(x[1] - air) / RB + g * (x[2] - x[1])) / CB, trunk]

    model = Model(two_nodes([effect("shared_mass", "*", conductance=g, time_constant=t, leak=leak)]))
    assert model.states == ["a", "b", "shared_mass.*"]
    readings = simulate(model, bind(model, RUN)).readings
    np.testing.assert_allclose(readings, _solved(rates, [30.0, 24.0, 27.0])[:2], atol=2e-4)


def test_shared_mass_keeps_the_energy() -> None:
    """Closed box, no leak: capacities times temperatures, that of the mass n g t, add up to the same for ever."""
    nodes, values = (node("a", 100.0), node("b", 60.0)), {"conductance": 0.8, "time_constant": 90.0, "leak": 0.0}
    model = Model(Network("closed", nodes, (link("a", "b", 1.0),), (effect("shared_mass", "*", **values),)))
    start = np.array([80.0, 20.0, 35.0])
    weights = np.array([100.0, 60.0, 2 * 0.8 * 90.0])
    path = model.run(3000)(start, np.zeros((0, 3000)), model.values, 1.0).full()
    np.testing.assert_allclose(weights @ path, weights @ start, rtol=1e-10)
    np.testing.assert_allclose(path[:, -1], weights @ start / weights.sum(), rtol=1e-6)


def test_shared_mass_without_any_surroundings_has_no_leak() -> None:
    nodes = (node("a", 100.0), node("b", 60.0))
    model = Model(Network("closed", nodes, (link("a", "b", 1.0),), (effect("shared_mass", "*", leak=3.0),)))
    np.testing.assert_allclose(model.rhs([40.0, 40.0, 40.0], [], model.values).full(), 0.0, atol=1e-15)


def test_drift_grows_by_its_rate_whatever_the_node_does() -> None:
    heat = effect("constant_heat", "a", power=5.0)
    readings = _readings([heat, effect("sensor_drift", "a", rate=-4.0)])
    expected = _readings([heat])
    np.testing.assert_allclose(readings[0] - expected[0], -4.0 * np.arange(N) * STEP / 3600, atol=1e-9)
    np.testing.assert_array_equal(readings[1], expected[1])


def test_drift_goes_on_where_a_log_is_cut() -> None:
    heat, late = effect("constant_heat", "a", power=5.0), 1800.0
    later = replace(RUN, name="log#2", time=RUN.time + late, log_start=float(RUN.time[0]))
    of_log, of_piece = (replace(effect("sensor_drift", "a", rate=-4.0), run=run) for run in ("log", "log#2"))
    for drift, begun in ((of_log, -4.0 * late / 3600), (of_piece, 0.0)):
        readings = _readings([heat, drift], later)[0] - _readings([heat], later)[0]
        np.testing.assert_allclose(readings, begun - 4.0 * np.arange(N) * STEP / 3600, atol=1e-9)


def test_position_reads_a_share_of_the_other_node() -> None:
    nodes, links = two_nodes().nodes, (link("a", "b", 3.0), link("b", "ambient", 7.0))
    for at, (own, other) in {"a~b": (0, 1), "b~a": (1, 0)}.items():
        network = Network("n", nodes, links, (effect("sensor_position", at, fraction=0.25),))
        model = Model(network)
        x = [60.0, 40.0]
        reading = model.output(x, model.values).full().ravel()
        assert reading[own] == pytest.approx(0.75 * x[own] + 0.25 * x[other], rel=1e-12)
        assert reading[other] == x[other]
    both = Network("n", nodes, links, (effect("sensor_position", "*"),))
    assert [instance.place for instance in both.effect_instances] == ["a~b", "b~a"]
    assert len({u.name for u in both.parameters}) == len(both.parameters)


def test_position_stands_only_where_nodes_touch() -> None:
    network = two_nodes()
    declared = effect("sensor_position", "a~b")
    assert network.places_for(declared) == []
    assert network.with_effects([effect("conduction")]).places_for(declared) == [("a~b", ("a", "b"))]


def test_hot_spot_leads_by_the_copper_loss_it_sits_in() -> None:
    alpha, resistance, r, t = 0.0039, 0.15 / 0.84**2, 0.4, 8.0

    def loss(x: FloatArray, u: dict[str, float]) -> float:
        return float(resistance * u["torque.a"] ** 2 * (1 + alpha * (x[0] - 25.0)))

    def rates(x: FloatArray, u: dict[str, float]) -> list[float]:
        air = u["temperature.ambient"]
        heat = loss(x, u)
        return [(heat - (x[0] - air) / RA) / CA, -(x[1] - air) / RB / CB, (heat - x[2]) / t]

    states = _solved(rates, [30.0, 24.0, 0.0])
    hot = effect("hot_spot", "a", resistance=r, time_constant=t)
    readings = _readings([effect("copper_loss", "a"), effect("resistance_rise", "a", alpha=alpha), hot])
    np.testing.assert_allclose(readings[0], states[0] + r * states[2], atol=5e-4)
    assert np.ptp(r * states[2]) > 1.0


def test_a_winding_passes_its_loss_on_late_and_keeps_none_of_it() -> None:
    resistance, t = 0.15 / 0.84**2, 40.0

    def rates(x: FloatArray, u: dict[str, float]) -> list[float]:
        air, loss = u["temperature.ambient"], resistance * u["torque.a"] ** 2
        return [(x[2] - (x[0] - air) / RA) / CA, -(x[1] - air) / RB / CB, (loss - x[2]) / t]

    copper, late = effect("copper_loss", "a"), effect("winding_mass", "a", fraction=1.0, time_constant=t)
    readings = _readings([copper, late])
    np.testing.assert_allclose(readings, _solved(rates, [30.0, 24.0, 0.0])[:2], atol=2e-4)
    assert np.abs(readings[0] - _readings([copper])[0]).max() > 1.0


def test_half_of_a_loss_may_take_the_way_through_the_winding() -> None:
    """Of a factor on the loss as well: at rest in the end the node is as warm as without."""
    torque = {name: np.full(4 * N, 6.0) for name in ("torque.a", "torque.b")}
    long = make_run(
        torque
        | {"temperature.ambient": np.full(4 * N, 20.0)}
        | {f"temperature.{name}": np.full(4 * N, 20.0) for name in "ab"},
        step=STEP,
    )
    heated = [effect("copper_loss", "a"), effect("loss_scale", "a", change=0.5)]
    late = _readings([*heated, effect("winding_mass", "a", fraction=0.5, time_constant=60.0)], long)
    soon = _readings(heated, long)
    assert soon[0][120] - late[0][120] > 0.5
    np.testing.assert_allclose(late[:, -1], soon[:, -1], atol=0.2)


@pytest.mark.parametrize("delay", [20.0, -7.5])
def test_a_clock_offset_shifts_the_readings_in_time(delay: float) -> None:
    heat, time = effect("driver_loss", "a", voltage=2.0), np.arange(N) * STEP
    without = _readings([heat])
    readings = _readings([heat, effect("clock_offset", "*", delay=delay)])
    inside = (time - delay < time[-1]) & (time > delay)
    for row in range(2):
        np.testing.assert_allclose(
            readings[row][inside], np.interp(time - delay, time, without[row])[inside], rtol=1e-12
        )


def test_one_surroundings_has_one_ambient_error() -> None:
    coolant = Network(
        "two airs",
        (node("a", 100.0), AMBIENT, NodeDeclaration("coolant", temperature="temperature.coolant")),
        (link("a", "ambient", 2.0), link("a", "coolant", 5.0)),
        (effect("ambient_offset", "coolant", offset=4.0),),
    )
    model = Model(coolant)
    inputs = {"temperature.ambient": 20.0, "temperature.coolant": 10.0}
    rate = float(model.rhs([60.0], [inputs[c] for c in model.inputs], model.values))
    assert rate == pytest.approx((-(60.0 - 20.0) / 2.0 - (60.0 - 14.0) / 5.0) / 100.0, rel=1e-12)
