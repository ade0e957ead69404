"""An FMU of somebody else's, written by hand in C: its own names, arrays, no model inside."""

from __future__ import annotations

import re
import subprocess
from importlib.resources import files
from pathlib import Path
from zipfile import ZipFile

import fmpy
import numpy as np
import pandas as pd
import pytest
from matplotlib.image import imread

from lptn.basics.c_library import compiler as c_compiler
from lptn.basics.errors import InputError
from lptn.cli.main import main
from lptn.fmu import Session
from lptn.fmu.cosim import cosimulate

# Two lumps, each 100 J/K and 2 K/W to a room of 300 K: T_case[i], heated by q[i] watts. Euler's steps of 0.01 s.
CODE = """
#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
static double q[2], T[2] = {300, 300};
void *fmi3InstantiateCoSimulation(void) { T[0] = T[1] = 300; return q; }
void fmi3FreeInstance(void *c) { (void)c; }
int fmi3EnterInitializationMode(void) { return 0; }
int fmi3ExitInitializationMode(void) { return 0; }
int fmi3Terminate(void) { return 0; }
int fmi3Reset(void *c) { (void)c; T[0] = T[1] = 300; return 0; }
const char *fmi3GetVersion(void) { return "3.0"; }
int fmi3GetFloat64(void *c, const uint32_t *r, size_t n, double *v, size_t m) {
    if (n != 1 || m != 2) return 3;
    memcpy(v, *r == 1 ? q : T, sizeof q);
    return 0;
}
int fmi3SetFloat64(void *c, const uint32_t *r, size_t n, const double *v, size_t m) {
    if (n == 0) return 0;
    if (n != 1 || m != 2 || *r != 1) return 3;
    memcpy(q, v, sizeof q);
    return 0;
}
int fmi3DoStep(void *c, double t, double h, bool no, bool *event, bool *end, bool *early, double *reached) {
    int k, i, n = (int)(h / 0.01 + 0.5);
    for (k = 0; k < n; k++)
        for (i = 0; i < 2; i++) T[i] += h / n * (q[i] - (T[i] - 300) / 2) / 100;
    *event = *end = *early = false, *reached = t + h;
    return 0;
}
"""
DESCRIPTION = """<?xml version="1.0" encoding="UTF-8"?>
<fmiModelDescription fmiVersion="3.0" modelName="lumps" instantiationToken="x">
<CoSimulation modelIdentifier="lumps" canHandleVariableCommunicationStepSize="true"/>
<UnitDefinitions><Unit name="K"><BaseUnit K="1"/></Unit></UnitDefinitions>
<ModelVariables>
<Float64 name="time" valueReference="0" causality="independent" variability="continuous"/>
<Float64 name="q" valueReference="1" causality="input" start="0 0"><Dimension start="2"/></Float64>
<Boolean name="enable" valueReference="3" causality="input" start="true"/>
<Float64 name="T_case" valueReference="2" causality="output" unit="K"><Dimension start="2"/></Float64>
</ModelVariables>
<ModelStructure><Output valueReference="2"/></ModelStructure>
</fmiModelDescription>
"""


