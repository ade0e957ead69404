"""The examples: what the README promises of measured data."""

from __future__ import annotations

from pathlib import Path

import pytest

from lptn.evidence import evidence
from lptn.ladder import improve
from lptn.on_evidence import fit_parts, holdout_errors
from lptn.opening import open_model

EXAMPLES = Path(__file__).parents[1] / "examples"


def test_two_heaters_lack_conduction_and_a_sensor_lag() -> None:
    opened = open_model(EXAMPLES / "tclab" / "two_heaters.toml")
    runs = opened.runs([EXAMPLES / "tclab" / "log.csv"])
    ladder = improve(opened.model, evidence(runs, holdout_after=300.0))
    assert {rung.effect for rung in ladder.rungs[1:3]} == {"conduction", "sensor_lag"}
    before, after = ladder.rungs[0].holdout, ladder.rungs[2].holdout
    assert before is not None
    assert after is not None
    assert before.rmse > 4.0
    assert after.rmse < 1.5


@pytest.mark.parametrize("name", ["winding", "four_nodes"])
def test_pmsm_models_fit_their_log(name: str) -> None:
    opened = open_model(EXAMPLES / "pmsm" / f"{name}.toml")
    runs = opened.runs([EXAMPLES / "pmsm" / "log.csv"])
    data = evidence(runs, holdout_after=4400.0).coarsened(5.0)
    done = fit_parts(opened.model, data.fit)
    assert done.rmse < 1.0
    held = holdout_errors(done, data.holdout)
    # One operating point was fitted: the fit looks good and predicts another one badly. That is the lesson.
    assert held is not None
    assert held.rmse > 3 * done.rmse


@pytest.mark.parametrize("folder", sorted(path.name for path in EXAMPLES.iterdir() if path.is_dir()))
def test_measured_data_stand_beside_their_source_and_licence(folder: str) -> None:
    notice = (EXAMPLES / folder / "NOTICE.md").read_text()
    assert "Source:" in notice
    assert "icen" in notice
