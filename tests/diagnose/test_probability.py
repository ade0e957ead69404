"""Probabilities of fitted models: what the data say, what is thought beforehand, and how far blocks scatter."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from lptn.diagnose.candidates import candidates
from lptn.diagnose.probability import (
    _off_in_use,
    in_occams_window,
    is_implausible,
    log_evidence_of_starts,
    log_odds_by_score,
    log_prior_of_sizes,
    log_prior_of_starts,
    log_priors,
    probabilities,
    probabilities_by_score,
)
from lptn.diagnose.scores import Scores, score
from lptn.effects import catalogue
from lptn.identify.data import split_data
from lptn.identify.fitting import Fit, fit
from lptn.identify.validation import fit_segments
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, Network
from lptn.simulate.bound_run import bind
from lptn.simulate.simulation import simulate
from tests.builders import AMBIENT, effect, link, node, random_run, two_nodes

NOISE = 0.05  # K
COLUMNS = ["temperature.ambient", "power.a", "power.b", "torque.a", "torque.b", "velocity.a", "velocity.b"]


HEATED = two_nodes([effect("heat_input")])


def run_with(extra: FloatArray, seed: int = 0, noise: float = NOISE) -> Run:
    """An hour of two heated nodes with something added to what node a reads [K], shape (n,)."""
    model = Model(HEATED)
    run = random_run(model, len(extra), seed=seed, step=5.0)
    readings = simulate(model, bind(model, run), model.values).readings
    readings = readings + np.random.default_rng(seed).normal(0.0, noise, readings.shape)
    columns = {f"temperature.{name}": row for name, row in zip(model.nodes, readings, strict=True)}
    columns["temperature.a"] = columns["temperature.a"] + extra
    return replace(run, columns={**run.columns, **columns})


def fit_of(run: Run, *added: EffectDeclaration) -> Fit:
    """The two nodes with some effects, fitted to the run."""
    return fit_segments(Model(HEATED.with_effects(added)), split_data([run]).fit)


STEPS = 720


def test_equal_fits_share_the_probability_as_thought_beforehand() -> None:
    one = fit_of(run_with(np.zeros(STEPS)))
    shares = probabilities([one, one, one], np.log([1.0, 2.0, 5.0]))
    assert shares == pytest.approx([1 / 8, 2 / 8, 5 / 8])
    assert in_occams_window(probabilities([one, one], np.log([1.0, 21.0]))) == [1]
    assert in_occams_window(probabilities([one, one], np.log([1.0, 19.0]))) == [1, 0]


def test_a_parameter_off_its_prior_counts_in_standard_deviations_however_quiet_the_sensors_are() -> None:
    def fit_with_prior(mean: float) -> Fit:
        (heat,) = HEATED.effects
        gain = replace(heat.resolved["gain"], fixed=False, prior=(mean, 0.1))
        first, *others = HEATED.nodes
        assert first.capacity is not None
        fixed = replace(first, capacity=replace(first.capacity, fixed=True))  # so that the data tell the gain
        given = Model(replace(HEATED, nodes=(fixed, *others), effects=(replace(heat, parameters=(gain,)),)))
        return fit_segments(given, split_data([run_with(np.zeros(STEPS), noise=0.002)]).fit)

    at_mean, off = fit_with_prior(1.0), fit_with_prior(1.2)
    assert at_mean.rmse == pytest.approx(off.rmse, rel=0.01)
    odds = probabilities([at_mean, off], np.zeros(2))
    assert odds[0] / odds[1] == pytest.approx(np.exp(0.5 * 2.0**2), rel=0.5)


def test_a_parameter_that_explains_nothing_is_paid_for() -> None:
    run = run_with(np.zeros(STEPS))
    plain, offset = fit_of(run), fit_of(run, effect("sensor_offset", "a", offset=0.1))
    of_plain, of_offset = probabilities([plain, offset], np.zeros(2))
    assert 0.8 < of_plain < 0.999
    assert of_plain + of_offset == pytest.approx(1.0)


def test_what_all_blocks_say_is_sure_and_what_one_says_is_not() -> None:
    """The same gain in one stretch of the run is no more than an accident of it."""
    throughout, once = np.linspace(0.0, 1.0, STEPS), np.zeros(STEPS)
    once[-60:] = 1.0
    sure, unsure = (
        [fit_of(run_with(extra)), fit_of(run_with(extra), effect("sensor_drift", "a", rate=0.5))]
        for extra in (throughout, once)
    )
    assert probabilities(sure, np.zeros(2))[1] > 0.99
    assert probabilities(unsure, np.zeros(2))[1] < 0.9


def _scored(run: Run) -> tuple[Scores, Fit]:
    done = fit_of(run)
    return score(done, candidates(HEATED, run.columns, ["run"])), done


@pytest.mark.parametrize(
    ("kelvin", "least", "most"),
    [(0.0, 0.97, 0.9999), (0.08, 0.4, 0.9), (0.3, 0.0, 0.01)],
    ids=["no", "faint", "plain"],
)
def test_nothing_is_the_less_probable_the_more_a_candidate_scores(kelvin: float, least: float, most: float) -> None:
    scores, done = _scored(run_with(np.linspace(0.0, kelvin, STEPS)))
    shares = probabilities_by_score(done, scores.ranked, 3.0)
    assert least <= 1 - shares.sum() < most
    assert (shares >= 0).all()
    # However often the candidates are counted, nothing is as probable beforehand as all of them.
    twice = probabilities_by_score(done, [*scores.ranked, *scores.ranked], 3.0)
    assert twice.sum() == pytest.approx(shares.sum(), abs=1e-6)


def test_scores_are_the_same_whether_or_not_the_scale_of_all_heat_is_known() -> None:
    """It is a combination of parameters that moves no temperature; rounding made a direction of it."""
    run = run_with(np.linspace(0.0, 0.08, STEPS))
    scores, done = _scored(run)
    gains = [index for index in done.problem.free if "gain" in done.model.parameters[index].name]
    assert len(gains) == 2
    others = [index for index in done.problem.free if index not in gains]
    held = fit(done.model, done.problem.bound_runs, sigma=done.problem.sigma, guess=done.point, free=others)
    reference = score(held, candidates(HEATED, run.columns, ["run"]))
    expected = {scored.candidate.key: scored.gain for scored in reference.ranked}
    assert {scored.candidate.key: scored.gain for scored in scores.ranked} == pytest.approx(
        expected, rel=1e-3, abs=1e-3
    )


def test_no_score_asks_for_more_than_an_amplitude_may_be() -> None:
    """Convection grows no faster with temperature than nature lets it, however far the readings stay behind."""
    scores, done = _scored(run_with(np.linspace(0.0, -40.0, STEPS)))
    squares = float(np.sum(done.problem.residuals(done.z) ** 2))
    at_an_end = 0
    for scored in scores.ranked:
        lower, upper = scored.candidate.room
        assert lower <= scored.amplitude <= upper
        assert 0.0 <= scored.gain <= squares
        at_an_end += scored.gain > 0 and scored.amplitude == upper
    assert at_an_end


def test_what_is_refitted_is_the_more_probable_of_what_scores_alike() -> None:
    scores, done = _scored(run_with(np.linspace(0.0, 0.5, STEPS)))
    drift = next(scored for scored in scores.ranked if scored.candidate.key == ("sensor_drift", "a"))
    usual = float(log_odds_by_score(done, [drift], np.zeros(1))[0])
    large = replace(drift, candidate=replace(drift.candidate, sizes=(0.01 * drift.candidate.typical,)))
    assert log_odds_by_score(done, [large], np.zeros(1))[0] == pytest.approx(usual - 3.0, abs=0.3)  # hardly believed
    assert log_odds_by_score(done, [drift], np.full(1, -2.0))[0] == pytest.approx(usual - 2.0)
    assert log_odds_by_score(done, [replace(drift, gain=0.5 * drift.gain)], np.zeros(1))[0] < usual


def test_what_would_not_show_and_what_does_not_matter_are_nothing() -> None:
    scores, done = _scored(run_with(np.zeros(STEPS)))
    unseen = [replace(scored, per_unit=1e-9 * scored.per_unit) for scored in scores.ranked]
    assert probabilities_by_score(done, unseen, 3.0).sum() < 1e-6
    assert probabilities_by_score(done, scores.ranked, 1e4).sum() < 1e-6


def test_a_hidden_mass_that_begins_far_from_its_node_is_paid_for() -> None:
    """A slow decay from the start of the log is no mass, though one that began 30 K off would leave it."""
    plain, decay = run_with(np.zeros(STEPS)), run_with(6.0 * np.exp(-np.arange(STEPS) * 5.0 / 400.0))
    mass = effect("second_mass", "a", capacity=60.0, time_constant=400.0)
    explained = fit_of(decay, mass)
    assert explained.rmse < 0.6 * fit_of(decay).rmse
    assert log_evidence_of_starts(explained) < -np.log(20.0)
    assert -np.log(20.0) < log_evidence_of_starts(fit_of(plain, mass)) < 0.0


def test_a_start_that_no_reading_holds_costs_nothing() -> None:
    plain = run_with(np.zeros(STEPS))
    assert log_evidence_of_starts(fit_of(plain)) == 0.0
    lagging = fit_of(plain, effect("sensor_lag", "a", time_constant=3.0))
    assert log_evidence_of_starts(lagging) == pytest.approx(0.0, abs=0.1)


def run_read_late(late: EffectDeclaration) -> Run:
    """Most of an hour of two heated nodes with a late sensor."""
    model = Model(HEATED.with_effects([late]))
    run = random_run(model, STEPS, step=5.0)
    readings = simulate(model, bind(model, run), model.values).readings
    readings = readings + np.random.default_rng(0).normal(0.0, NOISE, readings.shape)
    columns = {f"temperature.{name}": row for name, row in zip(model.nodes, readings, strict=True)}
    return replace(run, columns={**run.columns, **columns})


def test_a_sensor_that_forgets_within_seconds_begins_in_equilibrium() -> None:
    """Its start is an unknown that readings hold to a few hundredths of a kelvin, and nobody doubts it."""

    def evidence(seconds: float) -> float:
        late = effect("sensor_lag", "a", time_constant=seconds)
        return log_evidence_of_starts(fit_of(run_read_late(late), late))

    assert evidence(8.0) > -0.1
    assert evidence(300.0) < -0.4


def test_behind_a_gap_a_sensor_is_as_likely_late_as_not() -> None:
    """When its log begins a robot mostly goes on as before; behind a gap it was at work."""
    late = effect("sensor_lag", "a", time_constant=60.0)
    run = run_read_late(late).slice(125.0, 3600.0)  # from a minute after a change of the load on
    at_begin, behind_a_gap = (
        log_evidence_of_starts(fit_of(replace(run, log_start=begin), late)) for begin in (125.0, 0.0)
    )
    assert behind_a_gap - at_begin == pytest.approx(np.log(2.0), abs=0.05)


def test_a_hidden_state_is_as_far_off_as_it_is_in_use() -> None:
    """Where it acts, and begun in equilibrium; what rests with no node is off by what a start allows."""
    late = effect("sensor_lag", "a", time_constant=60.0)
    run = run_read_late(late)
    twice = split_data([replace(run, name="monday"), replace(run, name="tuesday")]).fit
    for own in ("", "monday"):
        lagging = fit_segments(Model(HEATED.with_effects([replace(late, run=own)])), twice)
        states = simulate(lagging.model, lagging.problem.bound_runs[0], lagging.point.values).states
        usual = float(np.sqrt(np.mean((states[2] - states[0]) ** 2)))
        assert _off_in_use(lagging) == pytest.approx([usual], rel=0.03)
    decay = run_with(6.0 * np.exp(-np.arange(STEPS) * 5.0 / 400.0))  # a start some 30 K off says nothing for itself
    assert _off_in_use(fit_of(decay, effect("second_mass", "a", capacity=60.0, time_constant=400.0)))[0] < 3.0
    outdoors = fit_of(run, effect("ambient_lag", "ambient"))
    assert np.isinf(_off_in_use(outdoors)).all()


def test_where_nothing_is_off_equilibrium_in_use_no_start_is() -> None:
    """A start that noise alone moves loses what it explains, a quarter, whichever of the two it is taken for."""
    late = effect("sensor_lag", "a", time_constant=60.0)
    whole, begin = run_read_late(late), STEPS - 300
    still = {name: 0.0 * column if name.startswith("power") else column for name, column in whole.columns.items()}
    model = Model(HEATED.with_effects([late]))
    readings = simulate(model, bind(model, replace(whole, columns=still)), model.values).readings[:, begin:]
    readings = readings + np.random.default_rng(1).normal(0.0, NOISE, readings.shape)
    read = {f"temperature.{name}": row for name, row in zip(model.nodes, readings, strict=True)}
    resting = replace(whole, columns=still).slice(5.0 * begin, 5.0 * STEPS)
    resting = replace(resting, columns={**resting.columns, **read}, log_start=0.0)
    assert -0.5 < log_evidence_of_starts(fit_of(resting, late)) < -0.1


def run_begun_at(*above: float, extra: float = 0.0) -> Run:
    """An hour of two heated nodes that begin so much above the air [K]; what node a reads is off by `extra` [K]."""
    model = Model(HEATED)
    run = random_run(model, STEPS, step=5.0)
    air = run.columns["temperature.ambient"]
    begun = {f"temperature.{name}": air[:1] + kelvin for name, kelvin in zip(model.nodes, above, strict=True)}
    begun = {name: np.repeat(value, STEPS) for name, value in begun.items()}
    readings = simulate(model, bind(model, replace(run, columns={**run.columns, **begun})), model.values).readings
    readings = readings + np.array([[extra], [0.0]]) + np.random.default_rng(1).normal(0.0, NOISE, readings.shape)
    read = {f"temperature.{name}": row for name, row in zip(model.nodes, readings, strict=True)}
    return replace(run, columns={**run.columns, **read})


def test_a_robot_begins_at_rest_or_warm_and_none_of_its_nodes_cold() -> None:
    at_rest, one_warm, one_cold, carried_in, warm, as_warm = (
        log_prior_of_starts(fit_of(run_begun_at(*above)))
        for above in [(0.0, 0.0), (0.0, 4.0), (0.0, -4.0), (-4.0, -4.0), (20.0, 24.0), (21.0, 24.0)]
    )
    assert at_rest - np.log(50.0) < one_warm < at_rest - np.log(5.0)  # it worked before, or reads off
    assert one_cold < one_warm - np.log(10.0)
    assert carried_in > one_cold
    assert warm == pytest.approx(as_warm, abs=0.3)  # how warm a robot was is nothing that anyone knows


def test_what_a_sensor_reads_before_anything_runs_tells_its_error() -> None:
    """Four kelvins from the start are the sensor's; one that reads as the air does has no such error."""
    offset = effect("sensor_offset", "a", offset=4.0)
    reads_off, reads_well = run_begun_at(0.0, 0.0, extra=4.0), run_begun_at(-4.0, 0.0, extra=4.0)
    assert log_prior_of_starts(fit_of(reads_off, offset)) > log_prior_of_starts(fit_of(reads_off)) + np.log(5.0)
    assert log_prior_of_starts(fit_of(reads_well, offset)) < log_prior_of_starts(fit_of(reads_well)) - np.log(20.0)


