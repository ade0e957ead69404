"""The rooms: their picture in CONTRIBUTING is the contract of imports, and their own pages name all of their files."""

from __future__ import annotations

import re
import tomllib

import pytest

from tests.docs.pages import ROOT, Page

_BESIDE = " | "


def floors() -> list[tuple[set[str], str]]:
    """The rooms of each floor of the picture, from the top, and what is said of them."""
    page = Page("CONTRIBUTING.md", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8"))
    (picture,) = page.blocks("text")
    lines = [re.split(r" {2,}", line, maxsplit=1) for line in picture.splitlines()]
    return [(set(rooms.split(_BESIDE)), said) for rooms, said in lines]


def test_the_picture_of_the_rooms_is_the_contract_of_imports() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = project["tool"]["importlinter"]["contracts"]
    (layers,) = (contract["layers"] for contract in contracts if contract.get("containers") == ["lptn"])
    assert [rooms for rooms, _ in floors()] == [set(layer.split(_BESIDE)) for layer in layers if layer != "__main__"]


def test_each_room_of_the_picture_is_described_and_has_tests() -> None:
    for rooms, said in floors():
        assert len(said.split(_BESIDE)) == len(rooms)
        for room in rooms:
            assert (ROOT / "tests" / room).is_dir(), room


@pytest.mark.parametrize("room", ["logs", "report", "workbench"])
def test_the_page_of_a_room_says_what_each_of_its_files_is_for(room: str) -> None:
    folder = ROOT / "src" / "lptn" / room
    named = set(re.findall(r"`(\w+\.py)`", (folder / "README.md").read_text(encoding="utf-8")))
    assert named == {path.name for path in folder.glob("*.py")} - {"__init__.py"}
