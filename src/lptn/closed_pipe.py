"""Standard output that nobody reads any more, as in `lptn effects | head`: the command goes on and writes its files."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, TextIO, cast


class _Output:
    """A text stream that drops what nobody reads; whatever else is asked of it, the stream answers."""

    def __init__(self, stream: TextIO) -> None:
        self._stream = stream

    def write(self, text: str) -> int:
        try:
            return self._stream.write(text)
        except OSError as error:
            self._let_go(error)
            return len(text)

    def flush(self) -> None:
        try:
            self._stream.flush()
        except OSError as error:
            self._let_go(error)

    def writelines(self, lines: list[str]) -> None:
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._stream, name)

    def _let_go(self, error: OSError) -> None:
        """Send the rest nowhere, so that Python has nothing to complain of when it ends."""
        with suppress(OSError, ValueError):
            nowhere = os.open(os.devnull, os.O_WRONLY)
            os.dup2(nowhere, self._stream.fileno())
            os.close(nowhere)
        if not isinstance(error, BrokenPipeError):
            raise error


@contextmanager
def spared_closed_pipes() -> Iterator[None]:
    """Within it a closed standard output is no error; a full disk behind it still is.

    Raises:
        OSError: standard output can't be written for another reason than that nobody reads it.
    """
    usual = sys.stdout
    if usual is None:  # `lptn … >&-`
        with open(os.devnull, "w") as nowhere:  # noqa: PTH123
            sys.stdout = nowhere
            try:
                yield
            finally:
                sys.stdout = usual
        return
    output = _Output(usual)
    sys.stdout = cast("TextIO", output)
    try:
        yield
    finally:
        sys.stdout = usual
        output.flush()
