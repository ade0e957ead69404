"""Spoilt files given to the readers: `python -m tests.hardening.fuzz --minutes 10 --what model`.

Each case is a good file with a few changes. It is read as the commands read it; the only exception allowed is an
`InputError` of one line. The seed of the run is printed; case k of seed s is always the same.
"""

from __future__ import annotations

import argparse
import json
import re
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from random import Random
from types import FrameType

from lptn.basics.errors import InputError
from tests.hardening.target import Target
from tests.hardening.targets import TARGETS

_PYTHON = re.compile(r"found \[?\{['\"]\w+['\"]:|found (True|False|None);")
_LONGEST = 30  # s, of one case
_LONGEST_LINE = 2000  # characters of a message


class TooLong(BaseException):
    """A case that does not end."""


@dataclass
class Tally:
    """What a run of the fuzzer saw.

    Args:
        read: cases that were read as good files.
        refused: cases that were refused in one line.
        exceptions: cases that did anything else, by exception and place.
    """

    read: int = 0
    refused: int = 0
    exceptions: Counter[str] = field(default_factory=Counter)
    examples: dict[str, bytes] = field(default_factory=dict)
    details: dict[str, str] = field(default_factory=dict)
    slowest: float = 0.0

    @property
    def cases(self) -> int:
        """All cases."""
        return self.read + self.refused + sum(self.exceptions.values())


def case(target: Target, seed: int, number: int) -> tuple[str, bytes]:
    """Case `number` of a seed: the good file's name, and the bad file's content."""
    random = Random(f"{seed}/{number}")
    seeds = target.seeds()
    name = random.choice(sorted(seeds))
    return name, target.spoil(random, seeds[name], list(seeds.values()))


def try_case(target: Target, seed: int, number: int, folder: Path, tally: Tally) -> None:
    """Read one case and note how it ended."""
    name, content = case(target, seed, number)
    ending = name[name.index(".") :]
    path = folder / f"case{ending}"
    path.write_bytes(content)
    begun = time.perf_counter()
    try:
        target.read(path, Random(f"{number}/{seed}"))
        tally.read += 1
    except InputError as error:
        wrong = _wrong(str(error))
        if wrong:
            _note(tally, wrong, content, str(error))
        else:
            tally.refused += 1
    except TooLong:
        _note(tally, _key("TooLong"), content, traceback.format_exc())
    except Exception as error:
        _note(tally, _key(type(error).__name__), content, traceback.format_exc())
    tally.slowest = max(tally.slowest, time.perf_counter() - begun)


def _wrong(line: str) -> str:
    """What is wrong with a message, nothing for a good one."""
    if not line.isprintable():
        return "a message with characters that can't be printed"
    if len(line) > _LONGEST_LINE:
        return "a message that is too long"
    return "a message with Python's values in it" if _PYTHON.search(line) else ""


def _key(kind: str) -> str:
    """The exception and the line of this package that it passed last."""
    frames = traceback.extract_tb(sys.exc_info()[2])
    ours = [frame for frame in frames if "/tests/" not in frame.filename and "site-packages" not in frame.filename]
    last = ours[-1] if ours else frames[-1]
    return f"{kind} in {Path(last.filename).name}:{last.lineno} {last.name}"


def _note(tally: Tally, key: str, content: bytes, detail: str) -> None:
    tally.exceptions[key] += 1
    if key not in tally.examples or len(content) < len(tally.examples[key]):
        tally.examples[key], tally.details[key] = content, detail


def run(
    what: str, seed: int, *, seconds: float = 1e9, cases: int = 10**9, say: Callable[[str], None] = lambda _: None
) -> Tally:
    """Fuzz one kind of file for a time or a number of cases."""
    target, tally = TARGETS[what], Tally()
    usual = signal.signal(signal.SIGALRM, _ring)
    try:
        with tempfile.TemporaryDirectory(prefix="lptn-fuzz-") as name, warnings.catch_warnings():
            warnings.simplefilter("error")
            end, number = time.monotonic() + seconds, 0
            while number < cases and time.monotonic() < end:
                before = len(tally.exceptions)
                signal.setitimer(signal.ITIMER_REAL, _LONGEST, 1.0)  # again and again: IPOPT swallows one
                try:
                    try_case(target, seed, number, Path(name), tally)
                except TooLong:  # between the reader and its end
                    pass
                finally:
                    signal.setitimer(signal.ITIMER_REAL, 0)
                if len(tally.exceptions) > before:
                    say(f"case {number}: {list(tally.exceptions)[-1]}")
                number += 1
    finally:
        signal.signal(signal.SIGALRM, usual)
    return tally


def _ring(_: int, __: FrameType | None) -> None:
    raise TooLong


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--what", choices=[*TARGETS, "all"], default="all")
    parser.add_argument("--minutes", type=float, default=10.0, help="in all")
    parser.add_argument("--seed", type=int, default=time.time_ns() % 10**6)
    parser.add_argument("--keep", type=Path, help="folder for the cases that raise anything else")
    parser.add_argument("--case", type=int, help="only this case: write it to standard output")
    asked = parser.parse_args()
    if asked.case is not None:
        sys.stdout.buffer.write(case(TARGETS[asked.what], asked.seed, asked.case)[1])
        return
    chosen = list(TARGETS) if asked.what == "all" else [asked.what]
    print(f"seed {asked.seed}", flush=True)
    exceptions = 0
    for what in chosen:
        tally = run(
            what, asked.seed, seconds=60 * asked.minutes / len(chosen), say=lambda text: print(text, flush=True)
        )
        counts = f"{tally.cases} cases, {tally.read} read, {tally.refused} refused, {len(tally.exceptions)} exceptions"
        print(f"{what}: {counts}, slowest {tally.slowest:.1f} s", flush=True)
        for number, (key, times) in enumerate(tally.exceptions.most_common()):
            print(f"  {times} x {key}", flush=True)
            if asked.keep is not None:
                asked.keep.mkdir(parents=True, exist_ok=True)
                (asked.keep / f"{what}-{number}").write_bytes(tally.examples[key])
                (asked.keep / f"{what}-{number}.txt").write_text(json.dumps(key) + "\n" + tally.details[key])
        exceptions += len(tally.exceptions)
    sys.exit(1 if exceptions else 0)


if __name__ == "__main__":
    main()
