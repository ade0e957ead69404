"""Two heaters on the workbench, in this process."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from lptn.workbench.bench import Bench
from lptn.workbench.opening import Opening

EXAMPLE = Path(__file__).parents[2] / "examples" / "tclab"
OPENING = Opening(EXAMPLE / "two_heaters.toml", (EXAMPLE / "log.csv",), holdout_after=300)


def unpacked(answer: bytes) -> dict[str, dict[str, FloatArray]]:
    """Lines by node, as the page's script reads them."""
    head, _, _ = answer.partition(b"\n")
    assert (len(head) + 1) % 8 == 0
    values = iter(np.frombuffer(answer[len(head) + 1 :], dtype="<f8"))
    return {
        node: {name: np.array([next(values) for _ in range(size)]) for name in names}
        for node, (names, size) in json.loads(head).items()
    }


@pytest.fixture(scope="module")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """Fitted as given."""
    study = OPENING.study()
    study.fit()
    return Bench(study, tmp_path_factory.mktemp("session"), OPENING.fingerprint(study))
