"""Hostile files, commands and machines: `python -m tests.hardening.hostile [--lptn PATH] [--piece 1/5] [--match WORD]`.

Each case is a command in a folder of its own with one thing wrong. It must end by itself within a minute with exit
status 0, 1 or 2 and no traceback, and leave nothing outside its folder but in the user's cache and state.
"""

from __future__ import annotations

import argparse
import gzip
import io
import os
import re
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from decimal import Decimal
from functools import partial
from itertools import chain
from pathlib import Path

import numpy as np

from tests.hardening.bad_inputs import desk

_LONGEST = 60.0  # s, of one command
_MEMORY = 6_000_000  # KiB of addresses: a command that wants more takes the machine down, not only itself
Make = bytes | str | Callable[[Path, Path], object]
"""Contents, or what makes a file at a path where none is, from the good one elsewhere."""


@dataclass(frozen=True)
class Case:
    """One command with one thing wrong.

    Args:
        name: what is wrong.
        words: the command behind `lptn`, run by a shell in the folder.
        files: what stands in place of good files, by name.
        before: what the shell does first, such as a `ulimit`.
        around: environment variables.
    """

    name: str
    words: str
    files: Mapping[str, Make] = field(default_factory=dict)
    before: str = ""
    around: Mapping[str, str] = field(default_factory=dict)

    def __str__(self) -> str:
        return f"{self.name}: lptn {self.words}"


# --- good files -----------------------------------------------------------------------------------------------

URDF = """<robot name="arm"><link name="a"/><link name="b"/><joint name="j" type="revolute"><parent link="a"/>
<child link="b"/><limit effort="20" velocity="1" lower="-1" upper="1"/></joint></robot>"""
_SSP = "http://ssp-standard.org/SSP1/SystemStructure"
SSV = f"""<ssv:ParameterSet xmlns:ssv="{_SSP}ParameterValues" version="1.0" name="v"><ssv:Parameters>
<ssv:Parameter name="motor.capacity"><ssv:Real value="300"/></ssv:Parameter></ssv:Parameters></ssv:ParameterSet>"""
HEAD = "time,temperature.motor,torque.motor,temperature.ambient\n"


def ssd(*sources: str) -> str:
    """A system of the FMUs at some addresses, which nothing connects."""
    elements = "".join(f'<ssd:Component name="c{k}" source="{source}"/>' for k, source in enumerate(sources))
    return f"""<ssd:SystemStructureDescription xmlns:ssd="{_SSP}Description" version="1.0" name="s">
<ssd:System name="s"><ssd:Elements>{elements}</ssd:Elements></ssd:System></ssd:SystemStructureDescription>"""


def archive(entries: Mapping[str, bytes | str], path: Path, like: Path | None = None) -> None:
    """A ZIP archive; with `like` that archive with entries changed."""
    kept: dict[str, bytes | str] = {}
    if like is not None:
        with zipfile.ZipFile(like) as old:
            kept = {name: old.read(name) for name in old.namelist()}
    content = io.BytesIO()
    with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as new:
        for name, text in (kept | dict(entries)).items():
            new.writestr(name, text)
    path.write_bytes(content.getvalue())


def good_files(folder: Path, lptn: str) -> None:
    """The good files of every kind that a command reads."""
    own = desk()["study.toml"].decode().replace("[task]", 'catalogue = "motors.csv"\n[task]', 1)
    texts = {"robot.urdf": URDF, "values.ssv": SSV, "system.ssd": ssd("x.fmu"), "motors.csv": "name,mass\nX,1\n"}
    for name, content in (desk() | {name: text.encode() for name, text in (texts | {"own.toml": own}).items()}).items():
        (folder / name).write_bytes(content)
    made = [lptn, "fmu", "model.toml", "-o", "x.fmu", "--fmi", "2"]
    subprocess.run(made, cwd=folder, check=True, capture_output=True)
    fmu = (folder / "x.fmu").read_bytes()
    archive({"SystemStructure.ssd": ssd("resources/x.fmu"), "resources/x.fmu": fmu}, folder / "system.ssp")


# --- any file -------------------------------------------------------------------------------------------------


def _link(target: str) -> Make:
    return lambda path, _: path.symlink_to(target)


def _folder(path: Path, _: Path) -> None:
    path.mkdir()


def _circle(path: Path, _: Path) -> None:
    path.symlink_to("other-link")
    path.with_name("other-link").symlink_to(path.name)


def _pipe(path: Path, _: Path) -> None:
    os.mkfifo(path)


def _holes(path: Path, _: Path) -> None:
    path.touch()
    os.truncate(path, 1 << 40)


