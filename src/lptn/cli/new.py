"""The command `lptn new`: a ready model file to begin with."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter as Option

from lptn.cli.options import OptionalOutput, check_outputs, write_beginning


def new(
    preset: str | None = None,
    /,
    *,
    model: Annotated[str | None, Option(help="Another model of the same robot, such as single-node.")] = None,
    urdf: Annotated[Path | None, Option(help="A model for the robot of this URDF, in place of a ready one.")] = None,
    output: OptionalOutput = None,
) -> None:
    """Write a model file to begin with: a ready one, or one made of a URDF; without either, list the ready ones.

    A file that is there already is kept, for it may have been edited.

    Example: lptn new quadruped --model single-node -o baseline.toml

    Example: lptn new --urdf my_robot.urdf -o my_robot.toml
    """
    from lptn.basics.errors import InputError
    from lptn.cli.terminal import print_file, show_table

    check_outputs(output, inputs=() if urdf is None else (urdf,))
    if urdf is not None:
        from lptn.robots.urdf import urdf_model_text

        beside = preset or model
        if beside:
            raise InputError("command line", "--urdf", f"'{beside}' beside it", "a URDF, or a preset")
        text = urdf_model_text(urdf)
    elif preset is not None:
        from lptn.robots.presets import preset_text

        text = preset_text(preset, model)
    else:
        show_table(("preset", "what it is"), _presets())
        return
    if output is None:
        print_file(text)
    else:
        write_beginning(output, text)


def _presets() -> Iterator[tuple[str, str]]:
    """Each preset as it is typed, its size, and the sentence that its file begins with."""
    from lptn.references import cite
    from lptn.robots.presets import SIZES, presets, variants

    for name, text in presets().items():
        models = {name: text} | {f"{name}.{model}": other for model, other in variants(name).items()}
        for file, model_text in models.items():
            nodes, parameters = SIZES[file]
            what = cite(re.split(r"\.( (?=[A-Z])|$)", " ".join(_first_comment(model_text)))[0])
            size = f"{nodes} node{'s' * (nodes > 1)}, {parameters} parameters"
            yield file.replace(".", " --model "), f"{what} ({size})"


def _first_comment(text: str) -> Iterator[str]:
    for line in text.splitlines():
        if not line.startswith("#"):
            return
        yield line.removeprefix("#").strip()
