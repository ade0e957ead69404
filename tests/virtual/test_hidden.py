"""Check each hidden effect: large enough to be found, not so large that anything finds it."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from lptn.virtual import EFFECTS, JOINTS, Hidden, leg_logs, places
from lptn.virtual.truth import Array

SEED = 0


@cache
def temperatures(hidden: tuple[Hidden, ...] = ()) -> Array:
    """Return the noise-free readings of all runs, of shape (rows, joints)."""
    logs = leg_logs(hidden, seed=SEED, noise=0, rate=1)
    return np.concatenate([log[[f"temperature.{joint}" for joint in JOINTS]].to_numpy() for log in logs.values()])


@pytest.mark.parametrize("effect", EFFECTS)
def test_peak_of_each_effect(effect: str) -> None:
    """The table of peaks is printed by ``pytest -s``."""
    alone = [place for place in places(effect) if place != "*"] or ["*"]
    peaks = {}
    for place in alone:
        # The lag of the ambient brings changes of the ambient with it, which are none of its own.
        usual = temperatures((Hidden(effect, place, 1e-6),) if effect == "ambient_lag" else ())
        trace = np.abs(temperatures((Hidden(effect, place),)) - usual).max(axis=0)
        peaks[place] = float(trace.max())
        ends = place.split("~") if set(place.split("~")) <= set(JOINTS) else JOINTS
        assert JOINTS[int(trace.argmax())] in ends, "the effect is largest where it was put"
    print(f"{effect:20s}", "  ".join(f"{place} {peak:.2f} K" for place, peak in peaks.items()))
    assert all(0.5 < peak < 8 for peak in peaks.values())


@pytest.mark.parametrize("effect", EFFECTS)
def test_size_zero_is_off_to_the_last_bit(effect: str) -> None:
    assert np.array_equal(temperatures((Hidden(effect, places(effect)[0], 0.0),)), temperatures())


@pytest.mark.parametrize("effect", ["resistance_rise", "radiation", "sensor_lag", "splash"])
def test_everywhere_is_every_joint(effect: str) -> None:
    each = tuple(Hidden(effect, joint) for joint in JOINTS)
    assert temperatures((Hidden(effect, "*"),)) == pytest.approx(temperatures(each), abs=0)


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("rough", [False, True])
def test_nothing_is_cooked(seed: int, rough: bool) -> None:
    hottest = max(
        log[f"temperature.{joint}"].max()
        for log in leg_logs(seed=seed, noise=0, rate=1, rough=rough).values()
        for joint in JOINTS
    )
    assert 50 < hottest < 95


def test_hottest_effect_everywhere_stays_below_95() -> None:
    assert temperatures((Hidden("resistance_rise", "*"),)).max() < 95


def test_unknown_effect_is_refused_with_the_known_ones() -> None:
    with pytest.raises(ValueError, match=r"effect: found 'gremlins'; expected one of resistance_rise, .*splash"):
        Hidden("gremlins", "FR_hip")


@pytest.mark.parametrize(
    ("effect", "place", "allowed"),
    [
        ("radiation", "FL_hip", r"FR_hip, FR_thigh, FR_calf, \*"),
        ("radiation", "FR_calf~FR_hip", r"FR_hip, FR_thigh, FR_calf, \*"),
        ("conduction", "FR_hip", "FR_calf~FR_hip"),
        ("conduction", "*", "FR_calf~FR_hip"),
        ("sensor_position", "FR_calf~FR_hip", "FR_calf~FR_thigh, FR_thigh~FR_calf, FR_hip~FR_thigh, FR_thigh~FR_hip"),
        ("sensor_position", "FR_calf~FR_calf_case", "FR_calf~FR_thigh, .*"),
        ("shared_mass", "FR_hip", r"\*"),
        ("clock_offset", "FR_hip", r"\*"),
        ("ambient_offset", "*", "ambient"),
    ],
)
def test_unknown_place_is_refused_with_the_allowed_ones(effect: str, place: str, allowed: str) -> None:
    with pytest.raises(ValueError, match=f"place of {effect}: found .* expected one of {allowed}$"):
        Hidden(effect, place)


@pytest.mark.parametrize("size", [-1.0, float("nan"), float("inf")])
def test_bad_size_is_refused(size: float) -> None:
    with pytest.raises(ValueError, match="size of radiation"):
        Hidden("radiation", "*", size)


@pytest.mark.parametrize("effect", [name for name, effect in EFFECTS.items() if effect.signed])
def test_signed_effect_goes_either_way(effect: str) -> None:
    place = places(effect)[0]
    up, down = (temperatures((Hidden(effect, place, size),)) - temperatures() for size in (0.5, -0.5))
    assert np.abs(up + down).mean() < 0.3 * np.abs(up).mean()


@pytest.mark.parametrize(("effect", "least"), [("loss_scale", "-4.50"), ("surface_scale", "-3.00")])
def test_scale_that_leaves_nothing_is_refused(effect: str, least: str) -> None:
    with pytest.raises(ValueError, match=f"size of {effect}: found -5; expected {least} or above"):
        leg_logs([Hidden(effect, "*", -5.0)], seed=0)


def test_second_mass_larger_than_its_node_is_refused() -> None:
    with pytest.raises(ValueError, match=r"size of second_mass: found 3; expected at most 2\.\d\d at FR_hip"):
        leg_logs([Hidden("second_mass", "FR_hip", 3.0)], seed=0)


def test_burning_leg_is_refused() -> None:
    with pytest.raises(ValueError, match="passes 150 degC in fit1; expected smaller sizes"):
        leg_logs([Hidden("constant_heat", "*", 30.0)], seed=0)
