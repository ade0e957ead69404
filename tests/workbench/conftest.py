"""Two heaters on the workbench, in this process."""

from __future__ import annotations

from pathlib import Path

import pytest

from lptn.workbench.bench import Bench
from lptn.workbench.opening import Opening

EXAMPLE = Path(__file__).parents[2] / "examples" / "tclab"
OPENING = Opening(EXAMPLE / "two_heaters.toml", (EXAMPLE / "log.csv",), holdout_after=300)


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """Fitted as given."""
    study = OPENING.study()
    study.fit()
    return Bench(study, tmp_path_factory.mktemp("session"), OPENING.fingerprint(study))