@pytest.fixture(scope="module")
def foreign(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The FMU, for this machine."""
    compiler = c_compiler()
    if compiler is None:
        pytest.skip("no C compiler on this machine")
    folder = tmp_path_factory.mktemp("foreign")
    header = (files("fmpy") / "c-code" / "fmi3Functions.h").read_text()
    missing = set(re.findall(r"(fmi3[A-Z]\w+);", header)) - set(re.findall(r"(fmi3\w+)\(", CODE))
    stubs = "".join(f"int {name}(void) {{ return 3; }}\n" for name in sorted(missing) if not name.endswith("TYPE"))
    (folder / "lumps.c").write_text(CODE + stubs)
    library = folder / f"lumps{fmpy.sharedLibraryExtension}"
    subprocess.run([*compiler, "-O1", "-w", "-shared", "-fPIC", "lumps.c", "-o", library.name], cwd=folder, check=True)
    path = folder / "lumps.fmu"
    with ZipFile(path, "w") as archive:
        archive.writestr("modelDescription.xml", DESCRIPTION)
        archive.write(library, f"binaries/{fmpy.platform_tuple}/{library.name}")
    return path


@pytest.fixture
def log(tmp_path: Path) -> Path:
    """What the two lumps do by the formula, in degC, the second one's sensor 1 K too high."""
    time = np.arange(0.0, 300.0, 1.0)
    rises = [2.0 * watts * -np.expm1(-time / 200.0) for watts in (10.0, 20.0)]
    table = pd.DataFrame({"time": time, "power.left": 10.0, "power.right": 20.0})
    table["temperature.left"], table["temperature.right"] = (26.85 + rise for rise in rises)
    table["temperature.right"] += 1.0
    path = tmp_path / "log.csv"
    table.to_csv(path, index=False)
    return path


MAPPED = {
    "q[1]": "power.left",
    "q[2]": "power.right",
    "T_case[1]": "temperature.left",
    "T_case[2]": "temperature.right",
}


def test_elements_of_foreign_arrays_are_called_by_their_index(foreign: Path) -> None:
    with Session(foreign, outputs=["T_case[2]"], trust=True) as session:
        assert session.input_names == ["q[1]", "q[2]"]
        session.inputs[:] = [0.0, 20.0]
        assert session.step(200.0)[0] == pytest.approx(300.0 + 40.0 * -np.expm1(-1.0), abs=1e-2)


def test_any_fmu_is_driven_by_a_log_and_compared(foreign: Path, log: Path) -> None:
    (run,) = cosimulate(foreign, [log], mapped=MAPPED, trust=True).runs
    assert run.errors(0).max == pytest.approx(0.0, abs=0.01)
    assert run.errors(1).mean == pytest.approx(-1.0, abs=0.01)


def test_units_are_those_that_the_fmu_defines(foreign: Path, log: Path, tmp_path: Path) -> None:
    """The same numbers in the FMU, which now says of them that they are mW, and mK above 299.7 K: a log of a thousandth
    of the power, warmer by a thousandth."""
    path, units = tmp_path / "small.fmu", '<Unit name="mW"><BaseUnit kg="1" m="2" s="-3" factor="0.001"/></Unit>'
    units += '<Unit name="above"><BaseUnit K="1" factor="0.001" offset="299.7"/></Unit></UnitDefinitions>'
    text = DESCRIPTION.replace("</UnitDefinitions>", units).replace('causality="input"', 'causality="input" unit="mW"')
    with ZipFile(foreign) as old, ZipFile(path, "w") as new:
        for name in old.namelist():
            new.writestr(name, text.replace('unit="K"', 'unit="above"') if name.endswith("xml") else old.read(name))
    table = pd.read_csv(log)
    table[["power.left", "power.right"]] /= 1000.0
    for side, more in (("left", 0.0), ("right", 1.0)):
        table[f"temperature.{side}"] = 26.85 + (table[f"temperature.{side}"] - more - 26.85) / 1000.0 + more
    table.to_csv(log, index=False)
    (run,) = cosimulate(path, [log], mapped=MAPPED, trust=True).runs
    assert run.errors(0).max == pytest.approx(0.0, abs=1e-5)
    assert run.errors(1).mean == pytest.approx(-1.0, abs=1e-5)


def test_an_input_that_the_log_lacks_keeps_its_start_and_is_told(
    foreign: Path, log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mapped = {name: column for name, column in MAPPED.items() if name != "q[2]"}
    words = [word for pair in mapped.items() for word in ("--map", "=".join(pair))]
    with pytest.raises(SystemExit) as stop:
        main(["cosim", str(foreign), str(log), "--trust", *words])
    assert stop.value.code == 0
    assert "kept at their start values: q[2]." in capsys.readouterr().out
    (run,) = cosimulate(foreign, [log], mapped=mapped, trust=True).runs
    assert run.errors(0).max == pytest.approx(0.0, abs=0.01)
    assert run.readings[1] == pytest.approx(26.85)  # the room's, for nothing heats it


def test_an_input_that_is_no_real_number_is_told(foreign: Path, log: Path) -> None:
    with pytest.raises(InputError, match="--map enable: found an input of Boolean; expected one of reals"):
        cosimulate(foreign, [log], mapped=MAPPED | {"enable": "powered.left"}, trust=True)


def test_the_command_draws_what_it_compared(foreign: Path, log: Path, tmp_path: Path) -> None:
    plot = tmp_path / "log.png"
    words = ["cosim", foreign, log, "--trust", "--plot", plot]
    for name, column in MAPPED.items():
        words += ["--map", f"{name}={column}"]
    with pytest.raises(SystemExit) as stop:
        main([str(word) for word in words])
    assert stop.value.code == 0
    assert imread(plot).shape[0] > 200
