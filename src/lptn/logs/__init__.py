"""Logs of robots, read into runs: uniform sampling, SI units, every fault found and said."""

from lptn.logs.columns import ColumnSource, parse_columns, parse_map_option
from lptn.logs.quantisation import quantisation_step
from lptn.logs.read import read_log
from lptn.logs.run import Run

__all__ = [
    "ColumnSource",
    "Run",
    "parse_columns",
    "parse_map_option",
    "quantisation_step",
    "read_log",
]
