"""The command `lptn effects`: the catalogue, or one effect of it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter as Option

from lptn.cli.options import Details, Json, check_outputs


def effects(
    key: str | None = None,
    /,
    *,
    markdown: Annotated[Path | None, Option(help="Write the whole catalogue as a page of Markdown.")] = None,
    details: Details = False,
    json: Json = None,
) -> None:
    """List the catalogue of effects, or show one.

    Example: lptn effects forced_convection
    """
    from lptn.basics.files import write_whole
    from lptn.cli.catalogue import catalogue_json, catalogue_markdown, show_effects
    from lptn.cli.terminal import write_json

    check_outputs(markdown, json)
    if markdown is None or key is not None:
        show_effects(key, details)
    write_json(json, catalogue_json(key))
    if markdown is not None:
        write_whole(markdown, catalogue_markdown())
