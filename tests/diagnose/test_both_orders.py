"""What one joint has may be taken for what all have: the search goes both ways, and held-out runs choose."""

from __future__ import annotations

from pathlib import Path

import pytest

from lptn.study import Study
from tests.benchmarks.verdict_cases import TRUTHS, Case


@pytest.mark.long
def test_a_board_that_draws_power_at_one_joint_is_not_spread_over_all(tmp_path: Path) -> None:
    """Structure first has 1.5 W at each of three joints, and a second mass of half an hour that makes up for it."""
    case = Case("finite volumes", "0.1K", ("standby@FR_thigh",), 1441)
    files = TRUTHS[case.truth].files(case, tmp_path)
    study = Study(files.model, files.fit, files.holdout)
    study.improve()
    first, last = study.steps[1], study.steps[-1]
    assert first.key == ("constant_heat", "FR_thigh")
    assert first.probability > 0.9
    assert first.size_parameter is not None
    size = {parameter.name: parameter.value for parameter in last.fit.model.parameters}[first.size_parameter.name]
    assert size == pytest.approx(5.0, rel=0.3)  # W, of which a part leaves by the board itself
    assert last.holdout is not None
    assert study.steps[0].holdout is not None
    assert last.holdout.rmse < 0.3 * study.steps[0].holdout.rmse
