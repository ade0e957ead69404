"""The command `lptn effects`: the catalogue, or one effect of it."""

from __future__ import annotations

from lptn.cli import options
from lptn.cli.terminal import write_json


def effects(key: str | None = None, /, *, details: options.Details = False, json: options.Json = None) -> None:
    """List the catalogue of effects, or show one.

    Example: lptn effects forced_convection
    """
    from lptn.cli.catalogue import catalogue_json, show_effects

    options.check_outputs(json)
    show_effects(key, details)
    write_json(json, catalogue_json(key))
