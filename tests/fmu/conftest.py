"""FMUs for the tests, each built once a session."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path

import pytest

from lptn.fmu import Exported, export
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.model.network import Network
from lptn.robots.presets import presets
from tests.builders import AMBIENT, effect, leg, link, node, with_every_effect

Build = Callable[..., Exported]


def network(name: str) -> Network:
    """A preset; `everything`, all effects on two nodes; `stiff`, a motor with a bead of 20 ms beside its minutes."""
    if name == "everything":
        return with_every_effect()
    if name == "stiff":
        nodes = (node("bead", 0.005), node("motor", 200.0), AMBIENT)
        return Network(
            "stiff",
            nodes,
            (link("bead", "motor", 4.0), link("motor", "ambient", 3.0)),
            (effect("copper_loss", "motor"),),
        )
    if name == "bare":
        return leg()
    return parse_model(presets()[name], Path(f"{name}.toml")).network


@pytest.fixture(scope="session")
def built(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Build]:
    """`built("leg", 3)`: a network's FMU; the trust store lies in a folder of its own."""
    folder = tmp_path_factory.mktemp("fmus")

    @cache
    def build(
        name: str,
        fmi: int = 3,
        solver: str = "rk4",
        step: float | None = None,
        admissible: bool = False,
        casadi: bool = False,
        forecast: bool = False,
        events: bool = False,
        arrays: bool = False,
    ) -> Exported:
        options = {"admissible": admissible, "casadi": casadi, "forecast": forecast, "events": events, "arrays": arrays}
        path = folder / f"{name}.{fmi}.{solver}.{step}.{'.'.join(key for key, on in options.items() if on)}.fmu"
        return export(Model(network(name)), path, fmi=fmi, solver=solver, step=step, **options)

    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(folder))
        yield build


def unknowns_and_knowns(exported: Exported) -> tuple[list[int], list[int]]:
    """Value references of all that FMI differentiates, and of all that it differentiates by."""
    component = exported.component
    parameters = [
        variable.reference
        for variable in component.of("state", "rate", "output", "admissible", "forecast", "indicator")
    ]
    return parameters, [variable.reference for variable in component.of("state", "input", "parameter")]
