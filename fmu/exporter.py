"""`lptn.fmu.export`: a model as an FMU, its XML, C sources, documentation, libraries and model file in one archive."""

from __future__ import annotations

import hashlib
import io
import math
import re
import uuid
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import cache
from importlib.metadata import metadata
from importlib.resources import files
from pathlib import Path
from typing import Any

from lptn.basics.errors import InputError
from lptn.basics.files import write_whole
from lptn.model.file import ModelFile, read_model_file
from lptn.model.model import Model
from lptn.model.network import Network

from .codegen import Integration, c_code, integration, jacobian_moves, structure
from .compile import Compiler, Platform, compile_all, platforms_of, universal
from .component import Component
from .experiments import FOLDER, experiment, related
from .joined import arrays as arrays_of
from .joined import places_of, shown, structure_of_arrays, terminals
from .trust import remember
from .variables import Variable, unit_definitions

_HEADERS = {
    2: ("fmi2Functions.h", "fmi2FunctionTypes.h", "fmi2TypesPlatform.h"),
    3: ("fmi3Functions.h", "fmi3FunctionTypes.h", "fmi3PlatformTypes.h"),
}
_CORE = ("core.c", "core.h", "derivatives.c", "events.c", "snapshots.c", "solve.c")
_NOT_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")
_NAMESPACE = uuid.UUID("6e1c2f0a-6c7b-5d0e-9a64-8f2d3b1c7e55")  # of the tokens; any fixed one would do


@dataclass(frozen=True)
class Exported:
    """An FMU that was written.

    Args:
        path: the file.
        fmi: 2 or 3.
        platforms: names of the platforms whose binaries it holds.
        integration: solver, inner step and what was said about them.
        component: its variables and expressions.
        size: of the file [bytes].
        arrays: the arrays that stand in place of scalars, if any.
    """

    path: Path
    fmi: int
    platforms: tuple[str, ...]
    integration: Integration
    component: Component
    size: int
    arrays: tuple[Variable, ...] = ()

    @property
    def variables(self) -> dict[str, int]:
        """Value references by name."""
        return {variable.name: variable.reference for variable in shown(self.component.variables, self.arrays)}

    def as_json(self) -> dict[str, object]:
        """What was written, as other programs read it."""
        return {
            "file": str(self.path),
            "fmi": self.fmi,
            "platforms": list(self.platforms),
            "bytes": self.size,
            "solver": self.integration.solver,
            "step": self.integration.step,
            "fastest_time_constant": self.integration.fastest,
            "notes": list(self.integration.notes),
            "states": len(self.component.of("state")),
            "inputs": len(self.component.of("input")),
            "parameters": len(self.component.of("parameter")),
            "outputs": sum(variable.causality == "output" for variable in self.component.variables),
            "arrays": len(self.arrays),
        }


def export(
    model: Model | Network | ModelFile | str | Path,
    output: str | Path,
    *,
    fmi: int = 3,
    platforms: Sequence[str] | None = None,
    solver: str = "rk4",
    step: float | None = None,
    limits: Mapping[str, float] | float | None = None,
    start: Mapping[str, float] | float | None = None,
    forecast: bool = False,
    events: bool = False,
    admissible: bool = False,
    current_limits: Mapping[str, float] | float | None = None,
    arrays: bool = False,
    reference: bool = False,
    casadi: bool = False,
    author: str | None = None,
    copyright: str | None = None,  # noqa: A002
    license: str | None = None,  # noqa: A002
    compiler: Compiler = "auto",
    date: datetime | None = None,
) -> Exported:
    """Write a model as an FMU for Model Exchange and Co-Simulation, with native code for each platform.

    Args:
        model: a model, a network, or a model file or its path; a file goes along inside the FMU.
        output: the file to write; its name ends in `.fmu`.
        fmi: version of the standard, 2 or 3.
        platforms: some of `linux64`, `linux-aarch64`, `win64`, `darwin-x86_64`, `darwin-arm64`; this machine by
            default, none for sources alone.
        solver: of Co-Simulation: `rk4`, or `ros2` for stiff networks.
        step: longest inner step of Co-Simulation [s]; by default one that fits the fastest time constant.
        limits: temperature limit [degC] for each node by name or pattern, or one for all; 80 degC where none is
            given.
        start: start temperature [degC] in the same way; 25 degC where none is given.
        forecast: `True` to add the time to each node's limit as an output; it depends on the whole model.
        events: `True` to make a limit that is crossed an event, with an output for each node and, in FMI 3, event mode
            in Co-Simulation too and clocks.
        admissible: `True` to add the admissible torque of each joint for 10 s, 60 s, 300 s and for ever as outputs.
        current_limits: of the joints [A] by name or pattern, or one of all; ends of the admissible torques.
        arrays: `True` to join what all places have in common as arrays, of FMI 3 alone.
        reference: `True` to put an experiment with reference results inside, as FMI-LS-REF asks.
        casadi: `True` to let states and parameters be set in any mode: CasADi's import does so when it differentiates,
            and the standard forbids it.
        author: of the model, as importers show it; nobody by default.
        copyright: of the model, in one sentence.
        license: of the model; what holds for the C sources is in the FMU's `documentation/licenses` in any case.
        compiler: `auto`, `zig` or `cc`.
        date: generation time in the FMU; now by default.

    Returns:
        What was written.

    Raises:
        InputError: a model that can't be read, an unknown option, another file ending, no compiler, a step too long
            for the solver, or a model without an admissible torque.
    """
    if fmi not in (2, 3):
        raise InputError("command line", "--fmi", f"{fmi!r}", "2 or 3")
    if arrays and fmi == 2:
        raise InputError("command line", "--arrays", "with FMI 2, which has none", "--fmi 3")
    if arrays and reference:
        raise InputError("command line", "--reference", "with --arrays", "one of them: its tables name scalars")
    path = Path(output)
    if path.suffix.lower() != ".fmu":  # importers want it; nor can a slip then overwrite the model file
        raise InputError(path, "--output", f"a file name ending in '{path.suffix}'", "one ending in .fmu")
    targets = platforms_of(platforms)
    loaded, text = model_and_text(model)
    added = {"forecast": forecast, "events": events, "clocks": fmi == 3, "admissible": admissible}
    exported = Component(loaded, limits, start, **added, current_limits=current_limits)
    steps = integration(exported, solver, step)
    identifier = _identifier(loaded.network)
    joined = arrays_of(exported.variables) if arrays else []
    values = _values(exported, steps, fmi, joined) | {
        "about": {"author": author, "copyright": copyright, "license": license},
        "casadi": casadi,
        "date": (date or datetime.now(UTC)).strftime("%Y-%m-%dT%H:%M:%SZ"),
        "identifier": identifier,
    }
    entries = _texts(exported, values, text)
    if reference:
        entries |= _experiment(exported, steps, entries)
    code = {name.removeprefix("sources/"): text for name, text in entries.items() if name.startswith("sources/")}
    libraries = compile_all(code, f"fmi{fmi}.c", identifier, targets, compiler)
    content = archived(entries | _binaries(libraries, identifier, fmi))
    write_whole(path, content)
    remember(content)
    names = tuple(target.name for target in targets)
    return Exported(path, fmi, names, steps, exported, len(content), tuple(joined))


