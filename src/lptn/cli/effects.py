"""The catalogue of effects on the terminal, and for other programs."""

from __future__ import annotations

import inspect
import re
from collections import deque

from lptn.basics.errors import InputError
from lptn.cli.terminal import new_table, out
from lptn.effects import Effect, ExcessEffect, LossEffect, catalogue
from lptn.logs.resampling import raw_keys
from lptn.model.heat_balance import input_column
from lptn.references import citations, cite, works_cited

_MATH = ".. math::"
_ROLE = re.compile(r":math:`([^`]*)`")
_EMPHASIS = re.compile(r"\*(\w+)\*")
_SOURCE = "Source: "


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
    out.print(docstring_text(effect), markup=False, highlight=False)
    table = new_table("parameter", "what it is", "unit", "typical", "off")
    for parameter in effect.parameters:
        off = "" if parameter.off is None else f"{parameter.off:g}"
        table.add_row(parameter.name, parameter.title, parameter.unit, f"{parameter.typical:g}", off)
    if effect.parameters:
        out.print(table)
    for line in (
        f"Log columns: {columns_text(effect)}.",
        *(f"Option: {option}" for option in options_text(effect)),
        f"Looks like: {effect.signature.looks_like}.",
        f"Separate it by: {effect.signature.separate_by}.",
        *_confused(effect),
        *_references(effect),
    ):
        out.print(line, markup=False, highlight=False)


def catalogue_json(key: str | None) -> dict[str, object]:
    """The catalogue, or one effect of it, as other tools read it."""
    return {
        name: {
            "title": effect.title,
            "at": effect.site,
            "needs": list(effect.needs),
            "options": {option: list(words) for option, words in effect.options.items()},
            "equations": equations(effect),
            "looks_like": effect.signature.looks_like,
            "separate_by": effect.signature.separate_by,
            "source": cite(effect.source),
            "references": [work.full for work in works_cited(cited_by(effect))],
            "parameters": {
                each.name: {"title": each.title, "unit": each.unit, "typical": each.typical, "off": each.off}
                for each in effect.parameters
            },
        }
        for name, effect in catalogue().items()
        if key in (None, name)
    }


def docstring_text(effect: type[Effect]) -> str:
    """An effect's docstring for people: equations in Unicode, a line each, and sources by author and year."""
    blocks = inspect.cleandoc(effect.__doc__ or effect.title).split("\n\n")
    return "\n\n".join(_block_text(block) for block in blocks)


def equations(effect: type[Effect]) -> list[str]:
    """The equations of an effect's docstring in Unicode, such as `R(v) = R₀ / (1 + γ |v|)`."""
    blocks = inspect.cleandoc(effect.__doc__ or "").split("\n\n")
    latex = " ".join(block.removeprefix(_MATH) for block in blocks if block.startswith(_MATH))
    return [equation_text(each).strip().removesuffix(",") for each in latex.split(r"\qquad") if each.strip()]


def cited_by(effect: type[Effect]) -> tuple[str, str]:
    """The texts in which an effect names its sources."""
    return effect.source, effect.__doc__ or ""


def columns_text(effect: type[Effect], place: str = "<place>") -> str:
    """The log columns that an effect needs: `torque.<place> or current.<place>`."""
    said = [
        " and ".join(f"{column}" for column in raw_keys(input_column(name, place)))
        for name in effect.options.get("input", effect.needs)
    ]
    joined = " or ".join(said) if "input" in effect.options else " and ".join(said)
    heat = effect.acts_on if issubclass(effect, LossEffect) else ""
    heat = effect.heat_of if issubclass(effect, ExcessEffect) else heat
    return (joined or "none beside the temperatures") + (f"; it acts on {heat} at the same place" if heat else "")


def options_text(effect: type[Effect]) -> list[str]:
    """The options of an effect as the model file has them: `input = "torque" | "current"`; the first is the default."""
    return [f"{option} = " + " | ".join(f'"{word}"' for word in words) for option, words in effect.options.items()]


def _confused(effect: type[Effect]) -> list[str]:
    others = effect.signature.confused_with
    return [f"Confused with: {', '.join(others)}."] if others else []


def _references(effect: type[Effect]) -> list[str]:
    texts = cited_by(effect)
    misprints = {error: None for text in texts for cited in citations(text) for error in cited.errata}
    works = works_cited(texts)
    lines = [f"Printed wrong in the source: {error}." for error in misprints]
    return [*lines, *(["", "References"] if works else []), *(f"  {work.full}" for work in works)]


def _block_text(block: str) -> str:
    """A paragraph of a docstring, or its equations."""
    if block.startswith(_MATH):
        lines = block.removeprefix(_MATH).split(r"\qquad")
        return "\n".join(f"    {equation_text(line).strip().removesuffix(',')}" for line in lines)
    text = _ROLE.sub(lambda match: equation_text(match[1]), " ".join(block.splitlines()))
    return cite(_EMPHASIS.sub(r"\1", text))


