"""One forward selection that finds missing heat, one that finds nothing."""

from __future__ import annotations

import pytest

from lptn.basics.parameters import Parameter
from lptn.diagnose.improvement import improve
from lptn.effects.constant_heat import ConstantHeat
from lptn.identify.data import split_data
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration
from tests.report.two_joints import NODES, Told, make_run, robot


def _told(truth: Model) -> Told:
    first, second, third = (make_run(truth, seed, name) for seed, name in ((1, "one"), (2, "two"), (3, "three")))
    data = split_data([first], [second], [third])
    return improve(robot(), data), data


@pytest.fixture(scope="session")
def missing() -> Told:
    """The truth has constant heat at the first joint."""
    heat = Parameter("power", 3.0, "W", (0.0, 100.0), off=0.0)
    return _told(robot(EffectDeclaration(ConstantHeat(), NODES[0], (heat,))))


@pytest.fixture(scope="session")
def adequate() -> Told:
    """The model is the truth."""
    return _told(robot())
