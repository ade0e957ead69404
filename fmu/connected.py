"""FMUs connected by a system's file and driven as one: integrated together, or step by step side by side."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager, ExitStack, closing
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError

from .archive import Unpacked
from .session import Exchange, Session
from .ssp import in_units_of, opened_system
from .variables import to_column


class Connected(AbstractContextManager["Connected"]):
    """A system of FMUs for Co-Simulation, initialised and ready to step: what `Session` is to one FMU.

    Inputs and outputs are called `component.variable`. Inputs that nothing drives are the system's.

    FMUs that are all for Model Exchange are one system of equations: a solver outside asks each for its rates, and
    every connection holds at every instant, so together they are what one model would be. FMUs for Co-Simulation
    alone, or with events, step side by side: at each communication point an input takes the value that the output
    it is connected to has there, and holds it over the step (what co-simulation calls a Jacobi master). The exchange
    then lags by a step, and its error falls in proportion to the step.

    Args:
        path: an `.ssd` or `.ssp` file.
        start: start time [s].
        held: `True` to let the exchange hold over a step in any case, which takes a tenth of the time.
        trust: `True` to run the native code of FMUs that were not exported on this machine.

    Raises:
        InputError: the system or an FMU can't be used, or is not trusted.
        FmuError: an FMU refuses a start value.
    """

    def __init__(self, path: str | Path, *, start: float = 0.0, held: bool = False, trust: bool = False) -> None:
        self.path, self.time = Path(path), start
        with ExitStack() as stack:
            self.structure = stack.enter_context(opened_system(path))
            files = self.structure.components
            self.together = not held
            for file in files.values():
                if self.together:
                    with closing(Unpacked(file, trust)) as unpacked:
                        self.together = Exchange.serves(unpacked)
            kind = Exchange if self.together else Session
            self._sessions: dict[str, Session] = {}
            for name, file in files.items():
                self._sessions[name] = stack.enter_context(kind(file, start=start, trust=trust))
            self._parameters = {
                name: in_units_of(self.structure.values.get(name, {}), session.unpacked, self.path)
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
            self.variables |= {f"{component}.{name}": variable for name, variable in session.variables.items()}
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
        component = next(prefix for prefix in self._sessions if name.startswith(f"{prefix}."))
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
        self.time = start
        self._exchange()
        if self.together:
            self._settle(self._exchanges)
        self.inputs[:] = [session.inputs[row] for session, row in self._inputs]
        self._collect()

    def step(self, step: float, ramp_to: FloatArray | None = None) -> FloatArray:
        """Set `inputs`, go on by a step, get `outputs`.

        Args:
            step: communication step [s].
            ramp_to: of no use here; inputs hold.

        Returns:
            `outputs`, shape (number of outputs,): the same array each time.

        Raises:
            FmuError: an FMU refuses an input or the step.
            InputError: inputs and outputs depend on each other in a loop without a state.
        """
        for (session, row), value in zip(self._inputs, self.inputs, strict=True):
            session.inputs[row] = value
        if self.together:
            self._integrate(step)
        else:
            self._exchange()
            for session in self._sessions.values():
                session.step(step)
        self.time += step
        self._collect()
        return self.outputs

    @property
    def _exchanges(self) -> list[Exchange]:
        return [session for session in self._sessions.values() if isinstance(session, Exchange)]

    def _integrate(self, step: float) -> None:
        """All FMUs as one system of equations, over a step."""
        fmus = self._exchanges
        ends = np.cumsum([fmu.states.size for fmu in fmus])[:-1]

        def rates(time: float, states: FloatArray) -> FloatArray:
            for fmu, own in zip(fmus, np.split(states, ends), strict=True):
                fmu.at(time, own)
            self._settle(fmus)
            return np.concatenate([fmu.read_rates() for fmu in fmus])

        begin = np.concatenate([fmu.states for fmu in fmus])
        end = self.time + step
        # Two models that exchange temperatures near 300 K are one to 1e-9 K.
        done = solve_ivp(rates, (self.time, end), begin, method="DOP853", rtol=1e-12, atol=1e-11)
        if not done.success:
            raise InputError(self.path, "step", str(done.message), "a system that a solver can follow")
        rates(end, done.y[:, -1])

    def _settle(self, fmus: list[Exchange]) -> None:
        """Exchange until every input is the output that it is connected to: at most once through all FMUs."""
        for _ in range(len(fmus) + 1):
            for fmu in fmus:
                fmu.set_inputs()
                fmu.read_outputs()
            before = [fmu.inputs.copy() for fmu in fmus]
            self._exchange()
            if all((fmu.inputs == old).all() for fmu, old in zip(fmus, before, strict=True)):
                return
        expected = "a state in each loop, or held=True"
        raise InputError(self.path, "Connections", "outputs that depend on themselves at once", expected)

    def _exchange(self) -> None:
        for start, output, end, entrance, factor, offset in self._wires:
            end.inputs[entrance] = factor * start.outputs[output] + offset

    def _collect(self) -> None:
        for place, (session, row) in enumerate(self._outputs):
            self.outputs[place] = session.outputs[row]

    def close(self) -> None:
        """Free all instances and remove what was unpacked."""
        self._closing.close()

    def __exit__(self, *_: object) -> None:
        self.close()
