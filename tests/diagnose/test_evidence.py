"""The evidence against what it stands for: dense covariances, numerical integration, and draws from its own prior."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad
from scipy.stats import norm

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.diagnose.candidates import Candidate, candidates
from lptn.diagnose.diagnosis import Step, refit
from lptn.diagnose.evidence import (
    AMPLITUDES,
    LACKING_SOMETHING,
    Amplitude,
    DiscrepancyLevel,
    Level,
    Likelihood,
    Whitening,
    levels_of,
    log_bayes_factors,
    log_priors,
    together,
)
from lptn.diagnose.fit_statistics import NEGLIGIBLE
from lptn.diagnose.improvement import _pruned
from lptn.identify.data import DataSplit, split_data
from lptn.identify.fitting import Fit
from lptn.identify.noise import Noise
from lptn.identify.problem import Problem
from lptn.identify.validation import fit_segments
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network
from lptn.simulate.bound_run import BoundRun, bind
from lptn.simulate.simulation import simulate
from tests.builders import AMBIENT, bound_runs, effect, leg, link, node, random_run, two_nodes

NODES = ("a", "b")
SIGMA = np.array([0.5, 0.8])  # K, weights of a fit
SENSORS = Noise(np.array([0.12, 0.0]), np.array([0.0, 1.0]))  # a fine sensor with noise, and one that has only steps
MISSED = np.array([0.9, 0.5])  # K, what a given model misses


# --- Whitening ------------------------------------------------------------------------------------


def _gappy_runs(step: float, lengths: Sequence[int]) -> list[BoundRun]:
    """Runs of unequal lengths with single readings missing, and long gaps."""
    model, rng, runs = Model(two_nodes([effect("heat_input", "a")])), np.random.default_rng(5), []
    for number, length in enumerate(lengths):
        run = random_run(model, length, number, step=step)
        time = run.time
        columns = dict(run.columns)
        for place, slowness in zip(NODES, (400.0, 900.0), strict=True):
            readings = 25.0 + 20.0 * (1.0 - np.exp(-time / slowness)) + rng.normal(0.0, 0.3, length)
            readings[rng.uniform(size=length) < 0.1] = np.nan
            readings[length // 3 : length // 3 + 7 + number] = np.nan
            columns[f"temperature.{place}"] = readings
        runs.append(replace(run, name=f"run{number}", columns=columns))
    return bound_runs(model, runs)


def _dense(bound: BoundRun, node: int, level: DiscrepancyLevel, block: float) -> tuple[FloatArray, FloatArray]:
    """Averages over blocks, shape (blocks, readings), and the covariance of these means [K²], by the formula alone."""
    time = bound.run.time[bound.counted[node]]
    readings = bound.measured[node][bound.counted[node]]
    numbers = np.floor(time / block)
    blocks = np.unique(numbers)
    averages = np.array([(numbers == each) / np.sum(numbers == each) for each in blocks])
    apart = np.abs(np.subtract.outer(*[np.array([time[numbers == each][0] for each in blocks])] * 2))
    # Noise is estimated: two standard errors are allowed for.
    noise = max(SENSORS.white[node] * (1.0 + 3.0 / np.sqrt(len(time))), 0.02 * SIGMA[node])
    white = noise**2 * averages @ averages.T
    slow = (level.size * MISSED[node]) ** 2 * np.exp(-apart / level.time_constant)
    steps = np.zeros_like(slow)
    if SENSORS.step[node]:
        crossings = np.abs(np.diff(readings)).sum() / SENSORS.step[node]
        rate = 6.0 * crossings / (time[-1] - time[0])
        of_means = 2.0 * (block * rate - 1.0 + np.exp(-block * rate)) / (block * rate) ** 2
        steps = SENSORS.step[node] ** 2 / 12.0 * of_means * np.exp(-apart * rate)
    return averages, white + slow + steps


@pytest.mark.parametrize(
    ("step", "lengths", "block"),
    [(10.0, (120, 75, 44), 10.0), (5.0, (300, 111), 10.0), (10.0, (1080, 90), 30.0)],
    ids=["each reading", "pairs", "blocks of three in a long run"],
)
def test_whitening_is_the_inverse_of_the_dense_covariance(step: float, lengths: Sequence[int], block: float) -> None:
    bound = _gappy_runs(step, lengths)
    whitening = Whitening(bound, SIGMA, SENSORS, MISSED)
    rows = sum(int(each.counted.sum()) for each in bound)
    assert whitening.rows == rows
    columns = np.random.default_rng(8).normal(size=(rows, 3)).cumsum(axis=0)
    levels = whitening.levels
    assert levels[0].size == 0.0
    assert sum(np.exp(level.log_prior) for level in levels) == pytest.approx(1.0)
    for level, white, half_determinant in whitening(columns, [levels[0], levels[5], levels[-1]]):
        forms, logarithm, first = np.zeros((3, 3)), 0.0, 0
        for each, row in product(bound, range(2)):
            averages, covariance = _dense(each, row, level, block)
            kelvin = averages @ columns[first : first + averages.shape[1]] * SIGMA[row]
            first += averages.shape[1]
            forms += kelvin.T @ np.linalg.solve(covariance, kelvin)
            logarithm += np.linalg.slogdet(covariance)[1]
        np.testing.assert_allclose(white.T @ white, forms, rtol=1e-8)
        assert half_determinant == pytest.approx(0.5 * logarithm, rel=1e-8)


def test_whitening_in_several_passes_gives_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    whitening = Whitening(_gappy_runs(10.0, (60, 33)), SIGMA, SENSORS, MISSED)
    columns = np.random.default_rng(1).normal(size=(whitening.rows, 2))
    at_once = list(whitening(columns))
    monkeypatch.setattr("lptn.diagnose.evidence._MEMORY", 1)
    for one, other in zip(at_once, whitening(columns), strict=True):
        assert one[0] == other[0]
        np.testing.assert_array_equal(one[1], other[1])
        assert one[2] == other[2]


# --- The closed form ------------------------------------------------------------------------------


def _covariance(bound: Sequence[BoundRun], level: DiscrepancyLevel) -> FloatArray:
    """Of all weighted readings, each in a block of its own."""
    parts = [_dense(each, node, level, each.run.step)[1] / SIGMA[node] ** 2 for each, node in product(bound, range(2))]
    whole = np.zeros((sum(map(len, parts)),) * 2)
    first = 0
    for part in parts:
        whole[first : first + len(part), first : first + len(part)] = part
        first += len(part)
    return whole


def test_unknowns_are_integrated_out_as_in_one_large_normal_distribution() -> None:
    bound = _gappy_runs(10.0, (60, 33))
    whitening, rng = Whitening(bound, SIGMA, SENSORS, MISSED), np.random.default_rng(3)
    residuals = rng.normal(0.0, 0.5, whitening.rows)
    unknowns, amplitudes = (rng.normal(size=(whitening.rows, k)).cumsum(axis=0) / 5 for k in (3, 2))
    prior = np.array([1.0, 0.3, 10.0])
    among = [whitening.levels[0], whitening.levels[9], whitening.levels[-1]]
    for level in levels_of(whitening, residuals, unknowns, prior, amplitudes, among=among):
        noise = _covariance(bound, level.level)
        whole = noise + (unknowns * prior**2) @ unknowns.T
        # The determinant is that of readings in K: weights are constants of the data.
        in_kelvin = np.linalg.slogdet(whole)[1] + 2.0 * sum(
            float(np.log(SIGMA[node]) * each.counted[node].sum()) for each, node in product(bound, range(2))
        )
        expected = -0.5 * (residuals @ np.linalg.solve(whole, residuals) + in_kelvin) + level.level.log_prior
        assert level.log_evidence == pytest.approx(expected, rel=1e-8)
        np.testing.assert_allclose(level.precision, amplitudes.T @ np.linalg.solve(whole, amplitudes), rtol=1e-7)
        np.testing.assert_allclose(level.towards, -amplitudes.T @ np.linalg.solve(whole, residuals), rtol=1e-7)
        informed = np.linalg.inv(unknowns.T @ np.linalg.solve(noise, unknowns) + np.diag(prior**-2))
        likely = -informed @ unknowns.T @ np.linalg.solve(noise, np.column_stack([residuals, amplitudes]))
        np.testing.assert_allclose(level.unknowns, likely[:, 0], rtol=1e-6)
        np.testing.assert_allclose(level.by_amplitudes, likely[:, 1:], rtol=1e-6)


def _level(
    precision: FloatArray | list[list[float]], towards: FloatArray | list[float], log_evidence: float = -7.0
) -> Level:
    nothing = np.zeros(0)
    return Level(
        DiscrepancyLevel(0.0, 60.0, 0.0), log_evidence, np.array(precision), np.array(towards), nothing, nothing
    )


def _prior_density(value: float, amplitude: Amplitude) -> float:
    if amplitude.one_sided and value < 0:
        return 0.0
    sides = 2.0 if amplitude.one_sided else 1.0
    return sides * sum(share * float(norm.pdf(value, 0.0, times * amplitude.usual)) for times, share in AMPLITUDES)


@pytest.mark.parametrize("one_sided", [False, True])
@pytest.mark.parametrize("towards", [-3.0, 0.0, 0.4, 6.0])
def test_one_amplitude_against_numerical_integration(towards: float, one_sided: bool) -> None:
    amplitude, level = Amplitude(0.7, one_sided), _level([[2.5]], [towards])

    def integrand(a: float) -> float:
        return float(np.exp(towards * a - 0.5 * 2.5 * a**2)) * _prior_density(a, amplitude)

    integral = quad(integrand, 0.0 if one_sided else -20.0, 20.0, epsabs=0, epsrel=1e-10, points=[towards / 2.5, 0.0])
    assert together(level, [amplitude]).log_evidence == pytest.approx(-7.0 + float(np.log(integral[0])), abs=1e-8)


@pytest.mark.parametrize(
    ("one_sided", "coupling"), [((False, False), -1.5), ((False, True), 0.0), ((True, True), 0.0)], ids=str
)
def test_two_amplitudes_against_numerical_integration(one_sided: tuple[bool, bool], coupling: float) -> None:
    one, other = (Amplitude(usual, sided) for usual, sided in zip((0.7, 1.3), one_sided, strict=True))
    precision, towards = np.array([[2.5, coupling], [coupling, 1.8]]), np.array([1.2, -0.5])
    assert together(_level(precision, towards), [one, other]).log_evidence == pytest.approx(
        -7.0 + float(np.log(_over_the_plane(precision, towards, one, other))), abs=1e-6
    )


@pytest.mark.parametrize("coupling", [-1.8, 1.8])
@pytest.mark.parametrize("towards", [(0.0, 0.0), (3.0, 3.0), (6.0, -2.0)])
def test_two_signs_that_hang_together_are_taken_by_themselves_at_little_loss(
    coupling: float, towards: tuple[float, float]
) -> None:
    """Both at least zero and nearly collinear: less than a factor of two is lost, where twenty decide."""
    precision = 4.0 * np.array([[2.5, coupling], [coupling, 1.8]])
    both = (Amplitude(0.7, True), Amplitude(1.3, True))
    exact = float(np.log(_over_the_plane(precision, np.array(towards), *both)))
    assert together(_level(precision, list(towards)), both).log_evidence + 7.0 == pytest.approx(exact, abs=np.log(2.0))


def _over_the_plane(precision: FloatArray, towards: FloatArray, one: Amplitude, other: Amplitude) -> float:
    """Likelihood times prior of two amplitudes, integrated by Gauss's rule on panels that end at zero."""
    nodes, weights = np.polynomial.legendre.leggauss(40)
    edges = np.array([-40.0, -12.0, -4.0, -1.5, -0.5, 0.0, 0.5, 1.5, 4.0, 12.0, 40.0])
    half, middle = np.diff(edges)[:, None] / 2, (edges[1:] + edges[:-1])[:, None] / 2
    x, share = (middle + half * nodes).ravel(), (half * weights).ravel()
    of_one, of_other = (share * [_prior_density(value, each) for value in x.tolist()] for each in (one, other))
    exponent = np.add.outer(
        towards[0] * x - 0.5 * precision[0, 0] * x**2, towards[1] * x - 0.5 * precision[1, 1] * x**2
    )
    return float(of_one @ np.exp(exponent - precision[0, 1] * np.outer(x, x)) @ of_other)


