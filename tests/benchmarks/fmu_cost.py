"""What a co-simulation step of the 13-node quadruped costs: our FMU in C and through fmpy, PythonFMU, MuJoCo beside it.

Each step sets all inputs, steps 0.1 s, gets the 13 temperatures. The peer is the same model as a PythonFMU slave that
calls the model's own CasADi function. Run: `python tests/benchmarks/fmu_cost.py`; with `PYTHONPATH=examples/mujoco_a1`
MuJoCo's step is measured too.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from statistics import median
from typing import Any
from zipfile import ZipFile

import fmpy
import numpy as np

from lptn.basics.c_library import compiler as c_compiler
from lptn.fmu import Session, export
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.robots.presets import presets

HOST = Path(__file__).parents[1] / "fmu" / "host.c"
STEP, ROUNDS = 0.1, 5
SLAVE = """
from pathlib import Path
import numpy as np
from pythonfmu import Fmi2Causality, Fmi2Slave, Fmi2Variability, Real
from lptn.model import Model
from lptn.model.file import parse_model
from lptn.robots import presets

MODEL = Model(parse_model(presets()["quadruped"], Path("quadruped.toml")).network)
STEP = MODEL.step("rk4")


class Quadruped(Fmi2Slave):
    def __init__(self, **kwargs):
        super().__init__(**kwargs)
        self.u = np.zeros(len(MODEL.inputs))
        self.x = np.full(len(MODEL.states), 25.0)
        self.p = MODEL.values
        for k, name in enumerate(MODEL.inputs):
            self._add(f"u{k}", Fmi2Causality.input, self.u, k)
        for k, name in enumerate(MODEL.nodes):
            self._add(f"x{k}", Fmi2Causality.output, self.x, k)

    def _add(self, name, causality, array, k):
        def get():
            return float(array[k])

        def put(value):
            array[k] = value

        setter = put if causality == Fmi2Causality.input else None
        more = {"start": float(array[k])} if setter else {}
        self.register_variable(
            Real(name, causality=causality, variability=Fmi2Variability.continuous, getter=get, setter=setter, **more)
        )

    def do_step(self, current_time, step_size):
        self.x[:] = STEP(self.x, self.u, self.p, step_size).full().ravel()
        return True
"""


def timed(call: Callable[[], object], n: int) -> float:
    """Microseconds of processor time a call, the median of several rounds."""
    times = []
    for _ in range(ROUNDS):
        begun = time.process_time()
        for _ in range(n):
            call()
        times.append((time.process_time() - begun) / n * 1e6)
    return median(times)


def in_c(fmu: Path, folder: Path, component: Any) -> float:
    """Our FMU called from C."""
    with ZipFile(fmu) as archive:
        archive.extractall(folder)
    compiler = c_compiler() or [sys.executable, "-m", "ziglang", "cc"]
    program = folder / "host"
    subprocess.run([*compiler, "-O2", "-I", str(folder / "sources"), "-o", str(program), str(HOST), "-ldl"], check=True)
    (library,) = (path for path in (folder / "binaries").rglob("*") if path.is_file())
    text = (folder / "sources" / "config.h").read_text()
    token = next(line.split('"')[1] for line in text.splitlines() if "define TOKEN" in line)
    counts = [component.of("input")[0].reference, len(component.of("input")), 1, len(component.model.nodes)]
    words = [str(program), str(library), token, "300000", *map(str, counts)]
    times = []
    for _ in range(ROUNDS):
        done = subprocess.run(words, check=True, capture_output=True, text=True)
        times.append(float(done.stdout.split("microseconds")[1]))
    return median(times)


def through_fmpy(fmu: Path, component: Any) -> tuple[float, float]:
    """Our FMU through fmpy: with arrays that are made once, and by fmpy's calls with lists."""
    outputs = [f"{node}.temperature" for node in component.model.nodes]
    with Session(fmu, outputs=outputs) as session:
        session.inputs[:] = [293.0 if name == "ambient.temperature" else 1.0 for name in session.input_names]
        arrays = timed(lambda: session.step(STEP), 5000)
        slave, values = session._fmu, session.inputs.tolist()
        inputs = [variable.reference for variable in component.of("input")]
        references = [component.names[name].reference for name in outputs]
        put, get = (slave.setReal, slave.getReal) if session._fmi == 2 else (slave.setFloat64, slave.getFloat64)

        def with_lists() -> None:
            put(inputs, values)
            slave.doStep(session.time, STEP)
            get(references)
            session.time += STEP

        return arrays, timed(with_lists, 5000)


