"""An FMU driven through fmpy with arrays that are made once: set inputs, step, get outputs."""

from __future__ import annotations

import ctypes
from collections.abc import Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError

from .archive import Access, Unpacked, import_fmpy
from .variables import UnitDefinition, to_column


class FmuError(RuntimeError):
    """A call that the FMU refused, with the reason that it logged."""


class _Block:
    """Variables that are got or set in one call, by arrays that stay where they are from one call to the next.

    Args:
        access: the variables.
        values: theirs, one for each that was asked for.
    """

    def __init__(self, access: Access, values: FloatArray | None, instance: Any, fmi: int) -> None:
        self.places = access.places
        count = access.size if access.places is None else len(access.places)
        self.values = np.zeros(count) if values is None else values
        self._whole = self.values if access.places is None else np.zeros(access.size)
        references = (ctypes.c_uint32 * len(access.references))(*access.references)
        pointer = self._whole.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
        arguments = (instance, references, len(access.references), pointer)
        self.arguments = arguments if fmi == 2 else (*arguments, access.size)

    def scatter(self) -> None:
        """Bring the values to their places before they are set."""
        if self.places is not None:
            self._whole[self.places] = self.values

    def gather(self) -> None:
        """Take the values from their places after they were got."""
        if self.places is not None:
            self.values[:] = self._whole[self.places]


