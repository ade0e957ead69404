"""A step: a fitted model, and the effect that it has beyond the model before it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import erf, sqrt

import pandas as pd

from lptn.basics.parameters import Parameter, ParameterInstance, Setting
from lptn.basics.places import EVERYWHERE
from lptn.basics.tables import Tabular
from lptn.identify.comparison import Errors
from lptn.identify.data import DataSplit
from lptn.identify.fitting import Fit
from lptn.identify.validation import holdout_errors
from lptn.model.network import EffectDeclaration

Key = tuple[str, str]
"""Effect and place, such as `("sensor_offset", "FR_calf")`; `"FR_calf@monday"` for an effect in one run only."""
NOTHING: Key = ("", "")
"""The answer that nothing is missing."""
Report = Callable[[str], None]
"""Called with a sentence about the current work."""


LIKELY = 0.5
"""The probability from which an answer is likelier than all others together."""


def named(key: Key) -> str:
    """An effect and its place, as the library's own sentences have it."""
    return f"{key[0]} at {key[1]}"


def is_structure(declared: EffectDeclaration) -> bool:
    """Whether an effect is what all parts have in common, or two parts that touch, and no deviation of one."""
    if declared.run or declared.difference or declared.effect.measurement_error:
        return False
    return declared.at == EVERYWHERE or (declared.effect.common and declared.effect.site == "edge")


@dataclass(frozen=True, eq=False, repr=False)
class Step(Tabular):
    """A fitted model, and the effect that it has beyond the model before it.

    A candidate that was refitted is a step that could be taken; a history is made of the steps that were.

    Args:
        fit: of the model with the effect.
        declaration: the effect as added; `None` for the model as given.
        log_odds: logarithm of the odds that it is missing to that nothing is, beside all else in the model.
        probability: that it is missing, beside all else in the model, and not another candidate, or nothing.
        at_its_place: probability that anything is missing there, by whatever name.
        indistinguishable: candidates that the fitted data can't tell from it.
        holdout: errors on held-out runs as they were logged, `None` without any.
        test: errors on runs that chose nothing, `None` without any.
    """

    fit: Fit
    declaration: EffectDeclaration | None = None
    log_odds: float = 0.0
    probability: float = 0.0
    at_its_place: float = 0.0
    indistinguishable: tuple[Key, ...] = ()
    holdout: Errors | None = None
    test: Errors | None = None

    @property
    def effect(self) -> str | None:
        """Key of the effect, `None` for the model as given."""
        return self.declaration.effect.key if self.declaration else None

    @property
    def at(self) -> str | None:
        """Its place, with the run if it acts in one only."""
        return self.declaration.where if self.declaration else None

    @property
    def key(self) -> Key:
        """Effect and place, empty for the model as given."""
        return self.effect or "", self.at or ""

    @property
    def is_structure(self) -> bool:
        """Whether it is what all parts have in common, or two parts that touch, and no deviation of one."""
        return self.declaration is not None and is_structure(self.declaration)

    def with_setting(self, key: str, setting: Setting) -> Step:
        """The step, its effect declared with what is set of its parameter of this key, at all its places."""
        assert self.declaration is not None
        resolved = self.declaration.resolved
        parameters = tuple(setting.of(parameter) if name == key else parameter for name, parameter in resolved.items())
        return replace(self, declaration=replace(self.declaration, parameters=parameters))

    @property
    def amplitude(self) -> ParameterInstance | None:
        """The effect's fitted amplitude; `None` for the model as given, and for an effect without one."""
        return self._fitted(self.declaration.effect.amplitude() if self.declaration else None)

    @property
    def size_parameter(self) -> ParameterInstance | None:
        """The fitted parameter that states the size of the effect: its amplitude, or, where that only says whether the
        effect is there, its time constant or other shape; `None` as for `amplitude`.
        """
        return self._fitted(self.declaration.effect.size() if self.declaration else None)

    @property
    def told_from_none(self) -> float:
        """The probability, by the fit's standard error, that the size is not none; 1 for an effect without a size."""
        size = self.size_parameter
        if size is None or not (error := self.fit.standard_errors.get(size.name)):
            return 1.0
        return erf(abs(size.value - (size.declared.off or 0.0)) / error / sqrt(2.0))

    def _fitted(self, parameter: Parameter | None) -> ParameterInstance | None:
        """A parameter of the effect as it was fitted."""
        if self.declaration is None or parameter is None:
            return None
        return self.fit.model.named.get(self.declaration.shared_name(parameter.name))

    @property
    def likely(self) -> bool:
        """Whether it is missing more probably than not, whichever of its names is right."""
        return max(self.probability, self.at_its_place) >= LIKELY

    @property
    def parameters(self) -> int:
        """Number of free parameters of the model."""
        return len(self.fit.free)

    @property
    def summary(self) -> str:
        """Effect, place and errors in one line."""
        what = named(self.key) if self.declaration else "as given"
        rmse = {"fitted": self.fit.rmse}
        rmse |= {"held out": self.holdout.rmse} if self.holdout else {}
        rmse |= {"test": self.test.rmse} if self.test else {}
        errors = ", ".join(f"{value:.3g} K {data}" for data, value in rmse.items())
        return f"{what}, {self.parameters} parameters, RMSE {errors}"

    def to_pandas(self) -> pd.DataFrame:
        """The model's parameters, as `Fit.to_pandas` gives them."""
        return self.fit.to_pandas()

    @property
    def declarations(self) -> list[EffectDeclaration]:
        """The effect as a list, empty for the model as given."""
        return [self.declaration] if self.declaration else []

    def judged_on(self, data: DataSplit) -> Step:
        """The step with its errors on held-out and test runs, as they were logged: only their starts are fitted."""
        return replace(self, holdout=holdout_errors(self.fit, data.holdout), test=holdout_errors(self.fit, data.test))
