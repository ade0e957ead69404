"""The catalogue of effects: on the terminal, and for other programs."""

from __future__ import annotations

import inspect
import re

from lptn.basics.equations import MATH, equation_text, equations_of
from lptn.cli.terminal import show_table
from lptn.effects import Effect, catalogue, effect_named
from lptn.effects.base import SITES
from lptn.references import cite, works_cited

ROLE = re.compile(r":math:`([^`]*)`")
"""An equation within a sentence of a docstring."""
_EMPHASIS = re.compile(r"\*(\w+)\*")


def show_effects(key: str | None, details: bool = True) -> None:
    """The catalogue, or one effect of it.

    Args:
        key: of the effect; all by default.
        details: whether to print titles, or of one effect options, rivals and sources, too.

    Raises:
        InputError: no effect has this key.
    """
    if key is None and not details:
        for site in SITES:
            print(f"{site}: {', '.join(name for name, effect in catalogue().items() if effect.site == site)}")
        print("`lptn effects KEY` describes one; --details has a line on each.")
        return
    if key is None:
        listed = ((name, effect.title, effect.site) for name, effect in catalogue().items())
        show_table(("effect", "what it is", "at"), listed)
        return
    effect = effect_named(key, "effects", "KEY")
    print(docstring_text(effect, sources=details), "", sep="\n")
    rows = [
        (one.name, one.title, one.unit, f"{one.typical:g}", "" if one.off is None else f"{one.off:g}")
        for one in effect.parameters
    ]
    if rows:
        show_table(("parameter", "what it is", "unit", ">typical", ">off"), rows)
    for line in (
        f"Acts on: {where_text(effect)}.",
        f"Log columns: {columns_text(effect)}.",
        f"Looks like: {effect.signature.looks_like}.",
        f"Separate it by: {sentence(effect.signature.separate_by)}",
    ):
        print(line)
    if details:
        options = (f"Option: {option}" for option in options_text(effect))
        needs = f"A log shows it with: {effect.excitation.needs}."
        others = effect.signature.confused_with
        confused = [f"Confused with: {', '.join(others)}."] if others else []
        print(*options, needs, *confused, *_references(effect), sep="\n")


def catalogue_json(key: str | None) -> dict[str, object]:
    """The catalogue, or one effect of it, as other tools read it."""
    return {
        name: {
            "title": effect.title,
            "at": effect.site,
            "needs": list(effect.needs),
            "options": {option: list(words) for option, words in effect.options.items()},
            "equations": equations_of(effect.__doc__ or ""),
            "looks_like": effect.signature.looks_like,
            "excitation": effect.excitation.needs,
            "separate_by": effect.signature.separate_by,
            "source": cite(effect.source),
            "references": [cited.reference.full for cited in works_cited(cited_by(effect))],
            "parameters": {
                one.name: {key: getattr(one, key) for key in ("title", "unit", "typical", "off")}
                for one in effect.parameters
            },
        }
        for name, effect in catalogue().items()
        if key in (None, name)
    }


def docstring_text(effect: type[Effect], *, sources: bool = True) -> str:
    """An effect's docstring for people: equations in Unicode, a line each, and sources by author and year."""
    blocks = inspect.cleandoc(effect.__doc__ or effect.title).split("\n\n")
    return "\n\n".join(_block_text(block) for block in blocks if sources or not block.startswith("Source:"))


def cited_by(effect: type[Effect]) -> tuple[str, str]:
    """The texts in which an effect names its sources."""
    return effect.source, effect.__doc__ or ""


def where_text(effect: type[Effect]) -> str:
    """Where an effect acts, in words."""
    words = SITES[effect.site]
    words += "; has a state of its own" if effect.has_state else ""
    words += "; the same for the whole robot" if effect.whole_robot else ""
    words += "; every part may have it" if effect.common else ""
    return words + ("; also in one run" if effect.per_run else "")


def columns_text(effect: type[Effect], place: str = "<place>") -> str:
    """The log columns that an effect needs, as code: `torque.<place>` or `current.<place>`."""
    from lptn.logs.resampling import raw_keys  # here and not above: a list of effects needs no logs and no model
    from lptn.model.heat_balance import input_column

    columns = [
        " and ".join(f"`{column}`" for column in raw_keys(input_column(name, place)))
        for name in effect.options.get("input", effect.needs)
    ]
    joined = " or ".join(columns) if "input" in effect.options else " and ".join(columns)
    heat = f"; it acts on `{effect.heat_of}` at the same place" if effect.heat_of else ""
    return (joined or "none beside the temperatures") + heat


def options_text(effect: type[Effect]) -> list[str]:
    """The options of an effect as the model file has them: `input = "torque" | "current"`; the first is the default."""
    return [f"{option} = " + " | ".join(f'"{word}"' for word in words) for option, words in effect.options.items()]


def _references(effect: type[Effect]) -> list[str]:
    lines = []
    for cited in works_cited(cited_by(effect)):
        lines.append(f"  {cited.reference.full}")
        lines += [f"    {place}: {cited.reference.what_stands_at(place)}." for place in cited.places]
    return ["", "References:", *lines] if lines else []


def sentence(text: str) -> str:
    """A text with its full stop."""
    return text if text.endswith("?") else f"{text}."


def _block_text(block: str) -> str:
    """A paragraph of a docstring, or its equations."""
    if block.startswith(MATH):
        lines = block.removeprefix(MATH).split(r"\qquad")
        return "\n".join(f"    {equation_text(line).strip().removesuffix(',')}" for line in lines)
    text = ROLE.sub(lambda match: equation_text(match[1]), " ".join(block.splitlines()))
    return cite(_EMPHASIS.sub(r"\1", text))