class Session(AbstractContextManager["Session"]):
    """One instance of an FMU for Co-Simulation, initialised and ready to step.

    Args:
        path: the FMU.
        inputs: names of the inputs to drive; all by default.
        outputs: names of the variables to read after each step; all outputs but the forecasts by default.
        values: start values of states, parameters and inputs by name, in the FMU's units (kelvin).
        start: start time [s].
        ramps: `True` to let `step` take inputs that go in straight lines.
        trust: `True` to run the native code of an FMU that was not exported on this machine.

    Raises:
        InputError: no usable FMU, an unknown name, no binary for this machine, or native code that is not trusted.
        FmuError: the FMU refuses a start value.
    """

    def __init__(
        self,
        path: str | Path,
        inputs: Sequence[str] | None = None,
        outputs: Sequence[str] | None = None,
        *,
        values: Mapping[str, float] | None = None,
        start: float = 0.0,
        ramps: bool = False,
        trust: bool = False,
    ) -> None:
        self.path, self.time, self.messages, self._ramps = Path(path), start, [""], ramps
        self._kept_alive: list[Any] = []  # what the FMU holds pointers to
        self._target: FloatArray | None = None  # of a straight line that is under way
        self._flags: tuple[Any, ...] = ()
        self._fmu: Any = None
        self.unpacked = Unpacked(self.path, trust)
        try:
            self._prepare(inputs, outputs)
            self._instantiate()
            self._begin(values or {})
        except BaseException:
            self.close()
            raise

    # --- stepping ------------------------------------------------------------------------------

    def step(self, step: float, ramp_to: FloatArray | None = None) -> FloatArray:
        """Set `inputs`, make a step, get `outputs`.

        Args:
            step: communication step [s].
            ramp_to: inputs at the end of the step, to which they go in a straight line; held by default.

        Returns:
            `outputs`, shape (number of outputs,): the same array each time.

        Raises:
            FmuError: the FMU refuses an input or the step.
        """
        self._entrances.scatter()
        self._call(self._set, *self._entrances.arguments)
        if ramp_to is not None:
            self._ramp(step, np.asarray(ramp_to, dtype=float))
        self._call(self._do, self._instance, self.time, step, True, *self._flags)
        self.time += step
        self._call(self._get, *self._exits.arguments)
        self._exits.gather()
        if ramp_to is not None:
            self._target = None
            self.inputs[:] = ramp_to
        return self.outputs

    def read(self, names: Iterable[str]) -> FloatArray:
        """Values of any variables, shape (number of names,), in the FMU's units."""
        return self._read(self._block(self.unpacked.access(names, "names")))

    def write(self, values: Mapping[str, float]) -> None:
        """Set variables: tunable parameters between steps, anything before the first.

        Raises:
            FmuError: the FMU refuses a value.
        """
        if values:
            block = self._block(self.unpacked.access(values, "values"))
            if block.places is not None:
                self._call(self._get, *block.arguments)  # elements of arrays that are not named keep their values
            block.values[:] = list(values.values())
            block.scatter()
            self._call(self._set, *block.arguments)

    def reset(self, values: Mapping[str, float] | None = None, start: float = 0.0) -> None:
        """Begin anew at the start values, changed by `values`."""
        self._call(self._fmu.reset)
        self.time = start
        self._begin(values or {})

    def close(self) -> None:
        """Free the instance and remove the unpacked files."""
        fmu, self._fmu = self._fmu, None
        if fmu is not None and getattr(fmu, "component", None):
            fmu.freeInstance()
        self.unpacked.close()

    def __exit__(self, *_: object) -> None:
        self.close()

    # --- loading -------------------------------------------------------------------------------

    @property
    def variables(self) -> dict[str, Any]:
        """fmpy's description of each variable by name."""
        return self.unpacked.variables

    def _prepare(self, inputs: Sequence[str] | None, outputs: Sequence[str] | None) -> None:
        unpacked = self.unpacked
        outputs_but_forecasts = [name for name in unpacked.names("output") if not name.endswith(".time_to_limit")]
        self.input_names = unpacked.names("input") if inputs is None else list(inputs)
        self.output_names = outputs_but_forecasts if outputs is None else list(outputs)
        self.inputs, self.outputs = np.zeros(len(self.input_names)), np.zeros(len(self.output_names))
        self._input_access = unpacked.access(self.input_names, "inputs")
        self._output_access = unpacked.access(self.output_names, "outputs")

    def _begin(self, values: Mapping[str, float]) -> None:
        self.write(values)
        if self._fmi == 2:
            self._call(self._fmu.setupExperiment, None, self.time)
            self._call(self._fmu.enterInitializationMode)
        else:
            self._call(self._fmu.enterInitializationMode, None, self.time)
        self._call(self._fmu.exitInitializationMode)
        self._read(self._entrances)
        self._read(self._exits)

    def _instantiate(self) -> None:
        fmpy = import_fmpy()
        description, self._fmi = self.unpacked.description, self.unpacked.fmi
        self.unpacked.check_binary(fmpy)
        library, identifier = self._library(fmpy)
        try:
            self._fmu = library(
                guid=description.guid,
                unzipDirectory=str(self.unpacked.folder),
                instanceName="lptn",
                modelIdentifier=identifier,
            )
            if self._fmi == 2:
                callbacks = fmpy.fmi2.fmi2CallbackFunctions()
                callbacks.logger = fmpy.fmi2.fmi2CallbackLoggerTYPE(self._logged)
                callbacks.allocateMemory = fmpy.fmi2.fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
                callbacks.freeMemory = fmpy.fmi2.fmi2CallbackFreeMemoryTYPE(fmpy.free)
                self._kept_alive.append(callbacks)
                self._fmu.instantiate(callbacks=callbacks, loggingOn=True)
            else:
                self._fmu.instantiate(loggingOn=True, logMessage=self._logged, **self._intermediate())
        except Exception as error:
            raise InputError(self.path, "binaries", str(error)[:200], "a library that loads") from error
        self._instance = self._fmu.component
        self._bind()

    def _library(self, fmpy: Any) -> tuple[Any, str]:
        """fmpy's class for the FMU, and the name of its library."""
        slave = fmpy.fmi2.FMU2Slave if self._fmi == 2 else fmpy.fmi3.FMU3Slave
        return slave, self.unpacked.description.coSimulation.modelIdentifier

    def _intermediate(self) -> dict[str, Any]:
        if not (self._ramps and getattr(self.unpacked.description.coSimulation, "providesIntermediateUpdate", False)):
            return {}
        return {
            "intermediateUpdate": self._update,
            "requiredIntermediateVariables": list(self._input_access.references),
        }

    def _bind(self) -> None:
        fmu = self._fmu
        if self._fmi == 2:
            self._set, self._get, self._do = fmu.fmi2SetReal, fmu.fmi2GetReal, getattr(fmu, "fmi2DoStep", None)
        else:
            flags: list[Any] = [ctypes.c_bool(), ctypes.c_bool(), ctypes.c_bool(), ctypes.c_double()]
            self._kept_alive.append(flags)
            self._set, self._get, self._do = fmu.fmi3SetFloat64, fmu.fmi3GetFloat64, getattr(fmu, "fmi3DoStep", None)
            self._flags = tuple(ctypes.byref(flag) for flag in flags)
        self._entrances = self._block(self._input_access, self.inputs)
        self._exits = self._block(self._output_access, self.outputs)

    def _block(self, access: Access, values: FloatArray | None = None) -> _Block:
        return _Block(access, values, self._instance, self._fmi)

    def _read(self, block: _Block) -> FloatArray:
        self._call(self._get, *block.arguments)
        block.gather()
        return block.values

    def unit(self, name: str) -> UnitDefinition | None:
        """The unit of a variable; `None` where the FMU does not define it."""
        return self.unpacked.unit(name)

    def column(self, name: str) -> str:
        """The log column of a variable."""
        return to_column(name)

    # --- calls ---------------------------------------------------------------------------------

    def _call(self, function: Any, *arguments: Any) -> None:
        before = self.messages
        try:
            function(*arguments)
        except Exception as error:
            reason = "" if self.messages is before else self.messages[-1]  # not what was logged of an earlier call
            raise FmuError(reason or str(error)) from error

    def _logged(self, *message: Any) -> None:
        """Keep what the FMU logs: environment, instance (FMI 2 alone), status, category, text."""
        self.messages = [*self.messages[-99:], (message[-1] or b"").decode("utf-8", "replace").strip()]

    def _ramp(self, step: float, target: FloatArray) -> None:
        slopes = (target - self.inputs) / step
        if self._fmi == 2:
            n = len(slopes)
            references, orders = (ctypes.c_uint32 * n)(*self._input_access.references), (ctypes.c_int * n)(*[1] * n)
            pointer = slopes.ctypes.data_as(ctypes.POINTER(ctypes.c_double))
            self._call(self._fmu.fmi2SetRealInputDerivatives, self._instance, references, n, orders, pointer)
        elif not self._intermediate():
            raise InputError(self.path, "ramp_to", "a session without ramps", "ramps=True and an FMU that takes them")
        else:
            self._from, self._slopes, self._target = self.inputs.copy(), slopes, target

    def _update(self, environment: Any, time: float, asked: bool, *_: Any) -> None:
        """FMI 3: the inputs at an intermediate time, where a ramp is under way."""
        if asked and self._target is not None:
            self.inputs[:] = self._from + self._slopes * (time - self.time)
            self._entrances.scatter()
            self._set(*self._entrances.arguments)


