"""The command `lptn add`: one more effect in a model file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter as Option

from lptn.basics.errors import InputError
from lptn.cli import options
from lptn.cli.terminal import show_written


def add(
    model: Path,
    effect: str,
    /,
    *,
    at: str,
    run: str = "",
    set: Annotated[list[str] | None, Option(consume_multiple=True)] = None,  # noqa: A002 - the option's name
    output: options.Output,
) -> None:
    """Add an effect to a model file.

    It gets its typical size, or the values given with --set.

    Example: lptn add leg.toml forced_convection --at "*" -o next.toml

    Args:
        at: Node, edge "a~b", pattern such as "*_calf", or "*"; NODE@RUN as `lptn diagnose` prints it.
        run: The only run in which the effect acts; all by default.
        set: Options and parameters of the effect: input=velocity span=6.
    """
    if run and "@" in at:
        raise InputError("command line", "--run", f"'{run}' beside --at {at}", "the run in one place")
    for text in set or ():
        if "=" not in text:
            raise InputError("command line", "--set", f"'{text}'", "NAME=VALUE, such as input=velocity")
    options.check_inputs(model)
    from lptn.model.file import added, read_model_file

    settings = {name: value for name, _, value in (text.partition("=") for text in set or ())}
    added(read_model_file(model), effect, at, run, settings).write(output)
    show_written({f"{model.name} with {effect} at {at}": output}, f"Fit it: lptn fit {output} LOG -o FITTED")
