"""The command `lptn new`: a ready model file to begin with."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter as Option

from lptn.cli.options import OptionalOutput, check_outputs, write_beginning


def new(
    preset: str | None = None,
    /,
    *,
    model: Annotated[str | None, Option(help="Variant of the preset, such as single-node.")] = None,
    urdf: Annotated[Path | None, Option(help="URDF of the robot to make a model for.")] = None,
    output: OptionalOutput = None,
) -> None:
    """Write a model file to begin with.

    A preset, or one made from a URDF; without either, the presets are listed. A file that exists is not replaced.

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
        from lptn.robots.presets import PRESETS

        rows = ((name.replace(".", " --model "), *map(str, about)) for name, about in PRESETS.items())
        show_table(("preset", ">nodes", ">parameters", "what it is"), rows)
        return
    if output is None:
        print_file(text)
    else:
        write_beginning(output, text)
