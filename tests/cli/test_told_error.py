"""The error that `improve` tells of held-out data is that of the file that it writes, as `compare` says it."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import lptn
from tests.cli.conftest import Lptn

EXAMPLES = Path(__file__).parents[2] / "examples"
ROUNDED = 1e-3  # relative: a file has six digits of each value


@pytest.mark.long
@pytest.mark.parametrize(
    ("model", "fitted", "held_out"),
    [
        ("bldc_stators/two_nodes.toml", ["Run1.csv", "Run3.csv"], "Run5.csv"),
        ("bldc_stators/two_nodes.toml", ["Run1.csv", "Run3.csv", "Run5.csv"], "Run4.csv"),
        ("bldc_stators/own_surfaces.toml", ["Run3.csv", "Run5.csv"], "Run1.csv"),
        ("ur3/single_nodes.toml", ["warm_up.parquet"], "later.parquet"),
        ("ur3/coupled.toml", ["later.parquet"], "warm_up.parquet"),
    ],
)
def test_a_run_of_its_own(model: str, fitted: list[str], held_out: str, lptn: Lptn, tmp_path: Path) -> None:
    given = EXAMPLES / model
    logs, other = [given.parent / name for name in fitted], given.parent / held_out
    better, told, said = (tmp_path / name for name in ("better.toml", "told.json", "said.json"))
    assert lptn("improve", given, *logs, "--holdout", other, "-o", better, "--json", told)[0] == 0
    assert lptn("compare", better, other, "--json", said)[0] == 0
    last = json.loads(told.read_text())["history"][-1]
    every = json.loads(said.read_text())["all"]
    assert (last["rmse_holdout"], last["max_holdout"]) == pytest.approx((every["rmse"], every["max"]), rel=ROUNDED)


@pytest.mark.long
@pytest.mark.parametrize(
    ("model", "after"), [("tclab/two_heaters.toml", 300), ("tclab/two_heaters.toml", 450), ("pmsm/winding.toml", 4800)]
)
def test_the_end_of_a_log(model: str, after: float, tmp_path: Path) -> None:
    study = lptn.Study(EXAMPLES / model, EXAMPLES / model.partition("/")[0] / "log.csv", holdout_after=after)
    study.improve().save(tmp_path / "better.toml")
    told = study.selection().best.holdout
    assert told is not None
    said = lptn.compare(lptn.load_model(tmp_path / "better.toml").model, study.data.holdout).all
    assert (told.rmse, told.max) == pytest.approx((said.rmse, said.max), rel=ROUNDED)
    assert study.compare().all.rmse == pytest.approx(told.rmse, rel=ROUNDED)