@pytest.mark.parametrize("runs", [(), ("monday", "tuesday")], ids=["one run", "two runs"])
def test_an_effects_candidates_share_its_odds(runs: tuple[str, ...]) -> None:
    proposed = candidates(HEATED, COLUMNS, runs)
    odds = np.exp(log_priors(proposed))
    for stated in {candidate.effect for candidate in proposed}:
        of_all = [
            value
            for candidate, value in zip(proposed, odds, strict=True)
            if candidate.effect is stated and not candidate.run
        ]
        of_one = [
            value
            for candidate, value in zip(proposed, odds, strict=True)
            if candidate.effect is stated and candidate.run
        ]
        assert sum(of_all) == pytest.approx(stated.prior_odds)
        assert sum(of_one) == pytest.approx(0.1 * stated.prior_odds if of_one else 0.0)


def test_the_clock_of_one_logger_is_rarely_off() -> None:
    apart, alike = (
        next(
            value
            for candidate, value in zip(proposed, log_priors(proposed), strict=True)
            if candidate.effect.key == "clock_offset" and not candidate.run
        )
        for proposed in (candidates(HEATED, COLUMNS), candidates(HEATED, COLUMNS, joined=[]))
    )
    assert alike == pytest.approx(apart + np.log(0.03))


def test_levels_share_evenly_and_one_run_is_rarer() -> None:
    joints = ("FL_hip", "FL_calf", "FR_hip", "FR_calf")
    links = (link("{leg}_hip", "{leg}_calf"), link("*_*", "ambient"))
    network = Network("legs", (node("*_*"), AMBIENT), links, (effect("copper_loss"),), joints=joints)
    proposed = candidates(network, ["temperature.ambient", *(f"torque.{joint}" for joint in joints)], ("mon", "tue"))
    odds = dict(zip((candidate.key for candidate in proposed), np.exp(log_priors(proposed)).tolist(), strict=True))
    own = {at: value for (key, at), value in odds.items() if key == "constant_heat"}
    assert sum(own[joint] for joint in joints) == pytest.approx(own["*"])
    assert own["*_hip"] == pytest.approx(own["*_calf"])
    assert own["*_hip"] + own["*_calf"] + own["FL_*"] + own["FR_*"] == pytest.approx(own["*"])
    assert sum(own[f"{joint}@{run}"] for joint in joints for run in ("mon", "tue")) == pytest.approx(0.1 * own["*"])
    errors = {at: value for (key, at), value in odds.items() if key == "sensor_drift"}
    assert errors["*"] == pytest.approx(0.1 * sum(errors[joint] for joint in joints))  # a defect befalls one sensor
    assert errors["*_hip"] + errors["*_calf"] == pytest.approx(errors["*"])
    material = {at: value for (key, at), value in odds.items() if key == "radiation"}
    assert sum(material[joint] for joint in joints) == pytest.approx(0.3 * material["*"])  # one bare joint is rare


