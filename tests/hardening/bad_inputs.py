"""Bad inputs of every kind, by command: what is wrong with the good files of `desk`, and what must be said of it.

`python -m tests.hardening.bad_inputs` prints how many there are of each kind.
"""

from __future__ import annotations

import gzip
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from lptn.robots.motor_drawing import sample
from lptn.robots.presets import presets
from tests.hardening.mutations import zipped

Content = bytes | str | Callable[[bytes], bytes | str] | tuple[str, str] | None


@dataclass(frozen=True)
class Bad:
    """One bad input.

    Args:
        kind: what is bad: a kind of file, or the command line.
        words: the command; `{model}` and the like stand for the good files.
        said: what the line must say.
        spoil: for files by name a new content, a change of the good one (a pair of old and new text, or a
            function), or `None` for no such file.
    """

    kind: str
    words: str
    said: tuple[str, ...]
    spoil: Mapping[str, Content]

    @property
    def name(self) -> str:
        """What the test is called."""
        return f"{self.kind}: {self.words.split()[0] if self.words else 'lptn'}: {' '.join(self.said)}"[:90]


TASK = """\
[task]
kind = "limit"
horizons = [10, 60]
[limits]
"*" = 60
[start]
"*" = 50
[load]
"*" = 1
[conditions]
"temperature.ambient" = 25
"""
TRACK = """\
[task]
kind = "track"
[limits]
"*" = 60
[start]
"*" = 50
[conditions]
"temperature.ambient" = 25
[[phases]]
duration = 100
torque = { "*" = 4 }
"""
MISSION = """\
[task]
kind = "mission"
deadline = 600
[limits]
motor = 60
[[activities]]
do = "walk"
distance = 50
[gaits.walk]
speeds = [0.2, 0.6]
torque = { motor = [2, 3] }
[gaits.rest]
"""
STUDY = """\
[study]
goal = "mass"
cooling = ["none", "passive"]
[task]
torque = 1.68
duration = 120
[limits]
winding = 105
[[motors]]
name = "U8"
[sink]
capacity = [20, 1500]
"""
CALIBRATION = """\
{"nodes": ["motor"], "healthy_hours": 1.5, "limits": {"offset": 9.0, "drift": 9.0, "lag": 9.0},
"noise": [0.1], "model_error": {"heat": 0.1, "heat_time": 600.0, "change": 0.01, "bias": 0.2,
"air": 0.1, "inputs": {}}}
"""


def table(seed: int = 0) -> pd.DataFrame:
    """Two minutes of a motor that warms up."""
    time = np.arange(0.0, 120.0)
    noise = np.random.default_rng(seed).normal(0, 0.05, time.size)
    return pd.DataFrame(
        {"time": time, "temperature.motor": (25 + 0.05 * time + noise).round(3), "torque.motor": 5.0,
         "temperature.ambient": 22.0}
    )  # fmt: skip


def desk() -> dict[str, bytes]:
    """Good files by name."""
    return {
        "model.toml": presets()["single-motor"].encode(),
        "log.csv": table().to_csv(index=False).encode(),
        "other.csv": table(1).to_csv(index=False).encode(),
        "task.toml": TASK.encode(),
        "track.toml": TRACK.encode(),
        "mission.toml": MISSION.encode(),
        "study.toml": STUDY.encode(),
        "drawing.toml": sample("inrunner").encode(),
        "kept.json": CALIBRATION.encode(),
    }


def _bad(kind: str, words: str, *said: str, **spoil: Content) -> Bad:
    """File names are given with `_` for their dot."""
    return Bad(kind, words, said, {name.replace("_", ".", 1): content for name, content in spoil.items()})


def _column(name: str, value: object, rows: slice = slice(None)) -> Callable[[bytes], str]:
    """The log with a column's rows changed."""

    def change(_: bytes) -> str:
        frame: Any = table().astype(object)
        frame.loc[frame.index[rows], name] = value
        return str(frame.to_csv(index=False))

    return change


