"""Check that the ground truth stands alone: what it tests must not be what it is made of."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import lptn.virtual

ROOM = Path(lptn.virtual.__file__).parent
FILES = sorted(ROOM.glob("*.py"))


def imported(file: Path) -> set[str]:
    """Return the top-level modules a file imports; relative imports as dots and name."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add("." * node.level + (node.module or ""))
    return names


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.name)
def test_nothing_of_the_library_is_imported(file: Path) -> None:
    names = imported(file)
    assert not {name for name in names if name.split(".")[0] in {"lptn", "casadi"} or name.startswith("..")}


def test_the_room_was_found() -> None:
    assert {"robot.py", "heat.py", "__main__.py"} <= {file.name for file in FILES}
