"""FMUs connected by a system's file and driven as one."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError

from .session import Session
from .ssp import OpenedSystem, in_units_of
from .variables import to_column


class Connected:
    """A system of FMUs for Co-Simulation, initialised and ready to step: what `Session` is to one FMU.

    Inputs and outputs are called `component.variable`. At each communication point every input takes the value that the
    output it is connected to has there, and holds it over the step (what co-simulation calls a Jacobi master): the
    exchange lags by a step, so its error falls in proportion to the step. Inputs that nothing drives are the system's.

    Args:
        path: an `.ssd` or `.ssp` file.
        start: start time [s].
        trust: `True` to run the native code of FMUs that were not exported on this machine.

    Raises:
        InputError: the system or an FMU can't be used, or is not trusted.
        FmuError: an FMU refuses a start value.
    """

    def __init__(self, path: str | Path, *, start: float = 0.0, trust: bool = False) -> None:
        self.path, self.time = Path(path), start
        with ExitStack() as stack:
            opened = OpenedSystem(path)
            stack.callback(opened.close)
            self.structure = opened.structure
            self._sessions: dict[str, Session] = {}
            for name, file in opened.structure.components.items():
                session = stack.enter_context(Session(file, start=start, trust=trust))
                self._sessions[name] = session
            self._parameters = {
                name: in_units_of(opened.structure.values.get(name, {}), session.unpacked, self.path)
                for name, session in self._sessions.items()
            }
            self._wire()
            self._closing = stack.pop_all()
        self.reset(start=start)

    def _wire(self) -> None:
        """Places of all inputs and outputs in the sessions' arrays, and the connections between them."""
        driven = {connection.end for connection in self.structure.connections if connection.start[0]}
        self.variables: dict[str, Any] = {}
        self._inputs: list[tuple[Session, int]] = []
        self._outputs: list[tuple[Session, int]] = []
        self.input_names: list[str] = []
        self.output_names: list[str] = []
        for component, session in self._sessions.items():
            for row, name in enumerate(session.input_names):
                if (component, name) not in driven:
                    self.input_names.append(f"{component}.{name}")
                    self._inputs.append((session, row))
            for row, name in enumerate(session.output_names):
                self.output_names.append(f"{component}.{name}")
                self._outputs.append((session, row))
            self.variables |= {f"{component}.{name}": each for name, each in session.variables.items()}
        self._wires = []
        for connection in self.structure.connections:
            (source, output), (target, entrance) = connection.start, connection.end
            if not (source and target):
                continue  # a connector of the system itself, which `inputs` and `outputs` already show
            start, end = self._sessions[source], self._sessions[target]
            for session, names, name, kind in (
                (start, start.output_names, output, "an output"),
                (end, end.input_names, entrance, "an input"),
            ):
                if name not in names:
                    raise InputError(self.path, "Connections", f'"{name}"', f"{kind} of {session.path.name}")
            places = start.output_names.index(output), end.input_names.index(entrance)
            self._wires.append((start, places[0], end, places[1], connection.factor, connection.offset))
        self.inputs, self.outputs = np.zeros(len(self._inputs)), np.zeros(len(self._outputs))

    def column(self, name: str) -> str:
        """The log column of an input or output: that of the variable without its component."""
        component = next(each for each in self._sessions if name.startswith(f"{each}."))
        return to_column(name[len(component) + 1 :])

    def reset(self, values: Mapping[str, float] | None = None, start: float = 0.0) -> None:
        """Begin anew at the start values and those of the system's file, changed by `values`."""
        given = values or {}
        for component, session in self._sessions.items():
            own = {
                name.removeprefix(f"{component}."): value
                for name, value in given.items()
                if name.startswith(f"{component}.")
            }
            session.reset(self._parameters[component] | own, start=start)
        self._exchange()
        self.time = start
        self.inputs[:] = [session.inputs[row] for session, row in self._inputs]
        self._collect()

    def step(self, step: float, ramp_to: FloatArray | None = None) -> FloatArray:
        """Exchange, set `inputs`, make a step of every FMU, get `outputs`.

        Args:
            step: communication step [s].
            ramp_to: of no use here; inputs hold.

        Returns:
            `outputs`, shape (number of outputs,): the same array each time.

        Raises:
            FmuError: an FMU refuses an input or the step.
        """
        self._exchange()
        for (session, row), value in zip(self._inputs, self.inputs, strict=True):
            session.inputs[row] = value
        for session in self._sessions.values():
            session.step(step)
        self.time += step
        self._collect()
        return self.outputs

    def _exchange(self) -> None:
        for start, output, end, entrance, factor, offset in self._wires:
            end.inputs[entrance] = factor * start.outputs[output] + offset

    def _collect(self) -> None:
        for place, (session, row) in enumerate(self._outputs):
            self.outputs[place] = session.outputs[row]

    def close(self) -> None:
        """Free all instances and remove what was unpacked."""
        self._closing.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
