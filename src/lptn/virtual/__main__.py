"""Make virtual logs from the command line: ``python -m lptn.virtual quadruped -o DIR``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn, get_args

from .effects import EFFECTS, Columns, Hidden
from .leg import RATES as LEG_RATES
from .leg import leg_logs
from .quadruped import RATES, quadruped_logs
from .robot import Level, Physics
from .runs import PLANS
from .writers import Format, write_logs


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Say one line and exit 2: argparse itself would print the usage, too."""
        self.exit(2, f"{self.prog}: {message}\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="lptn.virtual", description="Make logs of a virtual robot with hidden effects.")
    robots = parser.add_subparsers(dest="robot", required=True, metavar="ROBOT")
    leg = robots.add_parser("leg", help="a leg with the joints FR_hip, FR_thigh and FR_calf")
    _add_shared(leg, quantisation=0.0)
    leg.add_argument("--scatter", type=float, default=0.03, help="of the parameters, relative")
    leg.add_argument("--rate", type=float, default=10.0, help=f"Hz: {', '.join(f'{r:g}' for r in LEG_RATES)}")
    whole = robots.add_parser("quadruped", help="twelve joints and the onboard computer, as a Unitree A1 has them")
    _add_shared(whole, quantisation=1.0)
    whole.add_argument("--runs", choices=tuple(PLANS), default="protocol", help="protocol and tests as in the article")
    whole.add_argument("--physics", choices=get_args(Physics), default="full", help="plain: one mass a joint")
    whole.add_argument("--level", choices=get_args(Level), help="of the hidden errors of each run")
    whole.add_argument("--scatter", type=float, default=1.0, help="factor on the parameters' scatter over the legs")
    whole.add_argument("--rate", type=float, default=1.0, help=f"Hz: {', '.join(f'{r:g}' for r in RATES)}")
    whole.add_argument("--truth", action="store_true", help="write the true temperatures to DIR/truth, too")
    return parser


def _add_shared(robot: argparse.ArgumentParser, quantisation: float) -> None:
    effects = f"may be repeated; {', '.join(EFFECTS)}"
    robot.add_argument("--hidden", action="append", default=[], metavar="EFFECT", help=effects)
    robot.add_argument("--at", action="append", default=[], metavar="PLACE", help="one for each --hidden, in order")
    sizes = "one for each --hidden, in order, or none (1)"
    robot.add_argument("--size", action="append", default=[], type=float, help=sizes)
    alone = "in which alone it acts, one for each --hidden, in order, * for all runs, or none (*)"
    robot.add_argument("--run", action="append", default=[], metavar="RUN", help=alone)
    robot.add_argument("--noise", type=float, default=0.15, help="K")
    robot.add_argument("--quantisation", type=float, default=quantisation, help=f"K; {quantisation:g} if not given")
    robot.add_argument("--dropouts", type=float, default=0.0, help="share of readings that are missing")
    robot.add_argument(
        "--columns", choices=get_args(Columns), default="asked", help="all: also what no effect asks for"
    )
    robot.add_argument("--seed", type=int, default=0)
    robot.add_argument("--format", choices=get_args(Format), default="parquet")
    robot.add_argument("-o", "--output", required=True, metavar="DIR")


def _hidden(robot: str, effects: list[str], at: list[str], sizes: list[float], runs: list[str]) -> list[Hidden]:
    count = len(effects)
    sizes, runs = sizes or [1.0] * count, runs or ["*"] * count
    for option, values, none in (("--at", at, ""), ("--size", sizes, "none or "), ("--run", runs, "none or ")):
        if len(values) != count:
            raise ValueError(f"{option}: found {len(values)}; expected {none}one for each --hidden, so {count}")
    return [
        Hidden(effect, place, size, robot, run.replace("*", ""))
        for effect, place, size, run in zip(effects, at, sizes, runs, strict=True)
    ]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return 0, or 2 after one line on what was wrong.

    Raises:
        SystemExit: with status 2, after one line, for options that can't be read; with 0 after ``--help``.
    """
    options = vars(_parser().parse_args(arguments))
    robot, folder, kind = options.pop("robot"), options.pop("output"), options.pop("format")
    try:
        hidden = _hidden(robot, options.pop("hidden"), options.pop("at"), options.pop("size"), options.pop("run"))
        if robot == "quadruped":
            truth = options.pop("truth")
            logs = quadruped_logs(hidden, **options)
            files = write_logs(folder, logs, kind)
            if truth:
                write_logs(Path(folder) / "truth", logs.truth)
        else:
            files = write_logs(folder, leg_logs(hidden, **options), kind)
    except (ValueError, OSError) as problem:
        print(f"lptn.virtual: {problem}", file=sys.stderr)
        return 2
    print(*files, sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
