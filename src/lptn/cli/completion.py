"""The command that lets the shell complete `lptn`."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Literal, get_args

import cyclopts

from lptn.basics.errors import InputError

Shell = Literal["bash", "zsh", "fish"]


def add_completion(app: cyclopts.App) -> None:
    """Give an app the command `--install-completion`."""

    @app.command(name="--install-completion")
    def install_completion(*, shell: Shell | None = None) -> None:
        """Complete commands and options with the TAB key.

        It takes effect in the next shell.

        Example: lptn --install-completion --shell bash

        Args:
            shell: Shell; by default that of $SHELL.
        """
        name = Path(os.environ.get("SHELL", "")).name
        chosen = shell or next((known for known in get_args(Shell) if known == name), None)
        if chosen is None:
            expected = f"--shell and one of {', '.join(get_args(Shell))}"
            raise InputError("--install-completion", "$SHELL", f"'{name}'", expected)
        print(f"{app.install_completion(shell=chosen)}: read from the next shell on")