_ENTITIES = "".join(f'<!ENTITY {chr(98 + k)} "{f"&{chr(97 + k)};" * 10}">' for k in range(9))
ANY_FILE: dict[str, Make] = {
    "missing": lambda path, _: None,
    "a folder": _folder,
    "a circle of links": _circle,
    "a link to nowhere": _link("nowhere/at/all"),
    "/dev/zero": _link("/dev/zero"),
    "/dev/null": _link("/dev/null"),
    "a pipe without a writer": _pipe,
    "1 TB of holes": _holes,
    "empty": b"",
    "one byte": b"[",
    "zeros": bytes(5000),
    "noise": os.urandom(20_000),
    "no UTF-8": b'[model]\nname = "\xff\xfe"\n',
    "UTF-16": "[model]\nname = 'x'\n".encode("utf-16"),
    "lists in lists": "a = " + "[" * 20_000,
    "XML in XML": "<a>" * 60_000,
    "JSON in JSON": '{"nodes":' * 20_000,
    "60 MB of comment": lambda path, _: path.write_text(f"# {'x' * 97}\n" * 600_000),
    "a line of 20 MB": lambda path, _: path.write_text("x" * 20_000_000),
    "a billion laughs": f'<!DOCTYPE l [<!ENTITY a "ha">{_ENTITIES}]><robot>&j;</robot>',
    "300 MB of zeros, packed": lambda path, _: archive({"modelDescription.xml": bytes(300_000_000)}, path),
    "another kind": lambda path, _: archive({"SystemStructure.ssd": URDF, "modelDescription.xml": SSV}, path),
}
READERS = """
check model.toml log.csv
simulate model.toml log.csv -o out.csv
improve model.toml log.csv -o out.toml
fmu model.toml -o out.fmu --platforms source
add model.toml copper_loss --at motor -o out.toml
report model.toml log.csv -o out.html
check model.toml log.csv | log.csv
fit model.toml other.csv --holdout log.csv | log.csv
cosim x.fmu log.csv --trust | log.csv
plan model.toml task.toml | task.toml
trade study.toml | study.toml
trade own.toml | motors.csv
motor drawing.toml -o out.toml | drawing.toml
monitor model.toml log.csv --calibration kept.json | kept.json
watch model.toml log.csv --replay 0 --state kept.npz | kept.npz
cosim x.fmu log.csv --trust | x.fmu
cosim system.ssd log.csv --trust | x.fmu
cosim system.ssd log.csv --trust | system.ssd
cosim system.ssp log.csv --trust | system.ssp
cosim x.fmu log.csv --trust --parameters values.ssv | values.ssv
new --urdf robot.urdf -o out.toml | robot.urdf
"""
"""Commands, each with the file that is spoilt, the model file by default."""
RESULTS = """
fit model.toml log.csv -o
compare model.toml log.csv --report
plan model.toml task.toml --json
fleet model.toml log.csv other.csv -o
plan model.toml task.toml --emit-c
"""
PATHS = """link/x.csv
model.toml/x.csv
$(printf 'x%.0s' {1..300}).csv
$(printf 'd/%.0s' {1..3000})x.csv
$'\\xff\\xfe.csv'
-
--
''
$'a\\nb.csv'
/
..
'*'
/proc/self/mem
/dev/tty
log.csv+log.csv
+"""


def _any_file() -> Iterator[Case]:
    for line in READERS.strip().splitlines():
        words, _, file = line.partition(" | ")
        file = file or "model.toml"
        yield from (Case(f"{file} is {name}", words, {file: make}) for name, make in ANY_FILE.items())
    for path in PATHS.splitlines():
        for words in ("check model.toml {}", "plan model.toml {}", "new --urdf {}", "cosim {} log.csv"):
            yield Case(f"the path {path}", words.replace("{}", path), {"link": _link("link")})
        yield Case(f"the result {path}", f"simulate model.toml log.csv -o {path}", {"link": _link("link")})
    for path in ("no/out", "log.csv/out", "/proc/1/out", "/dev/full", "/dev/stdout", "%s%n", "\U0001f525"):
        yield from (Case(f"the result {path}", f"{words} '{path}'") for words in RESULTS.strip().splitlines())


# --- one kind of file -----------------------------------------------------------------------------------------


def _changed(file: str, old: str, new: str) -> dict[str, Make]:
    text = desk()[file].decode()
    assert old in text
    return {file: text.replace(old, new, 1)}


def _models() -> Iterator[Case]:
    capacity, name = 'value = 300, unit = "J/K", bounds = [20, 3000]', 'name = "single motor"'
    kinds = {
        f"{value} J/K": _changed("model.toml", capacity, f"value = {value}, bounds = [0, 1e15]")
        for value in ("1e-3", "1e-5", "1e-9", "5e-324", "1e15")
    }
    many = "".join(f"[nodes.n{k}]\ncapacity = 300\n" for k in range(3000))
    many += "".join(f'[[links]]\nbetween = ["n{k}", "motor"]\nresistance = 3\n' for k in range(3000))
    kinds["3,000 nodes"] = _changed("model.toml", "[[links]]", f"{many}[[links]]")
    keys = "".join(f"a.b{k}.c = 1\n" for k in range(33_000))
    kinds["half a megabyte of dotted keys"] = _changed("model.toml", "[model]", f"{keys}[model]")
    node = '[nodes."{0}"]\ncapacity = 3\n[[links]]\nbetween = ["{0}", "motor"]\nresistance = 3\n[[links]]'
    nodes = ("a b", "a'b", "\u00f6", "%s", "/", "..", "ambient", "__init__", "Motor", "$(id)", "<b>", "-o", "0")
    kinds |= {f"a node {text!r}": _changed("model.toml", "[[links]]", node.format(text)) for text in nodes}
    odd = ("", "x" * 255, "a/b", "../../up", "'", '\\"', "\U0001f525" * 70, "\\u0000", "a\\nb", "*/ #error", "%s")
    kinds |= {f"the name {text[:8]!r}": _changed("model.toml", name, f'name = "{text}"') for text in odd}
    for kind, files in kinds.items():
        for words in ("compare model.toml log.csv", "simulate model.toml log.csv -o out.csv",
                      "fmu model.toml -o y.fmu && {lptn} cosim y.fmu log.csv",
                      "plan model.toml task.toml --emit-c c"):  # fmt: skip
            yield Case(kind, words, files)


