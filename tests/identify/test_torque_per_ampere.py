"""The torque constant that a log of torques and currents shows, held against the model's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from lptn.effects.copper_loss import CopperLoss
from lptn.identify.torque_per_ampere import apart, torque_per_ampere
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration
from tests.builders import leg, make_run

RNG = np.random.default_rng(5)


def log(per_ampere: float, *, follows: bool = True) -> Run:
    """Ten minutes in which one joint's current is logged beside its torque, with 2 % of noise."""
    torque = RNG.normal(0.0, 5.0, 600)
    amperes = (torque if follows else RNG.normal(0.0, 5.0, 600)) / per_ampere
    return make_run({"torque.FR_hip": torque, "current.FR_hip": amperes * (1 + RNG.normal(0, 0.02, 600))})


def model(given: str = "torque") -> Model:
    constant = replace(CopperLoss.parameters[1], value=0.84)
    return Model(leg([EffectDeclaration(CopperLoss(input=given), "FR_hip", (constant,))]))


@pytest.mark.parametrize(
    ("per_ampere", "words"),
    [
        (0.84, ""),
        (0.80, ""),
        (0.84 / 2**0.5, "as RMS and peak amperes are"),
        (0.84 * 3**0.5, "as power-invariant and RMS amperes are"),
        (0.84 / 9, "as torque before and behind a gear is"),
    ],
)
def test_amperes_of_another_kind_are_seen(per_ampere: float, words: str) -> None:
    constants = torque_per_ampere(model(), [log(per_ampere)])
    assert constants.keys() == {"FR_hip"}
    logged, said = constants["FR_hip"]
    assert logged == pytest.approx(per_ampere, rel=0.01)
    assert said == 0.84
    assert apart(logged, said).endswith(words)
    assert bool(apart(logged, said)) == bool(words)


def test_a_current_that_does_not_go_with_the_torque_says_nothing() -> None:
    assert not torque_per_ampere(model(), [log(0.84, follows=False)])


def test_a_model_by_currents_needs_no_constant() -> None:
    assert not torque_per_ampere(model("current"), [log(0.5)])
