"""What an effect would change in a held-out run, to first order, beside what refitting it does."""

from __future__ import annotations

import numpy as np

from lptn.basics.parameters import Parameter
from lptn.diagnose.diagnosis import weighed
from lptn.diagnose.previews import Previews
from lptn.diagnose.refits import continued
from lptn.effects.constant_heat import ConstantHeat
from lptn.identify.comparison import Errors, predict
from lptn.identify.data import split_data
from lptn.identify.fitting import finished
from lptn.identify.validation import fit_segments
from lptn.model.network import EffectDeclaration
from tests.report.two_joints import NODES, NOISE, make_run, robot


def test_a_preview_of_a_held_out_run_comes_near_to_the_refit() -> None:
    truth = robot(EffectDeclaration(ConstantHeat(), NODES[0], (Parameter("power", 0.3, "W", (0.0, 100.0), off=0.0),)))
    runs = [make_run(truth, seed, name) for seed, name in ((1, "one"), (2, "two"), (3, "three"))]
    data = split_data(runs[:2], runs[2:])
    fit = fit_segments(robot(), data.fit)
    candidates = {one.candidate.key: one for one in weighed(fit)}
    answer, other = candidates["constant_heat", NODES[0]], candidates["radiation", NODES[1]]
    (segment,), sigma = data.holdout, fit.problem.sigma
    preview, _ = Previews(fit, [answer, other]).of(segment)

    before = predict(fit.model, segment, sigma)
    declared = answer.candidate.declaration(answer.amplitude, answer.shape)
    refit = finished(continued(fit, fit.model.network.with_effects([declared])))
    refitted = predict(refit.model, segment, sigma).readings
    change = np.sqrt(np.mean((refitted - before.readings) ** 2))
    assert np.sqrt(np.mean((preview.readings - refitted) ** 2)) < 0.2 * change
    assert Errors.of(preview.error).rmse < 1.1 * NOISE < 0.8 * Errors.of(before.error).rmse


def test_without_candidates_there_is_nothing_to_foresee() -> None:
    run = make_run(robot(), 1, "one")
    data = split_data([run], [make_run(robot(), 2, "two")])
    nothing = Previews(fit_segments(robot(), data.fit), [])
    assert nothing.of(data.holdout[0]) == []
    assert [len(of_scores) for of_scores in nothing.of_fitted_runs()] == [0]
