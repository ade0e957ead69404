"""The verdict in sentences: probabilities by the fitted data, held-out runs apart, sizes that are plausible or not."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lptn.diagnose.evidence import SIZES
from lptn.diagnose.improvement import History
from lptn.diagnose.unexplained_heat import HeatPeak, UnexplainedHeat, stretches
from lptn.identify.comparison import Errors
from lptn.report.tables import stretch_table
from lptn.report.text import percent
from lptn.report.verdict import (
    Size,
    nothing_missing,
    of_given_model,
    of_held_out_data,
    only_held_out_runs_object,
    sizes_added,
)
from lptn.report.words import next_step
from tests.report.two_joints import NODES, Told

HIDDEN = 3.0  # W, what the truth of `missing` has at the first joint


def test_nothing_is_said_to_be_certain() -> None:
    assert [percent(each) for each in (1.0, 0.9999, 0.99, 0.954, 0.5, 0.01, 1e-9, 0.0)] == [
        "more than 99 %",
        "more than 99 %",
        "99 %",
        "95 %",
        "50 %",
        "1 %",
        "less than 1 %",
        "less than 1 %",
    ]


def test_what_the_fitted_data_show_has_its_probability(missing: Told, adequate: Told) -> None:
    history = missing[0]
    assert nothing_missing(history.probabilities) < 0.005
    assert nothing_missing(history.first.probabilities) < 0.005
    said = of_given_model(history)
    assert said == "the fitted data show that something is missing (probability more than 99 %)"
    unexplained = replace(history, verdict="unexplained")
    assert "but no effect of the catalogue removes most of the misfit" in of_given_model(unexplained)
    good = nothing_missing(adequate[0].probabilities)
    assert good > 0.5
    assert of_given_model(adequate[0]) == f"the fitted data show nothing missing (probability {percent(good)})"


def test_a_model_that_only_held_out_runs_contradict(adequate: Told) -> None:
    history = _contradicted(adequate[0], enough=1.0)
    assert only_held_out_runs_object(history)
    said = of_given_model(history)
    assert said.startswith("the fitted data show nothing missing (probability ")
    assert said.endswith(
        "but held-out runs are wrong by 4.00 K: they hold something the fitted runs do not; "
        "fit on longer runs, or on more like them"
    )
    assert next_step(history).startswith("fit on longer runs, or on more like the held-out ones")
    misfit = _contradicted(adequate[0], enough=0.0)
    assert not only_held_out_runs_object(misfit)
    said = of_given_model(misfit)
    assert "show a misfit (probability more than 99 %) that no effect of the catalogue explains" in said
    assert said.endswith("what nothing explains is 0.50 K at the node where it is largest")


def _contradicted(history: History, enough: float) -> History:
    """A history whose held-out runs are wrong by 4 K, with a misfit of 0.5 K on the fitted ones if not `enough`."""
    sizes = (enough, *((1 - enough) / (len(SIZES) - 1) for _ in SIZES[1:]))
    evidence = replace(history.first.evidence, sizes=sizes, discrepancy=0.5 * (1 - enough))
    wrong = Errors(rmse=4.0, max=8.0, mean=1.0, count=100)
    first = replace(history.first, verdict="unexplained", holdout=wrong, evidence=evidence)
    steps = (replace(history.steps[0], holdout=wrong),)
    return replace(history, verdict="unexplained", first=first, steps=steps)


def test_held_out_runs_stand_apart(missing: Told) -> None:
    history = missing[0]
    said = of_held_out_data(history)
    assert said.startswith("The RMSE on the held-out runs, to which no parameter was fitted, goes from ")
    assert "no proof" not in said
    said = of_held_out_data(replace(history, chosen_by_holdout=True))
    assert "took part in the choice of the model, so their error is no proof of it" in said
    assert "give one more log with --test" in said
    alone = tuple(replace(step, holdout=None, test=None) for step in history.steps)
    assert of_held_out_data(replace(history, steps=alone)) == ""


def test_a_size_is_set_against_what_is_usual(missing: Told) -> None:
    history = missing[0]
    size = sizes_added(history)["constant_heat", NODES[0]]
    assert size.value == pytest.approx(HIDDEN, rel=0.1)
    assert abs(size.value - HIDDEN) < 3 * size.deviation
    assert not size.may_be_zero
    assert not size.implausible
    small = replace(size, value=0.8 * size.parameter.typical, deviation=0.5 * size.parameter.typical)
    assert small.text().endswith("0.8 of what is usual; not told from zero")
    large = replace(size, value=12.0 * size.parameter.typical)
    assert large.text().endswith("12 times what is usual: implausible")
    assert large.as_json()["implausible"] is True
    assert isinstance(size, Size)


def test_a_size_without_evidence_is_the_fits(missing: Told) -> None:
    history = missing[0]
    steps = tuple(replace(step, evidence=None) for step in history.steps)
    size = sizes_added(replace(history, steps=steps))["constant_heat", NODES[0]]
    assert size.value == pytest.approx(HIDDEN, rel=0.1)
    name = f"constant_heat.power.{NODES[0]}"
    assert size.deviation == history.best.fit.standard_errors[name]


def test_every_stretch_is_listed() -> None:
    """Two doors, a heater, and noise that is none: seven minutes apart, at two nodes."""
    heat = np.zeros((2, 120))
    heat[0, 10:20], heat[0, 60:70], heat[1, 30:50] = 4.0, 6.0, -3.0
    heat[0, 64] = 5.0  # no valley
    found = UnexplainedHeat("monday", 5.0 + 10.0 * np.arange(120), ("a", "b"), heat, np.full_like(heat, 0.5), 10.0)
    listed = stretches([found])
    assert [(each.node, each.start, each.stop) for each in listed] == [
        ("a", 600.0, 700.0),
        ("a", 100.0, 200.0),
        ("b", 300.0, 500.0),
    ]
    assert listed[2].as_json() == {"run": "monday", "node": "b", "from": 300.0, "to": 500.0, "watts": -3.0}
    assert stretch_table(listed).rows[2] == ("monday", "b", "300", "500", "−3", "−3.5", "−2.5")
    assert not stretches([replace(found, band=np.full_like(heat, 9.0))])
    assert isinstance(listed[0], HeatPeak)


def test_one_hill_with_a_shallow_valley_is_one_stretch() -> None:
    heat = np.array([[0.0, 4.0, 6.0, 4.0, 6.5, 4.0, 0.0, 0.0, 2.5, 0.0]])
    found = UnexplainedHeat("r", 5.0 + 10.0 * np.arange(10), ("a",), heat, np.full_like(heat, 0.1), 10.0)
    assert [(each.start, each.stop) for each in stretches([found])] == [(10.0, 60.0), (80.0, 90.0)]
