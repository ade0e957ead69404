"""Every shipped model has its drawing, with each of its nodes."""

from __future__ import annotations

import runpy
from pathlib import Path
from types import SimpleNamespace

import pytest

HERE = Path(__file__).parents[2] / "examples"
draw = SimpleNamespace(**runpy.run_path(str(HERE / "networks" / "draw.py")))
MODELS = {name: file for name, _, file in draw.models()}


def test_the_page_is_as_the_script_writes_it_and_has_no_drawing_too_many() -> None:
    folder = HERE / "networks"
    assert (folder / "README.md").read_text(encoding="utf-8") == draw.page(), "python examples/networks/draw.py"
    assert {path.name for path in folder.glob("*.svg")} == {draw.picture(name) for name in MODELS}
    assert set(draw.OF_SOURCES) <= set(MODELS)


@pytest.mark.parametrize("name", MODELS)
def test_a_drawing_names_every_node(name: str) -> None:
    drawing = (HERE / "networks" / draw.picture(name)).read_text(encoding="utf-8")
    for node in MODELS[name].network.dynamic:
        assert f">{node}<" in drawing