def test_amplitudes_that_no_data_hold_change_nothing() -> None:
    nothing = _level([[0.0, 0.0], [0.0, 0.0]], [0.0, 0.0])
    both = [Amplitude(1.0, False), Amplitude(5.0, True)]
    assert together(nothing, both).log_evidence == pytest.approx(-7.0)
    assert together(nothing, []).log_evidence == -7.0


@given(
    towards=st.floats(-30.0, 30.0),
    precision=st.floats(0.0, 100.0),
    usual=st.floats(1e-3, 1e3),
    one_sided=st.booleans(),
)
def test_a_candidates_factor_is_that_of_its_amplitude_alone(
    towards: float, precision: float, usual: float, one_sided: bool
) -> None:
    amplitude = Amplitude(usual, one_sided)
    alternatives = _level(np.array([precision]), [towards])
    (factor,) = log_bayes_factors(alternatives, [amplitude])
    joint = together(_level([[precision]], [towards]), [amplitude]).log_evidence
    assert factor == pytest.approx(joint + 7.0, rel=1e-9, abs=1e-6)  # of terms of 1e8 that cancel


# --- Priors on effects and places -------------------------------------------------------------------


def _total(found: Sequence[Candidate]) -> float:
    return float(np.exp(log_priors(found)).sum())


