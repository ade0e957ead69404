"""The page on JSON: each key that a command writes stands there, and each key there is written."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import TypeAlias

import pytest

from lptn.cli.main import main
from tests.docs.pages import ROOT

PAGE = ROOT / "src/site/pages/reference/json.md"
HEATERS = ROOT / "examples/tclab"
OUT = "--json", "out.json"

Keys: TypeAlias = tuple[str, ...]

# Commands that together write all that a section lists, typed in this order.
TYPED = {
    "check": ["check two_heaters.toml log.csv"],
    "fit": [
        "fit two_heaters.toml log.csv --holdout-after 300 -o fitted.toml",
    ],
    "fleet": ["fleet two_heaters.toml log.csv -o fleet"],
    "compare": [
        "compare fitted.toml log.csv --against two_heaters.toml",
        "simulate fitted.toml log.csv -o simulated.csv",
    ],
    "diagnose": ["diagnose two_heaters.toml log.csv --holdout-after 300"],
    "improve": ["improve two_heaters.toml log.csv --holdout-after 300 -o better.toml"],
    "forecast": ["forecast fitted.toml log.csv --limit 60"],
    "monitor": ["monitor fitted.toml log.csv --threshold 3"],
    "watch": ["watch fitted.toml log.csv --replay 0 --limit 60 --every 100"],
    "fmu": ["fmu fitted.toml -o heaters.fmu"],
    "cosim": ["cosim heaters.fmu log.csv"],
    "export": ["export two_heaters.toml --to numpy --limit 60 -o heat.py"],
    "plan": [
        "plan quadruped.toml limit_now.toml",
        "plan quadruped.toml firmware.toml",
        "plan quadruped.toml track_trot.toml",
        "plan quadruped.toml mission_deliveries.toml",
    ],
    "trade": ["trade study.toml"],
    "motor": ["motor drawing.toml -o motor.toml"],
    "effects": ["effects"],
}
BOTH = "improve", "diagnose"  # the first writes the last table of the second, too


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the commands are typed, with what they read."""
    folder = tmp_path_factory.mktemp("typed")
    sources = [HEATERS / "two_heaters.toml", HEATERS / "log.csv", ROOT / "examples/heat_sink/study.toml"]
    for source in (*sources, *(ROOT / "examples/plan").glob("*.toml")):
        shutil.copy(source, folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for words in ("motor -o drawing.toml", "motor drawing.toml -o motor.toml", "new quadruped -o quadruped.toml"):
            _typed(words)
        shutil.copy("motor.toml", "longer.toml")
    return folder


def _typed(words: str) -> None:
    with pytest.raises(SystemExit) as stop:
        main(words.split())
    assert stop.value.code == 0, words


def documented(section: str) -> set[Keys]:
    """The keys that a section's tables list."""
    (text,) = re.findall(rf"^## `lptn {section}`\n(.*?)(?=^## |\Z)", PAGE.read_text(), re.MULTILINE | re.DOTALL)
    listed: set[Keys] = set()
    for row in re.findall(r"^\| (`.*?) \| ", text, re.MULTILINE):
        beside: Keys = ()
        for span in re.findall(r"`([^`]+)`", row):
            keys = tuple(span.replace("[]", ".[]").removeprefix(".").replace("…", ".…").split("."))
            if span.startswith("."):
                keys = (*beside, *keys)
            else:
                beside = keys[:-1]
            listed.add(keys)
    return listed


def written(value: object, above: Keys = ()) -> Iterator[Keys]:
    """The keys down to each value that is no object, nor a list of objects."""
    if isinstance(value, dict) and value:
        for key, inside in value.items():
            yield from written(inside, (*above, key))
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        for inside in value:
            yield from written(inside, (*above, "[]"))
    else:
        yield above


def is_one(keys: Keys, listed: Keys) -> bool:
    """Whether a value stands where the page has it; `<name>` is any key, `…` all that is below."""
    if listed[-1] == "…":
        keys, listed = keys[: len(listed) - 1], listed[:-1]
    return len(keys) == len(listed) and all(b.startswith("<") or a == b for a, b in zip(keys, listed, strict=True))


def is_above(keys: Keys, listed: Keys) -> bool:
    """Whether an empty list, an empty object or null stands where a listed key would be."""
    return len(keys) < len(listed) and is_one(keys, listed[: len(keys)])


@pytest.mark.long
@pytest.mark.parametrize("section", TYPED)
def test_the_page_lists_what_is_written(section: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(folder)
    listed = documented(section)
    common = documented(BOTH[1]) if section == BOTH[0] else set()
    keys_written: set[Keys] = set()
    for words in TYPED[section]:
        _typed(" ".join((words, *OUT)))
        keys_written |= set(written(json.loads(Path("out.json").read_text())))
        Path("out.json").unlink()
    unlisted = [
        keys for keys in keys_written if not any(is_one(keys, path) or is_above(keys, path) for path in listed | common)
    ]
    assert not unlisted, "written, and not on the page"
    unwritten = [
        path for path in listed if not any(is_one(keys, path) or is_above(keys, path) for keys in keys_written)
    ]
    assert not unwritten, "on the page, and not written"


def test_the_page_has_a_section_for_each_command() -> None:
    sections = set(re.findall(r"^## `lptn (\w+)`$", PAGE.read_text(), re.MULTILINE))
    assert sections == set(TYPED)


def test_a_key_too_many_or_too_few_is_found() -> None:
    listed = documented("compare")
    assert ("all", "max") in listed
    assert ("runs", "<run>", "nodes", "<node>", "floor") in listed
    assert not any(is_one(("all", "least"), path) for path in listed)
    assert is_one(("not_believed", "knee", "why"), ("not_believed", "…"))
    assert is_above(("experiment",), ("experiment", "moves", "[]", "at"))