def model_and_text(model: Model | Network | ModelFile | str | Path) -> tuple[Model, str | None]:
    """The model of a network or file, and the text of the file if there is one."""
    if isinstance(model, Model):
        return model, None
    if isinstance(model, Network):
        return Model(model), None
    file = model if isinstance(model, ModelFile) else read_model_file(Path(model))
    return Model(file.network), file.text


def _identifier(network: Network) -> str:
    """A C identifier for a model's name: `single motor` gives `single_motor`.

    Raises:
        InputError: it is too long for the name of a library.
    """
    word = re.sub(r"\W+", "_", network.name, flags=re.ASCII).strip("_") or "model"
    word = word if word[0].isalpha() else f"model_{word}"
    longest = 240  # characters; file systems take 255 with what compilers put behind a library's name
    if len(word) > longest:
        problem = f"{len(network.name)} characters"
        raise InputError(network.origin, "model.name", problem, f"at most {longest} for a library's name")
    return word


def archived(entries: Mapping[str, bytes]) -> bytes:
    """A ZIP archive of files by their path; the same files give the same bytes."""
    stream = io.BytesIO()
    epoch = (1980, 1, 1, 0, 0, 0)  # of the files in the archive
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(entries, key=lambda path: (path != "modelDescription.xml", path)):
            info = zipfile.ZipInfo(path, epoch)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = (0o755 if path.startswith("binaries/") else 0o644) << 16
            archive.writestr(info, entries[path])
    return stream.getvalue()


def _binaries(libraries: Mapping[Platform, bytes], identifier: str, fmi: int) -> dict[str, bytes]:
    """The libraries by their path; two for one path (both kinds of Mac in FMI 2) become one file."""
    by_path: dict[str, list[bytes]] = {}
    for target, library in libraries.items():
        folder = target.folder2 if fmi == 2 else target.folder3
        by_path.setdefault(f"binaries/{folder}/{identifier}{target.suffix}", []).append(library)
    arm, intel = "binaries/aarch64-linux/", "binaries/linux64/"
    if fmi == 2 and not any(path.startswith(intel) for path in by_path):
        # FMI 2 has no name for Linux on ARM; importers there (fmpy) look where 64-bit Linux is.
        by_path |= {path.replace(arm, intel): same for path, same in by_path.items() if path.startswith(arm)}
    return {path: same[0] if len(same) == 1 else universal(same) for path, same in by_path.items()}


def _experiment(component: Component, integration: Integration, entries: Mapping[str, bytes]) -> dict[str, bytes]:
    """An experiment with reference results and the manifest of FMI-LS-REF, which also names the model file."""
    values = {"experiment": experiment(component, integration.step)}
    texts = {"smoke-test.exp": rendered("smoke-test.exp.xml.j2", values)} | values["experiment"]["tables"]
    files = {f"{FOLDER}/{name}": text.encode() for name, text in texts.items()}
    manifest = rendered("fmi-ls-manifest.xml.j2", {"related": related({**entries, **files})})
    return {**files, f"{FOLDER}/fmi-ls-manifest.xml": manifest.encode()}