class Exchange(Session):
    """One instance of an FMU for Model Exchange, in continuous-time mode; there it is `Session` without `step`."""

    states: FloatArray
    """Continuous states, shape (number of states,): those that the rates were last calculated for."""
    rates: FloatArray
    """Their rates [1/s], shape (number of states,)."""

    @staticmethod
    def serves(unpacked: Unpacked) -> bool:
        """Whether an FMU is for Model Exchange too and has no state events, which a plain solver steps over."""
        description = unpacked.description
        indicators = description.numberOfEventIndicators or getattr(description, "eventIndicators", None)
        return description.modelExchange is not None and not indicators

    def at(self, time: float, states: FloatArray) -> None:
        """Go to a time and states."""
        self.states[:] = states
        self._call(self._fmu.setTime, time)
        self._call(self._fmu.setContinuousStates, self._states, self.states.size)

    def set_inputs(self) -> None:
        """Give the FMU its `inputs`."""
        self._entrances.scatter()
        self._call(self._set, *self._entrances.arguments)

    def read_outputs(self) -> FloatArray:
        """Get `outputs`."""
        return self._read(self._exits)

    def read_rates(self) -> FloatArray:
        """Get `rates`."""
        get = self._fmu.getDerivatives if self._fmi == 2 else self._fmu.getContinuousStateDerivatives
        self._call(get, self._rates, self.rates.size)
        return self.rates

    def _library(self, fmpy: Any) -> tuple[Any, str]:
        model = fmpy.fmi2.FMU2Model if self._fmi == 2 else fmpy.fmi3.FMU3Model
        return model, self.unpacked.description.modelExchange.modelIdentifier

    def _begin(self, values: Mapping[str, float]) -> None:
        super()._begin(values)
        again = True
        while again:
            again = bool((self._fmu.newDiscreteStates if self._fmi == 2 else self._fmu.updateDiscreteStates)()[0])
        self._call(self._fmu.enterContinuousTimeMode)
        count = len(self.unpacked.description.derivatives)
        if self._fmi == 3:
            number = ctypes.c_size_t()
            self._call(self._fmu.fmi3GetNumberOfContinuousStates, self._instance, ctypes.byref(number))
            count = number.value
        self.states, self.rates = np.zeros(count), np.zeros(count)
        doubles = ctypes.POINTER(ctypes.c_double)
        self._states, self._rates = (array.ctypes.data_as(doubles) for array in (self.states, self.rates))
        self._call(self._fmu.getContinuousStates, self._states, count)
