"""Reference results inside an FMU, as FMI-LS-REF and MA-HS-Experiments lay them out."""

from __future__ import annotations

import hashlib
import io
from pathlib import Path
from xml.etree import ElementTree
from zipfile import ZipFile

import numpy as np
import pandas as pd
import pytest

from lptn.basics.errors import InputError
from lptn.fmu import Session, export
from lptn.model.model import Model
from tests.fmu.conftest import network

FOLDER = "extra/org.fmi-standard.fmi-ls-ref"
LS = "{http://fmi-standard.org/fmi-ls-manifest}"


def test_the_fmu_gives_the_results_that_it_carries(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    exported = export(Model(network("leg")), tmp_path / "leg.fmu", reference=True)
    with ZipFile(exported.path) as archive:
        content = {name: archive.read(name) for name in archive.namelist()}
    manifest = ElementTree.fromstring(content[f"{FOLDER}/fmi-ls-manifest.xml"])
    assert manifest.tag == "fmiReferences"
    assert manifest.get(f"{LS}fmi-ls-name") == "org.fmi-standard.fmi-ls-ref"
    for related in manifest.iterfind("Related"):
        file = content[f"{FOLDER}/{related.get('source')}"]
        assert related.get("checksum") == hashlib.sha3_256(file).hexdigest()
    (entry,) = (element for element in manifest if element.get("role") == "experiment/smoke-test")
    (experiment,) = ElementTree.fromstring(content[f"{FOLDER}/{entry.get('source')}"])
    run, stimuli, references = experiment
    assert run.tag == "TransientSimulation"
    inputs, results = (
        pd.read_csv(io.BytesIO(content[f"{FOLDER}/{element.get('source')}"])) for element in (stimuli, references)
    )
    hold = float(run.get("stepSize", "nan"))
    with Session(exported.path, inputs=list(inputs.columns[1:]), outputs=list(results.columns[1:])) as session:
        seen = [session.outputs.copy()]
        for row in inputs.to_numpy()[::2, 1:]:
            session.inputs[:] = row
            seen.append(session.step(hold).copy())
    assert len(seen) * hold - hold == float(run.get("stopTime", "nan"))
    error = np.abs(np.array(seen) - results.to_numpy()[:, 1:]).max()
    assert error < float(experiment.get("tolerance", "nan"))
    assert results.to_numpy()[-1, 1:].min() > results.to_numpy()[0, 1:].max()


def test_tables_name_scalars(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--arrays"):
        export(Model(network("leg")), tmp_path / "x.fmu", arrays=True, reference=True, platforms=())
