"""Equations as one line of Unicode text: the small part of LaTeX that docstrings use."""

from __future__ import annotations

import inspect
import re
from collections import deque

_SYMBOLS = {
    "alpha": "α", "beta": "β", "gamma": "γ", "delta": "δ", "varepsilon": "ε", "epsilon": "ε", "eta": "η", "theta": "θ",
    "kappa": "κ", "lambda": "λ", "mu": "μ", "nu": "ν", "rho": "ρ", "sigma": "σ", "tau": "τ", "varphi": "φ", "phi": "φ",
    "chi": "χ", "psi": "ψ", "omega": "ω", "Delta": "Δ", "Omega": "Ω", "Phi": "Φ", "pi": "π", "int": "∫",
    "partial": "∂", "infty": "∞", "cdot": "·", "times": "×", "propto": "∝", "approx": "≈", "le": "≤", "leq": "≤",
    "ge": "≥", "geq": "≥", "ne": "≠", "pm": "±", "to": "→", "quad": "  ", "qquad": "    ", "dots": "…", "left": "",
    "right": "", "bigl": "", "bigr": "", "exp": "exp", "ln": "ln",
}  # fmt: skip
_ACCENTS = {"dot": "\u0307", "ddot": "\u0308", "bar": "\u0304", "hat": "\u0302", "tilde": "\u0303"}
_TOKEN = re.compile(r"\\[A-Za-z]+|\\.|\s+|.", re.DOTALL)
_LOW = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_HIGH = str.maketrans("0123456789+-−n", "⁰¹²³⁴⁵⁶⁷⁸⁹⁺⁻⁻ⁿ")
_PREFIXES = {r"\Delta", r"\partial"}
_ATOM = re.compile(r"[^\s+−·×/=]+")


def equation_text(latex: str) -> str:
    r"""A formula of a docstring as Unicode text: `\frac{1 + g}{R_d}` as (1 + g)/R_d.

    An exponent that Unicode has no letters for stands in brackets, `|q|^{3/2}` as |q|^(3/2). Commands outside the
    part of LaTeX that the catalogue uses stay as their names, with the backslash.
    """
    tokens = deque(_TOKEN.findall(latex))
    return " ".join(_sequence(tokens).split()).replace("( ", "(").replace(" )", ")")


MATH = ".. math::"
"""What a docstring's block of equations begins with."""


def equations_of(docstring: str) -> list[str]:
    """The equations of a docstring as Unicode text, such as `R(v) = R₀ / (1 + γ |v|)`."""
    blocks = inspect.cleandoc(docstring).split("\n\n")
    latex = " ".join(block.removeprefix(MATH) for block in blocks if block.startswith(MATH))
    return [
        equation_text(equation).strip().removesuffix(",") for equation in latex.split(r"\qquad") if equation.strip()
    ]


def _sequence(tokens: deque[str]) -> str:
    """Text up to the end of the group."""
    text = ""
    while tokens and tokens[0] != "}":
        token = tokens.popleft()
        if token == "_":
            below = _argument(tokens)
            text += below.translate(_LOW) if below.isdigit() else f"_{below}"
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
    if token == r"\sqrt":
        return f"√({_argument(tokens)})"
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
        return _SYMBOLS.get(name, " " if name in {",", ";", ":", " ", "!"} else token)
    return {"-": "−", "'": "′"}.get(token, token)


def _fraction(above: str, below: str, tokens: deque[str]) -> str:
    """One line, with the brackets that it then needs."""
    above, below = (term if _ATOM.fullmatch(term) else f"({term})" for term in (above, below))
    behind = next((token for token in tokens if not token.isspace() and token != r"\,"), "}")
    apart = behind in {"}", "=", "+", "-", ")", ",", "]", "|", r"\right", r"\qquad", r"\quad"}
    return f"{above}/{below}" if apart else f"({above}/{below})"


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
