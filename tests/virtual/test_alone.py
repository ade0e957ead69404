"""Check that the ground truth stands alone: what it tests must not be what it is made of."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

import lptn.virtual

ROOM = Path(lptn.virtual.__file__).parent
TRUTH = Path(__file__).parents[1] / "truth"
"""Truths that only tests need; they may use the room's robots, and no other room."""
FILES = sorted(ROOM.glob("*.py"))
TRUTHS = sorted(file for file in TRUTH.glob("*.py") if not file.name.startswith("test_"))


def imported(file: Path) -> set[str]:
    """Return the modules a file imports; relative imports as dots and name."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            names.add("." * node.level + (node.module or ""))
    return names


@pytest.mark.parametrize("file", [*FILES, *TRUTHS], ids=lambda file: f"{file.parent.name}/{file.name}")
def test_nothing_of_the_library_is_imported(file: Path) -> None:
    own = {"lptn.virtual"} if file.parent == TRUTH else set()
    names = {name for name in imported(file) if ".".join(name.split(".")[:2]) not in own}
    assert not {name for name in names if name.split(".")[0] in {"lptn", "casadi", "tests"} or name.startswith("..")}


def test_the_rooms_were_found() -> None:
    assert {"robot.py", "heat.py", "__main__.py"} <= {file.name for file in FILES}
    assert {"finite_volumes.py", "changes.py"} <= {file.name for file in TRUTHS}
