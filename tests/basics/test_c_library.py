"""Native code is taken from a folder that only its user can write to, and from no other."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from lptn.basics.c_library import compiler, shared_library
from lptn.simulate.dynamics import stepper
from tests.builders import two_nodes

SOURCES = {"one.c": "int one(void) { return 1; }\n"}

pytestmark = [
    pytest.mark.skipif(compiler() is None, reason="no C compiler on this machine"),
    pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners of files here"),
]


@pytest.fixture(autouse=True)
def cache(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    monkeypatch.setattr("platformdirs.user_cache_path", lambda name: tmp_path / name)
    return tmp_path / "lptn" / "native"


def test_a_library_is_compiled_once_into_a_folder_of_one_s_own(cache: Path) -> None:
    path = shared_library(SOURCES, "one.c", ())
    assert path.parent == cache
    assert cache.stat().st_mode & 0o777 == 0o700
    made = path.stat().st_mtime_ns
    assert shared_library(SOURCES, "one.c", ()) == path
    assert path.stat().st_mtime_ns == made


@pytest.mark.parametrize("mode", [0o777, 0o775, 0o702])
def test_no_library_is_taken_from_a_folder_that_others_can_write(cache: Path, mode: int) -> None:
    shared_library(SOURCES, "one.c", ())
    cache.chmod(mode)
    with pytest.raises(PermissionError, match="others can write"):
        shared_library(SOURCES, "one.c", ())


def test_no_library_is_taken_from_another_user_s_folder(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    shared_library(SOURCES, "one.c", ())
    mine = os.getuid()
    monkeypatch.setattr("os.getuid", lambda: mine + 1)
    with pytest.raises(PermissionError, match="others can write"):
        shared_library(SOURCES, "one.c", ())


def test_a_model_runs_interpreted_where_the_cache_is_not_trusted(cache: Path) -> None:
    cache.mkdir(parents=True)
    cache.chmod(0o777)
    from lptn.model.model import Model

    model = Model(two_nodes())
    assert not stepper(model, len(model.states), range(len(model.parameters))).compile()
