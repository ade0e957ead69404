"""The names on the front door lead to what they say."""

from __future__ import annotations

import subprocess
import sys

import pytest

import lptn


@pytest.mark.parametrize("name", lptn.__all__)
def test_every_public_name_is_there_and_documented(name: str) -> None:
    assert getattr(lptn, name).__doc__
    assert name in dir(lptn)


def test_an_unknown_name_is_refused() -> None:
    with pytest.raises(AttributeError, match="Modell"):
        _ = lptn.Modell  # type: ignore[attr-defined]


def test_looking_at_the_package_loads_no_solver() -> None:
    script = "import sys, lptn; lptn.__version__; sys.exit('casadi' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0
