"""Ready model files: motors, a leg, a quadruped; each perhaps in several models."""

from __future__ import annotations

from importlib.resources import files

from lptn.basics.errors import InputError

PRESETS = {
    "heated-block": (1, 5, "a block heated evenly"),
    "leg": (3, 14, "three joints, coupled"),
    "leg.full": (3, 32, "with all the source's effects"),
    "leg.single-node": (3, 17, "three separate motors"),
    "quadruped": (13, 133, "12 joints and the computer"),
    "quadruped.coupled": (13, 81, "no laws of motion"),
    "quadruped.single-node": (12, 64, "12 separate motors"),
    "quadruped.windings": (26, 123, "winding and housing each"),
    "single-motor": (1, 4, "one motor in air"),
    "single-motor.full": (1, 11, "with all the source's effects"),
    "u10": (3, 10, "U10 motor, stalled"),
    "u8": (3, 10, "U8 motor, stalled"),
    "u8-heat-sink": (4, 13, "U8 motor with heat pipes"),
}
"""Nodes, parameters and what it is, of each file; a list of them need not make every network. A test counts them."""


def presets() -> dict[str, str]:
    """The text of each robot's first model by the robot's name."""
    return {name: text for name, text in _texts().items() if "." not in name}


def variants(preset: str) -> dict[str, str]:
    """The texts of a robot's other models by the model's name; kept in files `<robot>.<model>.toml`."""
    prefix = f"{preset}."
    return {name.removeprefix(prefix): text for name, text in _texts().items() if name.startswith(prefix)}


def preset_text(preset: str, model: str | None = None) -> str:
    """The text of one model file.

    Args:
        preset: the robot's name.
        model: which of its other models; its first one by default.

    Raises:
        InputError: no such robot, or no such model of it.
    """
    texts = presets()
    if preset not in texts:
        raise InputError("new", "PRESET", f"'{preset}'", f"one of {', '.join(texts)}")
    if model is None:
        return texts[preset]
    others = variants(preset)
    if model not in others:
        expected = f"one of {', '.join(others)}" if others else f"no --model, for {preset} has only one"
        raise InputError("new", "--model", f"'{model}'", expected)
    return others[model]


def _texts() -> dict[str, str]:
    entries = (entry for entry in files(__package__).iterdir() if entry.name.endswith(".toml"))
    return {entry.name.removesuffix(".toml"): entry.read_text(encoding="utf-8") for entry in sorted(entries, key=str)}
