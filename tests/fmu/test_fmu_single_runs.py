"""An effect of one run in an FMU: off, until somebody says that it is that run."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from fmpy.validation import validate_fmu

from lptn.effects import catalogue
from lptn.fmu import Session, cosimulate, export
from lptn.model import Model
from lptn.model_file import parse_model
from lptn.robots import presets
from tests.builders import effect, with_every_effect
from tests.fmu.drives import ZERO, in_kelvin, solved, steps


@pytest.fixture
def trusted(tmp_path: Path) -> Iterator[Path]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path))
        yield tmp_path


@pytest.mark.parametrize("fmi", [2, 3])
def test_every_effect_of_a_run_of_any_name(fmi: int, trusted: Path) -> None:
    every = with_every_effect()
    confined = [replace(effect(key), run="2026.11.21 ~hot~ {1}") for key in catalogue()]
    model = Model(every.with_effects(confined))
    path = export(model, trusted / "x.fmu", fmi=fmi).path
    assert validate_fmu(str(path)) == []
    states = [variable.name for variable in export(model, trusted / "y.fmu", platforms=()).component.of("state")]
    inputs = np.abs(steps(model, 20))
    on = model.in_run("2026.11.21 ~hot~ {1}", model.values)
    with Session(path, outputs=states) as session:
        (indicator,) = (name for name in session.variables if name.endswith(".run"))
        for flag, values in ((0.0, model.values), (1.0, on)):
            session.reset({indicator: flag})
            found = []
            for row in in_kelvin(model, inputs):
                session.inputs[:] = row
                found.append(session.step(2.0).copy())
            assert (
                np.abs(np.array(found) - ZERO - solved(model, inputs, 2.0, values=values)).max() < 1e-5
            )  # RK4 of its own step
    assert not np.array_equal(on, model.values)


def test_cosimulation_says_to_the_fmu_which_run_it_is(trusted: Path) -> None:
    model = parse_model(presets()["leg"], trusted / "leg.toml")
    confined = model.with_effects([replace(effect("constant_heat", "FR_calf", power=8.0), run="hot")])
    path = export(confined, trusted / "leg.fmu").path
    ends = {}
    for name in ("hot", "cool"):
        rng, n = np.random.default_rng(1), 300
        table = pd.DataFrame({"time": 2.0 * np.arange(n), "temperature.ambient": 22.0})
        for joint in ("FR_hip", "FR_thigh", "FR_calf"):
            table[f"temperature.{joint}"] = 22.0
            table[f"torque.{joint}"] = rng.uniform(0.0, 4.0, n // 20).repeat(20)
        table.to_csv(trusted / f"{name}.csv", index=False)
        done = cosimulate(path, [trusted / f"{name}.csv"])
        assert done.from_model is not None
        assert done.from_model < 1e-3
        ends[name] = done.runs[0].readings[:, -1]
    assert ends["hot"][2] - ends["cool"][2] > 3.0