def test_one_of_unlike_parts_may_radiate_alone() -> None:
    names = ("motor", "gearbox", "computer")
    heat = (effect("copper_loss", "motor"), effect("heat_input", "computer"))
    network = Network("unlike", (*map(node, names), AMBIENT), tuple(link(name, "ambient") for name in names), heat)
    proposed = candidates(network, ["temperature.ambient", "torque.motor", "power.computer"])
    odds = dict(zip((candidate.key for candidate in proposed), np.exp(log_priors(proposed)).tolist(), strict=True))
    assert odds["radiation", "gearbox"] == pytest.approx(odds["constant_heat", "gearbox"])


def at_size(key: str, name: str, share: float, at: str = "a") -> tuple[Fit, EffectDeclaration]:
    """A fit with an effect at so many times its usual size, and the effect."""
    declared = effect(key, at)
    if at == "*":  # one size for all places, as a candidate has it
        declared = replace(declared, parameters=tuple(replace(each, share="all") for each in declared.parameters))
    fitted = fit_of(run_with(np.zeros(STEPS)), declared)
    values = fitted.model.values
    own = declared.shared_name(name) if at == "*" else f"{key}.{name}.{at}"
    values[[parameter.name for parameter in fitted.model.parameters].index(own)] = share * next(
        parameter.typical for parameter in declared.parameters if parameter.name == name
    )
    return replace(fitted, model=fitted.model.with_values(values)), declared


