"""Mistakes in a TOML file of the user, each said with its line, its key, what was found and what was expected."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from pydantic import ValidationError
from tomlkit.exceptions import ParseError, TOMLKitError

from lptn.errors import InputError
from lptn.places import is_glob
from lptn.toml_places import locate


def text_of(path: Path, expected: str) -> str:
    """The text of a user's file.

    Args:
        path: the file.
        expected: what it should have been, for the message.

    Raises:
        InputError: there is no such file, or it can't be read as text.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "bytes that are not UTF-8 text"
        raise InputError(path, "file", reason or "no file", expected) from error


@contextmanager
def told_by_line(path: Path, text: str) -> Iterator[None]:
    """Turn what goes wrong while a TOML text is read into one line that names the place.

    Raises:
        InputError: with the line of the mistake.
    """
    try:
        yield
    except ParseError as error:
        raise InputError(path, f"line {error.line}", sentence(str(error)), "TOML") from error
    except TOMLKitError as error:
        raise InputError(path, "file", sentence(str(error)), "TOML") from error
    except ValidationError as error:
        raise from_validation(error, path, text) from error
    except InputError as error:
        raise with_line(error, path, text) from error


def from_validation(error: ValidationError, path: Path, text: str) -> InputError:
    """The first mistake that pydantic found, in the words of this file."""
    first = error.errors()[0]
    if isinstance(first["input"], Mapping):  # a table was meant: what is wrong inside it says more
        first = max(error.errors(), key=lambda each: len(each["loc"]))
    # A union reports each alternative with its own name in the path; only the file's own keys are wanted.
    keys = [part for part in first["loc"] if isinstance(part, int) or not _is_alternative(part)]
    place = ""
    for key in keys:
        place += f"[{key}]" if isinstance(key, int) else f'."{key}"' if "." in key or is_glob(key) else f".{key}"
    place = place.lstrip(".") or "file"
    return with_line(InputError(path, place, shown(first["input"]), expectation(first)), path, text)


def _is_alternative(part: str) -> bool:
    return part in {"str", "float", "ParameterTable"} or part.startswith("constrained")


def expectation(error: Any) -> str:
    """What pydantic expected, in plain words."""
    kind, message = error["type"], str(error["msg"])
    if kind == "extra_forbidden":
        return f'no key "{error["loc"][-1]}" here'
    if kind == "missing":
        return f'a key "{error["loc"][-1]}"'
    return sentence(message.removeprefix("Input should be ").removeprefix("Value error, "))


def shown(found: object) -> str:
    """What was found, cut to a length that fits a line."""
    text = repr(found)
    return text if len(text) <= 60 else text[:57] + "…"


def sentence(message: str) -> str:
    """A message that can stand behind a colon."""
    return message[:1].lower() + message[1:]


def with_line(error: InputError, path: Path, text: str) -> InputError:
    """The same mistake with the line at which its key stands."""
    if error.file != str(path) or error.place.startswith("line "):
        return error
    line = locate(text, error.place)
    return error if line is None else InputError(path, f"line {line}, {error.place}", error.found, error.expected)
