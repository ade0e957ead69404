"""Commands killed (SIGKILL) at random times: `python -m tests.hardening.kill --kills 50 --seed 0`.

Of each output the old file or the new one must be there, whole; beside them nothing but `.<name>.<random>.part`,
which nobody reads. Every other kill comes just after a file was seen to change. At last each command runs to its end.
A command is one entry of `COMMANDS`.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time
import zipfile
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from random import Random

import pandas as pd

from lptn.model.file import read_model_file
from lptn.robots.presets import presets
from lptn.virtual import leg_logs

EXAMPLES = Path(__file__).parents[2] / "examples"
LEFT = re.compile(r"\..+\.[0-9a-f]{12}\.part")
Check = Callable[[Path], object]
_AFTER = 0.2  # s after the first change of a file
LPTN = ("-m", "lptn")


@dataclass(frozen=True)
class Command:
    """A command to kill.

    Args:
        words: behind `python`, run in a folder with the inputs of `prepare`.
        outputs: for each file that it writes, or glob of files, a check that raises for half a file.
        fresh: folders that are removed before each kill, of commands that skip what is done.
        figure: what must come out the same at last as without kills, a number.
    """

    words: tuple[str, ...]
    outputs: Mapping[str, Check]
    fresh: tuple[str, ...] = ()
    figure: Callable[[Path], float] = lambda _: 0.0


@dataclass
class KillTally:
    """What became of the kills of one command."""

    kills: int = 0
    ended_before: int = 0
    states: Counter[str] = field(default_factory=Counter)
    leftovers: int = 0
    wrong: list[str] = field(default_factory=list)


def _json(path: Path) -> object:
    return json.loads(path.read_text(encoding="utf-8"))


def _page(path: Path) -> None:
    text = path.read_text(encoding="utf-8").rstrip()
    if not (text.startswith("<!DOCTYPE html>") and text.endswith("</html>")):
        raise ValueError("no whole page")


def _archive(path: Path) -> None:
    with zipfile.ZipFile(path) as archive:
        if archive.testzip() is not None or "modelDescription.xml" not in archive.namelist():
            raise ValueError("no whole archive")


def _csv(path: Path) -> None:
    if pd.read_csv(path).empty or not path.read_bytes().endswith(b"\n"):
        raise ValueError("no whole table")


def _picture(path: Path) -> None:
    if not path.read_bytes().endswith(b"IEND\xaeB`\x82"):
        raise ValueError("no whole picture")


def _code(path: Path) -> None:
    if not path.read_text(encoding="utf-8").endswith("\n"):
        raise ValueError("no whole text")


COMMANDS = {
    "fit": Command(
        (*LPTN, "fit", "heaters.toml", "log.csv", "--holdout-after", "300", "-o", "out.toml", "--json", "out.json"),
        {"out.toml": read_model_file, "out.json": _json},
        figure=lambda folder: float(json.loads((folder / "out.json").read_text())["rmse_holdout"]),
    ),
    "fmu": Command((*LPTN, "fmu", "leg.toml", "-o", "leg.fmu", "--json", "fmu.json"),
                   {"leg.fmu": _archive, "fmu.json": _json}),
    "improve": Command(
        (*LPTN, "improve", "heaters.toml", "short.csv", "--holdout-after", "110", "--steps", "1", "-o", "better.toml",
         "--json", "history.json", "--report", "story.html"),
        {"better.toml": read_model_file, "history.json": _json, "story.html": _page},
    ),
    "plan": Command(
        (*LPTN, "plan", "leg.toml", "task.toml", "-o", "plan.csv", "--json", "plan.json", "--plot", "plan.png",
         "--emit-c", "c"),
        {"plan.csv": _csv, "plan.json": _json, "plan.png": _picture, "c/*": _code},
    ),
    "virtual": Command(("-m", "lptn.virtual", "leg", "--seed", "3", "-o", "logs"), {"logs/*.parquet": pd.read_parquet}),
    "fleet": Command(
        (*LPTN, "fleet", "leg.toml", "robots", "-o", "fleet"),
        {"fleet/models/*.toml": read_model_file, "fleet/records/*.json": _json, "fleet/*.csv": _csv,
         "fleet/*.parquet": pd.read_parquet},
        ("fleet",),
        lambda folder: float(pd.read_csv(folder / "fleet" / "fleet.csv").select_dtypes("number").mean().sum()),
    ),
}  # fmt: skip
TASK = """\
[task]
kind = "track"
[limits]
"*" = 60
[start]
"*" = 50
[conditions]
"temperature.ambient" = 25
[[phases]]
duration = 200
torque = { "*" = 4, "FR_calf" = 12 }
"""


def prepare(folder: Path, name: str) -> None:
    """The inputs of the command of this name."""
    shutil.copy(EXAMPLES / "tclab" / "two_heaters.toml", folder / "heaters.toml")
    shutil.copy(EXAMPLES / "tclab" / "log.csv", folder / "log.csv")
    table = pd.read_csv(folder / "log.csv")
    table[table["time_s"] < 150].to_csv(folder / "short.csv", index=False)
    (folder / "leg.toml").write_text(presets()["leg"])
    (folder / "task.toml").write_text(TASK)
    for run, log in leg_logs(seed=3).items() if name == "fleet" else ():
        (folder / "robots" / f"robot_{run}").mkdir(parents=True)
        log.to_parquet(folder / "robots" / f"robot_{run}" / f"{run}.parquet", index=False)


def begin(command: Command, folder: Path) -> subprocess.Popen[bytes]:
    """The command in a session of its own, with a cache of its own, so that its kills reach the cache as well."""
    around = os.environ | {"XDG_CACHE_HOME": str(folder / ".cache"), "XDG_STATE_HOME": str(folder / ".state")}
    around |= {"OMP_NUM_THREADS": "1", "MPLBACKEND": "agg"}
    return subprocess.Popen([sys.executable, *command.words], cwd=folder, env=around, start_new_session=True,
                            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE)  # fmt: skip


def run(command: Command, folder: Path) -> float:
    """Run it to its end; returns the seconds that it took."""
    begun = time.monotonic()
    with begin(command, folder) as process:
        _, said = process.communicate(timeout=600)
    if process.returncode:
        raise RuntimeError(said.decode(errors="replace"))
    return time.monotonic() - begun


def kill_once(command: Command, folder: Path, after: float, aimed: bool, tally: KillTally) -> None:
    """Kill it some seconds after its start, or after a file changed; then look at what is there."""
    for name in command.fresh:
        shutil.rmtree(folder / name, ignore_errors=True)
    old = _seen(command, folder)
    with begin(command, folder) as process:
        if aimed:
            _wait_for_change(process, folder)
        time.sleep(after)
        tally.ended_before += process.poll() is not None
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate()
    tally.kills += 1
    new = _seen(command, folder)
    changed = [name for name in new if new[name] != old.get(name)]
    tally.states["old" if not changed else "new" if len(changed) == len(new) else "some new"] += 1
    tally.wrong += [f"{name} is gone" for name in old if name not in new]
    tally.wrong += [f"{name}: {wrong}" for name, wrong in _broken(command, folder).items()]
    _clear(folder, tally)


def _wait_for_change(process: subprocess.Popen[bytes], folder: Path) -> None:
    first = _names(folder)
    while process.poll() is None and _names(folder) == first:
        time.sleep(0.0002)


def _names(folder: Path) -> list[tuple[str, int]]:
    places = [folder, *(child for child in folder.iterdir() if child.is_dir() and not child.name.startswith("."))]
    times = []
    for place in places:
        with os.scandir(place) as entries:
            for entry in entries:
                try:
                    times.append((entry.path, entry.stat().st_mtime_ns if entry.is_file() else 0))
                except FileNotFoundError:
                    times.append((entry.path, -1))
    return sorted(times)


def _seen(command: Command, folder: Path) -> dict[str, int]:
    """Each output and when it was written."""
    paths = [path for pattern in command.outputs for path in folder.glob(pattern) if not LEFT.fullmatch(path.name)]
    return {str(path.relative_to(folder)): path.stat().st_mtime_ns for path in paths}


def _broken(command: Command, folder: Path) -> dict[str, str]:
    broken = {}
    for pattern, check in command.outputs.items():
        for path in folder.glob(pattern):
            try:
                if not LEFT.fullmatch(path.name):
                    check(path)
            except Exception as error:
                broken[path.name] = repr(error)
    return broken


def _clear(folder: Path, tally: KillTally) -> None:
    """Count and remove what the kill left; an hour later the commands would do it."""
    for path in [*folder.rglob(".*.part")]:
        if LEFT.fullmatch(path.name):
            tally.leftovers += 1
            shutil.rmtree(path) if path.is_dir() else path.unlink()


def trial(name: str, kills: int, random: Random, folder: Path) -> KillTally:
    """Kill one command several times; then let it end."""
    command, tally = COMMANDS[name], KillTally()
    took = run(command, folder)
    expected = command.figure(folder)
    tally.wrong += [f"{file}: {wrong}" for file, wrong in _broken(command, folder).items()]
    for number in range(kills):
        aimed = number % 2 == 1
        kill_once(command, folder, random.uniform(0.0, _AFTER if aimed else took), aimed, tally)
    run(command, folder)
    figure = command.figure(folder)
    if abs(figure - expected) > 1e-3 * abs(expected):
        tally.wrong.append(f"{figure:g} after the kills, {expected:g} without")
    tally.wrong += [f"at last {file}: {wrong}" for file, wrong in _broken(command, folder).items()]
    return tally


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=50, help="in all")
    parser.add_argument("--only", nargs="+", choices=[*COMMANDS], default=[*COMMANDS])
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    random, wrong = Random(asked.seed), 0
    print(f"{'command':10} kills  ended before  outputs afterwards  leftovers  wrong")
    for number, name in enumerate(asked.only):
        share = len(range(number, asked.kills, len(asked.only)))
        with tempfile.TemporaryDirectory(prefix="lptn-kill-") as place:
            prepare(Path(place), name)
            tally = trial(name, share, random, Path(place))
        states = ", ".join(f"{state} {count}" for state, count in sorted(tally.states.items()))
        counts = f"{tally.kills:5} {tally.ended_before:13}  {states}  {tally.leftovers}  {len(tally.wrong)}"
        print(f"{name:10} {counts}", flush=True)
        print(*(f"  {problem}" for problem in tally.wrong), sep="\n", end="\n" if tally.wrong else "")
        wrong += len(tally.wrong)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