COLUMNS = ["temperature.ambient", "power.a", "power.b", "torque.a", "torque.b", "velocity.a", "velocity.b"]
EVEN = LACKING_SOMETHING / (1.0 - LACKING_SOMETHING)


@pytest.mark.parametrize("runs", [(), ("monday", "tuesday")], ids=["one run", "two runs"])
def test_prior_odds_of_all_candidates_are_those_that_something_is_missing(runs: tuple[str, ...]) -> None:
    assert _total(candidates(leg(), COLUMNS, runs)) == pytest.approx(EVEN)


def test_an_effects_prior_is_split_evenly_over_its_levels_and_their_places() -> None:
    joints = ("FL_hip", "FL_calf", "FR_hip", "FR_calf")
    links = (link("{leg}_hip", "{leg}_calf"), link("*_*", "ambient"))
    network = Network("legs", (node("*_*"), AMBIENT), links, (effect("copper_loss"),), joints=joints)
    found = candidates(network, ["temperature.ambient", *(f"torque.{joint}" for joint in joints)])
    odds = dict(zip((each.key for each in found), np.exp(log_priors(found)).tolist(), strict=True))
    own = {at: value for (key, at), value in odds.items() if key == "constant_heat"}
    assert set(own) == {*joints, "*_hip", "*_calf", "*"}
    assert sum(own[joint] for joint in joints) == pytest.approx(own["*"])
    assert own["*_hip"] + own["*_calf"] == pytest.approx(own["*"])
    assert own["*_hip"] == pytest.approx(own["*_calf"])
    # On all legs at once is no single place.
    position = {at: value for (key, at), value in odds.items() if key == "sensor_position"}
    legs, single = ([value for at, value in position.items() if ("{" in at) == shared] for shared in (True, False))
    assert len(legs) == 2
    assert len(single) == 4
    assert sum(legs) == pytest.approx(sum(single))
    assert sum(own.values()) == pytest.approx(2.0 * sum(v for (key, _), v in odds.items() if key == "sensor_offset"))


