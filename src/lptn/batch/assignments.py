"""CasADi's operations as text: assignments of expressions to names, in C and in Python."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from lptn.simulate.kernel import NUMBERS, OPERATIONS, STATES, Operations

C = OPERATIONS
PYTHON = OPERATIONS | {
    # Comparisons give numbers of the arrays' own type. Where both operands are equal the slope is that of the first, as
    # CasADi has it; JAX's own fmax and PyTorch's would share it out.
    **{name: f"where({OPERATIONS[name]}, zero + 1, zero)" for name in ("LT", "LE", "EQ", "NE")},
    "FMIN": "where(a <= b, a, b)",
    "FMAX": "where(a >= b, a, b)",
    "NOT": "where(a == 0, zero + 1, zero)",
    "AND": "where(a != 0, where(b != 0, zero + 1, zero), zero)",
    "OR": "where(a != 0, zero + 1, where(b != 0, zero + 1, zero))",
    "IF_ELSE_ZERO": "where(a != 0, b, zero)",
    "SIGN": "sign(a)",
    "REMAINDER": "a - b * round(a / b)",  # rounded to the even neighbour, as C's is
}
"""The same in Python; `zero` is an array of the arguments' type, the functions are those of the array library."""

_PRECEDENCE = {"ADD": 1, "SUB": 1, "MUL": 2, "DIV": 2, "TWICE": 2, "SQ": 2, "INV": 2, "NEG": 3, "NOT": 3}
_LOOSEST, _ATOM = 0, 4
_CALL = re.compile(r"\w+\(.*\)")
_OPERAND = re.compile(r"\b[ab]\b")
_INLINE = 48  # characters of an expression that may stand within another: lines stay as long as a screen is wide


class Assignments(NamedTuple):
    """What makes some values: pairs of a name and its expression, in order, and an expression of each value."""

    lines: list[tuple[str, str]]
    results: list[str]


def assignments(
    operations: Operations, wanted: Sequence[int], names: Mapping[int, str], language: Mapping[str, str]
) -> Assignments:
    """The assignments that make some values of a list of operations.

    What is used once stands in the expression that uses it.

    Args:
        operations: the list.
        wanted: numbers of the values.
        names: of values that are there already, by number.
        language: `C` or `PYTHON`.
    """
    uses = Counter(wanted)
    for value in range(max(wanted, default=-1), -1, -1):
        if uses[value] and value not in names and operations.kinds[value] >= 0:
            for operand in _OPERAND.findall(language[_name(operations, value)]):
                uses[int((operations.left if operand == "a" else operations.right)[value])] += 1
    lines: list[tuple[str, str]] = []
    texts = {value: (name, _ATOM) for value, name in names.items()}
    for value in sorted(uses.keys() - names.keys()):
        if operations.kinds[value] < 0:
            texts[value] = _constant(float(operations.initial[value]), language)
            continue
        text, precedence = _expression(operations, value, texts, language)
        if uses[value] > 1 or len(text) > _INLINE:
            lines.append((f"v{value}", text))
            text, precedence = f"v{value}", _ATOM
        texts[value] = text, precedence
    return Assignments(lines, [texts[value][0] for value in wanted])


def held(operations: Operations) -> list[int]:
    """Numbers of the values that depend on inputs and parameters alone, and that the results are made of directly."""
    needed = set(operations.results.tolist())
    for value in range(len(operations.kinds) - 1, -1, -1):
        if value in needed and operations.kinds[value] >= 0 and operations.parts[value] >= STATES:
            needed |= {int(operations.left[value]), int(operations.right[value])}
    states, arguments = operations.sizes[0], sum(operations.sizes)
    fixed = (value for value in sorted(needed) if value >= states)
    return [
        value
        for value in fixed
        if value < arguments or (operations.kinds[value] >= 0 and operations.parts[value] < STATES)
    ]


def _name(operations: Operations, value: int) -> str:
    return NUMBERS[int(operations.kinds[value])]


def _constant(number: float, language: Mapping[str, str]) -> tuple[str, int]:
    text = repr(number)
    if language is C:
        return f"HEAT_NUMBER({text.replace('inf', 'INFINITY').replace('nan', 'NAN')})", _ATOM  # of the file's own type
    return text, _PRECEDENCE["NEG"] if text.startswith("-") else _ATOM


def _expression(
    operations: Operations, value: int, texts: Mapping[int, tuple[str, int]], language: Mapping[str, str]
) -> tuple[str, int]:
    """One operation on the texts of its operands, and how tightly it binds."""
    name = _name(operations, value)
    template = language[name]
    call = _CALL.fullmatch(template) is not None
    precedence = _ATOM if call else _PRECEDENCE.get(name, _LOOSEST)
    operands = {"a": texts[int(operations.left[value])], "b": texts[int(operations.right[value])]}
    binary = "b" in _OPERAND.findall(template)

    def filled(match: re.Match[str]) -> str:
        text, own = operands[match[0]]
        if call:
            # PyTorch's functions of two arrays take no plain numbers.
            plain = binary and language is PYTHON and not template.startswith("where(") and _is_number(text)
            return f"zero + {text}" if plain else text
        first = match.start() == 0
        return text if own > precedence or (first and own == precedence > _LOOSEST) else f"({text})"

    return _OPERAND.sub(filled, template), precedence


def _is_number(text: str) -> bool:
    return re.fullmatch(r"-?(\d.*|inf|nan)", text) is not None and " " not in text
