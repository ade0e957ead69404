"""Virtual legs with something hidden, read back from files, shared by the diagnosis tests."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from lptn.identify.data import DataSplit, load_model, split_data
from lptn.model.model import Model
from lptn.robots.presets import presets
from lptn.virtual import Hidden, leg_logs, write_logs

Leg = Callable[..., tuple[Model, DataSplit]]


@pytest.fixture(scope="session")
def leg(tmp_path_factory: pytest.TempPathFactory) -> Leg:
    """Makes a leg with hidden effects: the preset's model, two runs to fit and one held out."""

    @cache
    def make(
        *hidden: Hidden, seed: int = 11, noise: float = 0.15, quantisation: float = 0.0
    ) -> tuple[Model, DataSplit]:
        folder: Path = tmp_path_factory.mktemp("leg")
        write_logs(folder, leg_logs(hidden, seed=seed, noise=noise, quantisation=quantisation, rate=1.0))
        (folder / "leg.toml").write_text(presets()["leg"])
        loaded = load_model(folder / "leg.toml")
        fitted = loaded.runs([folder / "fit1.parquet", folder / "fit2.parquet"])
        return loaded.model, split_data(fitted, loaded.runs([folder / "holdout.parquet"]))

    return make
