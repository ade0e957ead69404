"""What differs from log to log and is no part of the robot: granted to a fit, so that no effect stands in for it."""

from __future__ import annotations

from dataclasses import replace

from lptn.diagnose.candidates import separate_runs
from lptn.effects.ambient_offset import AmbientOffset
from lptn.evidence import Evidence
from lptn.model import Model
from lptn.network import EffectDeclaration


def with_ambient_errors(model: Model, data: Evidence, spread: float) -> Model:
    """The model, granted an error of the ambient sensor in each fitted run.

    An error of half a kelvin in each run moves all nodes for hours; without this, constant heat or a sensor's offset
    in one run is named for it. One run alone has no error that differs.

    Args:
        model: the model.
        data: whose fitted runs are granted errors.
        spread: their standard deviation [K]; 0 grants none.
    """
    runs = separate_runs([part.run.name for part in data.fit])
    if spread <= 0 or len(runs) < 2:
        return model
    places = [name for name, source in model.network.prescribed.items() if not isinstance(source, int)]
    (offset,) = AmbientOffset.parameters
    free = replace(offset, value=0.0, prior=spread)
    granted = [EffectDeclaration(AmbientOffset(), place, (free,), run=run) for place in places for run in runs]
    return Model(model.network.with_effects(granted))
