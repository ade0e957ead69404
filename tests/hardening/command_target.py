"""Whole commands for the fuzzer: what gets past the readers must not break what stands behind them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from random import Random

from lptn.basics.errors import InputError
from tests.hardening.bad_inputs import desk
from tests.hardening.mutations import spoil_csv, spoil_toml
from tests.hardening.target import command

COMMANDS = (
    "fit {model} {log} -o {out}.toml --json {out}.json",
    "fit {model} {log} --holdout-after 80 --symmetry-penalty auto",
    "compare {model} {log} --report {out}.html --plot {out}.png",
    "compare {model} {log} --against {other}",
    "simulate {model} {log} -o {out}.parquet",
    "check {model} {log}",
    "forecast {model} {log} --limit 60 --json {out}.json --plot {out}.svg",
    "monitor {model} {log} --json {out}.json",
    "fmu {model} -o {out}.fmu --platforms source",
    "add {model} forced_convection --at * -o {out}.toml",
    "plan {model} {task} --json {out}.json",
    "diagnose {model} {log} --json {out}.json",
)


@cache
def inputs() -> Mapping[str, bytes]:
    """A model and a log."""
    return {name: content for name, content in desk().items() if name in ("model.toml", "log.csv")}


def spoil_input(random: Random, content: bytes, _: list[bytes]) -> bytes:
    """A model or a log with a change or two."""
    text = content.decode()
    return spoil_csv(random, text) if text.startswith("time") else spoil_toml(random, text, [text])


def run_command(path: Path, random: Random) -> None:
    """One of the commands with the spoilt file and otherwise good ones."""
    good = desk()
    places = {"out": str(path.with_name("out"))}
    for key, name in (("model", "model.toml"), ("other", "model.toml"), ("log", "log.csv"), ("task", "task.toml")):
        spoilt = (key == "model" and path.suffix == ".toml") or (key == "log" and path.suffix == ".csv")
        file = path if spoilt else path.with_name(f"good-{name}")
        if not spoilt:
            file.write_bytes(good[name])
        places[key] = str(file)
    if command([word.format(**places) for word in random.choice(COMMANDS).split()]):
        raise InputError(path, "command line", "exit status 2", "0")