# --- The evidence of fitted models ----------------------------------------------------------------


_HEAT = effect("heat_input", "*")
HEATED = (replace(_HEAT, parameters=(replace(_HEAT.parameters[0], fixed=True),)),)  # a logged watt is a watt
ADDED = effect("constant_heat", "b", power=1.5)
LENGTHS = (90, 60, 75)
NOISE = 0.05  # K


def _truth(extra: Sequence[EffectDeclaration] = (), lengths: Sequence[int] = LENGTHS, step: float = 10.0) -> list[Run]:
    """Runs of two nodes in air, heated by logged powers; with noise, and effects that a model may lack."""
    model, rng, runs = Model(two_nodes([*HEATED, *extra])), np.random.default_rng(21), []
    for number, length in enumerate(lengths):
        run = random_run(model, length, number, step=step)
        readings = simulate(model, bind(model, run), model.values).readings
        noisy = readings + rng.normal(0.0, NOISE, readings.shape)
        columns = dict(run.columns) | {f"temperature.{name}": row for name, row in zip(NODES, noisy, strict=True)}
        runs.append(replace(run, name=f"run{number}", columns=columns))
    return runs


@pytest.fixture(scope="module")
def data() -> DataSplit:
    """Three runs in which node b makes heat of its own."""
    return split_data(_truth([ADDED]))


