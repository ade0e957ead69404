"""The catalogue: effects of the folder, plug-ins sound and broken, and keys that people get wrong."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest

import lptn.effects
from lptn.basics.errors import InputError
from lptn.effects import NodeEffect, catalogue, effect_named

FOLDER = Path(lptn.effects.__file__).parent


class NoHeat(NodeEffect):
    """An effect that lacks what makes one."""

    key = "no_heat"
    title = "no heat"


@pytest.fixture
def fresh() -> Iterator[None]:
    """The catalogue read anew, before and after."""
    catalogue.cache_clear()
    yield
    catalogue.cache_clear()


def test_every_file_of_the_folder_is_an_effect_of_its_name() -> None:
    files = {path.stem for path in FOLDER.glob("*.py")} - {"__init__", "base", "excitation"}
    assert files == {key for key, effect in catalogue().items() if effect.__module__.startswith("lptn.effects.")}


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("no_such_package.fan:Fan", "ModuleNotFoundError: No module named 'no_such_package'"),
        ("tests.builders:NothingOfTheKind", "AttributeError"),
        ("tests.builders:two_nodes", "not a subclass of lptn.effects.Effect"),
        ("tests.effects.test_catalogue:NoHeat", "NoHeat has no signature, source, heat"),
    ],
)
@pytest.mark.usefixtures("fresh")
def test_a_broken_plug_in_is_named_in_one_line_and_left_out(
    value: str, said: str, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    entry = EntryPoint("broken_fan", value, "lptn.effects")
    monkeypatch.setattr(lptn.effects, "entry_points", lambda group: [entry])
    with caplog.at_level(logging.WARNING, "lptn"):
        effects = catalogue()
    (record,) = caplog.records
    assert record.getMessage().startswith(f"plug-in broken_fan ({value}) is left out: {said}")
    assert "\n" not in record.getMessage()
    assert "copper_loss" in effects
    assert "no_heat" not in effects


@pytest.mark.parametrize(
    ("word", "offered"),
    [
        ("convection", "forced_convection or natural_convection ("),
        ("dry_friction", " or ".join(key for key in catalogue() if "friction" in key) + " ("),
        ("coper_loss", "expected copper_loss ("),
        ("zzzz", "expected one of "),
    ],
)
def test_a_key_that_is_none_gets_those_that_could_be_meant(word: str, offered: str) -> None:
    with pytest.raises(InputError) as refused:
        effect_named(word, "add", "EFFECT")
    assert offered in str(refused.value)
