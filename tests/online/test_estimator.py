"""The online estimator against truth by scipy alone, and against its own promises."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import ndtr

import lptn
from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.parameters import Transform
from lptn.identify.fitting import fit
from lptn.identify.noise import Noise
from lptn.logs.scatter import off_their_neighbours, white_noise
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.online.augmented_model import AugmentedModel, ModelError
from lptn.online.estimator import Estimate, Estimator
from lptn.online.quantisation import as_gaussian, noise_and_steps
from lptn.robots.presets import presets
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import simulate
from tests.builders import leg, make_run, random_inputs, random_run, with_every_effect
from tests.identify.truth import TRUTH, network, truth_run

NOISE = 0.15  # K
LENGTH = 2400.0  # s
SETTLED = 300  # s


@pytest.fixture(scope="module")
def model() -> Model:
    """The true two nodes."""
    return Model(network().with_values(TRUTH))


@pytest.fixture(scope="module")
def truth() -> FloatArray:
    """True temperatures of the two nodes [degC], shape (2, seconds)."""
    run = truth_run(LENGTH, noise=0.0, seed=1)
    return np.array([run.columns["temperature.a"], run.columns["temperature.b"]])


def rounded(temperatures: FloatArray, step: float = 1.0, noise: float = NOISE, seed: int = 5) -> FloatArray:
    """What noisy sensors with steps read."""
    readings = temperatures + noise * np.random.default_rng(seed).standard_normal(temperatures.shape)
    return np.round(readings / step) * step if step else readings


def follow(estimator: Estimator, readings: FloatArray, every: int = 1) -> list[Estimate]:
    """Lead an estimator along the true run's inputs; one update in `every` seconds."""
    run = truth_run(LENGTH, noise=0.0, seed=1)
    columns = [run.columns[column] for column in estimator.model.inputs]
    estimates = []
    for k in range(0, len(run), every):
        inputs = {
            name: float(values[max(k - 1, 0)]) for name, values in zip(estimator.model.inputs, columns, strict=True)
        }
        now = {node: float(value) for node, value in zip(estimator.model.nodes, readings[:, k], strict=True)}
        estimates.append(estimator.update(inputs, now, 0.0 if k == 0 else float(every)))
    return estimates