@pytest.mark.parametrize(("share", "logarithm"), [(1.0, 0.0), (3.0, -1.0), (1 / 81, -4.0), (9.0, -2.0), (28.0, None)])
def test_sizes_of_things_are_plausible_by_factors_of_three(share: float, logarithm: float | None) -> None:
    fitted, declared = at_size("constant_heat", "power", share)
    assert is_implausible(fitted, [declared], fitted) == (logarithm is None)
    if logarithm is not None:
        assert log_prior_of_sizes(fitted, [declared]) == pytest.approx(logarithm)
    assert log_prior_of_sizes(fitted, []) == 0.0


@pytest.mark.parametrize(("share", "logarithm"), [(0.01, 0.0), (3.0, -0.5), (-6.0, -2.0), (-9.1, None), (9.1, None)])
def test_errors_of_either_sign_are_normal_about_none(share: float, logarithm: float | None) -> None:
    fitted, declared = at_size("sensor_drift", "rate", share)
    assert is_implausible(fitted, [declared], fitted) == (logarithm is None)
    if logarithm is not None:
        assert log_prior_of_sizes(fitted, [declared]) == pytest.approx(logarithm, abs=1e-4)


@pytest.mark.parametrize(
    ("kind", "at"), [("sensor_offset", "a"), ("sensor_offset", "*"), ("ambient_offset", "ambient")]
)
@pytest.mark.parametrize(("share", "logarithm"), [(-6.0, -2.0), (9.0, -4.5), (40.0, -4.5), (-273.0, -4.5)])
def test_a_shift_beyond_calibration_is_as_rare_whatever_its_size(
    kind: str, at: str, share: float, logarithm: float
) -> None:
    """Bytes with an offset and other units befall all sensors of a kind, errors of calibration a single one."""
    fitted, declared = at_size(kind, "offset", share, at)
    assert not is_implausible(fitted, [declared], fitted)
    common = np.log(10.0) if at == "*" and abs(share) > 9 else 0.0
    assert log_prior_of_sizes(fitted, [declared]) == pytest.approx(logarithm + common, abs=1e-4)


