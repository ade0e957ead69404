"""What differs from log to log and is no part of the robot: granted to a fit, so that no effect stands in for it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from lptn.diagnose.candidates import separate_runs
from lptn.effects.ambient_offset import AmbientOffset
from lptn.evidence import Evidence
from lptn.model import Model
from lptn.network import EffectDeclaration
from lptn.places import is_of_run


def with_ambient_errors(model: Model, data: Evidence, spread: float) -> Model:
    """The model, granted an error of the ambient sensor in each run.

    An error of half a kelvin in each run moves all nodes for hours; without this, constant heat or a sensor's offset
    in one run is named for it, and a held-out run judges its own sensor in place of the model. Errors of fitted runs
    are fitted with the rest; those of other runs whenever one is predicted. One run alone has no error that differs.

    Args:
        model: the model.
        data: whose runs are granted errors.
        spread: their standard deviation [K]; 0 grants none.
    """
    fitted = [part.run.name for part in data.fit]
    runs = separate_runs([*fitted, *(part.run.name for part in (*data.holdout, *data.proof))])
    if spread <= 0 or not runs:
        return model
    places = [name for name, source in model.network.prescribed.items() if not isinstance(source, int)]
    (offset,) = AmbientOffset.parameters
    free = replace(offset, value=0.0, prior=spread)
    held = replace(free, fixed=True)
    granted = [
        EffectDeclaration(AmbientOffset(), place, (free if _is_one_of(run, fitted) else held,), run=run)
        for place in places
        for run in runs
    ]
    return Model(model.network.with_effects(granted))


def _is_one_of(run: str, names: Sequence[str]) -> bool:
    return any(is_of_run(name, run) for name in names)