def with_outputs(fmu: Path, kind: str) -> float:
    """A step through fmpy that also reads every output whose name holds these words."""
    outputs = [variable.name for variable in fmpy.read_model_description(fmu).modelVariables if kind in variable.name]
    with Session(fmu, outputs=outputs) as session:
        session.inputs[:] = [293.0 if name == "ambient.temperature" else 1.0 for name in session.input_names]
        return timed(lambda: session.step(STEP), 500)


def python_fmu(folder: Path) -> float | None:
    """The same model as a PythonFMU slave, through fmpy; `None` where the package is missing."""
    if find_spec("pythonfmu") is None:
        return None
    script = folder / "quadruped_slave.py"
    script.write_text(SLAVE)
    import_module("pythonfmu").FmuBuilder.build_FMU(str(script), dest=str(folder))
    with Session(folder / "Quadruped.fmu", trust=True) as session:
        session.inputs[:] = [20.0] + [1.0] * (len(session.inputs) - 1)
        return timed(lambda: session.step(STEP), 300)


def mujoco_step() -> float | None:
    """One step of the A1 without control in MuJoCo; `None` where it or the example is missing."""
    if find_spec("mujoco") is None or find_spec("a1_robot") is None:
        return None
    import mujoco

    from a1_robot import OneNode, build

    model = build(OneNode())
    data = mujoco.MjData(model)
    for _ in range(500):
        mujoco.mj_step(model, data)
    return timed(lambda: mujoco.mj_step(model, data), 2000)


def agreement(fmu: Path, model: Model) -> float:
    """The largest difference between our FMU and the model after 300 steps [K]: the costs are of the same thing."""
    rng = np.random.default_rng(0)
    inputs = rng.uniform(0.0, 4.0, (300, len(model.inputs)))
    shift = np.array([273.15 if name.startswith("temperature.") else 0.0 for name in model.inputs])
    x = np.full(len(model.states), 25.0)
    with Session(fmu, outputs=[f"{node}.temperature" for node in model.nodes]) as session:
        for row in inputs:
            session.inputs[:] = row + shift
            session.step(STEP)
            x = model.step("rk4")(x, row, model.values, STEP).full().ravel()
        return float(np.abs(session.outputs - 273.15 - x[: len(model.nodes)]).max())


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    model = Model(parse_model(presets()["quadruped"], Path("quadruped.toml")).network)
    results: dict[str, float | None] = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        fmi3, fmi2 = (export(model, folder / f"q{fmi}.fmu", fmi=fmi, forecast=True) for fmi in (3, 2))
        results["apart from the model [K]"] = agreement(fmi3.path, model)
        results["ours in C [us]"] = in_c(fmi3.path, folder / "c", fmi3.component)
        for exported in (fmi2, fmi3):
            arrays, lists = through_fmpy(exported.path, exported.component)
            results[f"ours through fmpy, FMI {exported.fmi}, arrays made once [us]"] = arrays
            results[f"ours through fmpy, FMI {exported.fmi}, lists [us]"] = lists
        limited = export(model, folder / "limited.fmu", admissible=True)
        results["ours through fmpy, with each node's time to its limit [us]"] = with_outputs(fmi3.path, "time_to_limit")
        results["ours through fmpy, with the 48 admissible torques [us]"] = with_outputs(limited.path, "admissible")
        results["PythonFMU through fmpy [us]"] = peer = python_fmu(folder)
        results["MuJoCo's A1, one step of 2 ms [us]"] = robot = mujoco_step()
    ours, best = results["ours in C [us]"], results["ours through fmpy, FMI 2, arrays made once [us]"]
    assert ours is not None
    assert best is not None
    if peer is not None:
        results["PythonFMU / ours in C"], results["PythonFMU / ours through fmpy"] = peer / ours, peer / best
    if robot is not None:
        results["share of the thermal model, C, stepped with MuJoCo [%]"] = 100 * ours / (ours + robot)
        results["share of the thermal model, fmpy, stepped with MuJoCo [%]"] = 100 * best / (best + robot)
    for what, value in results.items():
        print(f"{what:62} {'not measured' if value is None else format(value, '.4g')}")
    if chosen.json:
        chosen.json.write_text(json.dumps(results, indent=2) + "\n")


if __name__ == "__main__":
    main()
