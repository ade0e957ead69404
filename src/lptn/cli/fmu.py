"""The command `lptn fmu`: a model as a component for other simulators."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, cast

from lptn.basics.errors import InputError
from lptn.cli import options
from lptn.cli.terminal import progress, write_json

if TYPE_CHECKING:
    from collections.abc import Sequence

    from lptn.fmu.compile import Compiler
    from lptn.fmu.exporter import Exported


def fmu(
    model: Path,
    /,
    *others: Path,
    output: options.Output,
    fmi: int = 3,
    platforms: str | None = None,
    solver: str = "rk4",
    step: float | None = None,
    limit: options.NodeLimits = None,
    forecast: bool = False,
    events: bool = False,
    admissible: bool = False,
    current_limit: list[str] | None = None,
    arrays: bool = False,
    reference: bool = False,
    casadi: bool = False,
    author: str | None = None,
    copyright: str | None = None,  # noqa: A002
    license: str | None = None,  # noqa: A002
    connect: list[str] | None = None,
    compiler: str = "auto",
    json: options.Json = None,
) -> None:
    """Write a model as an FMU for other simulators.

    Model Exchange and Co-Simulation, in native code. An .ssv file holds the values of all parameters; an .ssd or
    .ssp file connects existing FMUs.

    Example: lptn fmu fitted.toml -o leg.fmu --fmi 3 --platforms linux64,win64

    Example: lptn fmu fitted.toml -o fitted.ssv

    Example: lptn fmu motor.fmu body.fmu -o robot.ssd --connect motor.case.temperature=body.motor.temperature

    Args:
        fmi: Version of the standard: 2 or 3.
        platforms: Comma-separated: linux64, linux-aarch64, win64, darwin-x86_64, darwin-arm64; source for C code only.
            By default this machine.
        solver: Solver of Co-Simulation: rk4, or ros2 for stiff networks.
        step: Longest inner step in s; by default chosen from the model's time constants.
        forecast: Add the time to each node's limit as an output; it depends on the whole model.
        events: Crossing a limit is an event: outputs limit_crossed, and in FMI 3 event mode and clocks.
        admissible: Add each joint's admissible torque within --limit for 10 s, 60 s, 300 s and for ever as outputs.
        current_limit: With --admissible: limit in A, for all joints or as JOINT=30; may be repeated.
        arrays: Combine the variables of all joints into arrays, such as torque[12]; FMI 3.
        reference: Include an experiment with reference results (FMI-LS-REF), to check an importer with.
        casadi: Allow setting states and parameters in any mode, for CasADi's import; the standard forbids it.
        author: Author of the model, as importers show it.
        copyright: Copyright of the model.
        license: License of the model.
        connect: With -o SYSTEM.ssd or .ssp and FMUs: OUTPUT=INPUT, each FMU.VARIABLE; may be repeated.
        compiler: auto, zig or cc.
    """
    from lptn.fmu.exporter import export

    options.check_outputs(output, json)
    options.check_outputs(json, inputs=(model, *others))
    if json is not None and output.suffix in (".ssd", ".ssp", ".ssv"):
        raise InputError(json, "--json", f"with -o {output.name}", "an FMU to write about")
    if output.suffix in (".ssd", ".ssp"):
        _write_system([model, *others], output, connect or ())
        return
    if others or connect:
        raise InputError(output, "--output", "several FMUs", "a file name ending in .ssd or .ssp")
    limits = options.limits_of(limit, "*") or None
    if output.suffix == ".ssv":
        from lptn.fmu.ssp import write_values

        print(f"{output}: {write_values(model, output, limits)} parameters")
        return
    if compiler not in ("auto", "zig", "cc"):
        raise InputError("command line", "--compiler", f"'{compiler}'", "auto, zig or cc")
    if current_limit and not admissible:
        raise InputError("command line", "--current-limit", "no --admissible", "both")
    with progress("compiling"):
        done = export(
            model,
            output,
            fmi=fmi,
            platforms=platforms and [name.strip() for name in platforms.split(",") if name.strip() != "source"],
            solver=solver,
            step=step,
            limits=limits,
            forecast=forecast,
            events=events,
            admissible=admissible,
            current_limits=options.limits_of(current_limit, "*", "--current-limit", "A", "JOINT") or None,
            arrays=arrays,
            reference=reference,
            casadi=casadi,
            author=author,
            copyright=copyright,
            license=license,
            compiler=cast("Compiler", compiler),
        )
    _show_export(done)
    write_json(json, done.as_json())


def _write_system(fmus: list[Path], output: Path, connect: Sequence[str]) -> None:
    from lptn.fmu.ssp import write_system

    names = [path.stem for path in fmus]
    if len(set(names)) < len(names):
        raise InputError("command line", "FMUs", f"two called {names[0]}", "file names that tell them apart")
    pairs = []
    for text in connect:
        start, equals, end = text.partition("=")
        if not equals:
            raise InputError("command line", "--connect", f"'{text}'", "OUTPUT=INPUT, each FMU.VARIABLE")
        pairs.append((start.strip(), end.strip()))
    done = write_system(output, dict(zip(names, fmus, strict=True)), pairs, output.stem)
    print(f"{output}: {', '.join(done.components)}; {len(done.connections)} connections")


def _show_export(done: Exported) -> None:
    sizes = done.as_json()
    platforms = ", ".join(done.platforms) or "no binaries: sources alone"
    print(f"{done.path}: FMI {done.fmi}, {done.size / 1024:.0f} kB, {platforms}")
    print(", ".join(f"{sizes[kind]} {kind}" for kind in ("states", "inputs", "parameters", "outputs")))
    steps = done.integration
    print(f"Co-Simulation: {steps.solver}, inner steps of at most {steps.step:g} s")
    print(f"Fastest time constant: {steps.fastest:.3g} s")
    for note in steps.notes:
        print(f"Note: {note}.")
