"""What sets one part apart is told first, however it came into the model."""

from __future__ import annotations

from typing import Any, cast

import pytest

from lptn.diagnose.answers import Step
from lptn.diagnose.composition import Composition
from lptn.effects import effect_named
from lptn.identify.fitting import Fit
from lptn.model.network import EffectDeclaration

_FIT = cast("Fit", None)  # an order asks nothing of it


_EVIDENCE: Any = None  # nobody asks for it here


def _step(name: str) -> Step:
    key, _, at = name.partition(" ")
    return Step(_FIT, EffectDeclaration(effect_named(key, "test", "effect")(), at))


@pytest.mark.parametrize(
    ("findings", "structure", "told"),
    [
        ([], ["radiation *", "coulomb_friction tooth"], ["coulomb_friction tooth", "radiation *"]),
        (["sensor_offset *"], ["sensor_lag *"], ["sensor_offset *", "sensor_lag *"]),
        (["hot_spot hip"], ["conduction a~b", "iron_loss hip"], ["hot_spot hip", "iron_loss hip", "conduction a~b"]),
        (["hot_spot knee", "sensor_offset hip"], [], ["hot_spot knee", "sensor_offset hip"]),
    ],
)
def test_what_sets_one_part_apart_comes_first(findings: list[str], structure: list[str], told: list[str]) -> None:
    found, made_of = (tuple(map(_step, names)) for names in (findings, structure))
    made = Composition(_FIT, found, made_of, rivals=(), refused=(), before=_EVIDENCE, after=_EVIDENCE)
    assert [f"{step.effect} {step.at}" for step in made.steps] == told