# --- the texts inside -------------------------------------------------------------------------------


def _texts(component: Component, values: Mapping[str, Any], model_text: str | None) -> dict[str, bytes]:
    """All files of an FMU but its binaries, by their path inside; of what the templates show.

    Raises:
        InputError: the package that brings the FMI headers is missing.
    """
    fmi, code = values["fmi"], c_code(component, f"{values['identifier']}_model")
    own = {name: _resource(f"c/{name}") for name in (*_CORE, f"fmi{fmi}.c", *(("arrays.c",) if fmi == 3 else ()))}
    # The same model gives the same token, so a saved state goes from one export to the next.
    without_token = rendered("config.h.j2", {**values, "token": ""})
    digest = hashlib.sha256("\n".join([str(fmi), code, without_token, *own.values()]).encode()).hexdigest()
    token = str(uuid.uuid5(_NAMESPACE, digest))
    values = {**values, "token": "{" + token + "}" if fmi == 2 else token, "digest": digest[:12]}
    texts = {
        "modelDescription.xml": rendered(f"modelDescription{fmi}.xml.j2", values),
        "documentation/index.html": rendered("index.html.j2", values),
        "documentation/licenses/fmi-headers.txt": _header_licence(fmi),
        "documentation/licenses/license.txt": _resource("c/LICENSE"),
        "sources/config.h": rendered("config.h.j2", values),
        "sources/model.c": code,
        **{f"sources/{name}": text for name, text in own.items()},
        **{f"sources/{name}": _header(name) for name in _HEADERS[fmi]},
    }
    if fmi == 3:
        texts["sources/buildDescription.xml"] = rendered("buildDescription.xml.j2", values)
        texts["terminalsAndIcons/terminalsAndIcons.xml"] = rendered("terminalsAndIcons.xml.j2", values)
        texts["terminalsAndIcons/icon.svg"] = _resource("icon/icon.svg")
    if model_text is not None:
        texts["resources/model.toml"] = model_text
    picture = (files("lptn.fmu") / "icon" / "icon.png").read_bytes()
    icon = {"model.png" if fmi == 2 else "terminalsAndIcons/icon.png": picture}
    return {path: text.encode() for path, text in texts.items()} | icon


def _values(component: Component, integration: Integration, fmi: int, joined: Sequence[Variable]) -> dict[str, Any]:
    """What the templates show."""
    name, variables = component.model.network.name, component.variables
    seen = shown(variables, joined)
    stop = 3600.0  # s; default experiment
    return {
        "name": name,
        "version": metadata("lptn")["Version"],
        "fmi": fmi,
        "description": f"Thermal network of {name}",
        "variables": variables,
        "shown": seen,
        "arrays": joined,
        "places": {array.reference: places_of(array.elements) for array in joined},
        "states": component.of("state"),
        "inputs": component.of("input"),
        "parameters": component.of("parameter"),
        "outputs": component.of("output", "admissible"),
        "forecasts": component.of("forecast"),
        "indicators": component.of("indicator"),
        "limits": component.limited[0],
        "bound_moves": jacobian_moves(component),
        "structure": structure_of_arrays(structure(component), joined),
        "definitions": unit_definitions(variable.unit for variable in variables),
        "types": list(dict.fromkeys(variable.type for variable in variables if variable.type)),
        "terminals": terminals(seen),
        "solver": integration.solver,
        "step": integration.step,
        "fastest": integration.fastest,
        "stop": stop,
    }


def _resource(path: str) -> str:
    return (files("lptn.fmu") / path).read_text(encoding="utf-8")


def _header(name: str) -> str:
    """One of the FMI headers, which the package `fmpy` carries.

    Raises:
        InputError: the package is missing.
    """
    try:
        return (files("fmpy") / "c-code" / name).read_text(encoding="utf-8")
    except (ModuleNotFoundError, FileNotFoundError) as error:
        raise InputError("fmpy", "package", "no FMI headers", "pip install 'lptn[fmu]'") from error


def _header_licence(fmi: int) -> str:
    """The licence comment of the FMI headers, as it stands in them."""
    comments = re.findall(r"/\*(.*?)\*/", _header(_HEADERS[fmi][1]), flags=re.DOTALL)
    comments = [comment for comment in comments if "Redistribution" in comment]
    return "The FMI headers in sources/ come with this notice:\n" + "\n".join(comments)


@cache
def _environment() -> Any:
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(lambda name: _resource(f"templates/{name}")),
        autoescape=jinja2.select_autoescape(["xml.j2", "html.j2"]),
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
    )
    environment.filters["number"] = _number
    return environment


def rendered(template: str, values: Mapping[str, Any]) -> str:
    """A template filled in; a character of a name that XML can't hold becomes `_`."""
    return _NOT_XML.sub("_", _environment().get_template(template).render(values))


def _number(value: float) -> str:
    """A number that C and XML read back to the last bit."""
    return repr(float(value)) if math.isfinite(value) else ("INF" if value > 0 else "-INF")