def errors(found: list[Estimate], truth: FloatArray, every: int = 1) -> tuple[FloatArray, FloatArray]:
    """Errors [K] and errors in standard deviations, once settled, shape (n, 2) each."""
    error = np.array([estimate.temperatures for estimate in found]) - truth[:, ::every].T
    deviations = np.array([estimate.deviations for estimate in found])
    return error[SETTLED // every :], (error / deviations)[SETTLED // every :]


def inputs_of(model: Model) -> dict[str, float]:
    return {column: 20.0 if column.startswith("temperature.") else 3.0 for column in model.inputs}


# --- numbers ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("length", [1.0, 700.0])
def test_the_transition_is_the_derivative_of_the_step(length: float) -> None:
    model = Model(leg())
    error = ModelError(heat=1.0, bias=1.0, air=0.1, inputs={"temperature.ambient": 1.0})
    chosen = [0, len(model.parameters) - 1]
    augmented = AugmentedModel(model, error, chosen, np.zeros(2))
    z = np.concatenate([[30.0, 45.0, 60.0], np.arange(6.0), [0.05, 0.3], np.log([280.0, 0.8])])
    u = np.array(list(inputs_of(model).values()))
    small = 1e-4
    by_hand = np.column_stack(
        [
            (augmented.step(z + d, u, length).states - augmented.step(z - d, u, length).states) / (2 * small)
            for d in small * np.eye(len(z))
        ]
    )
    assert augmented.step(z, u, length).transition == pytest.approx(by_hand, abs=2e-6 * length)


def test_a_long_step_of_a_linear_model_is_that_of_many_short_ones(model: Model) -> None:
    """Up to the missing heat, which a long step holds: it fades by 3 % in 30 s of 900 s."""
    augmented = AugmentedModel(model, ModelError(heat=1.0, heat_time=900.0), (), np.zeros(0))
    z, u = np.array([40.0, 25.0, 1.0, -1.0]), np.array(list(inputs_of(model).values()))
    one, other = augmented.long_step(z, u, 30.0), augmented.step(z, u, 30.0)
    assert one.states == pytest.approx(other.states, rel=2e-4)
    assert one.transition == pytest.approx(other.transition, rel=0.02, abs=1e-4)
    assert one.added == pytest.approx(other.added, rel=0.1, abs=1e-3)
    still = np.array([40.0, 25.0, 0.0, 0.0])
    assert augmented.long_step(still, u, 30.0).states == pytest.approx(augmented.step(still, u, 30.0).states, rel=1e-4)


def test_without_errors_the_step_is_the_models_own(model: Model) -> None:
    augmented = AugmentedModel(model, ModelError(heat=0.0), (), np.zeros(0))
    x, u = np.array([40.0, 25.0]), np.array(list(inputs_of(model).values()))
    assert augmented.step(x, u, 1.0).states == pytest.approx(model.step()(x, u, model.values, 1.0).full().ravel())


def test_doubtful_parameters_begin_at_the_models_own_values() -> None:
    """Whatever coordinate the fit searches them by: logarithm, share, or the hyperbolic sine of one that may be 0."""
    model = Model(with_every_effect())
    x, u = np.full(len(model.states), 30.0), np.array(list(random_inputs(model, np.random.default_rng(0)).values()))
    augmented = AugmentedModel(model, ModelError(heat=0.0), model.free, np.zeros(len(model.free)))
    coordinates = Transform([model.parameters[index] for index in model.free]).forward(model.values[model.free])
    states = augmented.step(np.concatenate([x, coordinates]), u, 0.01).states[: len(x)]
    assert states == pytest.approx(model.step()(x, u, model.values, 0.01).full().ravel(), rel=1e-9)


@pytest.mark.parametrize("innovation", [-0.7, 0.0, 0.3, 1.4])
def test_a_cell_moves_mean_and_variance_as_the_exact_posterior(innovation: float) -> None:
    spread, noise, step = 0.4**2, 0.2**2, 1.0

    def weight(x: float) -> float:
        inside = ndtr((innovation + step / 2 - x) / 0.2) - ndtr((innovation - step / 2 - x) / 0.2)
        return float(np.exp(-(x**2) / (2 * spread)) * inside)  # moments need no constant in front

    moments = [quad(lambda x, power=power: x**power * weight(x), -4, 4, points=[innovation])[0] for power in (0, 1, 2)]
    mean = moments[1] / moments[0]
    variance = moments[2] / moments[0] - mean**2
    moved, scatter = as_gaussian(*(np.array([value]) for value in (innovation, spread, noise, step)))
    gain = spread / (spread + scatter[0])
    assert gain * moved[0] == pytest.approx(mean, abs=1e-6)
    assert spread * (1 - gain) == pytest.approx(variance, abs=1e-6)


def test_a_fine_sensor_and_an_impossible_reading_count_as_gaussian() -> None:
    moved, scatter = as_gaussian(np.array([0.4, 50.0]), np.full(2, 0.01), np.full(2, 0.04), np.array([0.0, 1.0]))
    assert moved.tolist() == [0.4, 50.0]
    assert scatter == pytest.approx([0.04, 0.04 + 1 / 12])


# --- against the truth --------------------------------------------------------------------------------


@pytest.mark.parametrize("currents", ["rest", "settled", "cooling", "stairs"])
def test_exact_readings_are_no_mistake_and_their_sensors_live(model: Model, currents: str) -> None:
    """Noise of 0: a covariance that can't be inverted, and readings that repeat themselves to the last bit."""
    torque = {
        "rest": np.zeros(1500),
        "settled": np.full(1500, 2.0),
        "cooling": np.repeat([4.0, 0.0], [300, 1200]),
        "stairs": np.repeat([1.0, 4.0, 2.0, 0.0], [300, 300, 300, 600]),
    }[currents]
    columns = {f"temperature.{place}": np.full(1500, 21.0) for place in ("ambient", "a", "b")} | {"torque.a": torque}
    exact = simulate(model, bind(model, make_run(columns))).readings
    estimator = Estimator(model, noise=0.0)
    for k in range(1500):
        inputs = {name: float(columns[name][max(k - 1, 0)]) for name in model.inputs}
        estimate = estimator.update(inputs, dict(zip(model.nodes, exact[:, k].tolist(), strict=True)), float(k > 0))
        assert estimate.untrusted == {}


@pytest.mark.long
def test_with_coarse_steps_it_is_right_and_knows_how_right(model: Model, truth: FloatArray) -> None:
    readings = rounded(truth)
    error, share = errors(follow(Estimator(model, noise=NOISE, step=1.0), readings), truth)
    assert np.sqrt(np.mean(error**2)) < 0.1
    assert np.mean(np.abs(share) < 1.96) > 0.93
    white = float(np.hypot(NOISE, 1 / np.sqrt(12)))  # the steps as noise of their variance
    naive, overconfident = errors(follow(Estimator(model, noise=white, watch=False), readings), truth)
    assert np.sqrt(np.mean(naive**2)) > 1.3 * np.sqrt(np.mean(error**2))
    assert np.mean(np.abs(overconfident) < 1.96) < 0.93


def test_missing_readings_and_long_steps_cost_certainty_not_truth(model: Model, truth: FloatArray) -> None:
    readings = rounded(truth, step=0.0)
    readings[0, 1000:2000] = np.nan
    readings[np.random.default_rng(2).uniform(size=readings.shape) < 0.4] = np.nan
    estimates = follow(Estimator(model, noise=NOISE), readings, every=5)
    error, share = errors(estimates, truth, every=5)
    assert np.abs(error).max() < 2.0
    assert np.mean(np.abs(share) < 1.96) > 0.9
    assert estimates[390].deviations[0] > 3 * estimates[190].deviations[0]
    assert np.isnan(estimates[300].innovations[0])


def test_a_long_gap_is_as_uncertain_as_many_short_ones(model: Model) -> None:
    spreads = []
    for parts in (1, 600):
        estimator = Estimator(model, noise=NOISE)
        estimator.update(inputs_of(model), {"a": 30.0, "b": 25.0}, 0.0)
        for _ in range(parts):
            estimator.advance(inputs_of(model), 600.0 / parts)
        spreads.append(estimator.estimate.deviations)
    assert spreads[0] == pytest.approx(spreads[1], rel=0.05)


@pytest.mark.long
def test_it_learns_the_resistance_to_the_air(truth: FloatArray) -> None:
    name = "resistance.ambient~b"
    wrong = Model(network().with_values(TRUTH | {name: 6.0}))
    estimates = follow(
        Estimator(wrong, noise=NOISE, step=1.0, error=ModelError(heat=0.1), learn=[name]), rounded(truth)
    )
    value, error = estimates[-1].parameters[name]
    assert value == pytest.approx(TRUTH[name], rel=0.05)
    assert abs(value - TRUTH[name]) < 3 * error
    assert estimates[0].parameters[name][0] == pytest.approx(6.0)
    assert error < 0.2 * estimates[0].parameters[name][1]


@pytest.mark.long
def test_doubt_about_fitted_parameters_widens_and_stays() -> None:
    run = truth_run(1800.0, noise=NOISE, seed=3)
    start = Model(network())
    done = fit(start, [bind(start, run)])
    doubting = Estimator.from_fit(done, error=ModelError(heat=0.01))
    sure = Estimator(done.model, noise=NOISE, error=ModelError(heat=0.01))
    for estimator in (doubting, sure):
        assert len(list(estimator.run(bind(start, run)))) == len(run)
    assert (doubting.estimate.deviations >= sure.estimate.deviations).all()
    for estimator in (doubting, sure):
        for _ in range(20):
            estimator.advance(inputs_of(start) | {"torque.a": 12.0}, 60.0)
    assert (doubting.estimate.deviations > 1.2 * sure.estimate.deviations).all()
    block = doubting.state()["covariance"][-len(start.free) :, -len(start.free) :]
    assert block == pytest.approx(done.uncertainty.covariance, rel=1e-6, abs=1e-12)


@pytest.mark.parametrize("noise", [0.2, 0.4])
@pytest.mark.parametrize("step", [0.1, 0.5, 1.0])
def test_noise_hidden_in_steps_is_found_though_one_sensor_stands(truth: FloatArray, step: float, noise: float) -> None:
    readings = rounded(np.vstack([truth, np.full_like(truth[:1], 20.0)]), step, noise)
    readings[2] = 20.0
    white = [white_noise(off_their_neighbours(np.arange(row.size, dtype=float), row), step) for row in readings]
    found, steps = noise_and_steps(Noise(np.array(white), np.full(3, step)))
    assert found == pytest.approx(noise, rel=0.15)
    assert (steps == step).all()


def test_a_fine_sensor_keeps_its_own_noise_and_means_the_steps_that_they_have_left() -> None:
    found, steps = noise_and_steps(Noise(np.array([0.3, 0.1, 0.0]), np.zeros(3), np.array([0.0, 0.2, 0.0])))
    assert found.tolist() == [0.3, 0.1, 0.1]
    assert steps.tolist() == [0.0, 0.2, 0.0]


# --- promises -----------------------------------------------------------------------------------------


def test_the_covariance_stays_positive(model: Model) -> None:
    estimator = Estimator(model, noise=1e-6, error=ModelError(heat=1e-3), learn=["capacity.a"])
    for k in range(3000):
        estimator.update(inputs_of(model), {"a": 30.0 + 1e-4 * k}, 1.0 if k else 0.0)
    covariance = estimator.state()["covariance"]
    scale = np.sqrt(np.diag(covariance))
    assert np.linalg.eigvalsh(covariance / np.outer(scale, scale)).min() > 0
    assert (covariance == covariance.T).all()


def test_a_saved_state_goes_on_as_if_nothing_had_happened(model: Model, tmp_path: Path) -> None:
    options = {"step": 1.0, "error": ModelError(change=0.5, bias=0.2), "learn": ["capacity.a"]}
    first, second = (Estimator(model, **options) for _ in range(2))  # type: ignore[arg-type]
    for k in range(20):
        first.update(inputs_of(model), {"a": 30.0 + k // 5, "b": 25.0}, 1.0 if k else 0.0)
    file = tmp_path / "state.npz"
    np.savez(file, **first.state())  # type: ignore[arg-type]
    with np.load(file) as saved:
        second.restore(dict(saved))
    further = [resumed.update(inputs_of(model) | {"torque.a": 8.0}, {"a": 35.0}, 2.0) for resumed in (first, second)]
    assert (further[0].temperatures == further[1].temperatures).all()
    assert (further[0].deviations == further[1].deviations).all()
    with pytest.raises(InputError, match="expected an array of shape"):
        Estimator(model).restore(first.state())


@pytest.mark.parametrize(
    ("inputs", "readings", "dt", "word"),
    [
        ({"torque.a": float("nan")}, {}, 1.0, "torque.a"),
        ({"torque.a": float("inf")}, {}, 1.0, "torque.a"),
        ({}, {"c": 20.0}, 1.0, "'c'"),
        ({}, {"a": float("inf")}, 1.0, "infinite"),
        ({}, {}, -1.0, "time step"),
        ({}, {}, float("nan"), "time step"),
        ({}, {}, 1e6, "time step"),
    ],
)
def test_what_cant_be_used_is_refused_in_one_line(
    model: Model, inputs: Mapping[str, float], readings: Mapping[str, float], dt: float, word: str
) -> None:
    estimator = Estimator(model)
    estimator.update(inputs_of(model), {"a": 30.0, "b": 25.0}, 0.0)
    before = estimator.state()
    with pytest.raises(InputError, match=word) as refused:
        estimator.update(inputs_of(model) | dict(inputs), readings, dt)
    assert "\n" not in str(refused.value)
    assert all((before[name] == array).all() for name, array in estimator.state().items() if name != "last_inputs")


def test_slips_of_the_pen_are_refused(model: Model) -> None:
    with pytest.raises(InputError, match="torque"):
        Estimator(model, error=ModelError(inputs={"torque.c": 1.0}))
    with pytest.raises(InputError, match="resistance"):
        Estimator(model, learn=["resistance.a"])
    with pytest.raises(InputError, match="'c'"):
        Estimator(model, noise={"c": 1.0})
    with pytest.raises(InputError, match="no such input"):
        Estimator(model).update({}, {"a": 30.0}, 0.0)
    with pytest.raises(ValueError, match="heat"):
        ModelError(heat=-1.0)
    with pytest.raises(ValueError, match="covariance"):
        Estimator(model, covariance=np.eye(2))


def test_a_log_that_begins_at_rest_needs_no_ambient() -> None:
    text = presets()["leg"].replace('ambient = "temperature.ambient"', 'ambient = "start"')
    model = Model(parse_model(text, Path("leg.toml")).network)
    estimator = Estimator(model)
    torques = {column: 0.0 for column in model.inputs if column.startswith("torque.")}
    for k in range(100):
        estimate = estimator.update(torques, dict.fromkeys(model.nodes, 23.0), 60.0 if k else 0.0)
    assert estimate.temperatures == pytest.approx(23.0, abs=0.1)


def test_without_any_reading_it_starts_at_the_ambient_and_says_how_little_it_knows(model: Model) -> None:
    estimator = Estimator(model)
    estimate = estimator.update(inputs_of(model), {"a": None}, 0.0)
    assert estimate.temperatures.tolist() == [20.0, 20.0]
    assert estimate.deviations.min() > 10.0
    estimate = estimator.update(inputs_of(model), {"a": 41.0, "b": 32.0}, 1.0)
    assert estimate.temperatures == pytest.approx([41.0, 32.0], abs=0.2)


def test_a_log_that_begins_at_rest_needs_a_first_reading() -> None:
    text = presets()["leg"].replace('ambient = "temperature.ambient"', 'ambient = "start"')
    model = Model(parse_model(text, Path("leg.toml")).network)
    with pytest.raises(InputError, match="first update"):
        Estimator(model).update({column: 0.0 for column in model.inputs if "torque" in column}, {}, 0.0)


def test_the_whole_quadruped_fits_through_the_front_door() -> None:
    model = Model(parse_model(presets()["quadruped"], Path("quadruped.toml")).network)
    estimator = lptn.Estimator(model, step=1.0)
    run = random_run(model, 30)
    assert list(estimator.run(bind(model, run))) == list(range(30))
    assert estimator.estimate.nodes == tuple(model.nodes)
    assert len(estimator.estimate.nodes) == 13
    assert estimator.estimate.temperature("pc")[1] < 1.0


def test_state_is_plain_arrays(model: Model) -> None:
    estimator = Estimator(model)
    estimator.update(inputs_of(model), {"a": 30.0}, 0.0)
    np.savez(io.BytesIO(), **estimator.state())  # type: ignore[arg-type]
    assert all(type(array) is np.ndarray and array.dtype == float for array in estimator.state().values())


@pytest.mark.parametrize(("nodes", "fitted"), [(320, False), (250, True), (280, True)])
def test_a_filter_that_would_not_come_to_an_end_is_refused(nodes: int, fitted: bool) -> None:
    names = ", ".join(f'"j{k}"' for k in range(nodes))
    text = f"""[model]\nname = "m"\nambient = 25\njoints = [{names}]\n[nodes."*"]\ncapacity = 300
[[links]]\nbetween = ["*", "ambient"]\nresistance = {{ value = 3, share = "each" }}\n"""
    large = Model(parse_model(text, Path("m.toml")).network)
    covariance = np.eye(len(large.free)) * 1e-4 if fitted else None
    with pytest.raises(InputError, match=r"m.toml: filter: found .* states .*; expected at most 600"):
        Estimator(large, covariance=covariance)