@pytest.mark.parametrize(
    ("kind", "usual", "change", "believed"),
    [
        ("surface_scale", 0.3, 2.0, True),
        ("surface_scale", 0.3, 9.0, True),
        ("surface_scale", 0.3, -0.8, True),
        ("surface_scale", 0.3, -0.9, False),
        ("surface_scale", 0.3, 12.0, False),
        ("heat_scale", 0.2, 3.0, True),
        ("heat_scale", 0.2, 4.5, False),
    ],
)
def test_factors_vary_by_so_many_times_their_usual_change(
    kind: str, usual: float, change: float, believed: bool
) -> None:
    fitted, declared = at_size(kind, "change", change / usual)
    assert is_implausible(fitted, [declared], fitted) != believed
    expected = -abs(np.log(1 + change)) / (3 * np.log(1 + usual))
    assert log_prior_of_sizes(fitted, [declared]) == pytest.approx(expected)


@pytest.mark.parametrize(
    ("kind", "at", "parameter", "size", "believed"),
    [
        ("natural_convection", "a", "beta", 0.04, True),
        ("natural_convection", "a", "beta", 0.05, False),
        ("natural_convection", "a", "beta", 0.0, True),
        ("ambient_lag", "ambient", "fraction", 1.0, True),
    ],
)
def test_what_went_as_far_as_nature_lets_it_is_not_believed(
    kind: str, at: str, parameter: str, size: float, believed: bool
) -> None:
    """But for where an effect vanishes, and for all of a share."""
    typical = next(definition.typical for definition in catalogue()[kind].parameters if definition.name == parameter)
    fitted, declared = at_size(kind, parameter, size / typical, at)
    assert is_implausible(fitted, [declared], fitted) != believed