def _cut(content: bytes) -> bytes:
    return content[: len(content) // 2]


def _model(*said: str, old: str, new: str, words: str = "check {model}") -> Bad:
    return _bad("model file", words, *said, model_toml=(old, new))


NODE = "capacity = { value = 300"
ZIPPED = "fit {model} {log_csv_gz} -o {out}.toml --json {out}.json"
END = "torque_constant = 0.84 "
FIT = "fit {model} {log} -o {out}.toml --json {out}.json"

MODELS = [
    _model("line 8, nodes", "neither capacity nor temperature", old=NODE, new="# capacity = { value = 300"),
    _model("line 11, links[0].between", "no such key", 'a key "between"', old="between =", new="# between ="),
    _model("line 16, effects[0].at", "no such key", old='at = "motor"', new='# at = "motor"'),
    _model("links[0].betwen", 'no key "betwen" here', old="between =", new='between = ["motor", "ambient"]\nbetwen ='),
    _model("nodes.motor.capacity.valeu", "no key", old="{ value = 300", new="{ valeu = 300"),
    _model("nodes.motor.capacity", "a number", old="{ value = 300, unit", new='"300" # { value = 300, unit'),
    _model("capacity.value", "finite", old="value = 300", new="value = nan"),
    _model("capacity.value", "1000000000000000", old="value = 300", new="value = 1e300"),
    _model("whole number of", "18 digits", old="value = 300", new="value = 0x" + "f" * 300),
    _model("TOML", old="value = 300", new="value = " + "3" * 5000),
    _model("capacity.unit", '"K/W"', "J/K", old='unit = "J/K"', new='unit = "K/W"'),
    _model("capacity.unit", "9**9", "J/K", old='unit = "J/K"', new='unit = "9**9**9**9"'),
    _model("capacity.bounds", "3000", old="[20, 3000]", new="[3000, 20]"),
    _model("capacity.value", "300 J/K", "a value from 20 to 100", old="[20, 3000]", new="[20, 100]"),
    _model("effects[0].kind", "copper_los", "copper_loss", old='"copper_loss"', new='"copper_los"'),
    _model("effects[0].torqe_constant", "torque_constant", old=END, new="torqe_constant = 0.84 "),
    _model("effects[0].input", '"torque" or "current"', old='input = "torque"', new='input = "voltage"'),
    _model("effects[0].at", "rotor", old='at = "motor"', new='at = "rotor"'),
    _model("effects[0].share", "everybody", old=END, new='share = "everybody"\n' + END),
    _model("effects[0].run", old=END, new='run = ""\n' + END),
    _model("links[0].between", "stator", old='["motor", "ambient"]', new='["stator", "ambient"]'),
    _model("links[0].between", "at most 4", old='"motor", "ambient"]', new='"{a}{b}{c}{d}{e}", "ambient"]'),
    _model("links[0].between", "list", old='["motor", "ambient"]', new='"motor"'),
    _model("links[1].between", "a second link", old="[[effects]]",
           new='[[links]]\nbetween = ["ambient", "motor"]\n[[effects]]'),
    _model("gearbox", "isolated", old="[[links]]", new="[nodes.gearbox]\ncapacity = 3\n[[links]]"),
    _model("the name", old="[nodes.motor]", new='[nodes."mo tor"]'),
    _model("declare", "twice", old="[nodes.motor]", new="[nodes.motor]\ncapacity = 3\n[nodes.motor]"),
    _model("line 9", "TOML", old=NODE, new="capacity = { value = = 300"),
    _model("without end", "TOML", old="[nodes.motor]", new="x = " + "[" * 4000 + "]" * 4000 + "\n[nodes.motor]"),
    _model("model.step", "greater than 0", old="[nodes.motor]", new="step = 0\n[nodes.motor]"),
    _model("model.ambient", "temperature.", old='"temperature.ambient"', new='"room"'),
    _model("fit.parameters", "no part of the model", old=END, new=END + '\n[fit.parameters]\n"x.y" = { value = 1 } #'),
    _model("fit.parameters", "a value from", old=END,
           new=END + '\n[fit.parameters]\n"capacity.motor" = { value = 1 } #'),
    _model("perfect and resistance", old="[[effects]]",
           new='[[links]]\nbetween = ["motor", "ambient"]\nperfect = true\nresistance = 1\n[[effects]]'),
    _model("element", old=NODE, new='element = { kind = "sphere" }\n# capacity = { value = 300'),
    _model("columns", old="[nodes.motor]", new='[columns]\nspeed = "v"\n[nodes.motor]'),
    _bad("model file", "check {model}", "UTF-8", model_toml=b"\xff\xfe[model]"),
    _bad("model file", "check {model}", "No such file", model_toml=None),
    _bad("model file", "check {model}", "no node with a capacity", model_toml=""),
    _bad("model file", "check {folder}", "Is a directory"),
    _bad("model file", "fmu {model} -o {out}.fmu", "copper_loss", model_toml=("copper_loss", "cooper_loss")),
    _bad("model file", 'add {model} copper_los --at "*" -o {out}.toml', "copper_los"),
    _bad("model file", "add {model} conduction --at motor~rotor -o {out}.toml", "motor~rotor"),
    _bad("model file", FIT, "none that is free",
         model_toml=lambda good: good.replace(b"unit =", b"fixed = true, unit =")),
    _bad("model file", "compare {model} {log} --against {other_toml}", "No such file", other_toml=None),
]  # fmt: skip

LOGS = [
    _bad("log", FIT, "no such file", log_csv=None),
    _bad("log", FIT, "empty", log_csv=""),
    _bad("log", FIT, "header", log_csv="1,2,3\n4,5,6\n"),
    _bad("log", FIT, "torque.motor", log_csv=lambda good: good.replace(b"torque.motor", b"tau")),
    _bad("log", FIT, "line 9", "ERROR", log_csv=_column("torque.motor", "ERROR", slice(7, 8))),
    _bad("log", FIT, "line 9", "infinite", log_csv=_column("torque.motor", "inf", slice(7, 8))),
    _bad("log", FIT, "line 52", "10", log_csv=_column("time", 10.0, slice(50, 51))),
    _bad("log", FIT, "time", log_csv=_column("time", 5.0)),
    _bad("log", FIT, "no time", log_csv=_column("time", None, slice(3, 4))),
    _bad("log", FIT, "kelvin", log_csv=_column("temperature.motor", 300.0)),
    _bad("log", FIT, "no value in any row", log_csv=_column("torque.motor", None)),
    _bad("log", FIT, "torque.motor", log_csv=_column("torque.motor", 1e300)),
    _bad("log", FIT, "5 rows", "at least 10", log_csv=lambda good: b"".join(good.splitlines(keepends=True)[:6])),
    _bad("log", FIT, "7 cells under 4 names", log_csv=lambda good: good + b"1,2,3,4,5,6,7\n"),
    _bad("log", FIT, "UTF-8", log_csv=b"time,\xff\0\n1,2\n"),
    _bad("log", FIT, "more than once",
         log_csv=lambda good: good.replace(b"\n", b",1\n").replace(b"ambient,1", b"ambient,torque.motor")),
    _bad("log", FIT.replace("{log}", "{log_parquet}"), "Parquet", log_parquet=b"PAR1" + b"x" * 50 + b"PAR1"),
    _bad("log", ZIPPED, "can't be read", **{"log_csv.gz": b"not gzip"}),
    _bad("log", ZIPPED, "log.csv.gz", **{"log_csv.gz": _cut(gzip.compress(b"time,a\n" * 99))}),
    _bad("log", FIT.replace("{log}", "{log_txt}"), ".txt", log_txt="time,a\n"),
    _bad("log", "check {model} {log}", "torque.motor", log_csv=_column("torque.motor", "x", slice(1, 2))),
    _bad("log", "compare {model} {log} --json {out}.json", "no such file", log_csv=None),
    _bad("log", "diagnose {model} {log} --json {out}.json", "time", log_csv=_column("time", 5.0)),
    _bad("log", "new --log {log} -o {out}", "no joint in: time, a, b", "knee_temp and knee_current",
         log_csv="time,a,b\n" + "\n".join(f"{k},1,2" for k in range(20))),
    _bad("log", "new --log {log} -o {out}", "no such file", log_csv=None),
    _bad("log", "open {model} {log} --no-browser", "no such file", log_csv=None),
    _bad("log", "improve {model} {log} -o {out}.toml", "empty", log_csv=""),
    _bad("log", "report {model} {log} -o {out}.html", "torque.motor", log_csv=_column("torque.motor", None)),
    _bad("log", "simulate {model} {log} -o {out}.csv", "no such file", log_csv=None),
    _bad("log", "forecast {model} {log} --limit 60", "line 3", log_csv=_column("time", "x", slice(1, 2))),
    _bad("log", "monitor {model} {log} --healthy {other} --json {out}.json", "UTF-8", other_csv=b"time,\xff\0\n"),
]  # fmt: skip

COMMANDS = [
    _bad("command line", "fitt {model}", "fitt"),
    _bad("command line", "fit", "MODEL"),
    _bad("command line", "fit {model}", "LOGS", "no log"),
    _bad("command line", "fit {model} {log} --outptu x", "--outptu"),
    _bad("command line", "new --log {log} --urdf {model} -o {out}", "--urdf", "a log, a URDF, or a preset"),
    _bad("command line", "open {model} --no-browser", "LOGS", "no log"),
    _bad("command line", "open {model} {log} --no-browser --port 70000", "port"),
    _bad("command line", "fit {model} {log} --symmetry-penalty much", "symmetry-penalty"),
    _bad("command line", "fit {model} {log} --symmetry-penalty nan", "symmetry-penalty"),
    _bad("command line", "fit {model} {log} --holdout-after 1e9", "holdout-after"),
    _bad("command line", "fit {model} {log} --holdout {log}", "the same data"),
    _bad("command line", "fit {model} {log} --map torque.motor", "--map"),
    _bad("command line", "fit {model} {log} --map torque.motor=torque.motor[furlong]", "furlong"),
    _bad("command line", "fit {model} {log} --map torque.motor=torque.motor[9**9**9**9]", "9**9"),
    _bad("command line", "new cat", "cat"),
    _bad("command line", "new leg --model whole", "whole"),
    _bad("command line", "effects copper_los", "copper_los"),
    _bad("command line", "improve {model} {log} --steps -1", "--steps"),
    _bad("command line", "diagnose {model} {log} --jobs 0", "--jobs"),
    _bad("command line", "diagnose {model} {log} --ambient-error -1", "--ambient-error"),
    _bad("command line", "forecast {model} {log} --limit hot", "--limit"),
    _bad("command line", "forecast {model} {log} --limit rotor=60", "rotor"),
    _bad("command line", "forecast {model} {log} --limit 60 --coverage 1", "--coverage"),
    _bad("command line", "forecast {model} {log} --limit 60 --window -3", "--window"),
    _bad("command line", "watch {model} udp://robot", "no port"),
    _bad("log", "watch {model} {folder}/bag.mcap", "bag.mcap: source", "a broken file", bag_mcap="time,a\n0,1\n"),
    _bad("log", "watch {model} {folder}/bag.db3", "bag.db3: source", "no such file"),
    _bad("command line", "watch {model} {log} --replay 0 --limit rotor=60", "rotor"),
    _bad("command line", "watch {model} {log} --to page://0.0.0.0:8000", "127.0.0.1 alone"),
    _bad("command line", "watch {model} {log} --to page://:99999", "no port"),
    _bad("command line", "export {model} --to fortran -o {out}.py", "--to"),
    _bad("command line", "export {model} --to numpy -o {out}.py --limit rotor=60", "rotor"),
    _bad("command line", "fleet {model} {log}", "--output"),
    _bad("command line", "fleet {model} {folder}/no -o {out}", "no such file or folder"),
    _bad("command line", "monitor {model} {log} --threshold 0", "--threshold"),
    _bad("command line", "monitor {model} {log} --healthy {log}", "the same data"),
    _bad("command line", "fmu {model} -o {out}.fmu --fmi 4", "--fmi"),
    _bad("command line", "fmu {model} -o {out}.fmu --limit warm", "--limit"),
    _bad("command line", "fmu {model} -o {out}.fmu --platforms amiga", "amiga"),
    _bad("command line", "motor --sample dynamo", "dynamo"),
]

OUTPUTS = [
    _bad("output", "new leg -o {folder}/no/leg.toml", "no"),
    _bad("output", FIT.replace("{out}.json", "{folder}/no/x.json"), "no such folder"),
    _bad("output", "fit {model} {log} -o {folder}", "a folder"),
    _bad("output", "fit {model} {log} -o {out} --json {out}", "one file for two results"),
    _bad("output", "improve {model} {log} -o {log}", "a file that is read"),
    _bad("output", "diagnose {model} {log} --json {model}", "a file that is read"),
    _bad("output", "fit {model} {log} --json {model}", "a file that is read"),
    _bad("output", "improve {model} {log} -o {out} --report {model}", "a file that is read"),
    _bad("output", "compare {model} {log} --plot {out}.jpg", ".png, .svg or .pdf"),
    _bad("output", "compare {model} {log} --report {log}", "a file that is read"),
    _bad("output", "simulate {model} {log} -o {out}.xlsx", ".csv or .parquet"),
    _bad("output", "forecast {model} {log} --limit 60 --plot {out}", ".png, .svg or .pdf"),
    _bad("output", "fmu {model} -o {out}.zip", ".fmu"),
    _bad("output", "plan {model} {task} -o {out}.txt", ".csv or .parquet"),
    _bad("output", "plan {model} {task} --json {task}", "would be lost"),
    _bad("output", "plan {model} {task} --emit-c {log}", "a folder"),
    _bad("output", "trade {study} --json {study}", "would be lost"),
    _bad(
        "output",
        "trade {study} --json {motors_csv}",
        "would be lost",
        motors_csv="name,mass\nX,1\n",
        study_toml=("[task]", 'catalogue = ["motors.csv"]\n[task]'),
    ),
    _bad("output", "monitor {model} {log} --calibration {kept} --json {kept}", "would be lost"),
    _bad("output", "monitor {model} {log} --healthy {other} --calibration {other}", "would be lost"),
    _bad("output", "cosim {model} {log} --parameters {task} --json {task}", "would be lost"),
    _bad("output", "cosim {model} {log} -o {out}.txt", ".csv or .parquet"),
]

TASKS = [
    _bad("task", "plan {model} {task}", "task.kind", "no such key", task_toml=('kind = "limit"', "")),
    _bad("task", "plan {model} {task}", "task.kind", "track, limit, firmware, mission", task_toml=('"limit"', '"fly"')),
    _bad("task", "plan {model} {task}", "limits", task_toml=('[limits]\n"*" = 60', "[limits]")),
    _bad("task", "plan {model} {task}", "line 5", "500", task_toml=('"*" = 60', '"*" = 6000')),
    _bad("task", "plan {model} {task}", "no such place", task_toml=('"*" = 60', "rotor = 60")),
    _bad("task", "plan {model} {task}", "start", "no such place",
         task_toml=('[start]\n"*" = 50', '[start]\n"x*" = 50\n')),
    _bad("task", "plan {model} {task}", "conditions", task_toml=('"temperature.ambient" = 25', "")),
    _bad("task", "plan {model} {task}", "horizons", task_toml=("[10, 60]", "[10, -60]")),
    _bad("task", "plan {model} {task}", "task.air", task_toml=('"limit"', '"firmware"')),
    _bad("task", "plan {model} {task}", "TOML", task_toml=("[limits]", "[limits")),
    _bad("task", "plan {model} {track}", "phases", track_toml=lambda good: good[: good.index(b"[[phases]]")]),
    _bad("task", "plan {model} {track}", "duration", track_toml=("duration = 100", "duration = 0")),
    _bad("task", "plan {model} {track}", "torque", track_toml=('{ "*" = 4 }', '"four"')),
    _bad("task", "plan {model} {mission}", "activities", mission_toml=("[[activities]]", "[[activity]]")),
    _bad("task", "plan {model} {mission}", "gait", mission_toml=('do = "walk"', 'do = "fly"')),
    _bad("task", "plan {model} {mission}", "distance", mission_toml=("distance = 50", "distance = -50")),
    _bad("task", "plan {model} {mission}", "torque", mission_toml=("[2, 3]", "[2, 3, 4]")),
    _bad("task", "plan {model} {mission}", "torque", mission_toml=("[2, 3]", "[2, 1e300]")),
    _bad("task", "plan {model} {mission}", "No such file", mission_toml=None),
]  # fmt: skip

STUDIES = [
    _bad("study", "trade {study}", "study.goal", study_toml=('"mass"', '"beauty"')),
    _bad("study", "trade {study}", "study.goal", "no such key", study_toml=('goal = "mass"', "")),
    _bad("study", "trade {study}", "task.torque", study_toml=("torque = 1.68", "torque = -1")),
    _bad("study", "trade {study}", "task.torque", study_toml=("1.68", '{ value = 1, unit = "9**9**9" }')),
    _bad("study", "trade {study}", "motors", study_toml=('[[motors]]\nname = "U8"', "")),
    _bad("study", "trade {study}", "U9", study_toml=('"U8"', '"U9"')),
    _bad("study", "trade {study}", "model", study_toml=('"U8"', '"U8"\nmodel = "../../etc/passwd"')),
    _bad("study", "trade {study}", "sink.capacity", study_toml=("[20, 1500]", "[1500, 20]")),
    _bad("study", "trade {study}", "fan.speed", study_toml=("[sink]", "[fan]\nspeed = 5e-324\n[sink]")),
    _bad(
        "study",
        "trade {study}",
        "effects[0].at",
        "no_such",
        study_toml=("[sink]", '[[effects]]\nkind = "radiation"\nat = "no_such"\n[sink]'),
    ),
    _bad(
        "study",
        "trade {study}",
        "fan.curve.pressure",
        "falling",
        study_toml=("[sink]", "[fan.curve]\nflow = [0, 1]\npressure = [1, 2]\n[sink]"),
    ),
    _bad("study", "trade {study}", "pareto", study_toml=("[sink]", "[pareto]\nleast = 1\n[sink]")),
    _bad("study", "trade {study}", "No such file", study_toml=None),
]

DRAWINGS = [
    _bad("drawing", "motor {drawing} -o {out}.toml", "motor.kind", drawing_toml=('"inrunner"', '"pancake"')),
    _bad("drawing", "motor {drawing} -o {out}.toml", "motor.slots", drawing_toml=("slots = 12", "slots = 0")),
    _bad("drawing", "motor {drawing} -o {out}.toml", "winding", drawing_toml=("[winding]", "[windings]")),
    _bad("drawing", "motor {drawing} -o {out}.toml", "gap", drawing_toml=("value = 19,", "value = 9,")),
    _bad("drawing", "motor {drawing} -o {out}.toml", "housing", drawing_toml=('"aluminium"', '"cheese"')),
    _bad("drawing", "motor {drawing} -o {out}.toml", "No such file", drawing_toml=None),
]

KEPT = [
    _bad("calibration", "monitor {model} {log} --calibration {kept}", "calibration", kept_json="{"),
    _bad("calibration", "monitor {model} {log} --calibration {kept}", "nodes", kept_json=('["motor"]', '["rotor"]')),
    _bad("calibration", "monitor {model} {log} --calibration {kept}", "noise", kept_json=("[0.1]", "[-0.1]")),
    _bad("calibration", "monitor {model} {log} --calibration {kept}", "No such file", kept_json=None),
]

COSIM = "cosim {x_fmu} {log} --trust --json {out}.json"
FMUS = [
    _bad("FMU", COSIM, "No such file", x_fmu=None),
    _bad("FMU", COSIM, "ZIP", x_fmu=b""),
    _bad("FMU", COSIM, "ZIP", x_fmu=b"PK\x03\x04" + bytes(60)),
    _bad("FMU", COSIM, "inside the FMU", x_fmu=zipped([("../x", b"x"), ("modelDescription.xml", b"<x/>")])),
    _bad("FMU", COSIM, "inside the FMU", x_fmu=zipped([("/etc/x", b"x"), ("modelDescription.xml", b"<x/>")])),
    _bad("FMU", COSIM, "no modelDescription.xml", x_fmu=zipped([("readme", b"x")])),
    _bad("FMU", COSIM, "entities", x_fmu=zipped([("modelDescription.xml", b'<!DOCTYPE x [<!ENTITY a "b">]><x/>')])),
    _bad("FMU", COSIM, "UTF-8", x_fmu=zipped([("modelDescription.xml", "<x/>".encode("utf-16"))])),
    _bad("FMU", COSIM, "FMI", x_fmu=zipped([("modelDescription.xml", b"<x/>")])),
    _bad("FMU", COSIM, "modelDescription.xml", x_fmu=zipped([("modelDescription.xml", b"<x")])),
    _bad("FMU", "cosim {log} {log}", "ZIP"),
    _bad("FMU", "cosim {folder} {log}", "Is a directory"),
    _bad("FMU", "cosim {log}", "no log"),
]

BAD = [*MODELS, *LOGS, *COMMANDS, *OUTPUTS, *TASKS, *STUDIES, *DRAWINGS, *KEPT, *FMUS]


def by_kind() -> dict[str, Counter[str]]:
    """For each kind how many bad inputs each command is given."""
    commands: dict[str, Counter[str]] = {}
    for bad in BAD:
        commands.setdefault(bad.kind, Counter())[bad.words.split()[0]] += 1
    return commands


if __name__ == "__main__":
    for kind, counts in by_kind().items():
        listed = ", ".join(f"{command} {n}" for command, n in counts.items())
        print(f"{kind:13} {counts.total():4}  {listed}")
    print(f"{'all':13} {len(BAD):4}")
