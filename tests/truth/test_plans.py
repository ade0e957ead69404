"""Check the plans of the trials: every trot gets to its limit, every kind of fault has its share."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from lptn.virtual import QUADRUPED_JOINTS, quadruped_logs
from tests.truth.plans import outings, trots

HOT = [f"temperature.{joint}" for joint in QUADRUPED_JOINTS]


@pytest.mark.long
def test_every_trot_passes_60_degrees() -> None:
    runs = trots(1)
    assert len(runs) == 20
    assert all(0 <= run.segments[0].load <= 6 and 5 <= run.ambient <= 35 for run in runs.values())
    assert np.ptp([run.segments[0].load for run in runs.values()]) > 4
    assert np.ptp([run.ambient for run in runs.values()]) > 15
    hottest = [truth[HOT].max(axis=1) for truth in quadruped_logs(seed=1, runs=runs).truth.values()]
    assert all(T.iloc[0] < 40 and T.max() > 64 for T in hottest)
    assert np.ptp([(T > 60.0).to_numpy().argmax() for T in hottest]) > 500


def test_outings_have_as_many_faulty_logs_as_healthy_ones() -> None:
    runs = outings(3)
    healthy = [run for name, run in runs.items() if name.startswith("healthy")]
    faulty = [run for name, run in runs.items() if name.startswith("faulty")]
    assert len(healthy) == len(faulty) == 50
    assert not any(run.faults for run in healthy)
    kinds = Counter(run.faults[0].kind for run in faulty)
    assert set(kinds) == {"drift", "offset", "stuck", "dropout"}
    assert min(kinds.values()) >= 12
    assert all(600 <= run.faults[0].time < 1800 for run in faulty)
