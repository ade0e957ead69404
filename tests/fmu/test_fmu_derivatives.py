"""Directional and adjoint derivatives of all outputs against differences; output slopes; updates; Model Exchange."""

from __future__ import annotations

from typing import Any

import fmpy
import numpy as np
import pytest

from lptn.arrays import FloatArray
from lptn.fmu import Exported, Session
from tests.fmu.conftest import Build
from tests.fmu.drives import ZERO, leg_by_hand

WARM = {"FR_calf.torque": 12.0, "FR_hip.torque": 6.0, "FR_thigh.torque": 9.0, "FR_calf.temperature": 345.0}


def _forward(session: Session, unknowns: list[int], knowns: list[int], seed: FloatArray) -> FloatArray:
    fmu = session._fmu
    return np.array(fmu.getDirectionalDerivative(unknowns, knowns, seed.tolist()))


def _reverse(session: Session, unknowns: list[int], knowns: list[int], seed: FloatArray) -> FloatArray:
    return np.array(session._fmu.getAdjointDerivative(unknowns, knowns, seed.tolist(), len(knowns)))


def _lists(exported: Exported) -> tuple[list[int], list[int]]:
    component = exported.component
    unknowns = [variable.reference for variable in component.of("state", "rate", "output", "forecast")]
    knowns = [variable.reference for variable in component.of("state", "input", "parameter")]
    return unknowns, knowns


@pytest.mark.parametrize(("fmi", "solver"), [(2, "rk4"), (3, "rk4"), (3, "ros2")])
def test_forward_derivatives_are_those_of_differences(fmi: int, solver: str, built: Build) -> None:
    exported = built("leg", fmi, solver)
    unknowns, knowns = _lists(exported)
    starts = {v.name: v.start for v in exported.component.of("state", "input", "parameter")} | WARM
    names, every = list(starts), [exported.component.variables[reference].name for reference in unknowns]
    rng = np.random.default_rng(4)
    direction = rng.normal(size=len(knowns)) * np.array([abs(starts[name] or 1.0) for name in names])
    with Session(exported.path, values=starts) as session:
        found = _forward(session, unknowns, knowns, direction)
        sides = []
        for sign in (1.0, -1.0):
            moved = {name: starts[name] + sign * 1e-6 * step for name, step in zip(names, direction, strict=True)}
            session.reset(moved)
            sides.append(session.read(every))
    differences = (sides[0] - sides[1]) / 2e-6
    assert np.count_nonzero(differences) > 15
    forecasts = [name.endswith("time_to_limit") for name in every]
    assert np.abs(np.array(found)[forecasts]).min() > 0
    assert found == pytest.approx(differences, rel=2e-4, abs=1e-4)


@pytest.mark.parametrize("name", ["leg", "everything"])
def test_adjoint_and_forward_derivatives_are_one(name: str, built: Build) -> None:
    exported = built(name)
    unknowns, knowns = _lists(exported)
    rng = np.random.default_rng(6)
    values = (
        WARM if name == "leg" else {"a.temperature": 340.0, "a.torque": 9.0, "base.speed": 1.0, "b.velocity_rms": 2.0}
    )
    with Session(exported.path, values=values) as session:
        down, up = rng.normal(size=len(knowns)), rng.normal(size=len(unknowns))
        across = up @ _forward(session, unknowns, knowns, down)
        assert _reverse(session, unknowns, knowns, up) @ down == pytest.approx(across, rel=1e-11)
        assert up @ _forward(session, unknowns, knowns, down) == across


@pytest.mark.parametrize("fmi", [2, 3])
def test_output_slopes_are_those_of_the_motion(fmi: int, built: Build) -> None:
    exported = built("leg", fmi)
    names = ["FR_calf.temperature", "FR_calf.to_ambient.heat_flow", "FR_calf.torque_scale"]
    with Session(exported.path, outputs=names, values=WARM) as session:
        references = [session.variables[name].valueReference for name in names]
        fmu: Any = session._fmu
        get = fmu.getRealOutputDerivatives if fmi == 2 else fmu.getOutputDerivatives
        slopes = np.array(get(references, [1] * len(names)))
        before = session.read(names)
        session.step(1e-3)
        assert (session.outputs - before) / 1e-3 == pytest.approx(slopes, rel=1e-3, abs=1e-7)


def test_an_intermediate_update_may_end_a_step_early(built: Build) -> None:
    from fmpy.fmi3 import FMU3Slave

    exported = built("leg")
    description = fmpy.read_model_description(str(exported.path))
    folder = fmpy.extract(str(exported.path))
    fmu = FMU3Slave(
        guid=description.guid,
        modelIdentifier=description.coSimulation.modelIdentifier,
        unzipDirectory=str(folder),
        instanceName="one",
    )
    seen: list[tuple[float, bool]] = []

    def update(_: Any, time: float, asked: bool, shown: bool, done: bool, may: bool, early: Any, when: Any) -> None:
        seen.append((time, asked))
        if may and time > 2.5:
            early[0], when[0] = True, time

    fmu.instantiate(intermediateUpdate=update, earlyReturnAllowed=True, requiredIntermediateVariables=[7])
    fmu.enterInitializationMode()
    fmu.exitInitializationMode()
    _, _, early, reached = fmu.doStep(0.0, 10.0)
    assert early
    assert reached == pytest.approx(3.0)
    assert [time for time, asked in seen if asked] == pytest.approx([1.0, 2.0, 3.0])
    fmu.doStep(reached, 1.0)
    fmu.freeInstance()


@pytest.mark.parametrize("fmi", [2, 3])
def test_model_exchange_by_fmpy_with_constant_inputs(fmi: int, built: Build) -> None:
    """fmpy's CVODES; its own handling of inputs that vary is off, so they stay."""
    names = [f"FR_{joint}.temperature" for joint in ("hip", "thigh", "calf")]
    found = fmpy.simulate_fmu(
        str(built("leg", fmi).path),
        fmi_type="ModelExchange",
        stop_time=100.0,
        output_interval=10.0,
        relative_tolerance=1e-9,
        start_values={"FR_calf.torque": 5.0, "ambient.temperature": 290.0},
        output=names,
    )
    expected = leg_by_hand(np.tile([290.0 - ZERO, 0.0, 0.0, 5.0], (10, 1)), 10.0)
    temperatures = np.array([[row[name] for name in names] for row in found[1:]]) - ZERO
    assert np.abs(temperatures - expected).max() < 1e-4
