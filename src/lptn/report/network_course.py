"""Temperatures and heat flows of a network over a run, for drawings of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.identify.comparison import Comparison, Prediction
from lptn.model.model import Model
from lptn.model.network import Network
from lptn.report.network_drawing import Drawing, draw_network, heat_flows

_MOST_MOMENTS = 400  # of a run; the plot above the drawing is about a thousand pixels wide


@dataclass(frozen=True)
class NetworkCourse:
    """What a model predicts of a run.

    Args:
        network: the model's.
        time: s in the log's clock, shape (k,).
        temperatures: degC by node, prescribed ones too, shape (k,) each.
        flows: W by link and effect as `heat_flows` gives them, shape (k,) each.
    """

    network: Network
    time: FloatArray
    temperatures: Mapping[str, FloatArray]
    flows: Mapping[str, FloatArray]

    @classmethod
    def of(cls, model: Model, prediction: Prediction) -> NetworkCourse:
        """From the prediction of a run."""
        run, count = prediction.segment.run, prediction.bound.inputs.shape[1]
        model = model.with_values(model.in_run(run.name, model.values))
        moments = np.unique(np.linspace(0, count - 1, min(count, _MOST_MOMENTS)).astype(int))
        states, inputs = prediction.states[:, moments], prediction.bound.inputs[:, moments]
        temperatures = dict(zip(model.nodes, states, strict=False))
        for name, source in model.network.prescribed.items():
            column = f"temperature.{name}" if source == "start" else source
            temperature = model.values[column] if isinstance(column, int) else inputs[model.inputs.index(column)]
            temperatures[name] = np.broadcast_to(temperature, moments.shape)
        return cls(model.network, run.time[moments], temperatures, heat_flows(model, states, inputs))

    @property
    def hottest(self) -> tuple[float, str, float]:
        """The highest temperature of a node [degC], the node, and when [s]."""
        nodes = list(self.network.dynamic)
        table = np.array([self.temperatures[name] for name in nodes])
        node, moment = np.unravel_index(int(np.argmax(table)), table.shape)
        return float(table[node, moment]), nodes[node], float(self.time[moment])

    def drawing(self, time: float) -> Drawing:
        """The network as SVG at the moment that is nearest to a time [s]."""
        moment = int(np.argmin(np.abs(self.time - time)))
        temperatures, flows = (
            {name: float(values[moment]) for name, values in table.items()} for table in (self.temperatures, self.flows)
        )
        return draw_network(self.network, temperatures, flows)


def hottest_moment(comparison: Comparison) -> tuple[Drawing, str]:
    """The network when a node of the compared runs is hottest, and that moment in words."""
    predictions = {prediction.segment.run.name: prediction for prediction in comparison.predictions}
    courses = {name: NetworkCourse.of(comparison.model, prediction) for name, prediction in predictions.items()}
    run = max(courses, key=lambda name: courses[name].hottest)
    _, node, time = courses[run].hottest
    elapsed = time - predictions[run].segment.run.origin
    return courses[run].drawing(time), f"at {elapsed:.0f} s of {run}, when {node} is hottest"
