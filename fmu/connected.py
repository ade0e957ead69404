"""FMUs connected by a system's file and driven as one: integrated together, or step by step side by side."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import AbstractContextManager, ExitStack, closing
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError

from .archive import Unpacked
from .session import Exchange, Session
from .ssp import Wiring, dotted, in_units_of, opened_system
from .variables import UnitDefinition, to_column


@dataclass(frozen=True)
class _Place:
    """A component's variable, which is `factor` times an input or output of the system plus `offset`."""

    component: str
    variable: str
    factor: float = 1.0
    offset: float = 0.0


class Connected(AbstractContextManager["Connected"]):
    """A system of FMUs for Co-Simulation, initialised and ready to step: what `Session` is to one FMU.

    Inputs and outputs are called `component.variable`, or as the system's own connector for them. Inputs that nothing
    drives are the system's.

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
            self._wire()
            self._bind()
            self._closing = stack.pop_all()
        self.reset(start=start)

    def _wire(self) -> None:
        """What the system's inputs and outputs are in its components, and the connections between these."""
        sessions = self._sessions
        opened = {name: session.unpacked for name, session in sessions.items()}
        self._wiring = Wiring(self.structure, opened, self.path)
        origins = self._wiring.origins
        for (component, name), *_ in origins.values():
            if component in sessions and name not in sessions[component].output_names:
                raise InputError(self.path, "Connections", dotted(component, name), "a number, and no forecast")
        driven: dict[str, list[_Place]] = {}
        shown: dict[str, list[_Place]] = {}
        self._wires: list[tuple[Session, int, Session, int, float, float]] = []
        for component, session in sessions.items():
            for row, name in enumerate(session.input_names):
                end = component, name
                origin, factor, offset = origins.get(end, (end, 1.0, 0.0))
                if origin[0] in sessions and origin != end:
                    start = sessions[origin[0]]
                    self._wires.append((start, start.output_names.index(origin[1]), session, row, factor, offset))
                else:
                    driven.setdefault(dotted(*origin), []).append(_Place(component, name, factor, offset))
        for (system, name), (origin, factor, offset) in origins.items():
            if not system and origin[0] in sessions:
                shown[name] = [_Place(*origin, 1 / factor, -offset / factor)]
        seen = {(place.component, place.variable) for places in shown.values() for place in places}
        every = {
            f"{name}.{own}": [_Place(name, own)] for name, session in sessions.items() for own in session.variables
        }
        for name, session in sessions.items():
            shown |= {f"{name}.{own}": [_Place(name, own)] for own in session.output_names if (name, own) not in seen}
        self._places = every | driven | shown
        self.input_names, self.output_names = list(driven), list(shown)
        self.variables = {
            name: sessions[places[0].component].variables[places[0].variable] for name, places in self._places.items()
        }
        self._inputs = [(row, *self._row(place)) for row, name in enumerate(driven) for place in driven[name]]
        self._outputs = [self._row(place) for (place,) in shown.values()]
        self.inputs, self.outputs = np.zeros(len(driven)), np.zeros(len(shown))

    def _bind(self) -> None:
        """Parameters and start values of the components: bound to them, or to connectors of systems around them."""
        given, sessions = self.structure.values, self._sessions
        self._parameters = {
            name: in_units_of(given.get(name, {}), session.unpacked, self.path) for name, session in sessions.items()
        }
        for (element, name), (origin, factor, offset) in self._wiring.origins.items():
            value = given.get(origin[0], {}).get(origin[1])
            if element in sessions and origin[0] not in sessions and value is not None:
                unit = self._wiring.unit(origin)
                number = value.to(None if unit is None else unit.name, self.path, dotted(*origin))
                self._parameters[element][name] = factor * number + offset

    def _row(self, place: _Place) -> tuple[Session, int, float, float]:
        """Session and row of an input or output, with the place's factor and offset."""
        session = self._sessions[place.component]
        names = session.input_names if place.variable in session.input_names else session.output_names
        return session, names.index(place.variable), place.factor, place.offset

    def unit(self, name: str) -> UnitDefinition | None:
        """The unit of an input or output: that of the system's connector, or of the variable; `None`: not defined."""
        place = self._places[name][0]
        return self.structure.connectors.get(("", name)) or self._wiring.unit((place.component, place.variable))

    def column(self, name: str) -> str:
        """The log column of an input or output: that of the system's connector, or of the component's variable."""
        variable = self._places[name][0]
        return to_column(name if ("", name) in self.structure.connectors else variable.variable)

    def reset(self, values: Mapping[str, float] | None = None, start: float = 0.0) -> None:
        """Begin anew at the start values and those of the system's file, changed by `values`."""
        own = {name: dict(given) for name, given in self._parameters.items()}
        for name, value in (values or {}).items():
            for place in self._places[name]:
                own[place.component][place.variable] = place.factor * value + place.offset
        for name, session in self._sessions.items():
            session.reset(own[name], start=start)
        self.time = start
        self._exchange()
        if self.together:
            self._settle(self._exchanges)
        for entrance, session, row, factor, offset in self._inputs:
            self.inputs[entrance] = (session.inputs[row] - offset) / factor
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
        for place, session, row, factor, offset in self._inputs:
            session.inputs[row] = factor * self.inputs[place] + offset
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
        for place, (session, row, factor, offset) in enumerate(self._outputs):
            self.outputs[place] = (session.outputs[row] - offset) / factor

    def close(self) -> None:
        """Free all instances and remove what was unpacked."""
        self._closing.close()

    def __exit__(self, *_: object) -> None:
        self.close()
