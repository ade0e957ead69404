"""Messages as they come, JSON or lines of CSV, made numbers by column name."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from pydantic_core import from_json

from lptn.basics.errors import InputError

Numbers = Mapping[str, Any]
"""A message: a number, `None`, or a text that is one, by column name."""
_SEPARATORS = ",;\t"
_NESTED = {dict, list}
LONGEST = 1_000_000
"""Bytes of a line, of which a robot of a hundred joints fills some thousand."""


class Decoder:
    """Lines of JSON objects, or of CSV below a line of names; the first line says which.

    Args:
        source: what the lines come from, for messages.
    """

    def __init__(self, source: str) -> None:
        self._source = source
        self._count = 0
        self._names: list[str] = []
        self._header, self._separator = "", ""

    def decode(self, line: bytes) -> Numbers | None:
        """The numbers of a line; `None` of an empty one and of names.

        Raises:
            InputError: the line is neither JSON nor CSV of as many cells as there are names.
        """
        self._count += 1
        if not line.strip() or line.lstrip().startswith(b"#"):
            return None
        if line.lstrip()[:1] in (b"{", b"["):
            try:
                content = from_json(line)  # takes a quarter of the time of `json`
            except ValueError as error:
                raise self._mistake(line, f"a JSON object of numbers ({error})") from None
            if not isinstance(content, dict):
                raise self._mistake(line, "a JSON object of numbers")
            return flat(content)
        text = line.decode("utf-8-sig", "replace").strip("\r\n")
        if not self._names:
            self._begin(line, text)
            return None
        if text == self._header:
            return None
        cells = [cell.strip().strip('"') for cell in self._cells(text)]
        if len(cells) != len(self._names):
            raise self._mistake(line, f"{len(self._names)} cells, as there are names")
        if self._separator != ",":
            cells = [cell.replace(",", ".") for cell in cells]
        return {name: cell or None for name, cell in zip(self._names, cells, strict=True)}

    def _begin(self, line: bytes, text: str) -> None:
        self._separator = max(_SEPARATORS, key=text.count) if any(mark in text for mark in _SEPARATORS) else " "
        names = [cell.strip().strip('"') for cell in self._cells(text)]
        if not all(re.search(r"[^\W\d]", name) for name in names) or len(set(names)) < len(names):
            raise self._mistake(line, "a JSON object, or first a line of names for CSV")
        self._names, self._header = names, text

    def _cells(self, text: str) -> list[str]:
        return text.split(self._separator if self._separator != " " else None)

    def _mistake(self, line: bytes, expected: str) -> InputError:
        return InputError(self._source, f"message {self._count}", repr(line[:80].decode("utf-8", "replace")), expected)


def flat(content: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Nested content by names such as `motor_state[2].temperature`.

    Beside a list `name`, as `sensor_msgs/JointState` has it, elements of others bear its words: `effort[knee]`.
    """
    if not prefix and _NESTED.isdisjoint(map(type, content.values())):
        return dict(content)
    found: dict[str, Any] = {}
    labels: Any = content.get("name")
    labelled = isinstance(labels, list) and all(isinstance(label, str) for label in labels)
    for key, value in content.items():
        name = f"{prefix}{key}"
        if isinstance(value, dict):
            found |= flat(value, f"{name}.")
        elif isinstance(value, list):
            if value is labels and labelled:
                continue
            which: Sequence[Any] = labels if labelled and len(labels) == len(value) else range(len(value))
            for label, element in zip(which, value, strict=True):
                one = f"{name}[{label}]"
                found |= flat(element, f"{one}.") if isinstance(element, dict) else {one: element}
        else:
            found[name] = value
    return found