# --- equations: the small part of LaTeX that docstrings use, as text --------------------------------

_SYMBOLS = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "varepsilon": "ε", "epsilon": "ε", "eta": "η", "theta": "θ",
    "kappa": "κ", "lambda": "λ", "mu": "μ", "nu": "ν", "rho": "ρ", "sigma": "σ", "tau": "τ", "varphi": "φ", "phi": "φ",
    "chi": "χ", "psi": "ψ", "omega": "ω", "Delta": "Δ", "Omega": "Ω", "Phi": "Φ", "pi": "π", "int": "∫",
    "partial": "∂", "infty": "∞", "cdot": "·", "times": "×", "propto": "∝", "approx": "≈", "le": "≤", "leq": "≤",
    "ge": "≥", "geq": "≥", "ne": "≠", "pm": "±", "to": "→", "quad": "  ", "qquad": "    ", "dots": "…", "left": "",
    "right": "", "exp": "exp", "ln": "ln",
}  # fmt: skip
_ACCENTS = {"dot": "\u0307", "ddot": "\u0308", "bar": "\u0304", "hat": "\u0302", "tilde": "\u0303"}
_TOKEN = re.compile(r"\\[A-Za-z]+|\\.|\s+|.", re.DOTALL)
_LOW = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_HIGH = str.maketrans("0123456789+-−n", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻⁻ⁿ")
_PREFIXES = {r"\Delta", r"\partial"}
_ATOM = re.compile(r"[^\s+−·×/=]+")


def equation_text(latex: str) -> str:
    r"""A formula of a docstring as Unicode text: `\frac{1 + g}{R_d}` as (1 + g)/R_d.

    Commands outside the part of LaTeX that the catalogue uses stay as their names.
    """
    tokens = deque(_TOKEN.findall(latex))
    return " ".join(_sequence(tokens).split())


def _sequence(tokens: deque[str]) -> str:
    """Text up to the end of the group."""
    text = ""
    while tokens and tokens[0] != "}":
        token = tokens.popleft()
        if token == "_":
            text += _subscript(_argument(tokens))
        elif token == "^":
            text = _power(text, _argument(tokens))
        else:
            text += _token(token, tokens)
    if tokens:
        tokens.popleft()
    return text


def _argument(tokens: deque[str]) -> str:
    """The group or the one token that a command is applied to."""
    while tokens and tokens[0].isspace():
        tokens.popleft()
    return _token(tokens.popleft(), tokens) if tokens else ""


def _token(token: str, tokens: deque[str]) -> str:
    if token == "{":
        return _sequence(tokens)
    if token == r"\sum":
        return _sum(tokens)
    if token == r"\frac":
        return _fraction(_argument(tokens), _argument(tokens), tokens)
    name = token[1:]
    if token.startswith("\\") and name in _ACCENTS:
        return _argument(tokens) + _ACCENTS[name]
    if name in {"text", "mathrm", "mathit", "mathbf", "operatorname"}:
        return _argument(tokens).replace("−", "-")
    if token in _PREFIXES and tokens and tokens[0].isspace():
        tokens.popleft()
    if token.startswith("\\"):
        return _SYMBOLS.get(name, " " if name in {",", ";", ":", " ", "!"} else name)
    return {"-": "−", "'": "′"}.get(token, token)


def _fraction(above: str, below: str, tokens: deque[str]) -> str:
    """One line, with the brackets that it then needs."""
    above, below = (each if _ATOM.fullmatch(each) else f"({each})" for each in (above, below))
    behind = next((token for token in tokens if not token.isspace() and token != r"\,"), "}")
    apart = behind in {"}", "=", "+", "-", ")", ",", "]", "|", r"\right", r"\qquad", r"\quad"}
    return f"{above}/{below}" if apart else f"({above}/{below})"


def _subscript(below: str) -> str:
    return below.translate(_LOW) if below.isdigit() else f"_{below}"


def _power(text: str, exponent: str) -> str:
    if re.search(r"(?<![^\W\d_])e$", text):
        return f"{text[:-1]}exp({exponent})"
    short = all(letter in "0123456789+-−n" for letter in exponent)
    return text + (exponent.translate(_HIGH) if short else f"^({exponent})")


def _sum(tokens: deque[str]) -> str:
    """The sign of a sum with what it runs over: Σ(i=1…n)."""
    ends = []
    while tokens and tokens[0] in {"_", "^"}:
        tokens.popleft()
        ends.append(_argument(tokens))
    return f"Σ({'…'.join(ends)})" if ends else "Σ"
