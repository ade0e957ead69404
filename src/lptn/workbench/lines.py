"""Lines for plots: what was measured and predicted of one node in one run, thinned without losing a peak."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.lines import thinned
from lptn.diagnose.unexplained_heat import UnexplainedHeat
from lptn.identify.comparison import Prediction

_MARGIN = 1  # readings beyond a window on either side, so that a line runs to the plot's edge


@dataclass(frozen=True)
class Attempt:
    """What a run would look like with an answer added.

    Args:
        time: s, (m,), in the steps of a search.
        readings: degC, (nodes, m).
        linearised: to first order; else the answer was refitted.
    """

    time: FloatArray
    readings: FloatArray
    linearised: bool


@dataclass(frozen=True)
class RunLines:
    """All that plots of one run show.

    Args:
        nodes: the model's nodes.
        time: s in the log's clock, (n,).
        measured: degC, (nodes, n), NaN where missing.
        inputs: the log's other columns, (n,) each.
        predicted: degC, (nodes, n), by what names the model.
        attempts: by answer.
        heat: unexplained heat, where it was worked out.
    """

    nodes: tuple[str, ...]
    time: FloatArray
    measured: FloatArray
    inputs: Mapping[str, FloatArray]
    predicted: Mapping[str, FloatArray] = field(default_factory=dict)
    attempts: Mapping[str, Attempt] = field(default_factory=dict)
    heat: UnexplainedHeat | None = None

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

    def with_answers(self, attempts: Mapping[str, Attempt], heat: UnexplainedHeat | None) -> RunLines:
        """The same with what a diagnosis says, in place of what an older one said."""
        return replace(self, attempts=attempts, heat=heat)

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
        node: str,
        models: Mapping[str, str],
        start: float | None = None,
        stop: float | None = None,
        points: int = 1500,
        attempt: str = "",
    ) -> dict[str, list[float | None]]:
        """The lines of one node from `start` to `stop` [s], all at the same times.

        Args:
            node: its name.
            models: which lines to show: names on the page, with the models' names.
            start: s; the run's begin by default.
            stop: s; the run's end by default.
            points: at most about so many.
            attempt: an answer whose line is wanted besides.

        Raises:
            InputError: no such node.
        """
        row = self._row(node)
        first = 0 if start is None else max(int(np.searchsorted(self.time, start)) - _MARGIN, 0)
        last = self.time.size if stop is None else int(np.searchsorted(self.time, stop, side="right")) + _MARGIN
        inside = slice(min(first, self.time.size - 1), max(last, first + 1))
        time, measured = self.time[inside], self.measured[row, inside]
        columns = {"measured": measured}
        lines = {name: self.predicted[model][row, inside] for name, model in models.items() if model in self.predicted}
        if attempt in self.attempts:
            tried = self.attempts[attempt]
            lines["attempt"] = np.interp(time, tried.time, tried.readings[row])
        for name, readings in lines.items():
            columns |= {name: readings, f"error {name}": readings - measured}
        columns |= {name: self.inputs[name][inside] for name in self.inputs_of(node)}
        if self.heat is not None and node in self.heat.nodes:
            place = self.heat.nodes.index(node)
            heat, band = self.heat.heat[place], self.heat.band[place]
            for name, values in (("heat", heat), ("heat low", heat - band), ("heat high", heat + band)):
                columns[name] = np.interp(time, self.heat.time, values, left=np.nan, right=np.nan)
        at, thin = thinned(time, np.array(list(columns.values()), dtype=float), points)
        return {"time": np.round(at, 3).tolist()} | {
            name: _plain(values) for name, values in zip(columns, thin, strict=True)
        }


def _plain(values: FloatArray) -> list[float | None]:
    """Six digits, which no screen exceeds; `None` for what is missing."""
    missing = ~np.isfinite(values)
    known = np.where(missing | (values == 0), 1.0, values)
    places = 5 - np.floor(np.log10(np.abs(known)))
    exact = np.abs(places) < 300  # beyond, a power of ten is no double any more
    scale = 10.0 ** np.where(exact, places, 0.0)
    shown: list[float | None] = np.where(exact, np.round(values * scale) / scale, values).tolist()
    for k in np.flatnonzero(missing):
        shown[int(k)] = None
    return shown
