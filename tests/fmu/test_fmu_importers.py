"""Foreign importers drive the FMUs: each gives what a solver of its own gives."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile

import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from lptn.fmu import Exported
from tests.fmu.conftest import Build
from tests.fmu.truth import ZERO, in_kelvin, leg_by_hand, solved, steps

DRIVER = Path(__file__).with_name("drive_importer.py")
STEP = 0.5
CASES = [
    ("fmpy", 2),
    ("fmpy", 3),
    ("fmuloader", 2),
    ("fmuloader", 3),
    ("libcosimpy", 2),
    ("ecospy", 2),
    ("ecospy", 3),
]


def _driven(importer: str, exported: Exported, rows: FloatArray, tmp_path: Path) -> FloatArray:
    component = exported.component
    with ZipFile(exported.path) as archive:
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
    plan = {
        "file": str(exported.path),
        "fmi": exported.fmi,
        "step": STEP,
        "inputs": [variable.name for variable in component.of("input")],
        "input_references": [variable.reference for variable in component.of("input")],
        "rows": rows.tolist(),
        "outputs": [f"{node}.temperature" for node in component.model.nodes],
        "output_references": [component.names[f"{node}.temperature"].reference for node in component.model.nodes],
        "identifier": root.findall("CoSimulation")[0].get("modelIdentifier"),
        "token": root.get("guid") or root.get("instantiationToken"),
    }
    file = tmp_path / "plan.json"
    file.write_text(json.dumps(plan))
    done = subprocess.run(
        [sys.executable, str(DRIVER), importer, str(file)], capture_output=True, text=True, check=False, timeout=120
    )
    if "libtbb.so" in done.stderr:
        pytest.skip("ecospy's library needs libtbb12 of the operating system")
    assert done.returncode == 0, done.stderr[-2000:]
    (line,) = (line for line in done.stdout.splitlines() if line.startswith("ROWS"))
    return np.array(json.loads(line.removeprefix("ROWS"))) - ZERO


@pytest.mark.parametrize(("importer", "fmi"), CASES)
def test_an_importer_gives_the_leg_written_by_hand(importer: str, fmi: int, built: Build, tmp_path: Path) -> None:
    exported = built("leg", fmi)
    inputs = steps(exported.component.model, 40)
    temperatures = _driven(importer, exported, in_kelvin(exported.component.model, inputs), tmp_path)
    assert np.abs(temperatures - leg_by_hand(inputs, STEP)).max() < 1e-6


@pytest.mark.parametrize(
    ("importer", "fmi"),
    [
        ("fmpy", 3),
        ("fmuloader", 3),
        ("ecospy", 3),
        pytest.param("libcosimpy", 2, marks=pytest.mark.slow),
    ],
)
def test_an_importer_gives_the_quadruped(importer: str, fmi: int, built: Build, tmp_path: Path) -> None:
    exported = built("quadruped", fmi)
    model = exported.component.model
    inputs = steps(model, 20)
    temperatures = _driven(importer, exported, in_kelvin(model, inputs), tmp_path)
    assert np.abs(temperatures - solved(model, inputs, STEP)[:, : len(model.nodes)]).max() < 1e-6
