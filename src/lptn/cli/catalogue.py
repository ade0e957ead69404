"""The catalogue of effects: on the terminal, for other programs, and as the page of Markdown beside the classes."""

from __future__ import annotations

import inspect
import re
from collections.abc import Iterable, Mapping

from lptn.basics.equations import MATH, equation_text, equations_of
from lptn.basics.parameters import LARGEST, Parameter
from lptn.cli.terminal import show_table
from lptn.effects import Effect, catalogue, effect_named
from lptn.effects.base import SITES
from lptn.references import Citation, cite, works_cited

_OURS = "lptn.effects."
_ROLE = re.compile(r":math:`([^`]*)`")
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
        (
            parameter.name,
            parameter.title,
            parameter.unit,
            f"{parameter.typical:g}",
            "" if parameter.off is None else f"{parameter.off:g}",
        )
        for parameter in effect.parameters
    ]
    if rows:
        show_table(("parameter", "what it is", "unit", ">typical", ">off"), rows)
    for line in (
        f"Acts on: {where_text(effect)}.",
        f"Log columns: {columns_text(effect)}.",
        f"Looks like: {effect.signature.looks_like}.",
        f"Separate it by: {_sentence(effect.signature.separate_by)}",
    ):
        print(line)
    if details:
        options = (f"Option: {option}" for option in options_text(effect))
        needs = f"A log shows it with: {effect.excitation.needs}."
        print(*options, needs, *_confused(effect), *_references(effect), sep="\n")


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
                parameter.name: {
                    "title": parameter.title,
                    "unit": parameter.unit,
                    "typical": parameter.typical,
                    "off": parameter.off,
                }
                for parameter in effect.parameters
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


def _confused(effect: type[Effect]) -> list[str]:
    others = effect.signature.confused_with
    return [f"Confused with: {', '.join(others)}."] if others else []


def _references(effect: type[Effect]) -> list[str]:
    lines = []
    for cited in works_cited(cited_by(effect)):
        lines.append(f"  {cited.reference.full}")
        lines += [f"    {place}: {cited.reference.what_stands_at(place)}." for place in cited.places]
    return ["", "References:", *lines] if lines else []


def _sentence(text: str) -> str:
    return text if text.endswith("?") else f"{text}."


def _block_text(block: str) -> str:
    """A paragraph of a docstring, or its equations."""
    if block.startswith(MATH):
        lines = block.removeprefix(MATH).split(r"\qquad")
        return "\n".join(f"    {equation_text(line).strip().removesuffix(',')}" for line in lines)
    text = _ROLE.sub(lambda match: equation_text(match[1]), " ".join(block.splitlines()))
    return cite(_EMPHASIS.sub(r"\1", text))


# --- the page of Markdown ----------------------------------------------------------------------------

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


def catalogue_markdown(effects: Mapping[str, type[Effect]] | None = None) -> str:
    """The page.

    Args:
        effects: by key; by default the whole catalogue with installed plug-ins.

    Returns:
        Markdown text that GitHub shows with its formulas.
    """
    chosen = catalogue() if effects is None else effects
    rows = ["| effect | what it is | acts on |", "| --- | --- | --- |"]
    rows += [f"| [`{key}`](#{key}) | {effect.title} | {SITES[effect.site]} |" for key, effect in chosen.items()]
    return "\n".join([HEAD, *rows, "", *map(_section, chosen.values()), *_works(chosen.values())])


def _section(effect: type[Effect]) -> str:
    lines = [f"## {effect.key}", "", *_prose(effect), "", *_parameters(effect), "", f"- Acts on: {where_text(effect)}."]
    lines += [f"- Log columns: {columns_text(effect)}.", *_options(effect)]
    lines += [f"- Looks like: {effect.signature.looks_like}."]
    lines += [f"- A log shows it with: {effect.excitation.needs}."]
    lines.append(f"- Separate it by: {_sentence(effect.signature.separate_by)}")
    if effect.signature.confused_with:
        others = ", ".join(f"[`{key}`](#{key})" for key in effect.signature.confused_with)
        lines.append(f"- Confused with: {others}.")
    if effect.__module__.startswith(_OURS):
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
            lines.append(_linked(_ROLE.sub(r"$`\1`$", line)))
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
