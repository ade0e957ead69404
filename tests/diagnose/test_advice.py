"""What advice says beyond answers: what would have shown; whether slow rows that nobody spoke of look like means."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

import lptn
from lptn.basics.parameters import Parameter
from lptn.diagnose.advice import advise, smallest
from lptn.diagnose.diagnosis import diagnose, weighed
from lptn.effects.constant_heat import ConstantHeat
from lptn.identify.data import DataSplit, split_data
from lptn.identify.validation import fit_segments
from lptn.model.network import EffectDeclaration
from tests.report.two_joints import NODES, make_run, robot

BODY = """
[model]
name = "body"
ambient = { value = 20, unit = "degC" }

[nodes.body]
capacity = { value = 400, unit = "J/K" }

[[links]]
between = ["body", "ambient"]
resistance = { value = 2, unit = "K/W" }

[[effects]]
kind = "heat_input"
at = "body"
gain = { value = 1, fixed = true }
"""
ROW, TAU, RESISTANCE = 300, 900.0, 3.0  # s, s, K/W


def split(folder: Path, *, means: bool) -> DataSplit:
    """Two logs of a body that is heated by fits and starts, a row every five minutes: means, or samples."""
    (folder / "body.toml").write_text(BODY)
    for number, name in enumerate(("one", "two")):
        rng = np.random.default_rng(number)
        power = rng.uniform(0, 15, 200).repeat(ROW)
        decay = np.exp(-1 / TAU)
        warm = lfilter([0, 1 - decay], [1, -decay], RESISTANCE * power) + 20
        by_row = [series.reshape(-1, ROW) for series in (warm, power)]
        readings = (by_row[0].mean(axis=1) if means else by_row[0][:, 0]) + rng.normal(0, 0.05, 200)
        columns = {"temperature.body": readings, "power.body": by_row[1][:, 0]}
        pd.DataFrame({"time": ROW * np.arange(200)} | columns).to_csv(folder / f"{name}.csv", index=False)
    loaded = lptn.load_model(folder / "body.toml")
    one, two = loaded.runs([folder / "one.csv", folder / "two.csv"])
    return lptn.split_data([one], [two])


@pytest.mark.parametrize("means", [True, False])
def test_slow_rows_that_are_means_are_told_with_the_line_that_says_so(tmp_path: Path, means: bool) -> None:
    data = split(tmp_path, means=means)
    model = lptn.load_model(tmp_path / "body.toml").model
    advice = advise(diagnosis := diagnose(model, data), diagnosis, data)
    assert advice.rows.startswith("Read as means, these slow rows are met to 0.05") is means
    assert ('"means before"' in advice.rows) is means
    assert advice.as_json()["rows"] == (advice.rows or None)
    # Where somebody has said it, nobody is asked.
    said = [
        [replace(segment, run=replace(segment.run, notes=())) for segment in runs] for runs in (data.fit, data.holdout)
    ]
    assert not advise(diagnosis, diagnosis, DataSplit(*map(tuple, said))).rows


@pytest.mark.parametrize(("times", "least", "most"), [(0.0, 0, 0), (0.4, 0, 2), (1.0, 8, 10), (2.0, 10, 10)])
def test_what_would_have_shown_does_and_half_of_it_does_not(times: float, least: int, most: int) -> None:
    """Of ten logs, a heat of so many times the smallest is more probable than nothing in so many."""
    heat, shown = ("constant_heat", NODES[0]), 0
    for seed in range(10):
        limits = smallest(weighed(fit_segments(robot(), split_data([make_run(robot(), seed, "one")]).fit)))
        (limit,) = (one for one in limits if (one.effect, one.at) == heat)
        assert limit.unit == "W"
        power = Parameter("power", times * limit.smallest, "W", (0.0, 100.0), off=0.0)
        truth = robot(EffectDeclaration(ConstantHeat(), NODES[0], (power,)))
        candidates = weighed(fit_segments(robot(), split_data([make_run(truth, seed, "one")]).fit))
        (own,) = (one for one in candidates if one.candidate.key == heat)
        shown += own.log_odds > 0
    assert least <= shown <= most


def test_what_is_weighed_allows_for_the_errors_of_logs_that_are_stated() -> None:
    """Where the air of each run may be off by kelvins, a heat at one place is less sure."""
    data, heat = split_data([make_run(robot(), 1, "one"), make_run(robot(), 2, "two")]), ("constant_heat", NODES[0])
    both = [diagnose(robot(), data, ambient_error=error).weighed for error in (0.01, 5.0)]
    sure, unsure = (next(one.standard_error for one in listed if one.candidate.key == heat) for listed in both)
    assert unsure > 1.1 * sure
