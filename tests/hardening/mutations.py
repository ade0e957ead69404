"""Ways to spoil a file: lines, keys, values, characters, bytes, and the contents of archives and tables."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable, Sequence
from random import Random

ODD_NUMBERS = (
    "nan", "inf", "-inf", "1e400", "-1e400", "1e308", "-1e308", "5e-324", "1e-300", "0", "-0.0", "-1", "0.1", "1e6",
    "1_0", "99999999999999999999999999", "9" * 5000, "0x" + "f" * 400, "1e-9999", "1.", ".5", "--1", "1e", "2", "1e5",
)  # fmt: skip
ODD_STRINGS = (
    "", " ", "*", "?", "[", "]", "[z-a]", "[!", "*_calf", "{leg}", "{leg}_{leg}", "{0}", "{", "(?P<x", "\\\\", "a~b",
    "~", "a.b", ".", "..", "../x", "/etc/passwd", "ambient", "start", "temperature.", "temperature.x", "nan", "=1", "@",
    "#", "a@b", "FR_calf", "é", "\u202e", "\U0001f525", "ﬁ", "x" * 3000, "%s", "{{7*7}}", "__import__('os')", "K",
    "9**9**9**9", "m/s**99999", "K/W*0", "1/0", "J/K;", "degF", "percent", "kg m", "None", "true",
)  # fmt: skip
ODD_VALUES = (
    "true", "[]", "{}", "[[]]", "[{}]", "[1, 2, 3]", "[nan, nan]", '["a", "b"]', "[1, 'a']", "1979-05-27T07:32:00Z",
    "1979-05-27", "07:32:00", "{ value = 1 }", "{ value = nan }", "{ value = 1, unit = 'K' }", "{ unit = 'J/K' }",
    "{ value = 1, unit = '9**9**9**9' }", "{ value = 1, bounds = [1] }", "{ value = 1, bounds = [inf, nan] }",
    "{ bounds = [0, 1e308] }", "{ value = 1e300, bounds = [1e-300, 1e308] }", "{ column = 'x' }", "{ norm = [] }",
    "{ share = 'sides' }", "{ fixed = 3 }", "{ a = { b = { c = {} } } }", "'''\n'''", '"""x\ny"""', "", "=", "'",
    '"', "[",
)  # fmt: skip
ODD_CHARACTERS = "\0\x01\x1b\x7f\x85\u2028\ufeff\u202e\r\n\t\"'[]{}=.,#\\é\U0001f525"
_NUMBER = re.compile(r"(?<![\w.\"'])[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")
_STRING = re.compile(r'"[^"\n]*"')
_KEY = re.compile(r"^(\s*)([\w\"*.~-]+)(\s*=)", re.MULTILINE)
_VALUE = re.compile(r"=[^\n#]*")


def spoil_toml(random: Random, text: str, others: Sequence[str]) -> bytes:
    """A TOML text with one to five changes; rarely bytes that are no text at all."""
    for _ in range(random.choice((1, 1, 1, 2, 3, 5))):
        text = random.choice(_TEXT_MOVES)(random, text, others)
    content = text.encode("utf-8", "surrogatepass")
    return spoil_bytes(random, content) if random.random() < 0.05 else content


def spoil_bytes(random: Random, content: bytes) -> bytes:
    """Bytes flipped, cut off, doubled, removed or put in."""
    spoilt = bytearray(content)
    for _ in range(random.choice((1, 1, 2, 4, 16))):
        size = len(spoilt)
        at, n = random.randrange(size + 1), random.choice((1, 2, 4, 64))
        kind = random.randrange(5)
        if kind == 0 and size:
            spoilt[at % size] = random.randrange(256)
        elif kind == 1:
            del spoilt[at:]
        elif kind == 2:
            del spoilt[at : at + n]
        elif kind == 3:
            spoilt[at:at] = random.randbytes(n)
        else:
            spoilt[at:at] = spoilt[at : at + n]
    return bytes(spoilt)


def spoil_csv(random: Random, text: str) -> bytes:
    """A CSV text with cells, lines, separators or bytes changed."""
    for _ in range(random.choice((1, 1, 2, 4))):
        text = random.choice(_CSV_MOVES)(random, text)
    content = text.encode("utf-8", "surrogatepass")
    return spoil_bytes(random, content) if random.random() < 0.15 else content


def spoil_zip(random: Random, content: bytes) -> bytes:
    """An archive with an entry's name, content or place changed; now and then its bytes."""
    if random.random() < 0.3:
        return spoil_bytes(random, content)
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        entries = [(entry.filename, archive.read(entry)) for entry in archive.infolist()]
    for _ in range(random.choice((1, 1, 2))):
        if not entries:
            break
        k = random.randrange(len(entries))
        name, body = entries[k]
        kind = random.randrange(6)
        if kind == 0:
            entries[k] = random.choice(("../x", "/x", "C:x", "a\\b", "x/", name + "/x", name.upper(), "é")), body
        elif kind == 1:
            del entries[k]
        elif kind == 2:
            entries.append((name, body))
        elif kind == 3:
            entries[k] = name, spoil_bytes(random, body)
        else:
            xml = [n for n, (file, _) in enumerate(entries) if file.endswith((".xml", ".toml"))]
            if xml:
                k = random.choice(xml)
                entries[k] = entries[k][0], _spoil_xml(random, entries[k][1].decode("utf-8", "replace"))
    return zipped(entries)


