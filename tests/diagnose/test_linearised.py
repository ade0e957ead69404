"""What an answer would change, to first order: the misfit falls, and the change is about the refit's."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import lptn
from lptn.diagnose.diagnosis import Diagnosis, diagnose
from lptn.diagnose.previews import Previews
from lptn.diagnose.refits import refit

EXAMPLE = Path(__file__).parents[2] / "examples" / "tclab"


@pytest.fixture(scope="module")
def diagnosis() -> Diagnosis:
    """Of two heaters, whose model lacks much."""
    loaded = lptn.load_model(EXAMPLE / "two_heaters.toml")
    return diagnose(loaded.model, lptn.split_data(loaded.runs([EXAMPLE / "log.csv"]), holdout_after=300))


def test_the_misfit_falls(diagnosis: Diagnosis) -> None:
    problem = diagnosis.fit.problem
    before = np.sum(problem.residuals(diagnosis.fit.z)[: problem.readings] ** 2)
    ((bound, predicted),) = zip(
        problem.bound_runs, Previews(diagnosis.fit, diagnosis.weighed[:5]).of_fitted_runs(), strict=True
    )
    for readings in predicted:
        assert np.isnan(readings[~bound.counted]).all()
        errors = (readings - bound.measured) / problem.sigma[:, None]
        assert float(np.sum(errors[bound.counted] ** 2)) < before


def test_it_lies_near_what_the_refit_gives(diagnosis: Diagnosis) -> None:
    (bound,), (before,) = diagnosis.fit.problem.bound_runs, diagnosis.fit.residuals
    wanted = {("natural_convection", "*"), ("conduction", "heater1~heater2"), ("sensor_offset", "heater2")}
    candidates = [one for one in diagnosis.weighed if one.candidate.key in wanted]
    assert len(candidates) == len(wanted)
    for one in candidates:
        declared = one.candidate.declaration(one.amplitude, one.shape)
        ((readings,),) = Previews(diagnosis.fit, [one]).of_fitted_runs()
        change = (readings - bound.measured - before)[bound.counted]
        refitted = (refit(diagnosis.fit, declared).residuals[0] - before)[bound.counted]
        assert np.corrcoef(change, refitted)[0, 1] > 0.9
        assert np.std(change) == pytest.approx(np.std(refitted), rel=0.3)
