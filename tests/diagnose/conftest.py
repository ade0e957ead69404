"""Virtual legs with something hidden, read back from files, shared by the diagnosis tests."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from lptn.evidence import Evidence, evidence
from lptn.model import Model
from lptn.opening import open_model
from lptn.robots import presets
from lptn.virtual import Hidden, leg_logs, write_logs

Leg = Callable[..., tuple[Model, Evidence]]


@pytest.fixture(scope="session")
def leg(tmp_path_factory: pytest.TempPathFactory) -> Leg:
    """Makes a leg with hidden effects: the preset's model, two runs to fit and one held out."""

    @cache
    def make(*hidden: Hidden, seed: int = 11, noise: float = 0.15, quantisation: float = 0.0) -> tuple[Model, Evidence]:
        folder: Path = tmp_path_factory.mktemp("leg")
        write_logs(folder, leg_logs(hidden, seed=seed, noise=noise, quantisation=quantisation, rate=1.0))
        (folder / "leg.toml").write_text(presets()["leg"])
        opened = open_model(folder / "leg.toml")
        fitted = opened.runs([folder / "fit1.parquet", folder / "fit2.parquet"])
        return opened.model, evidence(fitted, opened.runs([folder / "holdout.parquet"]))

    return make
