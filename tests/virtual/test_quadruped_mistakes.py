"""Check sensors' faults, and what is said about options and plans that can't be."""

from __future__ import annotations

import numpy as np
import pytest

from lptn.virtual import Fault, Run, Segment, plan, quadruped_logs

MIX = Run((Segment("trot", 240, 0.5, 2.0), Segment("stand", 60), Segment("hold", 60, joints=("RL_calf",), torque=8.0)))


def test_faults_are_what_they_are_called() -> None:
    faults = (
        Fault("drift", "FR_calf", 100, 0.05),
        Fault("offset", "FL_hip", 50.5, -6.0),
        Fault("stuck", "RR_thigh", 60),
        Fault("dropout", "pc", 200, until=300),
    )
    runs = {"healthy": MIX, "faulty": Run(MIX.segments, faults=faults)}
    for rate in (1, 100):
        # The same run under the same name, so that the noise is the same.
        healthy = quadruped_logs(seed=1, runs={"run": runs["healthy"]}, quantisation=0, rate=rate)["run"]
        faulty = quadruped_logs(seed=1, runs={"run": runs["faulty"]}, quantisation=0, rate=rate)["run"]
        time = healthy["time"].to_numpy()
        gap = (faulty - healthy).astype(float)
        assert gap["temperature.FR_calf"].to_numpy() == pytest.approx(0.05 * np.maximum(time - 100, 0), abs=1e-4)
        assert gap["temperature.FL_hip"].to_numpy() == pytest.approx(-6.0 * (time >= 50.5), abs=1e-4)
        stuck = faulty["temperature.RR_thigh"][time >= 60]
        assert stuck.nunique() == 1
        assert stuck.iloc[0] == pytest.approx(healthy["temperature.RR_thigh"][time >= 60].iloc[0], abs=1)
        assert np.array_equal(faulty["temperature.pc"].isna(), (time >= 200) & (time < 300))
        untouched = gap.drop(
            columns=["temperature.FR_calf", "temperature.FL_hip", "temperature.RR_thigh", "temperature.pc"]
        )
        assert not untouched.to_numpy().any()


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"seed": -1}, "seed: found -1"),
        ({"rate": 10.0}, "rate: found 10; expected one of 1, 100 Hz"),
        ({"runs": "holidays"}, "runs: found 'holidays'; expected one of protocol, tests"),
        ({"level": "huge"}, "level: found 'huge'; expected one of none, default, strong"),
        ({"physics": "ideal"}, "physics: found 'ideal'; expected one of full, plain"),
        ({"scatter": 3.0}, "scatter: found 3"),
        ({"noise": -1.0}, "noise: found -1"),
    ],
)
def test_bad_options_are_refused(options: dict[str, object], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        quadruped_logs(**{"seed": 0, "runs": {"mix": MIX}, **options})  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Segment("fly", 10), "activity: found 'fly'; expected one of rest, stand"),
        (lambda: Segment("trot", 0), "seconds of trot: found 0"),
        (lambda: Segment("trot", 10, 9.0), "speed of trot: found 9; expected 0 to 3 m/s"),
        (lambda: Segment("hold", 10), "joints of hold: found 0"),
        (lambda: Segment("hold", 10, joints=("knee",)), "joints of hold: found 'knee'"),
        (lambda: Fault("melt", "pc", 0), "fault: found 'melt'; expected one of drift"),
        (lambda: Fault("drift", "trunk", 0), "place of drift: found 'trunk'"),
        (lambda: Fault("drift", "pc", 10, until=5), "time of drift: found 10"),
        (lambda: Run(()), "segments: found none"),
        (lambda: plan("tests", -1), "seed: found -1"),
    ],
)
def test_bad_plans_are_refused(make: object, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make()  # type: ignore[operator]
