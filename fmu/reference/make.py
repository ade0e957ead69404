"""Write the golden FMUs with their reference inputs and outputs: `python fmu/reference/make.py`.

The reference outputs come from SciPy's DOP853 at 1e-12, restarted at each jump of the inputs, not from the FMUs.
"""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path
from zipfile import ZipFile

from lptn.fmu import export
from lptn.fmu.component import Component
from lptn.fmu.experiments import experiment
from lptn.model.file import ModelFile, parse_model
from lptn.model.model import Model
from lptn.robots.presets import presets

HERE = Path(__file__).parent
DATE = datetime(2026, 1, 1, tzinfo=UTC)


def write(name: str, file: ModelFile) -> None:
    """The folder of one preset."""
    folder = HERE / name
    folder.mkdir(exist_ok=True)
    for fmi in (2, 3):
        exported = export(file, folder / f"{name}.fmu", fmi=fmi, platforms=["linux64"], compiler="zig", date=DATE)
        with ZipFile(exported.path) as archive:
            (folder / f"FMI{fmi}.xml").write_bytes(archive.read("modelDescription.xml"))
    tables(name, file)


def tables(name: str, file: ModelFile) -> None:
    """Inputs and outputs of one preset, and how to compare them."""
    done = experiment(Component(Model(file.network)), step=0.0, stretches=30)
    for part, table in (("in", "inputs.csv"), ("ref", "results.csv")):
        (HERE / name / f"{name}_{part}.csv").write_text(done["tables"][table])
    options = f"StartTime, 0.0\nStopTime, {done['stop']}\nStepSize, {done['hold']}\nRelTol, 0.0\nAbsTol, 1e-6\n"
    (HERE / name / f"{name}_ref.opt").write_text(options)


if __name__ == "__main__":
    for preset, text in presets().items():
        write(preset, parse_model(text, Path(f"{preset}.toml")))