_ENTITY = '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
_DIRECTORY: dict[str, tuple[int, bytes]] = {
    "files that are encrypted": (8, b"\1"),
    "a method that is none": (10, b"\x63"),
    "sums that lie": (16, b"abcd"),
    "sizes that lie": (24, b"\x0a\0\0\0"),
    "files that overlap": (42, bytes(4)),
}
"""Bytes of each file's entry in the directory of an archive, and what stands in their place."""


def _fmus() -> Iterator[tuple[str, Make]]:
    def with_xml(old: str, new: str, path: Path, good: Path) -> None:
        with zipfile.ZipFile(good) as fmu:
            xml = fmu.read("modelDescription.xml").decode()
        archive({"modelDescription.xml": xml.replace(old, new, 1)}, path, like=good)

    def dimension(size: int, path: Path, _: Path) -> None:
        xml = f"""<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t">
<CoSimulation modelIdentifier="m"/><ModelVariables><Float64 name="v" valueReference="1" causality="input" start="0">
<Dimension start="{size}"/></Float64></ModelVariables><ModelStructure/></fmiModelDescription>"""
        archive({"modelDescription.xml": xml}, path)

    def holding(entries: Mapping[str, bytes | str], path: Path, good: Path) -> None:
        archive(entries, path, like=good)

    for size in (20_000_000, 10**12, -3):
        yield f"a dimension of {size}", partial(dimension, size)
    scalar = '<ScalarVariable name="a{0}" valueReference="{1}" causality="output"><Real/></ScalarVariable>'
    scalars = "".join(scalar.format(k, k + 10_000) for k in range(300_000))
    end = "</ModelVariables>"
    yield "300,000 variables", partial(with_xml, end, scalars + end)
    yield "a description of 200 MB", partial(with_xml, end, f"<!--{'x' * 200_000_000}-->{end}")
    yield "a model of 300 MB", partial(holding, {"resources/model.toml": "# x\n" * 75_000_000})
    yield "a model of noise", partial(holding, {"resources/model.toml": os.urandom(999)})
    yield "a library of noise", partial(holding, {"binaries/linux64/single_motor.so": os.urandom(99)})
    yield "20,000 files", partial(holding, {f"resources/{k}": b"" for k in range(20_000)})
    for name in ("../out", "/tmp/out-of-it", "a/../../../out", "a\\..\\out", "x" * 300, "a/" * 3000 + "b"):
        yield f"a file {name[:12]!r} inside", partial(holding, {name: b"x"})


def _described() -> Iterator[tuple[str, Make]]:
    def matched(old: str, new: str, path: Path, good: Path) -> None:
        with zipfile.ZipFile(good) as fmu:
            xml = fmu.read("modelDescription.xml").decode()
        archive({"modelDescription.xml": re.sub(old, new, xml)}, path, like=good)

    def directory(at: int, value: bytes, path: Path, good: Path) -> None:
        content = bytearray(good.read_bytes())
        for entry in re.finditer(b"PK\1\2", bytes(content)):
            content[entry.start() + at : entry.start() + at + len(value)] = value
        path.write_bytes(content)

    for old, new in {
        'modelIdentifier="[^"]*': 'modelIdentifier="../../out',
        'valueReference="[^"]*': 'valueReference="4294967296',
        'start="[^"]*': 'start="NaN',
        'stepSize="[^"]*': 'stepSize="1e-300',
        'stopTime="[^"]*': 'stopTime="1e300',
        'Variable name="[^"]*': 'Variable name="a',
        'index="[^"]*': 'index="99999999',
        "<fmiModelDescription": f'{_ENTITY}<fmiModelDescription x="&x;"',
    }.items():
        yield f"a description with {new[:30]}", partial(matched, old, new)
    for name, change in _DIRECTORY.items():
        yield f"an archive of {name}", partial(directory, *change)


def _connected(*ends: str, times: int = 1) -> str:
    """Two FMUs, connected from one connector to another, each `component.variable`."""
    pairs = [(*start.split(".", 1), *end.split(".", 1)) for start, end in zip(ends[::2], ends[1::2], strict=True)]
    line = '<ssd:Connection startElement="{}" startConnector="{}" endElement="{}" endConnector="{}"/>'
    lines = "".join(line.format(*pair) for pair in pairs) * times
    connections = f"<ssd:Connections>{lines}</ssd:Connections></ssd:System>"
    return ssd("x.fmu", "x.fmu").replace("</ssd:System>", connections)


