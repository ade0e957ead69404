"""Directional and adjoint derivatives of all outputs; output slopes; updates; Model Exchange; CasADi as importer."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from zipfile import ZipFile

import casadi as ca
import fmpy
import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from lptn.fmu import Exported, Session
from tests.fmu.conftest import Build, unknowns_and_knowns
from tests.fmu.truth import ZERO, leg_by_hand

WARM = {"FR_calf.torque": 12.0, "FR_hip.torque": 6.0, "FR_thigh.torque": 9.0, "FR_calf.temperature": 345.0}


def _forward(session: Session, parameters: list[int], knowns: list[int], seed: FloatArray) -> FloatArray:
    fmu = session._fmu
    return np.array(fmu.getDirectionalDerivative(parameters, knowns, seed.tolist()))


def _reverse(session: Session, parameters: list[int], knowns: list[int], seed: FloatArray) -> FloatArray:
    return np.array(session._fmu.getAdjointDerivative(parameters, knowns, seed.tolist(), len(knowns)))


@pytest.mark.slow
@pytest.mark.parametrize(("fmi", "solver"), [(2, "rk4"), (3, "rk4"), (3, "ros2")])
def test_forward_derivatives_are_those_of_differences(fmi: int, solver: str, built: Build) -> None:
    exported = built("leg", fmi, solver, forecast=True, events=True)
    parameters, knowns = unknowns_and_knowns(exported)
    starts = {v.name: v.start for v in exported.component.of("state", "input", "parameter")} | WARM
    names, every = list(starts), [exported.component.variables[reference].name for reference in parameters]
    rng = np.random.default_rng(4)
    direction = rng.normal(size=len(knowns)) * np.array([abs(starts[name] or 1.0) for name in names])
    with Session(exported.path, values=starts) as session:
        derivatives = _forward(session, parameters, knowns, direction)
        sides = []
        for sign in (1.0, -1.0):
            moved = {name: starts[name] + sign * 1e-6 * step for name, step in zip(names, direction, strict=True)}
            session.reset(moved)
            sides.append(session.read(every))
    differences = (sides[0] - sides[1]) / 2e-6
    assert np.count_nonzero(differences) > 15
    forecasts = [name.endswith("time_to_limit") for name in every]
    assert np.abs(np.array(derivatives)[forecasts]).min() > 0
    assert derivatives == pytest.approx(differences, rel=2e-4, abs=1e-4)


@pytest.mark.parametrize("name", ["leg", pytest.param("everything", marks=pytest.mark.slow)])
def test_adjoint_and_forward_derivatives_are_one(name: str, built: Build) -> None:
    exported = built(name, forecast=True, events=True)
    parameters, knowns = unknowns_and_knowns(exported)
    rng = np.random.default_rng(6)
    values = (
        WARM if name == "leg" else {"a.temperature": 340.0, "a.torque": 9.0, "base.speed": 1.0, "b.velocity_rms": 2.0}
    )
    with Session(exported.path, values=values) as session:
        down, up = rng.normal(size=len(knowns)), rng.normal(size=len(parameters))
        across = up @ _forward(session, parameters, knowns, down)
        assert _reverse(session, parameters, knowns, up) @ down == pytest.approx(across, rel=1e-11)
        assert up @ _forward(session, parameters, knowns, down) == across


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
    rows = fmpy.simulate_fmu(
        str(built("leg", fmi).path),
        fmi_type="ModelExchange",
        stop_time=100.0,
        output_interval=10.0,
        relative_tolerance=1e-9,
        start_values={"FR_calf.torque": 5.0, "ambient.temperature": 290.0},
        output=names,
    )
    expected = leg_by_hand(np.tile([290.0 - ZERO, 0.0, 0.0, 5.0], (10, 1)), 10.0)
    temperatures = np.array([[row[name] for name in names] for row in rows[1:]]) - ZERO
    assert np.abs(temperatures - expected).max() < 1e-4


# --- CasADi takes an FMU back in: its Jacobians are those of the symbolic model -----------------------


def _imported(exported: Exported, folder: Path) -> ca.DaeBuilder:
    with ZipFile(exported.path) as archive:
        archive.extractall(folder)
    return ca.DaeBuilder("again", str(folder))


class _Point:
    """A point in kelvin, and the symbolic model's derivatives there."""

    def __init__(self, exported: Exported, imported: ca.DaeBuilder) -> None:
        component, model = exported.component, exported.component.model
        rng = np.random.default_rng(5)
        self.x = rng.uniform(290.0, 350.0, len(model.states))
        hot = np.array([variable.celsius for variable in component.of("input")])
        self.u = np.where(hot, 295.0, rng.uniform(0.5, 5.0, len(model.inputs)))
        self.p = np.array([variable.start for variable in component.of("parameter")])
        assert [component.names[name].kind for name in imported.p()] == ["parameter"] * len(self.p)
        count = len(model.parameters)
        raised = np.array([ZERO if parameter.declared.unit == "degC" else 0.0 for parameter in model.parameters])
        point = (self.x - ZERO, self.u - np.where(hot, ZERO, 0.0), self.p[:count] - raised)
        symbols = model.symbols
        by_input = ca.Function(
            "B", [symbols.x, symbols.u, symbols.p], [ca.densify(ca.jacobian(symbols.rates, symbols.u))]
        )
        self.by_state = model.state_jacobian(*point).full()
        self.by_input = by_input(*point).full()
        self.by_parameter = np.zeros((len(self.x), len(self.p)))
        self.by_parameter[:, :count] = model.parameter_jacobian(*point).full()

    def agrees(self, jacobians: Any) -> bool:
        for jacobian, expected in zip(jacobians, (self.by_state, self.by_input, self.by_parameter), strict=True):
            if np.abs(np.array(ca.DM(jacobian)) - expected).max() > 1e-10:
                return False
        return True


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "fmi"),
    [
        ("leg", 2),
        ("leg", 3),
        pytest.param("everything", 3, marks=pytest.mark.slow),
        pytest.param("quadruped", 3, marks=pytest.mark.slow),
    ],
)
def test_jacobians_before_and_after_an_adjoint_call(name: str, fmi: int, built: Build, tmp_path: Path) -> None:
    exported = built(name, fmi, casadi=True)
    imported = _imported(exported, tmp_path)
    point = _Point(exported, imported)
    jacobians = imported.create("J", ["x", "u", "p"], ["jac_ode_x", "jac_ode_u", "jac_ode_p"])
    assert point.agrees(jacobians(point.x, point.u, point.p))
    if fmi == 3:
        rates = imported.create("rates", ["x", "u", "p"], ["ode"])
        seed = np.linspace(-1.0, 2.0, len(point.x))
        back = rates.reverse(1)(point.x, point.u, point.p, rates(point.x, point.u, point.p), seed)
        expected = (seed @ point.by_state, seed @ point.by_input, seed @ point.by_parameter)
        for product, row in zip(back, expected, strict=True):
            assert np.abs(np.array(ca.DM(product)).ravel() - row).max() < 1e-10
        assert point.agrees(jacobians(point.x, point.u, point.p))


def test_a_simulation_of_the_import_is_the_models(built: Build, tmp_path: Path) -> None:
    """Model Exchange by CasADi's CVODES: the same end as the model's own."""
    exported = built("leg", casadi=True)
    imported, model = _imported(exported, tmp_path), exported.component.model
    rates = imported.create("rates", ["x", "u", "p"], ["ode"])
    x, u, p = ca.MX.sym("x", 3), ca.MX.sym("u", 4), ca.MX.sym("p", len(imported.p()))
    again = ca.integrator(
        "again", "cvodes", {"x": x, "u": u, "p": p, "ode": rates(x, u, p)}, 0.0, 300.0, {"reltol": 1e-10}
    )
    inputs = np.array([20.0, 3.0, -4.0, 5.0])
    start = np.array([variable.start for variable in exported.component.of("parameter")])
    end = again(x0=np.full(3, 298.15), u=inputs + np.array([ZERO, 0, 0, 0]), p=start)["xf"].full().ravel() - ZERO
    own = model.run(3000)(np.full(3, 25.0), np.repeat(inputs[:, None], 3000, axis=1), model.values, 0.1).full()[:, -1]
    assert np.abs(end - own).max() < 1e-6
