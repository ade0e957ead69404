"""The thesis example's modules, imported from beside its scripts."""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import pytest

THESIS = Path(__file__).parents[2] / "examples" / "u8_thesis"


@pytest.fixture(scope="session")
def thesis() -> Iterator[Callable[[str], ModuleType]]:
    """Import a module of `examples/u8_thesis` by its name, as its scripts do."""
    sys.path.insert(0, str(THESIS))
    before = set(sys.modules)
    yield importlib.import_module
    sys.path.remove(str(THESIS))
    for name in set(sys.modules) - before:
        if str(THESIS) in str(getattr(sys.modules[name], "__file__", "")):
            del sys.modules[name]