def _systems() -> Iterator[Case]:
    warm, load = "temperature.motor", "torque.motor"
    for name, text in {
        "connected to itself": _connected(f"c0.{warm}", f"c0.{load}"),
        "connected in a circle": _connected(f"c0.{warm}", f"c1.{load}", f"c1.{warm}", f"c0.{load}"),
        "connected to nobody": _connected(f"c0.{warm}", f"x.{load}"),
        "connected to an output": _connected(f"c0.{warm}", f"c1.{warm}"),
        "connected 100,000 times": _connected(f"c0.{warm}", f"c1.{load}", times=100_000),
        "a system within itself": ssd("system.ssd"),
        "systems within systems": ssd("x.fmu").replace("<ssd:Elements>", '<ssd:Elements><ssd:System name="t">' * 400),
        "an entity of a file": _ENTITY + ssd("x.fmu").replace('name="s"', 'name="&x;"'),
    }.items():
        yield Case(name, "cosim system.ssd log.csv --trust", {"system.ssd": text})

    def packed(text: str, path: Path, good: Path) -> None:
        archive({"SystemStructure.ssd": text}, path, like=good)

    sources = ["", "..", "resources/", "../../out.fmu", "%2e%2e/%2e%2e/out.fmu", "..%2fout.fmu", "x.fmu%00", "x" * 5000]
    sources += ["resources/../../out.fmu", "/etc/passwd", "file:///etc/passwd", "http://127.0.0.1:9/x.fmu"]
    for file, own in (("system.ssd", "x.fmu"), ("system.ssp", "resources/x.fmu")):
        texts = {f"a source {source[:20]!r}": ssd(source) for source in sources}
        texts |= {f"{count} FMUs": ssd(*[own] * count) for count in (0, 300, 5000)}
        texts |= {"no system": ssd(own).replace("ssd:System>", "ssd:S>").replace("<ssd:System ", "<ssd:S ")}
        texts |= {"a name twice": ssd(own, own).replace('"c1"', '"c0"')}
        for name, text in texts.items():
            make: Make = text if file == "system.ssd" else partial(packed, text)
            yield Case(name, f"cosim {file} log.csv --trust", {file: make})


def _robots() -> Iterator[tuple[str, str]]:
    for effort in ("1e300", "1e9", "1e-300", "inf", "nan", "-5", "much", ""):
        yield f"effort {effort}", URDF.replace('"20"', f'"{effort}"')
    joint = (
        '<link name="l{1}"/><joint name="j{1}" type="revolute"><parent link="l{0}"/><child link="l{1}"/>'
        '<limit effort="{2}"/></joint>'
    )
    for name, sizes in (("3,000 joints", 1), ("3,000 joints of many sizes", 3000)):
        yield name, "<robot>" + "".join(joint.format(k, k + 1, k % sizes + 1) for k in range(3000)) + "</robot>"
    for name in ("x" * 300, "\U0001f525", "../../up", "&quot;'", "&#10;", ""):
        yield f"a joint {name[:8]!r}", URDF.replace('name="j"', f'name="{name}"')
        yield f"a robot {name[:8]!r}", URDF.replace('name="arm"', f'name="{name}"')
    for file in ("../../../../etc/passwd", "file:///dev/zero", "http://127.0.0.1:9/x.stl", "package://..", "x" * 5000):
        mesh = f'<link name="b"><collision><geometry><mesh filename="{file}"/></geometry></collision></link>'
        yield f"a mesh {file[:20]!r}", URDF.replace('<link name="b"/>', mesh)
    for name, head in {
        "a file": 'SYSTEM "file:///etc/passwd"',
        "zeros": 'SYSTEM "/dev/zero"',
        "100 kB": f'"{"x" * 100_000}"',
    }.items():
        yield (
            f"an entity of {name}",
            f"<!DOCTYPE r [<!ENTITY x {head}>]>{URDF.replace('<link', '&x;' * 5000 + '<link', 1)}",
        )
    for mass in ("nan", "-5", "1e300"):
        inertia = f'<link name="b"><inertial><mass value="{mass}"/></inertial></link>'
        yield f"a mass of {mass}", URDF.replace('<link name="b"/>', inertia)
    yield "a joint that mimics itself", URDF.replace("<limit", '<mimic joint="j"/><limit')
    yield "two roots", URDF * 2
    yield (
        "100,000 attributes",
        URDF.replace('name="a"/>', 'name="a" ' + " ".join(f'a{k}="1"' for k in range(100_000)) + "/>"),
    )
    yield "a far origin", URDF.replace("<limit", '<origin xyz="1e200 1e200 1e300"/><limit')
    yield "a chain in a circle", URDF.replace('parent link="a"', 'parent link="b"')


