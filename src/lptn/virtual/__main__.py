"""Make virtual logs from the command line: ``python -m lptn.virtual leg -o DIR``."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from typing import NoReturn, get_args

from .hidden import EFFECTS, Hidden
from .leg import RATES, Format, Start, leg_logs, write_logs


class _Parser(argparse.ArgumentParser):
    def error(self, message: str) -> NoReturn:
        """Say one line and exit 2: argparse itself would print the usage, too."""
        self.exit(2, f"{self.prog}: {message}\n")


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(prog="lptn.virtual", description="Make logs of a virtual robot with hidden effects.")
    robots = parser.add_subparsers(dest="robot", required=True, metavar="ROBOT")
    leg = robots.add_parser("leg", help="a leg with the joints FR_hip, FR_thigh and FR_calf")
    leg.add_argument(
        "--hidden",
        action="append",
        default=[],
        metavar="EFFECT",
        help=f"may be repeated; {', '.join(EFFECTS)}",
    )
    leg.add_argument("--at", action="append", default=[], metavar="PLACE", help="one for each --hidden, in order")
    leg.add_argument(
        "--size", action="append", default=[], type=float, help="one for each --hidden, in order, or none (1)"
    )
    leg.add_argument("--seed", type=int, default=0)
    leg.add_argument("--noise", type=float, default=0.15, help="K")
    leg.add_argument("--quantisation", type=float, default=0.0, help="K")
    leg.add_argument("--dropouts", type=float, default=0.0, help="share of readings that are missing")
    leg.add_argument("--rough", action="store_true", help="add small physics that no model has")
    leg.add_argument("--scatter", type=float, default=0.03, help="of the parameters, relative")
    leg.add_argument("--start", choices=get_args(Start), default="cold")
    leg.add_argument("--rate", type=float, default=10.0, help=f"Hz: {', '.join(f'{r:g}' for r in RATES)}")
    leg.add_argument("--format", choices=get_args(Format), default="parquet")
    leg.add_argument("-o", "--output", required=True, metavar="DIR")
    return parser


def _hidden(effects: list[str], at: list[str], sizes: list[float]) -> list[Hidden]:
    if len(at) != len(effects):
        raise ValueError(f"--at: found {len(at)}; expected one for each --hidden, so {len(effects)}")
    if sizes and len(sizes) != len(effects):
        raise ValueError(f"--size: found {len(sizes)}; expected none or one for each --hidden, so {len(effects)}")
    return [Hidden(*one) for one in zip(effects, at, sizes or [1.0] * len(effects), strict=True)]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; return 0, or 2 after one line on what was wrong.

    Raises:
        SystemExit: with status 2, after one line, for options that can't be read; with 0 after ``--help``.
    """
    given = vars(_parser().parse_args(arguments))
    del given["robot"]
    folder, kind = given.pop("output"), given.pop("format")
    try:
        hidden = _hidden(given.pop("hidden"), given.pop("at"), given.pop("size"))
        files = write_logs(folder, leg_logs(hidden, **given), kind)
    except (ValueError, OSError) as problem:
        print(f"lptn.virtual: {problem}", file=sys.stderr)
        return 2
    print(*files, sep="\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
