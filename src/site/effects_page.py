"""The page of the catalogue of effects, beside their classes: `python src/site/effects_page.py` writes it."""

from __future__ import annotations

import inspect
from collections.abc import Iterable
from pathlib import Path

from lptn.basics.equations import MATH
from lptn.basics.files import write_whole
from lptn.basics.parameters import LARGEST, Parameter
from lptn.cli.catalogue import ROLE, cited_by, columns_text, options_text, sentence, where_text
from lptn.effects import Effect, catalogue
from lptn.effects.base import SITES
from lptn.references import Citation, cite, works_cited

_OURS = "lptn.effects."

HEAD = """\
# The catalogue of effects

Each effect has one equation, its parameters, and a description of how its absence shows; `lptn effects KEY` prints it.

The *amplitude* is the parameter that scales an effect: at its off-value the model is the same to the last bit. A
*shape* (a time constant, an exponent) is tried at a few values before it is fitted. `lptn improve` tests each effect at
each place where the log has the columns that it needs. Effects that "every part may have" are added everywhere at
first; those "also in one run" are tested in single runs, too. Sources are cited in brackets and listed
[at the end](#references); their misprints are in [the errata](../../../examples/README.md#errata-of-the-sources).

You can add [effects of your own](PLUGIN.md) as a package.
"""


def effects_page() -> str:
    """The page on the effects of this package, without plug-ins, as Markdown that GitHub shows with its formulas."""
    chosen = {key: effect for key, effect in catalogue().items() if effect.__module__.startswith(_OURS)}
    rows = ["| effect | what it is | acts on |", "| --- | --- | --- |"]
    rows += [f"| [`{key}`](#{key}) | {effect.title} | {SITES[effect.site]} |" for key, effect in chosen.items()]
    return "\n".join([HEAD, *rows, "", *map(_section, chosen.values()), *_works(chosen.values())])


def _section(effect: type[Effect]) -> str:
    lines = [f"## {effect.key}", "", *_prose(effect), "", *_parameters(effect), "", f"- Acts on: {where_text(effect)}."]
    lines += [f"- Log columns: {columns_text(effect)}.", *_options(effect)]
    lines += [f"- Looks like: {effect.signature.looks_like}."]
    lines += [f"- A log shows it with: {effect.excitation.needs}."]
    lines.append(f"- Separate it by: {sentence(effect.signature.separate_by)}")
    if effect.signature.confused_with:
        others = ", ".join(f"[`{key}`](#{key})" for key in effect.signature.confused_with)
        lines.append(f"- Confused with: {others}.")
    name = f"{effect.__module__.removeprefix(_OURS)}.py"
    lines.append(f"- File: [{name}]({name}).")
    return "\n".join([*lines, ""])


def _prose(effect: type[Effect]) -> list[str]:
    """The docstring; its formulas as blocks that GitHub sets."""
    lines: list[str] = []
    formula: list[str] | None = None
    for line in inspect.cleandoc(effect.__doc__ or effect.title).splitlines():
        if line.startswith(MATH):
            formula = [line.removeprefix(MATH).strip()]
        elif formula is not None and line.startswith(" "):
            formula.append(line.strip())
        else:
            lines += _block(formula)
            formula = None
            lines.append(_linked(ROLE.sub(r"$`\1`$", line)))
    return lines + _block(formula)


def _block(formula: list[str] | None) -> list[str]:
    return [] if formula is None else ["```math", *formula, "```"]


def _parameters(effect: type[Effect]) -> list[str]:
    if not effect.parameters:
        return ["No parameter."]
    head = ["| parameter | what it is | unit | bounds | typical | role |", "| --- | --- | --- | --- | --- | --- |"]
    return head + [_row(effect, parameter) for parameter in effect.parameters]


def _row(effect: type[Effect], parameter: Parameter) -> str:
    lower, upper = (("−∞" if end < 0 else "∞") if abs(end) >= LARGEST else f"{end:g}" for end in parameter.bounds)
    typical = f"{parameter.typical:g}" + (f", goes with the {parameter.relative_to}" if parameter.relative_to else "")
    role = []
    if parameter is effect.amplitude():
        role.append(f"amplitude, off at {parameter.off:g}")
    if parameter.grid:
        role.append(f"shape, tried at {', '.join(f'{value:g}' for value in parameter.grid)}")
    if parameter.fixed:
        role.append(f"held at {parameter.value:g}")
    return (
        f"| `{parameter.name}` | {parameter.title} | {parameter.unit} | "
        f"{lower} to {upper} | {typical} | {'; '.join(role)} |"
    )


def _options(effect: type[Effect]) -> list[str]:
    return [f"- Option: `{option}`; the first is the default." for option in options_text(effect)]


def _linked(text: str) -> str:
    """A text whose citations lead to the list of references below."""

    def link(cited: Citation) -> str:
        key = cited.reference.key
        return f"[[{key}](#{key.lower()})" + (f", {'; '.join(cited.places)}]" if cited.places else "]")

    return cite(text, link)


def _works(effects: Iterable[type[Effect]]) -> list[str]:
    """The works that effects cite: a heading each, to be linked to, and what stands at the cited places."""
    lines = ["## References", ""]
    for cited in works_cited(text for effect in effects for text in cited_by(effect)):
        work = cited.reference
        lines += [f"### {work.key}", "", work.full, ""]
        lines += [f"- {place}: {work.what_stands_at(place)}." for place in cited.places]
        lines += [""] if cited.places else []
    return lines


if __name__ == "__main__":
    write_whole(Path(__file__).parents[1] / "lptn/effects/README.md", effects_page())
