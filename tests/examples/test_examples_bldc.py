"""The stators: of a run with a fan on, which no log tells, the loss to the air is named."""

from __future__ import annotations

from pathlib import Path

import pytest

from lptn.diagnose.runs_that_differ import RunDifference, runs_that_differ
from lptn.identify.data import load_model, split_data
from lptn.identify.fitting import Fit
from lptn.identify.validation import fit_segments

FOLDER = Path(__file__).parents[2] / "examples" / "bldc_stators"


def _said(model: str, fitted: str, held_out: str) -> tuple[Fit, list[RunDifference]]:
    """The model fitted to some runs by their numbers, and what is said of another."""
    loaded = load_model(FOLDER / f"{model}.toml")
    runs, others = (loaded.runs([FOLDER / f"Run{number}.csv" for number in text]) for text in (fitted, held_out))
    data = split_data(runs, others)
    done = fit_segments(loaded.model, data.fit)
    return done, runs_that_differ(done, data.holdout)


@pytest.mark.parametrize(
    "model",
    [
        "two_nodes",
        pytest.param(
            "own_surfaces", marks=pytest.mark.xfail(reason="power that heats only 0.58 times as much is told first")
        ),
    ],
)
def test_of_the_run_with_a_fan_the_loss_to_the_air_is_named(model: str) -> None:
    done, (difference,) = _said(model, "135", "4")
    assert done.rmse < 3.5
    assert difference.rmse_before > 50.0
    best = difference.causes[0]
    assert best.key == ("surface_scale", "*@Run4")
    assert best.amplitude is not None
    assert 3.0 < best.amplitude.value < 12.0
    assert difference.rmse_after < 0.3 * difference.rmse_before
    assert "times as fast as the other runs: was a fan on?" in difference.text()
    # A fan on two lumps is not all that there is.
    assert "It does not explain all" in difference.text()


def test_of_a_run_in_still_air_nothing_is_said() -> None:
    _, differences = _said("two_nodes", "15", "3")
    assert differences == []


def test_run_4_is_slower_from_the_first_seconds() -> None:
    """Why a fan is not all: at 10 K above the air no loss to the air takes a fifth of 560 W."""
    loaded = load_model(FOLDER / "two_nodes.toml")
    rises = {}
    for run in loaded.runs([FOLDER / f"Run{number}.csv" for number in "1345"]):
        power, winding = run.columns["power.winding"], run.temperature("winding")
        begun = int((power > 200.0).argmax())
        rises[run.name] = 1e3 * (winding[begun + 20] - winding[begun]) / (power[begun : begun + 20].sum() * run.step)
    slow = rises.pop("Run4")
    assert 1.7 < min(rises.values()) <= max(rises.values()) < 1.9  # K/kJ
    assert slow < 0.85 * min(rises.values())
