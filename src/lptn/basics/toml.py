"""TOML files of the user: what any may hold, and each mistake with its line, what was found and what was expected."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import tomlkit
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError
from tomlkit.exceptions import TOMLKitError

from lptn.basics.errors import InputError, shown
from lptn.basics.places import is_glob
from lptn.basics.units import convert

# --- What any file of the user may hold -------------------------------------------------------------

_LARGEST = 1e15  # in any unit: no quantity of a robot is larger, and its square can still be computed with
Number = Annotated[float, Field(allow_inf_nan=False, strict=True, ge=-_LARGEST, le=_LARGEST)]
"""A finite number, and no text that looks like one."""


def quantity(unit: str) -> BeforeValidator:
    """A pydantic validator: a bare number in `unit`, or `{ value = …, unit = "…" }` converted to it."""
    expected, least = f'a number in {unit}, or {{ value = …, unit = "…" }}', 1e-12

    def normal(value: Any) -> Any:
        if isinstance(value, float) and 0 < abs(value) < least:  # its inverse would overflow the squares of solvers
            raise ValueError(f"0, or a size of at least {least:g}")
        return value

    def read(given: Any) -> Any:
        if not isinstance(given, Mapping):
            return normal(given)
        number, named = given.get("value"), given.get("unit", unit)
        if not set(given) <= {"value", "unit"} or not isinstance(named, str):
            raise ValueError(expected)
        if isinstance(number, bool) or not isinstance(number, int | float):
            raise ValueError(expected)
        try:
            return normal(convert(float(number), named, unit))
        except ValueError as error:
            raise ValueError(f"a unit like {unit}") from error

    return BeforeValidator(read)


class Strict(BaseModel):
    """A table that has no other keys than these."""

    model_config = ConfigDict(extra="forbid")


# --- The line of a TOML text at which a key stands ------------------------------------------------


def locate(text: str, place: str) -> int | None:
    """The 1-based line of a place such as `effects[2].gamma.bounds`, as near as the text shows it.

    Returns:
        the line of the key, else of the table that should hold it, else `None`.
    """
    keys = _split(place)
    best: tuple[int, int] | None = None
    header: list[str] = []
    seen: dict[str, int] = {}
    for number, line in enumerate(text.split("\n"), start=1):
        stripped = line.strip()
        if stripped.startswith("["):
            header = _header(stripped, seen)
            path = header
        else:
            path = header + _split(stripped.partition("=")[0].strip()) if "=" in stripped else []
        if path and path == keys[: len(path)] and (best is None or len(path) > best[0]):
            best = (len(path), number)
    return None if best is None else best[1]


def _header(line: str, seen: dict[str, int]) -> list[str]:
    """The path of a table header; each `[[name]]` counts up."""
    name = line.strip("[] \t").split("]")[0]
    keys = _split(name)
    if line.startswith("[["):
        seen[name] = seen.get(name, -1) + 1
        keys.append(f"[{seen[name]}]")
    return keys


def _split(place: str) -> list[str]:
    """`nodes."*_calf".capacity[0]` as its keys."""
    return [token.strip("\"'") for token in re.findall(r'"[^"]*"|\'[^\']*\'|\[\d+\]|[^."\'\[\]\s]+', place)]


# --- Mistakes in a TOML file of the user, each said with its line, its key, what was found and what was expected ---


_KINDS = {
    "float_type": "a number",
    "finite_number": "a finite number",
    "int_type": "a whole number",
    "string_type": "a text in quotes",
    "path_type": "a text in quotes",
    "bool_type": "true or false",
    "list_type": "a list, […]",
    "dict_type": "a table, {…}",
    "model_type": "a table, {…}",
    "model_attributes_type": "a table, {…}",
}
"""What pydantic expected, by its kind of error."""


def toml_of(path: Path, text: str) -> dict[str, Any]:
    """A TOML text as plain Python values.

    Raises:
        InputError: it is no TOML, or holds a number that no program can use; with its line.
    """
    try:
        content = tomllib.loads(text)
        _check_integers(path, content)
    except tomllib.TOMLDecodeError as error:
        problem, _, place = str(error).rpartition(" (at ")
        line = place.partition(",")[0] if place.startswith("line") else f"line {text.count(chr(10)) + 1}"  # its end
        raise InputError(path, line, sentence(problem), "TOML") from error
    except RecursionError as error:
        raise InputError(path, "file", "tables or lists in each other without end", "TOML of a few levels") from error
    except InputError as error:
        raise with_line(error, path, text) from error
    except (ValueError, OverflowError) as error:  # such as a number of 5000 digits
        raise InputError(path, "file", sentence(str(error)), "TOML") from error
    return content


def editable(path: Path, text: str) -> tomlkit.TOMLDocument:
    """A TOML text as a document that keeps its comments and order, forty times as slowly as `toml_of`.

    Raises:
        InputError: it is no TOML, or none that can be edited.
    """
    toml_of(path, text)  # which says the line
    try:
        return tomlkit.parse(text)
    except (TOMLKitError, ValueError) as error:
        raise InputError(path, "file", sentence(str(error)), "TOML that can be edited") from error


def _check_integers(path: Path, content: object, place: str = "") -> None:
    """Refuse whole numbers beyond what TOML promises: they are no `float` either."""
    if isinstance(content, Mapping):
        for key, inner in content.items():
            _check_integers(path, inner, place + _step(str(key)))
    elif isinstance(content, list):
        for number, inner in enumerate(content):
            _check_integers(path, inner, f"{place}[{number}]")
    elif isinstance(content, int) and abs(content) > 2**63 - 1:  # TOML promises 64 bits
        problem = f"a whole number of {len(hex(content)) * 4 // 13} digits"
        raise InputError(path, place.lstrip("."), problem, "one of 18 digits at most")


@contextmanager
def mistakes_by_line(path: Path, text: str) -> Iterator[None]:
    """Turn what goes wrong while a TOML text is understood into one line that names the place.

    Raises:
        InputError: with the line of the mistake.
    """
    try:
        yield
    except ValidationError as error:
        first = first_mistake(error)
        place = place_of(first).lstrip(".") or "file"
        raise with_line(InputError(path, place, found_in(first), expectation(first)), path, text) from error
    except InputError as error:
        raise with_line(error, path, text) from error


def first_mistake(error: ValidationError) -> Any:
    """The mistake to speak of: the first, or where that is in a table, the one that is deepest inside it."""
    first = error.errors()[0]
    if isinstance(first["input"], Mapping):  # a table was meant: what is wrong inside it says more
        return max(error.errors(), key=lambda mistake: len(mistake["loc"]))
    return first


def place_of(mistake: Any) -> str:
    """The keys at which pydantic found a mistake: `.nodes."*_calf".capacity`."""
    # A union reports each alternative with its own name in the path; only the file's own keys are wanted.
    names, beginnings = ("str", "float", "ParameterTable"), ("constrained", "dict[")
    keys = (key for key in mistake["loc"] if isinstance(key, int) or not (key in names or key.startswith(beginnings)))
    return "".join(map(_step, keys))


def _step(key: str | int) -> str:
    if isinstance(key, int):
        return f"[{key}]"
    return f'."{key}"' if "." in key or is_glob(key) else f".{key}"


def expectation(error: Any) -> str:
    """What pydantic expected, in plain words."""
    kind, message = error["type"], str(error["msg"])
    if kind == "extra_forbidden":
        return f'no key "{error["loc"][-1]}" here'
    if kind == "missing":
        return f'a key "{error["loc"][-1]}"'
    if kind in _KINDS:
        return _KINDS[kind]
    if kind in ("too_short", "too_long"):
        least = kind == "too_short"
        count = error["ctx"]["min_length" if least else "max_length"]
        return f"{'at least' if least else 'at most'} {count} entr{'y' if count == 1 else 'ies'}"
    return sentence(message.removeprefix("Input should be ").removeprefix("Value error, "))


def found_in(error: Any) -> str:
    """What stands in the file where pydantic found a mistake."""
    if error["type"] == "missing":
        return "no such key"
    return "none" if error["type"] == "too_short" and not error["input"] else shown(error["input"])


def sentence(message: str) -> str:
    """A message that can stand behind a colon."""
    return message[:1].lower() + message[1:] if message[1:2].islower() else message


def with_line(error: InputError, path: Path, text: str) -> InputError:
    """The same mistake with the line at which its key stands."""
    if error.file != str(path) or error.place.startswith("line "):
        return error
    line = locate(text, error.place)
    return error if line is None else InputError(path, f"line {line}, {error.place}", error.found, error.expected)
