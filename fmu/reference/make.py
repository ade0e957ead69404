"""Write the golden FMUs with their reference inputs and outputs: `python fmu/reference/make.py`.

The reference outputs come from SciPy's DOP853 at 1e-12, restarted at each jump of the inputs, not from the FMUs.
"""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pandas as pd

from lptn.basics.arrays import FloatArray
from lptn.fmu import Exported, export
from lptn.fmu.experiments import held_solution
from lptn.model.file import ModelFile, parse_model
from lptn.model.model import Model
from lptn.robots.presets import presets

HERE = Path(__file__).parent
DATE = datetime(2026, 1, 1, tzinfo=UTC)
HOLD, JUMPS = 20.0, 30  # s between jumps of the inputs, and how many
ZERO, ROOM = 273.15, 25.0
OPTIONS = f"StartTime, 0.0\nStopTime, {HOLD * JUMPS}\nStepSize, {HOLD}\nRelTol, 0.0\nAbsTol, 1e-6\n"


def inputs_of(model: Model) -> FloatArray:
    """Rows of held inputs in the model's units: torques up to 6 N·m, an ambient that drifts by 2 K."""
    rng = np.random.default_rng(20260101)
    rows = np.round(rng.uniform(-6.0, 6.0, (JUMPS, len(model.inputs))), 3)
    for column, name in enumerate(model.inputs):
        if name.startswith("temperature."):
            rows[:, column] = np.round(22.0 + 2.0 * np.sin(np.arange(JUMPS) / 9), 3)
        if name.startswith(("powered.", "power.", "speed.")):
            rows[:, column] = np.abs(rows[:, column]) / 6
        if name.startswith("velocity_rms."):
            rows[:, column] = np.abs(rows[:, column])
    return rows


def write(name: str, file: ModelFile) -> None:
    """The folder of one preset."""
    folder = HERE / name
    folder.mkdir(exist_ok=True)
    model = Model(file.network)
    exported: Exported | None = None
    for fmi in (2, 3):
        exported = export(file, folder / f"{name}.fmu", fmi=fmi, platforms=["linux64"], compiler="zig", date=DATE)
        with ZipFile(exported.path) as archive:
            (folder / f"FMI{fmi}.xml").write_bytes(archive.read("modelDescription.xml"))
    if exported is None:
        return
    inputs, rows = [variable.name for variable in exported.component.of("input")], inputs_of(model)
    shift = np.array([ZERO if column.startswith("temperature.") else 0.0 for column in model.inputs])
    held = np.repeat(rows + shift, 2, axis=0)
    times = np.column_stack([HOLD * np.arange(JUMPS), HOLD * np.arange(1, JUMPS + 1)]).ravel()
    pd.DataFrame(held, columns=inputs).assign(time=times)[["time", *inputs]].to_csv(
        folder / f"{name}_in.csv", index=False, float_format="%.10g"
    )
    states = held_solution(model.rhs, np.full(len(model.states), ROOM), rows, model.values, HOLD)
    outputs = pd.DataFrame(
        states[:, : len(model.places)] + ZERO, columns=[f"{place}.temperature" for place in model.places]
    )
    outputs.insert(0, "time", HOLD * np.arange(JUMPS + 1))
    outputs.to_csv(folder / f"{name}_ref.csv", index=False, float_format="%.12g")
    (folder / f"{name}_ref.opt").write_text(OPTIONS)


if __name__ == "__main__":
    for preset, text in presets().items():
        write(preset, parse_model(text, Path(f"{preset}.toml")))