MODELS = r"""
300, unit | nan, unit
300, unit | 2026-01-01, unit
300, unit | [1, [2, [3]]], unit
[20, 3000] | [3000, 20]
[20, 3000] | [nan, nan]
unit = "J/K" | unit = "J^999999999/K^1e9"
unit = "J/K" | unit = "((((((((((((((((((((J))))))))))))))))))))"
[[links]] | [nodes."*a*a*a*a*a*a*a*a*a*a*a*a*a*a*a*a*b"]\ncapacity = 3\n[[links]]
[[links]] | [[links]]\nbetween = ["{a}{b}{c}{d}{e}", "{e}{d}{c}{b}{a}"]\nresistance = 1\n[[links]]
[[links]] | [nodes."[[[[!"]\ncapacity = 3\n[[links]]
[nodes.motor] | [nodes."mo\\u0000tor"]
name = "single motor" | name = "\\u001b[2J\\u202e"
[nodes.motor] | step = 1e-12\n[nodes.motor]
[nodes.motor] | step = 1e12\n[nodes.motor]
["motor", "ambient"] | ["motor", "motor"]
resistance = 0.15 | resistance = 1e300
torque_constant = 0.84 | torque_constant = 1e-300
[[links]] | x = {a = 1, a = 2}\n[[links]]
[nodes.motor] | [nodes.motor]\n[nodes.motor]
[[links]] | [nodes.a]\ncapacity = 3\n[nodes.b]\ncapacity = 3\n[[links]]\nbetween = ["a", "b"]\n[[links]]
resistance = 0.15 | resistance = -0.15
unit = "J/K" | unit = "m/s"
[nodes.motor] | links = 5\n[nodes.motor]
[nodes.motor] | effects = [[]]\n[nodes.motor]
[nodes.motor] | [columns]\ntime = "temperature.motor"\n[nodes.motor]
[nodes.motor] | [columns]\n"temperature.motor" = { column = ["a", "b"] }\n[nodes.motor]
[nodes.motor] | [fit.parameters]\n"capacity.motor" = { value = 300, standard_error = inf }\n[nodes.motor]
"""
MAPS = """
temperature.motor=temperature.motor[;;;]
time=time[wrap=1e-300]
time=[rate=1e300]
temperature.motor=temperature.motor[scale=nan]
temperature.motor=temperature.motor[offset=1e308; scale=1e308]
temperature.motor=temperature.motor[valid=[5]]
a=b=c=d
*=*
temperature.motor=\x1b[2J
torque.motor=torque.motor[J^99999999]
torque.motor=[[]]
time=time[rows=never]
"""
TASKS = r"""
mission.toml | distance = 50 | distance = 1e9
mission.toml | distance = 50 | distance = 1e15
mission.toml | distance = 50 | distance = 1e-9
mission.toml | deadline = 600 | deadline = 1e15
mission.toml | deadline = 600 | deadline = 1e-300
mission.toml | speeds = [0.2, 0.6] | speeds = [1e-9, 0.6]
mission.toml | speeds = [0.2, 0.6] | speeds = [0.2, 1e9]
track.toml | duration = 100 | duration = 1e9
track.toml | duration = 100 | duration = 1e-300
track.toml | { "*" = 4 } | { "*" = 1e12 }
task.toml | [10, 60] | [1e15]
task.toml | [10, 60] | [1e-300]
task.toml | [10, 60] | [nan]
task.toml | [10, 60] | []
task.toml | "*" = 60 | "*" = 10
task.toml | "*" = 60 | "../x" = 60
task.toml | kind = "limit" | kind = "../x"
track.toml | { "*" = 4 } | {}
mission.toml | speeds = [0.2, 0.6] | speeds = [0.6, 0.2]
mission.toml | [2, 3] | [nan, 3]
mission.toml | motor = 60 | motor = 20
study.toml | duration = 120 | duration = 1e15
study.toml | torque = 1.68 | torque = 1e12
study.toml | torque = 1.68 | torque = nan
study.toml | name = "U8" | name = "../../etc/passwd"
study.toml | [20, 1500] | [1500, 20]
study.toml | [20, 1500] | [1e-300, 1e300]
study.toml | [task] | catalogue = "/dev/zero"\n[task]
drawing.toml | slots = 12 | slots = 1000000000
drawing.toml | slots = 12 | slots = -12
kept.json | [0.1] | [NaN]
kept.json | "inputs": {} | "inputs": {"torque.motor": 1e300}
kept.json | "heat_time": 600.0 | "heat_time": 0
kept.json | 1.5 | 1e999
"""
WORDS = """
forecast model.toml log.csv --limit {}
fmu model.toml -o out.fmu --limit {}
fit model.toml log.csv --map {}
fit model.toml log.csv --rate {}
fit model.toml log.csv --holdout-after {}
fmu model.toml -o out.fmu --step {}
add model.toml {} --at motor
watch model.toml udp://[{} --limit 60
watch model.toml log.csv --replay 0 --to prometheus://[{}
watch model.toml log.csv --replay 0 --to page://[{}
watch model.toml {}.mcap
add model.toml constant_heat --at {}
monitor model.toml log.csv --threshold {}
open model.toml log.csv --no-browser --port {}x
"""


