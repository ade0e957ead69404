"""Lines for plots: what was measured and predicted of one node in one run, thinned without losing a peak."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.lines import joined, thinned
from lptn.diagnose.unexplained_heat import WIDE, UnexplainedHeat
from lptn.identify.comparison import Prediction
from lptn.identify.validation import Spread

_MARGIN = 1  # readings beyond a window on either side, so that a line runs to the plot's edge
_BLOCK = 64  # readings of which the smallest and the largest are kept: long windows are drawn from a 64th of the log
_OF_NODES = {"temperature": "measured", "predicted": "now", "error": "error now"}
"""Signals that each node has, and what their lines are called in its plots."""

_Key = tuple[str, ...]
_Read = Callable[[Any], FloatArray]  # the values of a line at an index of the run's readings


@dataclass(frozen=True)
class RunLines:
    """All that plots of one run show.

    Args:
        nodes: the model's nodes.
        time: s in the log's clock, (n,).
        measured: degC, (nodes, n), NaN where missing.
        inputs: the log's other columns, (n,) each.
        predicted: degC, (nodes, n), by what names the model.
        heat: unexplained heat, where it was worked out.
        spread: of readings about the line that is called `now`.
    """

    nodes: tuple[str, ...]
    time: FloatArray
    measured: FloatArray
    inputs: Mapping[str, FloatArray]
    predicted: Mapping[str, FloatArray] = field(default_factory=dict)
    heat: UnexplainedHeat | None = None
    spread: Spread | None = None
    _extremes: dict[_Key, FloatArray] = field(default_factory=dict, init=False, repr=False, compare=False)

    @classmethod
    def of(cls, prediction: Prediction, nodes: tuple[str, ...]) -> RunLines:
        """Without any model's line yet."""
        run = prediction.bound.run
        inputs = {name: values for name, values in run.columns.items() if name.partition(".")[0] != "temperature"}
        read = {f"temperature.{node}" for node in nodes}
        inputs |= {name: run.columns[name] for name in run.columns if name not in inputs and name not in read}
        return cls(nodes, run.time, prediction.bound.measured, inputs)

    def with_line(self, model: str, readings: FloatArray) -> RunLines:
        """The same with what a model predicts."""
        return replace(self, predicted={**self.predicted, model: readings})

    def inputs_of(self, node: str) -> list[str]:
        """The inputs that act at a node: its own, then those of the robot and the air, which all nodes have."""
        own = [name for name in self.inputs if name.partition(".")[2] == node]
        places = {name.partition(".")[2] for name in self.inputs}
        common = [name for name in self.inputs if name.partition(".")[2] in places - set(self.nodes)]
        return [*own, *common]

    def error(self, node: str, model: str) -> FloatArray:
        """Predicted − measured of a node [K], (n,), NaN where nothing was measured.

        Raises:
            InputError: no such node.
        """
        row = self._row(node)
        return np.asarray(self.predicted[model][row] - self.measured[row])

    def _row(self, node: str) -> int:
        if node not in self.nodes:
            raise InputError("plot", "node", node, f"one of {', '.join(self.nodes)}")
        return self.nodes.index(node)

    def window(
        self,
        what: str | Sequence[str],
        models: Mapping[str, str],
        start: float | None = None,
        stop: float | None = None,
        points: int = 1500,
    ) -> dict[str, FloatArray]:
        """Lines from `start` to `stop` [s], all at the same times, NaN where something is missing.

        Args:
            what: a node, for all lines of its plots; or names of signals: inputs, or `temperature`, `predicted` and
                `error` of a node, the latter two of the model that is called `now`.
            models: which lines to show: names on the page, with the models' names.
            start: s; the run's begin by default.
            stop: s; the run's end by default.
            points: at most about so many.

        Raises:
            InputError: no such node or signal.
        """
        lines = self._lines(what, models) if isinstance(what, str) else self._signals(what, models)
        size = self.time.size
        first = 0 if start is None else max(int(np.searchsorted(self.time, start)) - _MARGIN, 0)
        last = size if stop is None else int(np.searchsorted(self.time, stop, side="right")) + _MARGIN
        first, last = min(first, size - 1), min(max(last, first + 1), size)
        blocks = max(points, 3) // 2
        if last - first <= blocks * _BLOCK:
            inside = slice(first, last)
            at, thin = thinned(
                self.time[inside], np.array([read(inside) for read in lines.values()], dtype=float), points
            )
        else:
            at, thin = self._of_blocks(lines, first, last, blocks)
        return {"time": at} | {key[0]: values for key, values in zip(lines, thin, strict=True)}

    def _lines(self, node: str, models: Mapping[str, str]) -> dict[_Key, _Read]:
        """The lines of a node, by their name on the page and what else distinguishes them."""
        row = self._row(node)
        measured = self.measured[row].__getitem__
        lines: dict[_Key, _Read] = {("measured", node): measured}
        for name, of in models.items():
            if of in self.predicted:
                lines[name, node, of] = read = self.predicted[of][row].__getitem__
                lines[f"error {name}", node, of] = _difference(read, measured)
        lines |= {(name,): self.inputs[name].__getitem__ for name in self.inputs_of(node)}
        if self.spread is not None and models.get("now") in self.predicted:
            now, time, wide = self.predicted[models["now"]][row], self.spread.time, WIDE * self.spread.size[row]
            lines["now low", node] = _difference(now.__getitem__, self._between(time, wide))
            lines["now high", node] = _difference(now.__getitem__, self._between(time, -wide))
        if self.heat is not None and node in self.heat.nodes:
            place = self.heat.nodes.index(node)
            heat, band = self.heat.heat[place], self.heat.band[place]
            for name, values in (("heat", heat), ("heat low", heat - band), ("heat high", heat + band)):
                lines[name, node] = self._between(self.heat.time, values)
        return lines

    def _signals(self, names: Sequence[str], models: Mapping[str, str]) -> dict[_Key, _Read]:
        """Lines of several nodes, and inputs, by their own names and what else distinguishes them."""
        lines: dict[_Key, _Read] = {}
        for name in names:
            if name in self.inputs:
                lines[name,] = self.inputs[name].__getitem__
                continue
            quantity, _, node = name.partition(".")
            of_node = self._lines(node, models).items()
            found = {(name, *key): read for key, read in of_node if key[0] == _OF_NODES.get(quantity)}
            if not found:
                raise InputError("plot", "signal", name, f"an input, or {', '.join(_OF_NODES)} of a node")
            lines |= found
        return lines

    def _between(self, time: FloatArray, values: FloatArray) -> _Read:
        """A line at other times than the run's readings, interpolated; NaN outside of them."""
        return lambda at: np.interp(self.time[at], time, values, left=np.nan, right=np.nan)

    def _of_blocks(
        self, lines: Mapping[_Key, _Read], first: int, last: int, most: int
    ) -> tuple[FloatArray, FloatArray]:
        """Lines through the extremes of many blocks at a time, from the block that holds `first` on."""
        begin, end = first // _BLOCK, -(-(last - 1) // _BLOCK)
        edges = np.linspace(begin, end, min(most, end - begin) + 1).astype(int)
        low, high = np.stack([self._kept(key, read) for key, read in lines.items()], axis=1)[:, :, :end]
        return joined(
            self.time,
            lambda index: np.array([read(index[1]) for read in lines.values()], dtype=float),
            np.minimum(edges * _BLOCK, self.time.size - 1),
            np.fmin.reduceat(low, edges[:-1], axis=1),
            np.fmax.reduceat(high, edges[:-1], axis=1),
        )

    def _kept(self, key: _Key, read: _Read) -> FloatArray:
        """The smallest and the largest value of each block of a line, all but its last reading; looked for once."""
        if key not in self._extremes:
            values = read(slice(0, self.time.size - 1))
            starts = np.arange(0, values.size, _BLOCK)
            self._extremes[key] = np.stack([np.fmin.reduceat(values, starts), np.fmax.reduceat(values, starts)])
        return self._extremes[key]


def _difference(one: _Read, other: _Read) -> _Read:
    return lambda at: one(at) - other(at)


def packed(windows: Mapping[str, Mapping[str, FloatArray]]) -> bytes:
    """Lines of several nodes as a page reads them without parsing numbers.

    A line of JSON says by node which lines follow and how many values each has; then come the values, as 64-bit numbers
    with the least byte first, from a multiple of 8 bytes on.
    """
    head = {node: [list(lines), lines["time"].size] for node, lines in windows.items()}
    text = json.dumps(head).encode()
    values = [np.asarray(line, dtype="<f8").tobytes() for lines in windows.values() for line in lines.values()]
    return b"".join([text, b" " * (-(len(text) + 1) % 8), b"\n", *values])
