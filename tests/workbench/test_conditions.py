"""Errors by operating condition: each lands where its readings were."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from numpy.typing import NDArray

from lptn.basics.arrays import FloatArray
from lptn.identify.comparison import Prediction
from lptn.workbench.conditions import by_condition
from tests.builders import make_run

TIME: FloatArray = np.arange(0.0, 1800.0)
SOME: FloatArray = np.where(TIME > 5, 1.0, np.nan)


def _prediction(error: NDArray[np.floating[Any]], **columns: FloatArray) -> Prediction:
    run = make_run({name.replace("__", "."): values for name, values in columns.items()})
    return cast("Prediction", SimpleNamespace(error=np.stack([error, 0 * error]), bound=SimpleNamespace(run=run)))


def _found(predictions: dict[str, Prediction]) -> dict[tuple[str, str], list[dict[str, Any] | None]]:
    return {(row["group"], row["name"]): row["tiles"] for row in by_condition(("a", "b"), predictions)}


def test_an_error_stands_where_its_condition_was() -> None:
    moving = TIME >= 900
    columns = {"velocity__a": -3.0 * moving, "torque__a": TIME - 900, "temperature__ambient": np.full(TIME.size, 20.0)}
    tiles = _found({"fit 0": _prediction(-2.0 * moving, **columns)})
    moves, stands = tiles["joint", "moves"][0], tiles["joint", "stands"][0]
    assert moves is not None
    assert stands is not None
    assert (moves["mean"], moves["rmse"], stands["rmse"]) == (-2.0, 2.0, 0.0)
    assert tiles["joint", "moves"][1] is None  # b has no such column
    assert ("air", "low") not in tiles  # the air was the same throughout
    first, second, later = (tiles["since the start", name][0] for name in ("to 5 min", "to 20 min", "later"))
    assert first is not None
    assert second is not None
    assert later is not None
    assert (first["rmse"], second["mean"], later["mean"]) == (0.0, pytest.approx(-2 * 300 / 900), -2.0)
    low = tiles["load", "low"][0]
    assert low is not None
    assert low["mean"] == pytest.approx(-1.0, abs=0.01)  # the size of the torque is low on both sides of its zero


def test_thirds_are_of_all_runs_and_the_worst_run_is_named() -> None:
    quiet = _prediction(0.1 + 0 * TIME, torque__a=TIME / 1800)
    hard = _prediction(SOME, torque__a=2 + TIME / 1800)
    tiles = _found({"holdout 0": quiet, "holdout 1": hard})
    high, low = tiles["load", "high"][0], tiles["load", "low"][0]
    assert high is not None
    assert low is not None
    assert (high["segment"], low["segment"]) == ("holdout 1", "holdout 0")
    assert high["limits"].startswith("from 2.3")
