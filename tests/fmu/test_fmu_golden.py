"""The golden FMUs, and new ones of the same presets, give the reference outputs."""

from __future__ import annotations

import sys
from pathlib import Path
from zipfile import ZipFile

import numpy as np
import pandas as pd
import pytest

from lptn.fmu import Session, export
from lptn.model_file import parse_model
from lptn.robots import presets
from tests.fmu.conftest import Build

REFERENCE = Path(__file__).parents[2] / "fmu" / "reference"


def _apart(fmu: Path, name: str) -> float:
    """The largest difference between an FMU and the reference [K]."""
    inputs = pd.read_csv(REFERENCE / name / f"{name}_in.csv")
    expected = pd.read_csv(REFERENCE / name / f"{name}_ref.csv")
    outputs, driven = [*expected.columns[1:]], [*inputs.columns[1:]]
    with Session(fmu, inputs=driven, outputs=outputs, trust=True) as session:
        found = [session.outputs.copy()]
        for row, step in zip(inputs.iloc[::2].to_numpy(), np.diff(expected["time"]), strict=True):
            session.inputs[:] = row[1:]
            found.append(session.step(float(step)).copy())
    return float(np.abs(np.array(found) - expected[outputs].to_numpy()).max())


def test_each_preset_has_its_folder() -> None:
    folders = {path.name for path in REFERENCE.iterdir() if path.is_dir() and not path.name.startswith("__")}
    assert folders == set(presets())


@pytest.mark.skipif(sys.platform != "linux", reason="the stored libraries are for Linux")
@pytest.mark.parametrize("name", presets())
def test_the_stored_fmu_gives_the_reference(name: str) -> None:
    assert _apart(REFERENCE / name / f"{name}.fmu", name) < 1e-6


@pytest.mark.parametrize("fmi", [2, 3])
@pytest.mark.parametrize("name", presets())
def test_the_stored_description_is_what_export_writes(name: str, fmi: int, tmp_path: Path) -> None:
    exported = export(parse_model(presets()[name], Path(f"{name}.toml")), tmp_path / "x.fmu", fmi=fmi, platforms=())
    with ZipFile(exported.path) as archive:
        new = archive.read("modelDescription.xml").decode()
    stored = (REFERENCE / name / f"FMI{fmi}.xml").read_text()
    # All but the head, which holds date, version and token; `fmu/reference/make.py` brings the stored one up to date.
    assert new.partition("<ModelExchange")[2] == stored.partition("<ModelExchange")[2]


@pytest.mark.parametrize(("name", "fmi"), [("leg", 2), ("leg", 3), ("quadruped", 3)])
def test_a_new_fmu_gives_the_reference(name: str, fmi: int, built: Build) -> None:
    assert _apart(built(name, fmi).path, name) < 1e-6
