"""The losses in a motor's model file: copper by volume of winding, iron by volume of teeth and yoke."""

from __future__ import annotations

import math

from lptn.motor_geometry.geometry import Geometry


def loss_tables(geometry: Geometry) -> list[str]:
    """Lines of the file's effects; one motor's current, or torque, and speed drive all pieces."""
    shares, end = geometry.copper_shares
    lines = []
    for name, share in zip(geometry.names("winding"), shares, strict=True):
        lines += _copper(geometry, f"{name}_z*", share / geometry.given.pieces.axial)
    lines += _copper(geometry, "end_winding_*", end)
    lines += ["[[effects]]", 'kind = "resistance_rise"', 'at = "*winding_*"', 'share = "all"']
    lines += ["alpha = { value = 0.00393, fixed = true }", ""]
    return lines + (_iron(geometry) if geometry.given.losses.iron_gain else [])


def _copper(geometry: Geometry, at: str, share: float) -> list[str]:
    winding = geometry.given.winding
    lines = [
        f"[[effects]]  # {share:.2%} of the copper each",
        'kind = "copper_loss"',
        f'at = "{at}"',
        'driven_by = "motor"',
        f'input = "{winding.input}"',
        'share = "all"',
        f"resistance = {winding.resistance * share:.6g}",
    ]
    return [*lines, *([f"torque_constant = {winding.torque_constant:.6g}"] if winding.input == "torque" else []), ""]


def _iron(geometry: Geometry) -> list[str]:
    """Speed-dependent loss, spread over teeth and yoke by volume."""
    losses, motor = geometry.given.losses, geometry.given.motor
    volumes = {
        name: motor.slots * motor.tooth_width * layer.depth
        for name, layer in zip(geometry.names("tooth"), geometry.slot_layers, strict=True)
    }
    rings = zip(geometry.names("yoke"), geometry.layers("yoke"), strict=True)
    volumes |= {name: math.pi * (outer**2 - inner**2) for name, (inner, outer) in rings}
    lines: list[str] = []
    for name, volume in volumes.items():
        gain = losses.iron_gain * volume / sum(volumes.values()) / geometry.given.pieces.axial
        lines += ["[[effects]]", 'kind = "iron_loss"', f'at = "{name}_z*"', 'driven_by = "motor"', 'share = "all"']
        exponent = f"{{ value = {losses.iron_exponent:.6g}, bounds = [1, 2], fixed = true }}"
        lines += [f"gain = {gain:.6g}", f"exponent = {exponent}", ""]
    return lines
