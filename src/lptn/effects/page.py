"""The catalogue of effects as a page of Markdown: equation, parameters, signature and source, from the classes."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Mapping

from lptn.basics.parameters import Parameter
from lptn.effects import Effect, catalogue

_SITES = {
    "node": "a node",
    "link": "a link to the surroundings",
    "edge": 'a pair of nodes `"a~b"` that no link joins',
    "loss": "another effect's heat at a node",
    "sensor": "a sensor",
    "pair": 'a sensor and a neighbour, `"a~b"`',
    "group": "several nodes at once",
    "boundary": "a prescribed temperature",
}
_OURS = "lptn.effects."
_MATH = ".. math::"
_ROLE = re.compile(r":math:`([^`]*)`")

HEAD = """\
# The catalogue of effects

Every effect is one file in this folder: one equation, its parameters, what its absence looks like. This page is made
from the classes; after a change write it anew:

```
lptn effects --markdown src/lptn/effects/README.md
```

*Amplitude* is the parameter that switches an effect off: at its off-value the model is the same to the last bit. A
*shape* (a time constant, an exponent) is tried on a small grid before it is fitted. `lptn improve` looks for each
effect at each place where the log has what it needs; "also in one run" says that it is looked for in single runs,
too. Sources are named in brackets and listed [at the end](#references); what is wrong in their print stands in
[the errata](../../../examples/README.md#errata-of-the-sources).

An effect of your own: [in a package of your own](PLUGIN.md).
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
    rows += [f"| [`{key}`](#{key}) | {each.title} | {_SITES[each.site]} |" for key, each in chosen.items()]
    return "\n".join([HEAD, *rows, "", *(_section(each) for each in chosen.values())])


def built_in() -> dict[str, type[Effect]]:
    """The effects of this package, without plug-ins."""
    return {key: each for key, each in catalogue().items() if each.__module__.startswith(_OURS)}


def _section(effect: type[Effect]) -> str:
    lines = [f"## {effect.key}", "", *_prose(effect), "", *_parameters(effect), "", f"- Acts on: {_where(effect)}."]
    lines += [f"- Needs: {_needs(effect)}.", f"- Looks like: {effect.signature.looks_like}."]
    lines.append(f"- Separate it by: {effect.signature.separate_by}.")
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
        if line.startswith(_MATH):
            formula = [line.removeprefix(_MATH).strip()]
        elif formula is not None and line.startswith(" "):
            formula.append(line.strip())
        else:
            lines += _block(formula)
            formula = None
            lines.append(_ROLE.sub(r"$`\1`$", line))
    return lines + _block(formula)


def _block(formula: list[str] | None) -> list[str]:
    return [] if formula is None else ["```math", *formula, "```"]


def _parameters(effect: type[Effect]) -> list[str]:
    if not effect.parameters:
        return ["No parameter."]
    head = ["| parameter | what it is | unit | bounds | typical | role |", "| --- | --- | --- | --- | --- | --- |"]
    return head + [_row(effect, each) for each in effect.parameters]


def _row(effect: type[Effect], each: Parameter) -> str:
    lower, upper = (("−∞" if end < 0 else "∞") if math.isinf(end) else f"{end:g}" for end in each.bounds)
    role = []
    if each is effect.amplitude():
        role.append(f"amplitude, off at {each.off:g}")
    if each.grid:
        role.append(f"shape, tried at {', '.join(f'{value:g}' for value in each.grid)}")
    if each.fixed:
        role.append(f"held at {each.value:g}")
    return f"| `{each.name}` | {each.title} | {each.unit} | {lower} to {upper} | {each.typical:g} | {'; '.join(role)} |"


def _where(effect: type[Effect]) -> str:
    told = _SITES[effect.site]
    told += "; has a state of its own" if effect.has_state else ""
    told += "; the same for the whole robot" if effect.whole_robot else ""
    return told + ("; also in one run" if effect.per_run else "")


def _needs(effect: type[Effect]) -> str:
    words = effect.options.get("input", effect.needs)
    return " or ".join(f"`{word}`" for word in words) if words else "nothing beside the temperatures"
