"""C sources of a planner as a shared library for Python, compiled as a robot would."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from lptn.basics.c_library import shared_library

_OPTIONS = ("-std=c99", "-O2", "-ftree-vectorize", "-ffp-contract=off")
"""Without contraction a robot computes the same digits as Python does here."""


def library(sources: Mapping[str, str], main: str) -> Path:
    """A shared library; arguments and errors as for `lptn.basics.c_library.shared_library`."""
    return shared_library(sources, main, _OPTIONS)
