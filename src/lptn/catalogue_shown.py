"""The catalogue of effects on the terminal, and for other programs."""

from __future__ import annotations

import inspect

from lptn.effects import catalogue
from lptn.errors import InputError
from lptn.terminal import new_table, out


def show_effects(key: str | None) -> None:
    """The catalogue, or one effect of it.

    Raises:
        InputError: no effect has this key.
    """
    known = catalogue()
    if key is None:
        table = new_table("effect", "what it is", "at")
        for name, effect in known.items():
            table.add_row(name, effect.title, effect.site)
        out.print(table)
        return
    if key not in known:
        raise InputError("effects", "KEY", f"'{key}'", f"one of {', '.join(known)}")
    effect = known[key]
    out.print(inspect.cleandoc(effect.__doc__ or effect.title), markup=False)
    table = new_table("parameter", "what it is", "unit", "typical", "off")
    for parameter in effect.parameters:
        off = "" if parameter.off is None else f"{parameter.off:g}"
        table.add_row(parameter.name, parameter.title, parameter.unit, f"{parameter.typical:g}", off)
    out.print(table)
    out.print(f"Looks like: {effect.signature.looks_like}.", markup=False)
    out.print(f"Separate it by: {effect.signature.separate_by}.", markup=False)


def catalogue_json(key: str | None) -> dict[str, object]:
    """The catalogue, or one effect of it, as other tools read it."""
    return {
        name: {
            "title": effect.title,
            "at": effect.site,
            "needs": list(effect.needs),
            "looks_like": effect.signature.looks_like,
            "separate_by": effect.signature.separate_by,
            "parameters": {
                each.name: {"title": each.title, "unit": each.unit, "typical": each.typical, "off": each.off}
                for each in effect.parameters
            },
        }
        for name, effect in catalogue().items()
        if key in (None, name)
    }
