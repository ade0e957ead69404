"""Check that faults of sensors are what they are called."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from lptn.virtual import QUADRUPED_NODES, Bout, Job, quadruped_logs
from tests.truth.faults import Fault

MIX = Job((Bout("trot", 240, 0.5, 2.0), Bout("stand", 60), Bout("hold", 60, joints=("RL_calf",), torque=8.0)))


@pytest.mark.long
@pytest.mark.parametrize("rate", [1, 100])
def test_faults_are_what_they_are_called(rate: float) -> None:
    healthy = faulty = quadruped_logs(seed=1, runs={"run": MIX}, quantisation=0, rate=rate)["run"]
    for fault in (
        Fault("drift", "FR_calf", 100, 0.05),
        Fault("offset", "FL_hip", 50.5, -6.0),
        Fault("stuck", "RR_thigh", 60),
        Fault("dropout", "pc", 200, until=300),
    ):
        faulty = fault.shown(faulty)
    time = healthy["time"].to_numpy()
    gap = (faulty - healthy).astype(float)
    assert gap["temperature.FR_calf"].to_numpy() == pytest.approx(0.05 * np.maximum(time - 100, 0), abs=1e-4)
    assert gap["temperature.FL_hip"].to_numpy() == pytest.approx(-6.0 * (time >= 50.5), abs=1e-4)
    stuck = faulty["temperature.RR_thigh"][time >= 60]
    assert stuck.nunique() == 1
    assert stuck.iloc[0] == healthy["temperature.RR_thigh"][time >= 60].iloc[0]
    assert np.array_equal(faulty["temperature.pc"].isna(), (time >= 200) & (time < 300))
    untouched = gap.drop(
        columns=["temperature.FR_calf", "temperature.FL_hip", "temperature.RR_thigh", "temperature.pc"]
    )
    assert not untouched.to_numpy().any()


def test_faults_are_there_before_readings_are_rounded() -> None:
    fine, coarse = (quadruped_logs(seed=1, runs={"run": MIX}, quantisation=step)["run"] for step in (0.0, 1.0))
    faulty = Fault("drift", "FR_calf", 100, 0.013).shown(fine, quantisation=1.0)
    readings = [f"temperature.{node}" for node in QUADRUPED_NODES]
    assert np.array_equal(faulty[readings], np.round(faulty[readings]))
    differs = (faulty != coarse).any(axis=1).to_numpy()
    assert not differs[:101].any()
    assert differs[-60:].any()
    assert list((faulty != coarse).any().pipe(lambda column: column[column]).index) == ["temperature.FR_calf"]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Fault("melt", "pc", 0), "fault: found 'melt'; expected one of drift"),
        (lambda: Fault("drift", "trunk", 0), "place of drift: found 'trunk'"),
        (lambda: Fault("drift", "pc", 10, until=5), "time of drift: found 10"),
    ],
)
def test_bad_faults_are_refused(make: Callable[[], Fault], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()
