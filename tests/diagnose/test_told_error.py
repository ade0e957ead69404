"""The error that is told is the one that a user gets: `lptn compare` of the file that `lptn improve` wrote."""

from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest

from lptn.robots.presets import presets
from lptn.virtual import Hidden, leg_logs, write_logs
from tests.cli.conftest import Lptn, lptn  # noqa: F401 - a fixture

EXAMPLES = Path(__file__).parents[2] / "examples"


def _cut(folder: Path, log: Path, after: float) -> tuple[Path, Path]:
    """A log in two files: what is fitted, and what is held out."""
    table = pd.read_csv(log)
    time = next(name for name in table if str(name).startswith("time"))
    fitted = table[time] < after
    parts = folder / "fitted.csv", folder / "held_out.csv"
    for path, rows in zip(parts, (fitted, ~fitted), strict=True):
        table[rows].to_csv(path, index=False)
    return parts


def _leg(folder: Path) -> tuple[Path, Path, Path]:
    """A leg whose gears rub; the air of the held-out run is warmer than logged."""
    hidden = [Hidden("coulomb_friction", "*"), Hidden("ambient_offset", "ambient", size=0.5, run="holdout")]
    write_logs(folder, leg_logs(hidden, seed=5, noise=0.1, quantisation=0.0, rate=1.0))
    (folder / "leg.toml").write_text(presets()["leg"])
    return folder / "leg.toml", folder / "fit1.parquet", folder / "holdout.parquet"


def _errors_agree(lptn: Lptn, folder: Path, model: Path, fitted: Path, held_out: Path) -> None:  # noqa: F811
    better, told, compared = folder / "better.toml", folder / "told.json", folder / "compared.json"
    assert lptn("improve", model, fitted, "--holdout", held_out, "-o", better, "--json", told)[0] == 0
    assert lptn("compare", better, held_out, "--json", compared)[0] == 0
    steps = json.loads(told.read_text())["history"]
    assert len(steps) > 1
    got = json.loads(compared.read_text())
    # The file has its numbers to a few digits, and the error is told to three.
    assert steps[-1]["rmse_holdout"] == pytest.approx(got["all"]["rmse"], rel=5e-4)


def test_of_two_heaters(lptn: Lptn, tmp_path: Path) -> None:  # noqa: F811
    logs = _cut(tmp_path, EXAMPLES / "tclab" / "log.csv", 300.0)
    model, at_rest = tmp_path / "two_heaters.toml", 'ambient = "start"'
    text = (EXAMPLES / "tclab" / "two_heaters.toml").read_text()
    assert at_rest in text  # where the board is in the held-out part no more
    model.write_text(text.replace(at_rest, 'ambient = { value = 20.4, unit = "degC" }'))
    _errors_agree(lptn, tmp_path, model, *logs)


def test_of_a_winding_of_a_machine(lptn: Lptn, tmp_path: Path) -> None:  # noqa: F811
    logs = _cut(tmp_path, EXAMPLES / "pmsm" / "log.csv", 4800.0)
    _errors_agree(lptn, tmp_path, EXAMPLES / "pmsm" / "winding.toml", *logs)


def test_of_a_leg_whose_held_out_run_was_in_warmer_air(lptn: Lptn, tmp_path: Path) -> None:  # noqa: F811
    """Half a kelvin, which every log may be off by: it is part of the error, and fitted to nothing."""
    _errors_agree(lptn, tmp_path, *_leg(tmp_path))