@pytest.fixture(scope="module")
def given_fit(data: DataSplit) -> Fit:
    """The model without that heat."""
    return fit_segments(Model(two_nodes(HEATED)), data.fit)


@pytest.fixture(scope="module")
def larger_fit(given_fit: Fit) -> Fit:
    """The model with it."""
    return refit(given_fit, ADDED)


def _columns(done: Fit) -> list[str]:
    return list(done.problem.bound_runs[0].run.columns)


def test_a_hidden_effect_raises_the_evidence_and_its_size_is_that_of_the_truth(given_fit: Fit, larger_fit: Fit) -> None:
    noise = Noise(np.full(2, NOISE), np.zeros(2))  # as it is; runs so short hold it to a tenth only
    likelihood = Likelihood(replace(given_fit, noise=noise), _columns(given_fit))
    without, within = likelihood.of(given_fit), likelihood.of(larger_fit, [ADDED])
    assert within.log_evidence > without.log_evidence + 10.0
    assert within.enough == max(within.sizes)
    assert without.enough < 0.01
    assert within.discrepancy < NEGLIGIBLE < without.discrepancy
    ((mean, deviation),) = within.amplitudes.values()
    assert abs(mean - 1.5) < 3.0 * deviation < 1.0


def test_a_fit_moved_off_its_optimum_has_the_same_evidence(given_fit: Fit, larger_fit: Fit) -> None:
    likelihood, rng = Likelihood(given_fit, _columns(given_fit)), np.random.default_rng(4)
    for done, added in ((given_fit, []), (larger_fit, [ADDED])):
        expected = likelihood.of(done, added)
        for _ in range(3):
            moved = replace(done, z=done.z + rng.normal(0.0, 0.05, done.z.shape))
            assert moved.problem.cost(moved.z) > done.cost + 5.0
            found = likelihood.of(moved, added)
            assert found.log_evidence == pytest.approx(expected.log_evidence, abs=0.05)
            np.testing.assert_allclose(
                list(found.amplitudes.values()), np.array(list(expected.amplitudes.values())), rtol=0.02
            )


@settings(max_examples=5)
@given(order=st.permutations(range(len(LENGTHS))))
def test_the_order_of_runs_changes_no_evidence(order: list[int], given_fit: Fit, larger_fit: Fit) -> None:
    def permuted(done: Fit) -> Fit:
        problem, point = done.problem, done.point
        other = Problem(done.model, [problem.bound_runs[k] for k in order], problem.sigma)
        return replace(done, problem=other, z=other.guess(point.values, [point.starts[k] for k in order]))

    columns = _columns(given_fit)
    one = Likelihood(given_fit, columns).of(larger_fit, [ADDED])
    other = Likelihood(permuted(given_fit), columns).of(permuted(larger_fit), [ADDED])
    assert other.log_evidence == pytest.approx(one.log_evidence, rel=1e-9)
    np.testing.assert_allclose(list(other.amplitudes.values()), np.array(list(one.amplitudes.values())), rtol=1e-6)
    np.testing.assert_allclose(other.sizes, one.sizes, atol=1e-9)


# --- Calibration: truths drawn from the prior --------------------------------------------------------


