"""The thermal network as an FMU (FMI 3, Co-Simulation), stepped beside the simulator through fmpy."""

from __future__ import annotations

from pathlib import Path
from typing import Self

import numpy as np

from a1_task import JOINTS, FloatArray
from lptn.fmu import Session
from lptn.fmu.variables import to_column

ZERO_CELSIUS = 273.15  # K


class FmuThermal:
    """An FMU that `lptn.fmu.export` wrote; use it in a `with` statement.

    Args:
        path: the `.fmu` file.
        start: temperature of every node at the start [degC].
        limit: temperature that no joint may pass [degC].
        soft: where the limiter begins to act [degC].
    """

    def __init__(self, path: Path, start: float, limit: float, soft: float) -> None:
        read = [f"{joint}.temperature" for joint in JOINTS] + [f"{joint}.torque_scale" for joint in JOINTS]
        nodes = (*JOINTS, "pc")
        values = {f"{node}.temperature": start + ZERO_CELSIUS for node in nodes}
        values |= {f"{joint}.temperature_limit": limit + ZERO_CELSIUS for joint in JOINTS}
        self.session = Session(path, outputs=read, values=values | {"limiter.band": limit - soft})
        self.columns = [to_column(name) for name in self.session.input_names]
        self._shift = ZERO_CELSIUS * np.array([column.startswith("temperature.") for column in self.columns])
        # The other heat flows, "What … adds to …", are shares of these.
        self._flows = [
            name
            for name, variable in self.session.variables.items()
            if name.endswith(".heat_flow") and variable.description.startswith("Heat that")
        ]

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.session.close()

    def advance(self, inputs: FloatArray, dt: float) -> None:
        """Go on by `dt` seconds with the inputs held, in the order of `columns`."""
        np.add(inputs, self._shift, out=self.session.inputs)
        self.session.step(dt)

    @property
    def temperature(self) -> FloatArray:
        """Temperature of each joint [degC], shape (12,)."""
        return np.asarray(self.session.outputs[:12] - ZERO_CELSIUS)

    @property
    def scale(self) -> FloatArray:
        """Share of the peak torque that the FMU's thermal limiter allows each joint, shape (12,)."""
        return np.array(self.session.outputs[12:])

    def heat(self, node: str) -> dict[str, float]:
        """What warms a node and what cools it at this moment [W], by effect and link; the sum is C·dT/dt."""
        flows: dict[str, float] = {}
        for name, value in zip(self._flows, self.session.read(self._flows).tolist(), strict=True):
            place, middle, _ = name.split(".")
            if place == node:
                flows[middle] = -value if "to_" in middle else value
            elif middle.endswith(f"to_{node}"):
                flows[f"from_{place}"] = value
        return flows
