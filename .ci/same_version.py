"""The version is said in one place: names of what was built, package, command and changelog agree with it."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from pathlib import Path

import lptn

checkout, *built = (Path(word) for word in sys.argv[1:])
version = tomllib.loads((checkout / "pyproject.toml").read_text())["project"]["version"]
said = subprocess.run(["lptn", "--version"], capture_output=True, text=True, check=True).stdout.strip()
changes = (checkout / "CHANGELOG.md").read_text()
versions = {"lptn --version": said, "lptn.__version__": lptn.__version__}
wrong = [name for name, found in versions.items() if found != version]
wrong += [path.name for path in built if f"-{version}" not in path.name]
wrong += [] if f"## {version}" in changes else ["CHANGELOG.md"]
if wrong:
    sys.exit(f"not version {version}: {', '.join(wrong)}")
print(f"version {version} everywhere")