def _bomb(path: Path, _: Path) -> None:
    with gzip.open(path, "wb", compresslevel=1) as stream:
        stream.write(HEAD.encode())
        for _number in range(2000):
            stream.write(b"0" * 1_000_000)


def _parquet(kind: str, path: Path, _: Path) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    count = range(200)
    time, torque = pa.array(map(float, count)), pa.array([1.0] * 200)
    torques = {
        "dictionary": lambda: pa.array(["1.5", "word"] * 100).dictionary_encode(),
        "nested": lambda: pa.array([{"a": [1.0]}] * 200),
        "decimal": lambda: pa.array([Decimal(10) ** 60] * 200, pa.decimal256(76, 0)),
    }
    times = {
        "duration": lambda: pa.array(count, pa.duration("s")),
        "uint64": lambda: pa.array([2**63 + k for k in count], pa.uint64()),
        "date": lambda: pa.array(count, pa.date32()),
    }
    time, torque = times.get(kind, lambda: time)(), torques.get(kind, lambda: torque)()
    warm, air = pa.array([25.0] * 200), pa.array([22.0] * 200)
    pq.write_table(pa.table([time, warm, torque, air], names=HEAD.strip().split(",")), path)
    if kind == "cut":
        os.truncate(path, path.stat().st_size - 300)


def _hdf5(kind: str, path: Path, _: Path) -> None:
    import h5py

    time = np.arange(300.0)
    with h5py.File(path, "w") as file:
        file["time"], file["temperature.motor"], file["temperature.ambient"] = time, 25 + 0 * time, 22 + 0 * time
        if kind == "another file's bytes":
            file.create_dataset("torque.motor", time.shape, "u1", external=[("/etc/passwd", 0, time.size)])
            return
        file["torque.motor"], group = 1 + 0 * time, file
        if kind == "3,000 groups deep":
            for _number in range(3000):
                group = group.create_group("g")
        elif kind == "a group in itself":
            file["g"] = file["/"]
        elif kind == "links in a circle":
            file["a"], file["b"] = h5py.SoftLink("/b"), h5py.SoftLink("/a")
        else:
            file.create_dataset("pictures", (10**9, 900), "f8", chunks=(1000, 900))


def _text_logs() -> Iterator[tuple[str, bytes]]:
    head, rows = HEAD.encode(), b"".join(b"%d,25,1,22\n" % k for k in range(200))
    yield "names alone", head
    yield "one row", head + b"0,25,1,22\n"
    yield "rows of two times in turn", head + b"".join(b"%d,25,1,22\n" % (k if k % 2 else 999 - k) for k in range(200))
    yield "a million short lines", head + b"1\n" * 1_000_000
    yield "a million empty lines", head + b"\n" * 1_000_000 + rows
    yield "commas alone", head + b",,,\n" * 1000
    yield "UTF-32", (head + rows).decode().encode("utf-32")
    yield "markup in a name", head.replace(b"\n", b",<script>alert(1)</script>\n") + rows.replace(b"\n", b",1\n")
    yield "a quote without an end", head + rows + b'"' + rows * 500
    yield "a quote in the names", head.replace(b"torque", b'"torque') + rows
    yield "NUL within", (head + rows).replace(b"100,25", b"100,2\x005")
    yield "UTF-16 without a mark", (head + rows).decode().encode("utf-16-le")
    yield "escapes in a name", head.replace(b"\n", b",\x1b[2J\x1b]0;x\x07\n") + rows.replace(b"\n", b",1\n")
    yield "a name of 1 MB", head.replace(b"\n", b"," + b"x" * 1_000_000 + b"\n") + rows.replace(b"\n", b",1\n")
    yield "a number of 1 MB", head + rows + b"200," + b"1" * 1_000_000 + b",1,22\n"
    yield "semicolons and commas", head.replace(b",", b";") + rows
    yield "a gap of 1e9 s", head + rows + b"".join(b"%d,25,1,22\n" % (10**9 + k) for k in range(300))
    for name, row in {
        "a time that stands": "5,25,1,22",
        "steps of 1e-12 s": "{0}e-12,25,1,22",
        "steps of 1e12 s": "{0}e12,25,1,22",
        "time to 1e308": "{0}e306,25,1,22",
        "no times": "nan,25,1,22",
        "infinite readings": "{0},inf,-inf,inf",
        "torques of 1e300": "{0},25,1e300,22",
        "the least of numbers": "{0},25,5e-324,22",
        "a leap second": "2016-12-31T23:59:60Z,25,1,22",
        "a zone of 99 h": "2016-12-31T23:00:{0:02}+99:99,25,1,22",
    }.items():
        yield name, head + "".join(f"{row.format(k)}\n" for k in range(60)).encode()


