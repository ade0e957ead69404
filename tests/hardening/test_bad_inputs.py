"""Each bad input: one line, exit status 2, nothing written, nothing changed."""

from __future__ import annotations

import shlex
from pathlib import Path

import pytest

from lptn.cli.main import app, main
from tests.hardening.bad_inputs import BAD, Bad, by_kind, desk


@pytest.fixture(scope="module")
def good() -> dict[str, bytes]:
    """The good files' contents, made once."""
    return desk()


def _spoilt(content: object, good: bytes) -> bytes:
    if isinstance(content, tuple):
        old, new = content
        assert old.encode() in good
        return good.replace(old.encode(), new.encode(), 1)
    spoilt: object = content(good) if callable(content) else content
    assert isinstance(spoilt, bytes | str)
    return spoilt.encode() if isinstance(spoilt, str) else spoilt


def _lay_out(folder: Path, good: dict[str, bytes], bad: Bad) -> dict[str, str]:
    """Write the files; returns what stands for them in the words."""
    names = {"folder": str(folder), "out": str(folder / "out")}
    for name, content in good.items():
        (folder / name).write_bytes(content)
        names[name.partition(".")[0]] = str(folder / name)
    for name, spoil in bad.spoil.items():
        names.setdefault(name.replace(".", "_"), str(folder / name))
        if spoil is None:
            (folder / name).unlink(missing_ok=True)
        else:
            (folder / name).write_bytes(_spoilt(spoil, good.get(name, b"")))
    return names


def _seen(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.mark.parametrize("bad", BAD, ids=lambda bad: bad.name)
def test_one_line_status_two_nothing_written(
    bad: Bad, good: dict[str, bytes], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = _lay_out(tmp_path, good, bad)
    before = _seen(tmp_path)
    with pytest.raises(SystemExit) as stop:
        main([word.format(**names) for word in shlex.split(bad.words)])
    seen = capsys.readouterr()
    assert stop.value.code == 2, seen
    assert seen.err.count("\n") == 1
    assert seen.err.startswith("lptn: ")
    assert seen.err.removesuffix("\n").isprintable()
    assert len(seen.err) < 2000
    for word in bad.said:
        assert word in seen.err
    if not bad.words.startswith("check {model} {log}"):  # which is asked what the log holds, and says all it finds
        assert seen.out == ""
    assert _seen(tmp_path) == before


def test_there_are_a_hundred_and_every_command_has_some() -> None:
    kinds = by_kind()
    commands = {name for name in app if not name.startswith("-")}
    assert sum(counts.total() for counts in kinds.values()) >= 100
    assert commands - {command for counts in kinds.values() for command in counts} == set()
