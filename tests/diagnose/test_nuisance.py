"""What differs from log to log and is no part of the robot."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest

from lptn.diagnose.candidates import with_ambient_bias
from lptn.diagnose.diagnosis import for_search
from lptn.identify.data import Segment
from lptn.identify.validation import fit_segments, holdout_errors
from lptn.virtual import Hidden
from tests.diagnose.conftest import Leg


def _named(segments: Sequence[Segment], names: Sequence[str]) -> tuple[Segment, ...]:
    return tuple(
        replace(segment, run=replace(segment.run, name=name)) for segment, name in zip(segments, names, strict=True)
    )


@pytest.mark.parametrize("names", [("fit1", "fit2", "holdout"), ("log#1", "log#2", "log#3")], ids=["logs", "pieces"])
def test_a_held_out_run_with_a_wrong_ambient_does_not_judge_the_model_for_it(leg: Leg, names: tuple[str, ...]) -> None:
    model, data = leg(Hidden("ambient_offset", "ambient", size=0.4, run="holdout"))
    data = replace(data, fit=_named(data.fit, names[:2]), holdout=_named(data.holdout, names[2:]))
    coarse, errors = for_search(data), []
    for with_bias in (model, with_ambient_bias(model, data, 0.5)):
        held = holdout_errors(fit_segments(with_bias, coarse.fit), coarse.holdout)
        assert held is not None
        errors.append(held.rmse)
    assert errors[0] > 0.2  # K
    assert errors[1] < 0.1


def test_a_grant_does_not_hide_what_the_model_lacks(leg: Leg) -> None:
    model, data = leg(Hidden("forced_convection", "FR_thigh"))
    coarse, errors = for_search(data), []
    for with_bias in (model, with_ambient_bias(model, data, 0.5)):
        held = holdout_errors(fit_segments(with_bias, coarse.fit), coarse.holdout)
        assert held is not None
        errors.append(held.rmse)
    assert errors[1] > 0.5 * errors[0]


def test_one_log_alone_gets_no_bias(leg: Leg) -> None:
    model, data = leg()
    alone = type(data)(data.fit[:1])
    assert with_ambient_bias(model, alone, 0.5) is model
