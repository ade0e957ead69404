"""The error that `improve` tells of held-out data is that of the file that it writes, as `compare` says it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
import pytest

import lptn
from lptn.robots.presets import presets
from lptn.virtual import Hidden, leg_logs, write_logs
from tests.cli.conftest import Lptn

EXAMPLES = Path(__file__).parents[2] / "examples"
ROUNDED = 1e-3  # relative: a file has six digits of each value


def _agree(lptn: Lptn, folder: Path, model: Path, fitted: Sequence[Path], held_out: Path) -> int:
    """Number of effects that were added."""
    better, told, said = (folder / name for name in ("better.toml", "told.json", "said.json"))
    assert lptn("improve", model, *fitted, "--holdout", held_out, "-o", better, "--json", told)[0] == 0
    assert lptn("compare", better, held_out, "--json", said)[0] == 0
    steps, every = json.loads(told.read_text())["history"], json.loads(said.read_text())["all"]
    last = steps[-1]["rmse_holdout"], steps[-1]["max_holdout"]
    assert last == pytest.approx((every["rmse"], every["max"]), rel=ROUNDED)
    return len(steps) - 1


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
def test_of_a_run_of_its_own(model: str, fitted: list[str], held_out: str, lptn: Lptn, tmp_path: Path) -> None:
    given = EXAMPLES / model
    _agree(lptn, tmp_path, given, [given.parent / name for name in fitted], given.parent / held_out)


def test_of_a_log_in_two_files(lptn: Lptn, tmp_path: Path) -> None:
    table = pd.read_csv(EXAMPLES / "tclab" / "log.csv")
    parts = tmp_path / "fitted.csv", tmp_path / "held_out.csv"
    for path, rows in zip(parts, (table["time_s"] < 300, table["time_s"] >= 300), strict=True):
        table[rows].to_csv(path, index=False)
    model, at_rest = tmp_path / "two_heaters.toml", 'ambient = "start"'
    text = (EXAMPLES / "tclab" / "two_heaters.toml").read_text()
    assert at_rest in text  # where the board is in the held-out part no more
    model.write_text(text.replace(at_rest, 'ambient = { value = 20.4, unit = "degC" }'))
    assert _agree(lptn, tmp_path, model, parts[:1], parts[1])


def test_of_a_leg_whose_held_out_run_was_in_warmer_air(lptn: Lptn, tmp_path: Path) -> None:
    """Half a kelvin, which every log may be off by: it is part of the error, and fitted to nothing."""
    hidden = [Hidden("coulomb_friction", "*"), Hidden("ambient_offset", "ambient", size=0.5, run="holdout")]
    write_logs(tmp_path, leg_logs(hidden, seed=5, noise=0.1, quantisation=0.0, rate=1.0))
    model = tmp_path / "leg.toml"
    model.write_text(presets()["leg"])
    assert _agree(lptn, tmp_path, model, [tmp_path / "fit1.parquet"], tmp_path / "holdout.parquet")


@pytest.mark.long
@pytest.mark.parametrize(
    ("model", "after"), [("tclab/two_heaters.toml", 300), ("tclab/two_heaters.toml", 450), ("pmsm/winding.toml", 4800)]
)
def test_of_the_end_of_a_log(model: str, after: float, tmp_path: Path) -> None:
    study = lptn.Study(EXAMPLES / model, EXAMPLES / model.partition("/")[0] / "log.csv", holdout_after=after)
    study.improve().save(tmp_path / "better.toml")
    told = study.selection().best.holdout
    assert told is not None
    said = lptn.compare(lptn.load_model(tmp_path / "better.toml").model, study.data.holdout).all
    assert (told.rmse, told.max) == pytest.approx((said.rmse, said.max), rel=ROUNDED)
    assert study.compare().all.rmse == pytest.approx(told.rmse, rel=ROUNDED)
