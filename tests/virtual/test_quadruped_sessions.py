"""Check the free sessions: trots that pass the limit, logs for a monitor, runs for a diagnosis."""

from __future__ import annotations

from collections import Counter

import numpy as np

from lptn.virtual import plan, quadruped_logs
from lptn.virtual.quadruped_truth import JOINTS

HOT = [f"temperature.{joint}" for joint in JOINTS]


def test_every_trot_passes_60_degrees() -> None:
    runs = plan("forecast", 1)
    assert len(runs) == 20
    assert all(0 <= run.segments[0].load <= 6 and 5 <= run.ambient <= 35 for run in runs.values())
    assert np.ptp([run.segments[0].load for run in runs.values()]) > 4
    assert np.ptp([run.ambient for run in runs.values()]) > 15
    hottest = [truth[HOT].max(axis=1) for truth in quadruped_logs(seed=1, runs=runs).truth.values()]
    assert all(T.iloc[0] < 40 and T.max() > 64 for T in hottest)
    assert np.ptp([(T > 60.0).to_numpy().argmax() for T in hottest]) > 500


def test_monitor_has_as_many_faulty_logs_as_healthy_ones() -> None:
    runs = plan("monitor", 3)
    healthy = [run for name, run in runs.items() if name.startswith("healthy")]
    faulty = [run for name, run in runs.items() if name.startswith("faulty")]
    assert len(healthy) == len(faulty) == 50
    assert not any(run.faults for run in healthy)
    kinds = Counter(run.faults[0].kind for run in faulty)
    assert set(kinds) == {"drift", "offset", "stuck", "dropout"}
    assert min(kinds.values()) >= 12
    assert all(600 <= run.faults[0].time < 1800 for run in faulty)


def test_trial_powers_every_joint_alone_with_three_others() -> None:
    runs = plan("trial", 5)
    assert list(runs) == ["fit1", "fit2", "holdout"]
    for name in ("fit1", "fit2"):
        held = [joint for segment in runs[name].segments for joint in segment.joints]
        assert sorted(held) == sorted(3 * JOINTS)
    assert all(run.segments[-1].activity == "rest" and run.cutout is None for run in runs.values())
    for physics, coldest in (("full", 60), ("plain", 50)):
        logs = quadruped_logs(seed=5, runs="trial", physics=physics)  # type: ignore[arg-type]
        hottest = max(truth[HOT].max().max() for truth in logs.truth.values())
        assert coldest < hottest < 95


def test_tests_are_the_sources_conditions() -> None:
    runs = plan("tests", 1)
    named = ["stand", "trot_0kg_low", "trot_0kg_high", "trot_4kg_low", "walk_4kg", "cooling", "multi_gait"]
    assert list(runs) == named
    assert all(run.seconds == 1800 for run in runs.values())
    multi = [(segment.activity, segment.load) for segment in runs["multi_gait"].segments]
    assert multi == [("stand", 0), ("stand", 4), ("trot", 2), ("trot", 4), ("walk", 4)]
    cooling = quadruped_logs(seed=1, runs=runs).truth["cooling"][HOT]
    assert cooling.iloc[0].max() > 50
    assert cooling.iloc[-1].max() < 45
