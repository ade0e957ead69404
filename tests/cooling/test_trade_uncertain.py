"""What is not known carried to the answer: against the same designs computed by plain code at the ends."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import norm

from lptn.basics.errors import InputError
from lptn.planners.trade import solve_study
from tests.cooling import plain_sink as plain
from tests.cooling.studies import HELD, study

Z95 = float(norm.ppf(0.95))


def _errors(errors: str, draws: int = 64, level: float = 0.9) -> str:
    return f"[uncertainty]\ndraws = {draws}\nlevel = {level}\n[uncertainty.errors]\n{errors}\n"


@pytest.mark.long
def test_an_interval_is_that_of_the_built_design() -> None:
    asked = study("held_torque", "duration = 120", HELD, more=_errors('"resistance.stator~winding" = 0.2'),
                  cooling='"passive"')  # fmt: skip
    result = solve_study(asked)
    design, interval = result.best, result.intervals["U8, passive"]
    sigma = np.sqrt(np.log1p(0.2**2))
    ends = []
    for normal in (Z95, -Z95):
        c, r, r_ws = np.array([design.capacity]), np.array([design.resistance]), 1.084 * np.exp(normal * sigma)
        ends.append(float(plain.held_torque(c, r, 120.0, 105.0, r_ws=r_ws)[0]))
    spread = ends[1] - ends[0]
    assert interval.low == pytest.approx(ends[0], abs=0.08 * spread)  # 64 draws know a quantile to two of them
    assert interval.high == pytest.approx(ends[1], abs=0.08 * spread)
    assert (interval.feasible, interval.best) == (1.0, 1.0)


@pytest.mark.long
def test_fins_that_give_less_have_more_resistance() -> None:
    """As built: half the film is twice the resistance, where a design made anew would have grown more fins."""
    asked = study("held_torque", "duration = 600", HELD, more=_errors("film = 0.3"), cooling='"passive"')
    result = solve_study(asked)
    design, interval = result.best, result.intervals["U8, passive"]
    sigma = np.sqrt(np.log1p(0.3**2))
    ends = []
    for normal in (-Z95, Z95):
        c, r = np.array([design.capacity]), np.array([design.resistance]) / np.exp(normal * sigma)

        def over(torque: float, c: np.ndarray = c, r: np.ndarray = r) -> float:
            return float(plain.hottest(c, r, np.array([torque]), 600.0, step=1.0)[0]) - 105.0

        ends.append(float(brentq(over, 0.8, 1.8, xtol=1e-6)))
    spread = ends[1] - ends[0]
    assert interval.low == pytest.approx(ends[0], abs=0.08 * spread)
    assert interval.high == pytest.approx(ends[1], abs=0.08 * spread)


@pytest.mark.long
def test_where_the_least_mass_is_sought_each_draw_tells_what_it_would_take() -> None:
    task, limits = "torque = 1.66\nduration = 120", "volume = 450e-6"
    result = solve_study(study("mass", task, limits, more=_errors("torque = 0.01"), cooling='"none", "passive"'))
    interval = result.intervals["U8, passive"]
    low, high = (
        solve_study(
            study("mass", task.replace("1.66", str(1.66 * (1 + 0.01 * normal))), limits, cooling='"passive"')
        ).best.value
        for normal in (-Z95, Z95)
    )
    assert interval.low == pytest.approx(low, rel=0.02)
    assert interval.high == pytest.approx(high, rel=0.02)


@pytest.mark.long
def test_what_cannot_be_met_in_many_draws_has_no_end() -> None:
    more = _errors('start = { value = 3, unit = "K" }\ntorque = 0.03', draws=32, level=0.95)
    task, limits = "torque = 1.66\nduration = 120", "mass = 0.6\nvolume = 600e-6"
    result = solve_study(study("mass", task, limits, more=more, cooling='"passive"'))
    interval = result.intervals["U8, passive"]
    assert 0.5 < interval.feasible < 1.0
    assert np.isfinite(interval.low)
    assert np.isinf(interval.high)
    assert interval.low < result.best.value


@pytest.mark.long
def test_two_motors_change_places_as_often_as_their_constants_say() -> None:
    motors = '[[motors]]\nname = "U8"\n[[motors]]\nname = "mine"\nmodel = "u8"\nmass = 0.24\nvolume = 1e-4\n'
    motors += f"torque_constant = {plain.K_T * 1.05!r}\nlimits = {{ winding = 105 }}"
    more = _errors('"resistance.*" = 0.1\n"capacity.*" = 0.1', draws=128)
    result = solve_study(study("held_torque", "duration = 120", motors=motors, more=more, cooling='"none"'))
    first, second = (result.intervals[name].best for name in ("mine, no sink", "U8, no sink"))
    assert first + second == pytest.approx(1.0)
    assert 0.6 < first < 1.0
    # What all choices share changes none of them alone.
    shared = solve_study(study("held_torque", "duration = 120", motors=motors,
                               more=_errors('ambient = { value = 5, unit = "K" }'), cooling='"none"'))  # fmt: skip
    assert shared.intervals["mine, no sink"].best == 1.0


def test_a_fitted_model_brings_its_own_errors(tmp_path: Path) -> None:
    from lptn.planners.trade import load_study
    from lptn.robots.presets import presets

    text = presets()["u8"] + '\n[fit]\nstandard_errors = { "resistance.stator~winding" = 0.1 }\n'
    (tmp_path / "mine.toml").write_text(text)
    (tmp_path / "study.toml").write_text(
        '[study]\ngoal = "held_torque"\ncooling = ["none"]\n[task]\nduration = 120\n[[motors]]\nname = "U8"\n'
        'model = "mine.toml"\n[uncertainty]\ndraws = 16\n'
    )
    result = solve_study(load_study(tmp_path / "study.toml"))
    interval = result.intervals["U8, no sink"]
    assert interval.low < result.best.value < interval.high


@pytest.mark.parametrize(
    ("errors", "said"),
    [
        ("film = -0.1", ("film", "-0.1", "relative standard error")),
        ("ambient = 0.1", ("ambient", "temperature", "K")),
        ('"resistances.*" = 0.1', ("resistances.*", "no such number")),
        ('film = { value = 1, unit = "kg" }', ("film", "kg", "K")),
    ],
)
def test_errors_that_mean_nothing_are_refused(errors: str, said: tuple[str, ...]) -> None:
    with pytest.raises(InputError) as refused:
        solve_study(study("held_torque", "duration = 120", HELD, more=_errors(errors), cooling='"passive"'))
    for word in said:
        assert word in str(refused.value)
