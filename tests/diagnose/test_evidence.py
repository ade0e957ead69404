"""The evidence of a fitted model: effects that aren't there, allowances, sizes near none."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import trapezoid

from lptn import Study
from lptn.basics.parameters import Parameter
from lptn.diagnose.candidates import USUAL, log_priors, possible_effects
from lptn.diagnose.evidence import Allowance, ErrorsOfRuns, Evidence, allowances
from lptn.diagnose.refits import continued, refit
from lptn.effects.constant_heat import ConstantHeat
from lptn.effects.surface_scale import SurfaceScale
from lptn.identify.data import split_data
from lptn.identify.fitting import Fit, finished
from lptn.identify.validation import fit_segments
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration
from lptn.robots.presets import presets
from tests.report.two_joints import NODES, make_run, robot

HEAT = ("constant_heat", NODES[0])


def _fit(heat: float, seeds: tuple[int, int] = (1, 2)) -> Fit:
    """Two joints without the heat [W] that the one has, fitted to two runs."""
    power = Parameter("power", heat, "W", (0.0, 100.0), off=0.0)
    truth = robot(EffectDeclaration(ConstantHeat(), NODES[0], (power,)))
    runs = [make_run(truth, seed, name) for seed, name in zip(seeds, ("one", "two"), strict=True)]
    return fit_segments(robot(), split_data(runs).fit)


def _with_heat(fit: Fit, start: float = 0.3) -> tuple[Fit, str]:
    """The same with the heat, and the name of its size."""
    (one,) = (one for one in possible_effects(fit, fit.problem.bound_runs[0].run.columns) if one.key == HEAT)
    declared = one.declaration(start)
    return finished(refit(fit, declared)), declared.shared_name("power")


def _allowed(fit: Fit, errors: ErrorsOfRuns | None = None) -> Sequence[Allowance]:
    return allowances(fit, possible_effects(fit, fit.problem.bound_runs[0].run.columns), errors or ErrorsOfRuns())


def test_to_remove_nothing_changes_nothing() -> None:
    fit = _fit(0.3)
    allowed = _allowed(fit)
    before = Evidence(fit, allowed)
    again = finished(continued(fit, fit.model.network))
    assert Evidence(again, allowed, beside=before).log_evidence == pytest.approx(before.log_evidence, abs=0.1)


@pytest.mark.parametrize("seeds", [(1, 2), (3, 4), (5, 6), (7, 8)])
def test_a_heat_that_is_not_there_lowers_the_evidence_and_one_that_is_raises_it(seeds: tuple[int, int]) -> None:
    """A size that ends at none changes nothing: one that chance makes is worth less than its prior costs."""
    for heat in (0.0, 1.0):
        fit = _fit(heat, seeds)
        larger, name = _with_heat(fit)
        size = next(parameter.value for parameter in larger.model.parameters if parameter.name == name)
        evidence = Evidence(fit, [])
        gained = Evidence(larger, [], beside=evidence).log_evidence - evidence.log_evidence
        assert gained > 10.0 if heat else gained < (-1.0 if size > 0 else 1e-3)


@pytest.mark.parametrize("heat", [0.0, 0.003, 0.01, 0.02])
def test_the_odds_of_none_agree_with_the_difference_of_two_fits(heat: float) -> None:
    """To first order, by one fit."""
    fit = _fit(heat)
    larger, name = _with_heat(fit)
    evidence = Evidence(larger, [])
    exact = Evidence(fit, [], beside=evidence).log_evidence - evidence.log_evidence
    value = next(parameter.value for parameter in larger.model.parameters if parameter.name == name)
    if value == 0.0:  # at its bound nothing is told to first order
        assert evidence.log_odds_of_none(name) == np.inf
        assert exact == pytest.approx(0.0, abs=0.1)
    else:
        assert evidence.log_odds_of_none(name) == pytest.approx(exact, abs=2.0)


@pytest.mark.parametrize("heat", [0.02, 0.1])
def test_the_odds_of_an_exchange_agree_with_the_difference_of_two_fits(heat: float) -> None:
    """Convection that changes with temperature, or a drift, in place of a heat."""
    fit = _fit(heat)
    larger, name = _with_heat(fit)
    names = {("natural_convection", NODES[0]), ("radiation", NODES[0]), ("sensor_drift", NODES[0])}
    asked = [one for one in possible_effects(larger, fit.problem.bound_runs[0].run.columns) if one.key in names]
    evidence = Evidence(larger, [], asked)
    exchanges = evidence.exchanges(name)
    assert {entry.candidate.key for entry in exchanges} == names
    for entry in exchanges:
        other = finished(continued(larger, fit.model.network.with_effects([entry.declaration()])))
        exact = Evidence(other, [], beside=evidence).log_evidence - evidence.log_evidence
        assert entry.log_odds == pytest.approx(exact, abs=2.0)


def test_a_size_at_an_end_costs_what_the_integral_over_the_sizes_inside_does() -> None:
    """A joint that loses no heat: a model that says so has one parameter more, although none could move beyond."""
    (own,) = SurfaceScale.parameters
    scale = USUAL * own.typical
    network = robot().network
    links = tuple(
        replace(one, resistance=one.resistance and replace(one.resistance, fixed=True)) for one in network.links
    )

    def model(size: float, fixed: bool) -> Model:
        """With the true resistance, so that nothing can stand in for the loss."""
        change = replace(own, value=size, fixed=fixed, share="each")
        return Model(
            replace(network, links=links).with_effects([EffectDeclaration(SurfaceScale(), NODES[0], (change,))])
        )

    data = split_data([make_run(model(-1.0, True), seed, str(seed)) for seed in (1, 2)]).fit
    evidence = Evidence(fit_segments(model(-1.0, True), data), [])

    def relative(size: float, fixed: bool) -> float:
        return (
            Evidence(fit_segments(model(size, fixed), data), [], beside=evidence).log_evidence - evidence.log_evidence
        )

    sizes = np.linspace(-1.0, -0.98, 21)
    density = 1.0 / (np.pi * scale * (1.0 + (sizes / scale) ** 2))
    integral = trapezoid(density * np.exp([relative(float(size), True) for size in sizes]), sizes)
    assert relative(-0.5, False) == pytest.approx(np.log(integral), abs=0.3)
    assert np.log(integral) < -3.0


def test_an_allowance_takes_a_deviation_of_its_size_and_not_ten_times_as_much() -> None:
    """How much an offset of one sensor in one run gains to first order, beside an allowance for it."""
    odds = {}
    for size in (0.3, 3.0):
        one, two = (make_run(robot(), seed, name) for seed, name in ((1, "one"), (2, "two")))
        warmer = {"temperature.ambient": two.columns["temperature.ambient"] + size}
        runs = [one, replace(two, columns={**two.columns, **warmer})]
        fit = fit_segments(robot(), split_data(runs).fit)
        possible = possible_effects(fit, runs[0].columns)
        asked = [one for one in possible if one.key == ("ambient_offset", "ambient@two")]
        for allowed in ([], _allowed(fit)):
            (entry,) = Evidence(fit, allowed, asked).first_order(np.zeros(1))
            odds[size, bool(allowed)] = entry.log_odds
    assert odds[0.3, False] > 3.0 > odds[0.3, True]
    assert odds[3.0, True] > 10.0


def test_prior_odds_are_those_of_an_effect_split_over_its_places() -> None:
    fit = _fit(0.0)
    possible = possible_effects(fit, fit.problem.bound_runs[0].run.columns)
    shares = np.exp(log_priors(possible))
    assert shares.sum() == pytest.approx(1.0)
    of_effects: dict[str, float] = {}
    for one, share in zip(possible, shares.tolist(), strict=True):
        if not one.run:
            of_effects[one.effect.key] = of_effects.get(one.effect.key, 0.0) + share / one.prior_odds
    assert len(of_effects) > 5
    assert list(of_effects.values()) == pytest.approx([of_effects["constant_heat"]] * len(of_effects))


@pytest.mark.parametrize("held_out", [[], [24.0]])
def test_a_log_without_noise_that_is_met_to_the_last_digit_is_adequate(held_out: list[float], tmp_path: Path) -> None:
    """A motor that rests as warm as its air: no residual is left, and that makes nothing infinitely sure."""

    def rest(degc: float) -> pd.DataFrame:
        columns = {"temperature.motor": degc, "temperature.ambient": degc, "torque.motor": 0.0}
        return pd.DataFrame({"time": np.arange(600.0)} | columns)

    path = tmp_path / "motor.toml"
    path.write_text(presets()["single-motor"])
    assert Study(path, fit=rest(25.0), holdout=[rest(degc) for degc in held_out]).diagnose().verdict == "adequate"
