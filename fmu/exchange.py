"""An FMU for Model Exchange: its rates and outputs for a time, states and inputs, for a solver outside."""

from __future__ import annotations

import ctypes
from collections.abc import Mapping
from typing import Any

import numpy as np

from lptn.basics.arrays import FloatArray

from .archive import Unpacked
from .session import Session

_Doubles = ctypes.POINTER(ctypes.c_double)


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
        self._states, self._rates = (array.ctypes.data_as(_Doubles) for array in (self.states, self.rates))
        self._call(self._fmu.getContinuousStates, self._states, count)