def zipped(entries: Sequence[tuple[str | zipfile.ZipInfo, bytes]]) -> bytes:
    """Entries as a ZIP archive, whatever their names."""
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        seen = set()
        for name, body in entries:
            text = name if isinstance(name, str) else name.filename
            if text not in seen:  # zipfile itself warns of a second one
                archive.writestr(name, body)
            seen.add(text)
    return stream.getvalue()


# --- text -----------------------------------------------------------------------------------------


def _replaced(pattern: re.Pattern[str], odd: Callable[[Random], str]) -> Callable[[Random, str, Sequence[str]], str]:
    def move(random: Random, text: str, _: Sequence[str]) -> str:
        matches = list(pattern.finditer(text))
        if not matches:
            return text
        chosen = random.choice(matches)
        return text[: chosen.start()] + odd(random) + text[chosen.end() :]

    return move


def _line(random: Random, text: str, others: Sequence[str]) -> str:
    lines = text.split("\n")
    k, kind = random.randrange(len(lines)), random.randrange(5)
    if kind == 0:
        del lines[k]
    elif kind == 1:
        lines.insert(random.randrange(len(lines)), lines[k])
    elif kind == 2:
        j = random.randrange(len(lines))
        lines[k], lines[j] = lines[j], lines[k]
    elif kind == 3:
        lines.insert(k, random.choice(random.choice(others).split("\n")))
    else:
        del lines[k : k + random.randrange(1, 12)]
    return "\n".join(lines)


def _character(random: Random, text: str, _: Sequence[str]) -> str:
    at = random.randrange(len(text) + 1)
    return text[:at] + random.choice(ODD_CHARACTERS) + text[at + random.randrange(2) :]


def _cut(random: Random, text: str, _: Sequence[str]) -> str:
    return text[: random.randrange(len(text) + 1)]


def _nested(random: Random, text: str, _: Sequence[str]) -> str:
    depth = random.choice((3, 50, 400, 3000))
    kind = random.randrange(4)
    deep = (
        "x = " + "[" * depth + "]" * depth,
        "x = " + "{ a = " * depth + "1" + " }" * depth,
        "[" + ".".join(["a"] * depth) + "]",
        ".".join(["b"] * depth) + " = 1",
    )[kind]
    lines = text.split("\n")
    lines.insert(random.randrange(len(lines) + 1), deep)
    return "\n".join(lines)


_odd_string = _replaced(_STRING, lambda random: '"' + random.choice(ODD_STRINGS) + '"')
_TEXT_MOVES: tuple[Callable[[Random, str, Sequence[str]], str], ...] = (
    _line,
    _line,
    _character,
    _cut,
    _nested,
    _replaced(_NUMBER, lambda random: random.choice(ODD_NUMBERS)),
    _replaced(_NUMBER, lambda random: random.choice(ODD_NUMBERS)),
    _replaced(_NUMBER, lambda random: repr(random.uniform(-2, 2) * 10 ** random.randrange(-12, 12))),
    _odd_string,
    _odd_string,
    _replaced(_VALUE, lambda random: "= " + random.choice(ODD_VALUES + ODD_NUMBERS)),
    _replaced(_VALUE, lambda random: '= "' + random.choice(ODD_STRINGS) + '"'),
    _replaced(
        _KEY, lambda random: random.choice(('"*"', "x", "a.b", "value", "kind", "at", "run", '""', "name")) + " ="
    ),
)


def _spoil_xml(random: Random, text: str) -> bytes:
    for _ in range(random.choice((1, 2, 4))):
        text = random.choice(
            (_line, _character, _cut, _odd_string, _odd_string, _replaced(_NUMBER, lambda r: r.choice(ODD_NUMBERS)))
        )(random, text, [text])
    return text.encode("utf-8", "surrogatepass")


# --- tables ---------------------------------------------------------------------------------------


def _cell(random: Random, text: str) -> str:
    lines = text.split("\n")
    k = random.randrange(len(lines))
    cells = lines[k].split(",")
    cells[random.randrange(len(cells))] = random.choice(
        (*ODD_NUMBERS, *ODD_STRINGS, "", "NaN", "-", "#", '"', "1,5", "2024-01-01T00:00:00", "0 days 00:00:01", "TRUE")
    )
    lines[k] = ",".join(cells)
    return "\n".join(lines)


def _column(random: Random, text: str) -> str:
    """One column's cells all odd in the same way."""
    lines = text.split("\n")
    k, odd = random.randrange(lines[0].count(",") + 1), random.choice((*ODD_NUMBERS, "", "NaN", "x", "2024-01-01"))
    for n in range(1, len(lines)):
        cells = lines[n].split(",")
        if k < len(cells):
            cells[k] = odd
            lines[n] = ",".join(cells)
    return "\n".join(lines)


def _names(random: Random, text: str) -> str:
    head, _, rest = text.partition("\n")
    names = head.split(",")
    k, kind = random.randrange(len(names)), random.randrange(4)
    if kind == 0:
        names[k] = random.choice((*ODD_STRINGS, names[0]))
    elif kind == 1:
        del names[k]
    elif kind == 2:
        names.insert(k, random.choice(names))
    else:
        names = names * random.choice((2, 500))
    return ",".join(names) + "\n" + rest


def _separator(random: Random, text: str) -> str:
    return text.replace(",", random.choice((";", "\t", "|", ", ", " ")))


_CSV_MOVES: tuple[Callable[[Random, str], str], ...] = (
    _cell,
    _cell,
    _column,
    _names,
    _separator,
    lambda random, text: _line(random, text, [text]),
    lambda random, text: _character(random, text, []),
    lambda random, text: _cut(random, text, []),
    lambda random, text: text.replace("\n", random.choice(("\r\n", "\r", "\n\n", "\n#\n", "\0\n"))),
)
