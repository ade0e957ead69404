"""Pip's constraints for the lowest versions that a pyproject.toml admits: `lowest.py pyproject.toml base|EXTRA`."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

project = tomllib.loads(Path(sys.argv[1]).read_text())["project"]
part = sys.argv[2]
for requirement in project["dependencies"] if part == "base" else project["optional-dependencies"][part]:
    found = re.fullmatch(r"([\w.-]+)(?:\[[^]]*\])?>=([\w.]+)", requirement)
    if found is None:
        sys.exit(f"{requirement}: expected a name and its lowest version, such as numpy>=1.26")
    print(f"{found[1]}=={found[2]}")
