"""The files of an FMU but for its binaries: XML, C sources, documentation, the model file."""

from __future__ import annotations

import hashlib
import math
import re
import uuid
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import metadata
from importlib.resources import files
from typing import Any

from lptn.errors import InputError

from .codegen import c_code, moving_jacobian
from .component import Component
from .integration import Integration
from .structure import structure
from .units import definitions

_HEADERS = {
    2: ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    3: ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}
_OURS = ("core.c", "core.h", "derivatives.c", "snapshots.c", "solve.c")
_STOP = 3600.0  # s; default experiment
_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")
_NAMESPACE = uuid.UUID("6e1c2f0a-6c7b-5d0e-9a64-8f2d3b1c7e55")


@dataclass(frozen=True)
class Source:
    """An FMU without binaries.

    Args:
        identifier: the model identifier: name of the binaries.
        fmi: 2 or 3.
        files: contents by path inside the FMU.
    """

    identifier: str
    fmi: int
    files: dict[str, bytes]


def source(
    component: Component,
    fmi: int,
    integration: Integration,
    model_text: str | None = None,
    date: datetime | None = None,
) -> Source:
    """All files of an FMU but its binaries.

    Args:
        fmi: 2 or 3.
        integration: solver and inner step of Co-Simulation.
        model_text: the model file, which then goes along as a resource.
        date: generation time; now by default.

    Raises:
        InputError: the package that brings the FMI headers is missing.
    """
    name = component.model.network.name
    identifier = identifier_of(name)
    code = c_code(component, f"{identifier}_model")
    values = _values(component, integration, fmi) | {"identifier": identifier, "date": _stamp(date)}
    values["token"] = ""
    blank = _rendered("config.h.j2", values)
    # The same model gives the same token, so a saved state goes from one export to the next.
    digest = hashlib.sha256("\n".join([str(fmi), code, blank, *_our_sources(fmi).values()]).encode()).hexdigest()
    token = str(uuid.uuid5(_NAMESPACE, digest))
    values |= {"token": "{" + token + "}" if fmi == 2 else token, "digest": digest[:12]}
    found = {
        "modelDescription.xml": _rendered(f"modelDescription{fmi}.xml.j2", values),
        "documentation/index.html": _rendered("index.html.j2", values),
        "documentation/licenses/fmi-headers.txt": _notice(fmi),
        "documentation/licenses/license.txt": _own_licence(),
        "sources/config.h": _rendered("config.h.j2", values),
        "sources/model.c": code,
        **{f"sources/{name}": text for name, text in _our_sources(fmi).items()},
        **{f"sources/{name}": header(name) for name in _HEADERS[fmi]},
    }
    if fmi == 3:
        found["sources/buildDescription.xml"] = _rendered("buildDescription.xml.j2", values)
    if model_text is not None:
        found["resources/model.toml"] = model_text
    return Source(identifier, fmi, {path: text.encode() for path, text in found.items()})


def identifier_of(name: str) -> str:
    """A C identifier for a model's name: `single motor` gives `single_motor`."""
    word = re.sub(r"\W+", "_", name, flags=re.ASCII).strip("_") or "model"
    return word if word[0].isalpha() else f"model_{word}"


def header(name: str) -> str:
    """One of the FMI headers, which the package `fmpy` carries.

    Raises:
        InputError: the package is missing.
    """
    try:
        return (files("fmpy") / "c-code" / name).read_text(encoding="utf-8")
    except (ModuleNotFoundError, FileNotFoundError) as error:
        raise InputError("fmpy", "package", "no FMI headers", "pip install 'lptn[fmu]'") from error


def number(value: float) -> str:
    """A number that C and XML read back to the last bit."""
    return repr(float(value)) if math.isfinite(value) else ("INF" if value > 0 else "-INF")


def _values(component: Component, integration: Integration, fmi: int) -> dict[str, Any]:
    variables = component.variables
    return {
        "name": component.model.network.name,
        "version": metadata("lptn")["Version"],
        "fmi": fmi,
        "description": f"Thermal network of {component.model.network.name}",
        "variables": variables,
        "states": component.of("state"),
        "inputs": component.of("input"),
        "parameters": component.of("parameter"),
        "outputs": component.of("output", "admissible"),
        "forecasts": component.of("forecast"),
        "limits": component.limited[0],
        "bound_moves": moving_jacobian(component),
        "structure": structure(component),
        "definitions": definitions(variable.unit for variable in variables),
        "solver": integration.solver,
        "step": integration.step,
        "fastest": integration.fastest,
        "experiment_step": integration.step,
        "stop": _STOP,
    }


@cache
def _environment() -> Any:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(_template),
        autoescape=jinja2.select_autoescape(["xml.j2", "html.j2"]),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
    )
    environment.filters["number"] = number
    return environment


def _template(name: str) -> str:
    return (files("lptn.fmu") / "templates" / name).read_text(encoding="utf-8")


def _rendered(template: str, values: dict[str, Any]) -> str:
    """A template filled in; a character of a name that XML can't hold becomes `_`."""
    return _NOT_XML.sub("_", _environment().get_template(template).render(values))


@cache
def _our_sources(fmi: int) -> dict[str, str]:
    folder = files("lptn.fmu") / "c"
    return {name: (folder / name).read_text(encoding="utf-8") for name in (*_OURS, f"fmi{fmi}.c")}


def _notice(fmi: int) -> str:
    """The licence comment of the FMI headers, as it stands in them."""
    text = header(_HEADERS[fmi][1])
    comments = [comment for comment in re.findall(r"/\*(.*?)\*/", text, flags=re.DOTALL) if "Redistribution" in comment]
    return "The FMI headers in sources/ come with this notice:\n" + "\n".join(comments)


def _own_licence() -> str:
    """The licence of the C sources that lptn adds."""
    return (files("lptn.fmu") / "c" / "LICENSE").read_text(encoding="utf-8")


def _stamp(date: datetime | None) -> str:
    return (date or datetime.now(UTC)).strftime("%Y-%m-%dT%H:%M:%SZ")