def _drawn_answers(draws: int) -> tuple[FloatArray, FloatArray]:
    """Stated probability that a constant heat at b is there, and whether it is, shape (draws,) each.

    A model of two nodes, linear: unknown losses and initial temperatures, noise, and a discrepancy of a drawn size.
    """
    rng = np.random.default_rng(6)
    time = np.arange(0.0, 1800.0, 20.0)
    bound = _gappy_runs(20.0, (len(time),))
    full = replace(bound[0], counted=np.ones_like(bound[0].counted), measured=np.nan_to_num(bound[0].measured, nan=25))
    noise, sigma = Noise(np.array([0.1, 0.1]), np.zeros(2)), np.ones(2)
    whitening = Whitening([full], sigma, noise, MISSED)
    apart = np.abs(np.subtract.outer(time, time))
    slow, fast = np.exp(-time / 800.0), np.exp(-time / 300.0)
    nothing = np.zeros_like(time)
    # Derivatives by the loss of a and of b, and by their initial temperatures; b takes a little of a's.
    unknowns = np.array(
        [
            np.r_[9.0 * (1 - fast), 2.0 * (1 - slow)],
            np.r_[nothing, 5.0 * (1 - slow) * (1 + 0.3 * np.sin(time / 150.0))],
            np.r_[fast, 0.2 * (slow - fast)],
            np.r_[nothing, slow],
        ]
    ).T
    prior = np.array([1.0, 1.0, 10.0, 10.0])
    trace = np.r_[0.1 * (1 - slow), (1 - slow)][:, None]
    known = Amplitude(0.3, True)
    multiples, shares = np.array(AMPLITUDES).T
    probabilities = np.exp([level.log_prior for level in whitening.levels])
    stated, present = np.zeros(draws), rng.uniform(size=draws) < 0.5
    for number in range(draws):
        level = whitening.levels[rng.choice(len(probabilities), p=probabilities / probabilities.sum())]
        size = abs(rng.normal(0.0, known.usual * rng.choice(multiples, p=shares)))
        root = np.linalg.cholesky(np.exp(-apart / level.time_constant) + 1e-10 * np.eye(len(time)))
        discrepancy = (level.size * MISSED[:, None] * (rng.normal(size=(2, len(time))) @ root.T)).ravel()
        error = unknowns @ (prior * rng.normal(size=4)) + trace[:, 0] * size * present[number]
        error += discrepancy + rng.normal(0.0, 0.1, 2 * len(time))
        levels = levels_of(whitening, -error, unknowns, prior, trace)
        logs = np.array([[together(each, [known]).log_evidence, each.log_evidence] for each in levels])
        one, other = np.logaddexp.reduce(logs, axis=0)
        stated[number] = 1.0 / (1.0 + np.exp(other - one))
    return stated, present.astype(float)


def test_probabilities_are_as_often_right_as_they_state() -> None:
    stated, present = _drawn_answers(60)
    spread = float(np.sqrt((stated * (1 - stated)).sum()))
    assert abs((present - stated).sum()) < 2.5 * spread
    for chosen in (stated < 0.5, stated >= 0.5):
        expected, variance = stated[chosen].sum(), (stated[chosen] * (1 - stated[chosen])).sum()
        assert abs(present[chosen].sum() - expected) < 2.5 * np.sqrt(variance) + 0.5
    # And they say something: far better than an even guess, whose mean square error is a quarter.
    assert np.mean((stated - present) ** 2) < 0.2


# --- Edges that later effects need ---------------------------------------------------------------------


def test_an_edge_that_a_later_effect_needs_is_not_pruned() -> None:
    """A sensor that reads its neighbour needs the exchange of heat with it, which an effect before it made."""
    added = [effect("conduction", "a~b", conductance=0.4), effect("sensor_position", "a~b", fraction=0.3)]
    data = split_data(_truth(added))
    fits = [fit_segments(Model(two_nodes(HEATED)), data.fit)]
    for each in added:
        fits.append(refit(fits[-1], each))
    branch = tuple(Step(done, declaration) for done, declaration in zip(fits, [None, *added], strict=True))
    kept = _pruned(branch, data, lambda _: None)
    assert {step.key for step in kept[1:]} == {("conduction", "a~b"), ("sensor_position", "a~b")}
    with pytest.raises(InputError):
        fits[-1].model.network.without_effect("conduction", "a~b")