def _logs() -> Iterator[tuple[str, str, Make]]:
    yield from ((name, "log.csv", content) for name, content in _text_logs())
    for kind in ("dictionary", "nested", "decimal", "duration", "uint64", "date", "cut"):
        yield f"a Parquet file, {kind}", "log.parquet", partial(_parquet, kind)
    for kind in ("another file's bytes", "3,000 groups deep", "a group in itself", "links in a circle", "7 TB beside"):
        yield f"an HDF5 file, {kind}", "log.h5", partial(_hdf5, kind)
    wide = ",".join(f"c{k}" for k in range(300_000))
    yield "300,000 columns", "log.csv", f"time,{wide}\n" + ",".join(["0"] * 300_001) + "\n"
    yield "2 GB of zeros in a .gz", "log.csv.gz", _bomb
    yield "a .gz of a .gz", "log.csv.gz", gzip.compress(gzip.compress(b"time,x\n1,2\n"))
    for year in ("9999-12-31T23:59:59Z", "1500-01-01T00:00:00Z", "0000-00-00"):
        yield f"the year {year[:4]}", "log.csv", HEAD + f"{year},25,1,22\n" * 20
    for number in ("1e308", "1e400", "0x10", "\u0663"):
        yield f"the number {number}", "log.csv", HEAD + "".join(f"{k},25,{number},22\n" for k in range(20))
    for ending in ("parquet", "xlsx", "mcap", "db3", "ulg", "tsv", "json", "bag"):
        kinds: dict[str, Make] = {"noise": os.urandom(3000), "empty": b"", "zeros": bytes(3000), "a folder": _folder}
        yield from ((f"a .{ending} that is {name}", f"log.{ending}", make) for name, make in kinds.items())


def _texts() -> Iterator[Case]:
    for line in MODELS.strip().splitlines():
        old, new = line.encode().decode("unicode_escape").split(" | ")
        for words in ("check model.toml log.csv", "compare model.toml log.csv"):
            yield Case(repr(new)[:40], words, _changed("model.toml", old, new))
    for text in MAPS.strip().splitlines():
        yield Case("a mapping", f"check model.toml log.csv --map {shlex.quote(text)}")


def _one_kind() -> Iterator[Case]:
    yield from chain(_models(), _systems(), _texts())
    for name, make in (*_fmus(), *_described()):
        for words in ("cosim x.fmu log.csv --trust", "cosim system.ssd log.csv --trust", "fmu x.fmu -o out.ssp"):
            yield Case(name, words, {"x.fmu": make})
    for name, text in _robots():
        yield Case(name, "new --urdf robot.urdf -o out.toml", {"robot.urdf": text})
    commands = {"study.toml": "trade", "drawing.toml": "motor", "kept.json": "monitor model.toml log.csv --calibration"}
    for line in TASKS.strip().splitlines():
        file, old, new = line.replace("\\n", "\n").split(" | ")
        yield Case(new, f"{commands.get(file, 'plan model.toml')} {file}", _changed(file, old, new))
    for name, file, make in _logs():
        yield from (Case(name, f"{words} model.toml {file}", {file: make}) for words in ("check", "fit"))
    for words in WORDS.strip().splitlines():
        for text in ("", "nan", "inf", "1e308", "-1", "9" * 400, "x=1", "*=", "\U0001f525"):
            yield Case(f"the word {text[:9]!r}", words.replace("{}", f"'{text}'"))


# --- the machine ----------------------------------------------------------------------------------------------

ALL = """
check model.toml log.csv
compare model.toml log.csv --plot out.png --report out.html
improve model.toml log.csv -o out.toml --report out.html
simulate model.toml log.csv -o out.parquet
forecast model.toml log.csv --limit 60 --plot out.svg
fmu model.toml -o out.fmu
cosim x.fmu log.csv --trust -o out.csv
plan model.toml task.toml -o out.csv
motor drawing.toml -o out.toml
effects
"""
MACHINES: dict[str, tuple[str, Mapping[str, str]]] = {
    "700 MB of memory": ("ulimit -v 700000;", {}),
    "350 MB of memory": ("ulimit -v 350000;", {}),
    "a terminal of ASCII": ("", {"PYTHONIOENCODING": "ascii", "LC_ALL": "C"}),
    "LANG=C": ("", {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}),
    "a cache that is a file": ('rm -rf "$XDG_CACHE_HOME"; touch "$XDG_CACHE_HOME";', {}),
    "a cache on a full disk": ("", {"XDG_CACHE_HOME": "/dev/full/x"}),
    "a cache for reading alone": ("", {"XDG_CACHE_HOME": "/proc/cache", "XDG_STATE_HOME": "/proc/state"}),
    "no home": ("unset HOME XDG_CACHE_HOME XDG_STATE_HOME;", {}),
    "files of 1 KB at most": ("ulimit -f 1;", {}),
    "16 open files": ("ulimit -n 16;", {}),
    "no place for temporary files": ("", {"TMPDIR": "/nowhere"}),
    "a folder that is gone": ("mkdir gone; cd gone; rmdir ../gone;", {}),
    "one column": ("", {"COLUMNS": "1", "LINES": "1"}),
    "output to a full disk": ("exec >/dev/full;", {}),
    "no output": ("exec >&-;", {}),
    "no error stream": ("exec 2>&-;", {}),
    "no streams": ("exec <&- >&- 2>&-;", {}),
    "a cache that is a circle": ('rm -rf "$XDG_CACHE_HOME"; ln -s cache "$XDG_CACHE_HOME";', {}),
    "a home that is no folder": ("unset XDG_CACHE_HOME XDG_STATE_HOME;", {"HOME": "/dev/null"}),
    "a time zone of a file": ("", {"TZ": ":/etc/passwd"}),
    "a locale that is not there": ("", {"LC_ALL": "xx_YY.KOI8"}),
    "pictures by nobody": ("", {"MPLBACKEND": "nonsense", "MPLCONFIGDIR": "/dev/null/x"}),
    "a stack of 256 kB": ("ulimit -s 256;", {}),
    "threads and columns of words": ("", {"OMP_NUM_THREADS": "many", "COLUMNS": "wide", "LINES": "-1"}),
    "a compiler that fails": ("", {"CC": "/bin/false"}),
    "no program": ("PATH=/nowhere;", {}),
    "no C compiler": ("", {"CC": "/nowhere/cc"}),
}


