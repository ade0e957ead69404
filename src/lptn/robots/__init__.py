"""Ready model files: one motor, a leg, the motors of the cooling study."""

from __future__ import annotations

from importlib.resources import files


def presets() -> dict[str, str]:
    """The text of each ready model file by its name."""
    folder = files(__package__)
    found = {entry.name.removesuffix(".toml"): entry for entry in folder.iterdir() if entry.name.endswith(".toml")}
    return {name: found[name].read_text(encoding="utf-8") for name in sorted(found)}
