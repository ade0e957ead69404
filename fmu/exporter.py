"""`lptn.fmu.export`: a model as an FMU."""

from __future__ import annotations

import io
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from lptn.errors import InputError
from lptn.files import write_whole
from lptn.model import Model
from lptn.model_file import ModelFile, load_model
from lptn.network import Network

from .compile import Compiler, Platform, compile_all, platforms_of, universal
from .component import Component, component
from .integration import Integration, integration
from .source import Source, source
from .trust import remember

_EPOCH = (1980, 1, 1, 0, 0, 0)  # of the files in the archive, so that the same model gives the same bytes


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
    """

    path: Path
    fmi: int
    platforms: tuple[str, ...]
    integration: Integration
    component: Component
    size: int

    @property
    def variables(self) -> dict[str, int]:
        """Value references by name."""
        return {variable.name: variable.reference for variable in self.component.variables}

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
    admissible: bool = False,
    current_limits: Mapping[str, float] | float | None = None,
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
        admissible: `True` to add the admissible torque of each joint for 10 s, 60 s, 300 s and for ever as outputs.
        current_limits: of the joints [A] by name or pattern, or one of all; ends of the admissible torques.
        compiler: `auto`, `zig` or `cc`.
        date: generation time in the FMU; now by default.

    Returns:
        What was written.

    Raises:
        InputError: a model that can't be read, an unknown option, another file ending, no compiler, or a step too
            long for the solver, or a model without an admissible torque.
    """
    if fmi not in (2, 3):
        raise InputError("command line", "--fmi", f"{fmi!r}", "2 or 3")
    path = Path(output)
    if path.suffix.lower() != ".fmu":  # importers want it; nor can a slip then overwrite the model file
        raise InputError(path, "--output", f"a file name ending in '{path.suffix}'", "one ending in .fmu")
    chosen = platforms_of(platforms)
    assembled, text = _opened(model)
    made = component(assembled, limits, start, admissible=admissible, current_limits=current_limits)
    steps = integration(made, solver, step)
    parts = source(made, fmi, steps, text, date)
    content = _archive(parts, chosen, compiler)
    write_whole(path, content)
    remember(content)
    return Exported(path, fmi, tuple(each.name for each in chosen), steps, made, len(content))


def _opened(model: Model | Network | ModelFile | str | Path) -> tuple[Model, str | None]:
    if isinstance(model, Model):
        return model, None
    if isinstance(model, Network):
        return Model(model), None
    file = model if isinstance(model, ModelFile) else load_model(Path(model))
    return Model(file.network), file.text


def _archive(parts: Source, platforms: Sequence[Platform], compiler: Compiler) -> bytes:
    code = {path.removeprefix("sources/"): text for path, text in parts.files.items() if path.startswith("sources/")}
    built = compile_all(code, f"fmi{parts.fmi}.c", parts.identifier, platforms, compiler)
    entries = parts.files | _binaries(parts, built)
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(entries, key=lambda path: (path != "modelDescription.xml", path)):
            info = zipfile.ZipInfo(path, _EPOCH)
            info.compress_type = zipfile.ZIP_DEFLATED
            info.external_attr = (0o755 if path.startswith("binaries/") else 0o644) << 16
            archive.writestr(info, entries[path])
    return stream.getvalue()


def _binaries(parts: Source, built: Mapping[Platform, bytes]) -> dict[str, bytes]:
    """The libraries by their place; two for one place (both kinds of Mac in FMI 2) become one file."""
    by_place: dict[str, list[bytes]] = {}
    for target, library in built.items():
        folder = target.folder2 if parts.fmi == 2 else target.folder3
        by_place.setdefault(f"binaries/{folder}/{parts.identifier}{target.suffix}", []).append(library)
    arm, intel = "binaries/aarch64-linux/", "binaries/linux64/"
    if parts.fmi == 2 and not any(place.startswith(intel) for place in by_place):
        # FMI 2 has no name for Linux on ARM; importers there (fmpy) look where 64-bit Linux is.
        by_place |= {place.replace(arm, intel): each for place, each in by_place.items() if place.startswith(arm)}
    return {place: each[0] if len(each) == 1 else universal(each) for place, each in by_place.items()}