def cases() -> list[Case]:
    """All cases, in an order that stays."""
    machines = MACHINES.items()
    of_machines = (
        Case(name, words, before=before, around=around)
        for name, (before, around) in machines
        for words in ALL.strip().splitlines()
    )
    return [*_any_file(), *_one_kind(), *of_machines]


# --- a case is tried ------------------------------------------------------------------------------------------


_FOLDERS = ("a", "a/b", "a/b/desk", "home", "tmp")


def wrong(case: Case, good: Path, scratch: Path, lptn: str, longest: float = _LONGEST) -> str:
    """What is wrong with how a command ends; nothing for a good end.

    Args:
        case: the command.
        good: the folder of good files.
        scratch: a folder to work in.
        lptn: the program.
        longest: how long it may take [s].
    """
    with tempfile.TemporaryDirectory(dir=scratch, ignore_cleanup_errors=True) as name:
        outside = Path(name)
        folder, home, temporary = outside / "a" / "b" / "desk", outside / "home", outside / "tmp"
        shutil.copytree(good, folder)
        for own in (home / "cache", home / "state", temporary):
            own.mkdir(parents=True)
        for file, make in case.files.items():
            (folder / file).unlink(missing_ok=True)
            if callable(make):
                make(folder / file, good / file)
            else:
                (folder / file).write_bytes(make.encode("utf-8", "surrogatepass") if isinstance(make, str) else make)
        folders = {
            "HOME": home,
            "XDG_CACHE_HOME": home / "cache",
            "XDG_STATE_HOME": home / "state",
            "TMPDIR": temporary,
        }
        around = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1", "PATH": os.environ["PATH"], "LC_ALL": "C.UTF-8"}
        around |= {key: str(path) for key, path in folders.items()} | dict(case.around)
        line = f"ulimit -v {_MEMORY}; {case.before} {lptn} {case.words.replace('{lptn}', lptn)}"
        status, said = _run(line, folder, around, longest)
        left = [str(path.relative_to(outside)) for path in outside.rglob("*")]
        left = [path for path in left if not path.startswith(("home/", "a/b/desk/")) and path not in _FOLDERS]
    if status is None:
        return f"no end within {longest:g} s"
    if "Traceback" in said or "Exception ignored" in said:
        return f"a traceback: {said.strip().splitlines()[-1][:150]}"
    if status not in (0, 1, 2):
        return f"exit status {status}: {said.strip()[-150:]}"
    return f"files outside: {', '.join(left[:3])}" if left else ""


def _run(line: str, folder: Path, around: Mapping[str, str], longest: float) -> tuple[int | None, str]:
    """Exit status, `None` where there was no end, and all that was said."""
    process = subprocess.Popen(
        ["bash", "-c", line],
        cwd=folder,
        env=around,
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        start_new_session=True,
    )
    try:
        said, _ = process.communicate(timeout=longest)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
        return None, ""
    return process.returncode, said.decode("utf-8", "replace")


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lptn", default=shutil.which("lptn") or "lptn", help="the program that is tried")
    parser.add_argument("--piece", default="1/1", help="such as 2/5: the second of five pieces, of some minutes each")
    parser.add_argument("--match", default="", help="only cases whose line holds this")
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    number, count = map(int, asked.piece.split("/"))
    chosen = [case for case in cases() if asked.match in str(case)][number - 1 :: count]
    kinds: Counter[str] = Counter()
    with tempfile.TemporaryDirectory(prefix="lptn-hostile-") as name, ThreadPoolExecutor(asked.jobs) as pool:
        good = Path(name) / "good"
        good.mkdir()
        good_files(good, asked.lptn)
        begun = time.perf_counter()
        tried = pool.map(lambda case: wrong(case, good, Path(name), asked.lptn), chosen)
        for case, what in zip(chosen, tried, strict=True):
            if what:
                kinds[what.partition(":")[0]] += 1
                print(f"{str(case)[:160]}: {what}", flush=True)
    found = ", ".join(f"{times} {kind}" for kind, times in kinds.most_common()) or "none"
    print(f"{len(chosen)} commands in {time.perf_counter() - begun:.0f} s, of which fail: {kinds.total()} ({found})")
    sys.exit(1 if kinds else 0)


if __name__ == "__main__":
    main()
