"""The command `lptn new`: a ready model file to begin with."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from lptn.cli import options
from lptn.cli.terminal import show_table

Resistance = Literal["phase", "line_to_line", "delta"]
Amperes = Literal["power_invariant", "amplitude", "rms", "block"]


def new(
    preset: str | None = None,
    /,
    *,
    model: str | None = None,
    urdf: Path | None = None,
    log: Path | None = None,
    current: bool = False,
    resistance_of: Resistance | None = None,
    amperes: Amperes | None = None,
    output: options.Beginning = None,
) -> None:
    """Write a model file to begin with.

    A preset, or one made from a URDF or from a log's columns; without any, the presets are listed. A file that exists
    is not replaced.

    Example: lptn new quadruped --model single-node -o baseline.toml

    Example: lptn new --urdf my_robot.urdf -o my_robot.toml

    Example: lptn new --log monday.csv -o my_robot.toml

    Example: lptn new --urdf my_robot.urdf --current --resistance-of line_to_line --amperes rms -o my_robot.toml

    Args:
        model: Variant of the preset, such as single-node.
        urdf: URDF of the robot to make a model for.
        log: Log whose columns name the joints: one node for each, its columns mapped.
        current: With --urdf: the log has currents in place of torques.
        resistance_of: With --urdf: what winding resistances are of.
        amperes: With --urdf: what amperes are.
    """
    from lptn.basics.errors import InputError
    from lptn.robots.presets import PRESETS, preset_text

    words = {"resistance_of": resistance_of, "amperes": amperes, "input": "current" if current else None}
    copper = {name: word for name, word in words.items() if word is not None}
    if copper and urdf is None:
        option = "--current" if current else f"--{next(iter(copper)).replace('_', '-')}"
        raise InputError("command line", option, "no --urdf beside it", "--urdf: a preset says it in its copper_loss")
    if log is not None:
        from lptn.robots.urdf import log_model_text

        if beside := preset or model or (urdf and "--urdf"):
            raise InputError("command line", "--log", f"'{beside}' beside it", "a log, a URDF, or a preset")
        path, what = output or Path(f"{log.stem}.toml"), f"a model of the joints that {log.name} names"
        options.check_outputs(path, inputs=(log,))
        text, values = log_model_text(log), "Its values and columns are guesses"
    elif urdf is not None:
        from lptn.effects.copper_loss import CopperLoss
        from lptn.robots.urdf import urdf_model_text

        if beside := preset or model:
            raise InputError("command line", "--urdf", f"'{beside}' beside it", "a URDF, or a preset")
        path, what = output or Path(f"{urdf.stem}.toml"), f"a model of the joints in {urdf.name}"
        options.check_outputs(path, inputs=(urdf,))
        text, values = urdf_model_text(urdf, CopperLoss(**copper)), "Its values are guesses from the URDF"
    elif preset is not None:
        name = f"{preset}.{model}" if model else preset
        text, path = preset_text(preset, model), output or Path(f"{name}.toml")
        options.check_outputs(path)
        nodes, parameters, about = PRESETS[name]
        what, values = f"{about}: {nodes} nodes, {parameters} parameters", "Its values are of another robot"
    else:
        rows = ((name.replace(".", " --model "), *map(str, about)) for name, about in PRESETS.items())
        show_table(("preset", ">nodes", ">parameters", "what it is"), rows)
        return
    options.write_beginning(path, text, what, f"{values}. See what a log of yours holds for it: lptn check {path} LOG")
