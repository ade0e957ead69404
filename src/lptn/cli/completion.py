"""The command that lets the shell complete `lptn`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Literal

import cyclopts
from cyclopts import Parameter as Option

from lptn.basics.errors import InputError

Shell = Literal["bash", "zsh", "fish"]
_SHELLS: tuple[Shell, ...] = ("bash", "zsh", "fish")


def add_completion(app: cyclopts.App) -> None:
    """Give an app the command `--install-completion`."""

    @app.command(name="--install-completion")
    def install_completion(
        *, shell: Annotated[Shell | None, Option(help="Shell; by default that of $SHELL.")] = None
    ) -> None:
        """Complete commands and options with the TAB key.

        It takes effect in the next shell.

        Example: lptn --install-completion --shell bash
        """
        path = app.install_completion(shell=shell or _own_shell())
        print(f"{path}: read from the next shell on")


def _own_shell() -> Shell:
    name = Path(os.environ.get("SHELL", "")).name
    for shell in _SHELLS:
        if shell == name:
            return shell
    raise InputError("--install-completion", "$SHELL", f"'{name}'", f"--shell and one of {', '.join(_SHELLS)}")
