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
    runs, faults = outings(3)
    assert Counter(name.partition("_")[0] for name in runs) == {"healthy": 50, "faulty": 50}
    assert set(faults) == {name for name in runs if name.startswith("faulty")}
    kinds = Counter(fault.kind for fault in faults.values())
    assert set(kinds) == {"drift", "offset", "stuck", "dropout"}
    assert min(kinds.values()) >= 12
    assert all(600 <= fault.time < 1800 for fault in faults.values())