@pytest.mark.parametrize(("delay", "believed"), [(-2.0, False), (2.4, False), (2.6, True), (-20.0, True)])
def test_no_clock_is_known_to_less_than_half_a_step(delay: float, believed: bool) -> None:
    """Nobody says whether a row of 5 s is stamped where it begins or where it ends."""
    fitted, declared = at_size("clock_offset", "delay", delay / 10.0)
    assert is_implausible(fitted, [declared], fitted) != believed


@pytest.mark.parametrize(("share", "believed"), [(0.5, True), (-0.5, True), (-1.5, False)])
def test_no_place_takes_back_more_than_it_has_in_common_with_others(share: float, believed: bool) -> None:
    common, own = effect("constant_heat", "*", power=2.0), effect("constant_heat", "a")
    declared = replace(own, parameters=(replace(own.effect.stated(True)[0], value=2.0 * share),), difference=True)
    fitted = fit_of(run_with(np.zeros(STEPS)), common, declared)
    given = Model(HEATED.with_effects([common, declared]))
    assert is_implausible(replace(fitted, model=given), [common, declared], fitted) != believed


def test_no_effect_takes_the_place_of_what_the_model_was_given_with() -> None:
    run, radiating, heat = run_with(np.zeros(STEPS)), effect("radiation", "a", area=0.01), effect("heat_input")
    known = replace(heat, parameters=tuple(replace(parameter, fixed=True) for parameter in heat.parameters))
    network, segments = two_nodes([known], linked=True), split_data([run]).fit  # but in the log nothing links the nodes
    given, fitted = (fit_segments(Model(network.with_effects(added)), segments) for added in ([], [radiating]))

    def at_its_bound(fit: Fit, name: str, factor: float) -> Fit:
        """With a link at the largest resistance that the model file allows."""
        row = [fit.model.parameters[index].name for index in fit.problem.free].index(name)
        z, values = fit.z.copy(), fit.model.values
        z[row] = fit.problem.bounds[1][row]
        values[fit.problem.free[row]] *= factor
        return replace(fit, z=z, model=fit.model.with_values(values))

    air, between = "resistance.a~ambient", "resistance.a~b"
    assert not is_implausible(fitted, [radiating], given)
    assert is_implausible(at_its_bound(fitted, air, 4.0), [radiating], given)
    # A bound may be too near; and what had no way before, or may have had none, has none because of no effect.
    assert not is_implausible(at_its_bound(fitted, air, 2.0), [radiating], given)
    assert not is_implausible(at_its_bound(fitted, air, 4.0), [radiating], at_its_bound(given, air, 4.0))
    assert not is_implausible(at_its_bound(fitted, between, 4.0), [radiating], given)


def test_any_time_constant_of_the_grid_is_usual() -> None:
    declared = effect("second_mass", "a")
    fitted = fit_of(run_with(np.zeros(STEPS)), declared)
    (shape,) = (parameter for parameter in declared.parameters if parameter.grid)
    names = [parameter.name for parameter in fitted.model.parameters]
    amplitude = names.index("second_mass.capacity.a")

    def plausibility(time_constant: float) -> float:
        values = fitted.model.values
        values[names.index("second_mass.time_constant.a")] = time_constant
        values[amplitude] = fitted.model.parameters[amplitude].declared.typical
        return log_prior_of_sizes(replace(fitted, model=fitted.model.with_values(values)), [declared])

    assert plausibility(shape.grid[0]) == plausibility(shape.grid[-1]) == 0.0
    assert plausibility(9.0 * shape.grid[-1]) == pytest.approx(-2.0)
