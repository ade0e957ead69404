"""Drive an FMU with one foreign importer, in a process of its own: `drive_importer.py IMPORTER PLAN.json`.

The plan: file, step, inputs (names, references, rows), outputs (names, references), identifier, token. Rows of outputs
after each step are printed as JSON.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from typing import Any

Plan = dict[str, Any]
Rows = list[list[float]]


def with_fmpy(plan: Plan) -> Rows:
    """fmpy's own Co-Simulation master, inputs as its step signals."""
    import fmpy
    import numpy as np

    step, rows = plan["step"], plan["rows"]
    kinds = [("time", float), *((name, float) for name in plan["inputs"])]
    # Two entries for one time are a step to fmpy: the later holds from then on.
    signal = []
    for k, row in enumerate(rows):
        signal += [(k * step, *row), ((k + 1) * step, *row)]
    result = fmpy.simulate_fmu(
        plan["file"],
        stop_time=len(rows) * step,
        output_interval=step,
        step_size=step,
        fmi_type="CoSimulation",
        input=np.array(signal, dtype=kinds),
        output=plan["outputs"],
        set_input_derivatives=False,
    )
    return [[float(row[name]) for name in plan["outputs"]] for row in result[1:]]


def with_fmuloader(plan: Plan) -> Rows:
    """fmuloader's plain bindings."""
    if plan["fmi"] == 2:
        from fmuloader.fmi2 import Fmi2Slave, Fmi2Type

        slave: Any = Fmi2Slave(plan["file"], model_identifier=plan["identifier"])
        slave.instantiate("one", Fmi2Type.CO_SIMULATION, guid=plan["token"])
        slave.setup_experiment(start_time=0.0)
        put, get = slave.set_real, slave.get_real
    else:
        from fmuloader.fmi3 import Fmi3Slave

        slave = Fmi3Slave(plan["file"], model_identifier=plan["identifier"])
        slave.instantiate_co_simulation("one", instantiation_token=plan["token"])
        put, get = slave.set_float64, slave.get_float64
    slave.enter_initialization_mode()
    slave.exit_initialization_mode()
    table = []
    for k, row in enumerate(plan["rows"]):
        put(plan["input_references"], row)
        slave.do_step(k * plan["step"], plan["step"])
        table.append(list(get(plan["output_references"])))
    slave.terminate()
    slave.free_instance()
    return table


def with_libcosimpy(plan: Plan) -> Rows:
    """libcosim (Open Simulation Platform), FMI 2."""
    from libcosimpy.CosimExecution import CosimExecution
    from libcosimpy.CosimManipulator import CosimManipulator
    from libcosimpy.CosimObserver import CosimObserver
    from libcosimpy.CosimSlave import CosimLocalSlave

    execution = CosimExecution.from_step_size(plan["step"] * 1e9)
    slave = CosimLocalSlave(fmu_path=plan["file"], instance_name="one")
    index = execution.add_local_slave(slave)
    manipulator, observer = CosimManipulator.create_override(), CosimObserver.create_last_value()
    execution.add_manipulator(manipulator)
    execution.add_observer(observer)
    table = []
    for row in plan["rows"]:
        manipulator.slave_real_values(index, plan["input_references"], row)
        execution.step()
        table.append(list(observer.last_real_values(index, plan["output_references"])))
    return table


def with_ecospy(plan: Plan) -> Rows:
    """Ecos, FMI 2 and 3."""
    from ecospy import EcosSimulation, EcosSimulationStructure

    with EcosSimulationStructure() as structure:
        structure.add_model("one", plan["file"])
        with EcosSimulation(structure=structure, step_size=plan["step"]) as simulation:
            simulation.init()
            table = []
            for row in plan["rows"]:
                for name, value in zip(plan["inputs"], row, strict=True):
                    simulation.set_real(f"one::{name}", value)
                simulation.step()
                table.append([simulation.get_real(f"one::{name}") for name in plan["outputs"]])
            simulation.terminate()
            return table


IMPORTERS = {"fmpy": with_fmpy, "fmuloader": with_fmuloader, "libcosimpy": with_libcosimpy, "ecospy": with_ecospy}


if __name__ == "__main__":
    chosen, plan_file = sys.argv[1:3]
    rows = IMPORTERS[chosen](json.loads(Path(plan_file).read_text()))
    print("ROWS" + json.dumps(rows))
