"""Small logs for the tests of reading."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from lptn.basics.errors import InputError

Write = Callable[..., Path]
Refuse = Callable[..., str]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    """Write `columns` (name -> values) as CSV; None gives an empty cell."""

    def _write(columns: dict[str, list[object]], name: str = "log.csv") -> Path:
        rows = [",".join(columns)]
        rows += [
            ",".join("" if cell is None else str(cell) for cell in row) for row in zip(*columns.values(), strict=True)
        ]
        path = tmp_path / name
        path.write_text("\n".join(rows) + "\n")
        return path

    return _write


@pytest.fixture
def refuse() -> Refuse:
    """Call a function that has to raise an InputError; give its one line, which has to name the file."""

    def _refuse(file: str | Path, function: Callable[..., object], *args: object, **kwargs: object) -> str:
        with pytest.raises(InputError) as caught:
            function(*args, **kwargs)
        line = str(caught.value)
        assert "\n" not in line
        assert line.startswith(f"{file}: ")
        assert "found " in line
        assert "expected " in line
        return line

    return _refuse
