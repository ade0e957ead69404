"""The line of a TOML text at which a key stands."""

from __future__ import annotations

import re


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
        depth = _common(path, keys)
        if path and depth == len(path) and (best is None or depth > best[0]):
            best = (depth, number)
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


def _common(one: list[str], other: list[str]) -> int:
    count = 0
    for a, b in zip(one, other, strict=False):
        if a != b:
            break
        count += 1
    return count
