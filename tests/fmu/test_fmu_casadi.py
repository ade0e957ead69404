"""CasADi takes an FMU back in: its Jacobians are those of the symbolic model, before and after an adjoint call."""

from __future__ import annotations

from pathlib import Path
from typing import Any
from zipfile import ZipFile

import casadi as ca
import numpy as np
import pytest

from lptn.fmu import Exported
from tests.fmu.conftest import Build
from tests.fmu.drives import ZERO


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
        known = len(model.unknowns)
        raised = np.array([ZERO if unknown.declared.unit == "degC" else 0.0 for unknown in model.unknowns])
        point = (self.x - ZERO, self.u - np.where(hot, ZERO, 0.0), self.p[:known] - raised)
        symbols = model.symbols
        by_input = ca.Function(
            "B", [symbols.x, symbols.u, symbols.p], [ca.densify(ca.jacobian(symbols.rates, symbols.u))]
        )
        self.by_state = model.state_jacobian(*point).full()
        self.by_input = by_input(*point).full()
        self.by_parameter = np.zeros((len(self.x), len(self.p)))
        self.by_parameter[:, :known] = model.parameter_jacobian(*point).full()

    def agrees(self, jacobians: Any) -> bool:
        for found, expected in zip(jacobians, (self.by_state, self.by_input, self.by_parameter), strict=True):
            if np.abs(np.array(ca.DM(found)) - expected).max() > 1e-10:
                return False
        return True


@pytest.mark.parametrize(("name", "fmi"), [("leg", 2), ("leg", 3), ("everything", 3), ("quadruped", 3)])
def test_jacobians_before_and_after_an_adjoint_call(name: str, fmi: int, built: Build, tmp_path: Path) -> None:
    exported = built(name, fmi)
    imported = _imported(exported, tmp_path)
    point = _Point(exported, imported)
    jacobians = imported.create("J", ["x", "u", "p"], ["jac_ode_x", "jac_ode_u", "jac_ode_p"])
    assert point.agrees(jacobians(point.x, point.u, point.p))
    if fmi == 3:
        rates = imported.create("rates", ["x", "u", "p"], ["ode"])
        seed = np.linspace(-1.0, 2.0, len(point.x))
        back = rates.reverse(1)(point.x, point.u, point.p, rates(point.x, point.u, point.p), seed)
        expected = (seed @ point.by_state, seed @ point.by_input, seed @ point.by_parameter)
        for found, row in zip(back, expected, strict=True):
            assert np.abs(np.array(ca.DM(found)).ravel() - row).max() < 1e-10
        assert point.agrees(jacobians(point.x, point.u, point.p))


def test_a_simulation_of_the_import_is_the_models(built: Build, tmp_path: Path) -> None:
    """Model Exchange by CasADi's CVODES: the same end as the model's own."""
    exported = built("leg")
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
