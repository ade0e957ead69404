"""What advice says beyond answers: whether slow rows that nobody spoke of look like means."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter

import lptn
from lptn.diagnose.advice import advise
from lptn.diagnose.diagnosis import diagnose
from lptn.identify.data import DataSplit

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
    advice = advise(diagnosis := diagnose(model, data), diagnosis.fit, data)
    assert advice.rows.startswith("Read as means, these slow rows are met to 0.05") is means
    assert ('"means before"' in advice.rows) is means
    assert advice.as_json()["rows"] == (advice.rows or None)
    # Where somebody has said it, nobody is asked.
    said = [
        [replace(segment, run=replace(segment.run, notes=())) for segment in runs] for runs in (data.fit, data.holdout)
    ]
    assert not advise(diagnosis, diagnosis.fit, DataSplit(*map(tuple, said))).rows
