"""What faults are called, beside offsets, drifts and stuck sensors: truth by scipy alone."""

from __future__ import annotations

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from lptn.logs.channels import Kind as Silence
from lptn.logs.issue import Issue
from lptn.model.model import Model
from lptn.online.fault_bank import Alarm
from lptn.online.monitoring import MonitoredRun, known_faults, monitor, noisy, silent_rows
from tests.identify.truth import TRUTH, network, truth_run

BEGIN = 1200  # s
RUN = truth_run(3000.0, noise=0.15, seed=4)


@pytest.mark.long
@pytest.mark.parametrize("kind", ["disconnected", "swapped"])
def test_a_sensor_that_reads_something_else_is_named_by_what_it_reads(kind: str) -> None:
    model = Model(network().with_values(TRUTH))
    columns = dict(RUN.columns)
    a, b = (columns[f"temperature.{place}"].copy() for place in ("a", "b"))
    behind = np.arange(len(RUN)) >= BEGIN
    if kind == "swapped":
        columns["temperature.a"], columns["temperature.b"] = np.where(behind, b, a), np.where(behind, a, b)
    else:
        air = columns["temperature.ambient"] + np.random.default_rng(0).normal(0, 0.15, len(RUN))
        columns["temperature.a"] = np.where(behind, air, a)
    (watched,) = monitor(model, [replace(RUN, columns=columns)], rmse=0.2).runs
    named = {alarm.node: alarm.kind for alarm in watched.statistical_alarms}
    assert named.get("a") == kind
    assert set(named.values()) == {kind}


@pytest.mark.long
def test_without_healthy_logs_a_lag_and_swapped_plugs_are_named_and_a_drift_is_no_swap() -> None:
    model = Model(network().with_values(TRUTH))
    a, b = (RUN.columns[f"temperature.{place}"] for place in ("a", "b"))
    lagging, keep = a.copy(), np.exp(-RUN.step / 300.0)
    smooth = np.convolve(np.pad(a, 20, mode="edge"), np.ones(41) / 41, mode="valid")
    path = smooth.copy()
    for k in range(BEGIN, len(RUN)):
        path[k] = keep * path[k - 1] + (1 - keep) * smooth[k]
    lagging += path - smooth
    towards_b = a + (np.arange(len(RUN)) >= BEGIN) * np.linspace(-1, 1, len(RUN)).clip(0) * float((b - a)[-300:].mean())
    for expected, columns in (
        ({"a": "lag"}, {"temperature.a": lagging}),
        ({"a": "swapped", "b": "swapped"}, {"temperature.a": b, "temperature.b": a}),
        ({"a": "drift"}, {"temperature.a": towards_b}),
        ({}, {}),
    ):
        (watched,) = monitor(model, [replace(RUN, columns={**RUN.columns, **columns})], rmse=0.2).runs
        assert {alarm.node: alarm.kind for alarm in watched.statistical_alarms} == expected


@pytest.mark.long
def test_others_are_blamed_only_for_what_a_known_fault_leaves_unexplained() -> None:
    """A sensor that stands, from half-way on, as something else has found; beside it nothing, or one that is off."""
    model, behind = Model(network().with_values(TRUTH)), np.arange(len(RUN)) >= BEGIN
    a, b = (RUN.columns[f"temperature.{place}"] for place in ("a", "b"))
    stands = np.where(behind, a[BEGIN], a)
    known = Alarm("a", "stuck", float(RUN.time[-1]), float(BEGIN))
    for off, expected in ((0.0, {"a": "stuck"}), (6.0, {"a": "stuck", "b": "offset"})):
        columns = {**RUN.columns, "temperature.a": stands, "temperature.b": b + off * behind}
        (watched,) = monitor(model, [replace(RUN, columns=columns)], rmse=0.5, found=[known]).runs
        assert {alarm.channel or alarm.node: alarm.kind for alarm in watched.statistical_alarms} == expected


def test_noise_that_grows_is_called_and_rounding_is_not() -> None:
    rng = np.random.default_rng(0)
    quiet = np.round(30 + 0.15 * rng.standard_normal((1, len(RUN))))
    loud = quiet + (np.arange(len(RUN)) >= BEGIN) * rng.normal(0.0, 2.0, len(RUN))
    for readings, count in ((quiet, 0), (loud, 1)):
        watched = MonitoredRun(replace(RUN, resolution={"temperature.a": 1.0}), ("a",), readings, readings)
        alarms = noisy(watched)
        assert len(alarms) == count
        assert all(alarm.kind == "noise" and abs(alarm.onset - BEGIN) < 90 for alarm in alarms)


@pytest.mark.parametrize("kind", get_args(Silence))
def test_whatever_a_reader_leaves_out_of_a_sensor_is_an_alarm(kind: str) -> None:
    issue = Issue("temperature.a", "T1", "is no reading", "left out", False, kind=kind, stretch=(400.0, 900.0))
    ((alarm,),) = known_faults([replace(RUN, issues=(issue,))], ["a", "b"])
    assert alarm.node == "a"
    assert silent_rows(replace(RUN, issues=(issue,)), ["a", "b"])[0, 500]


def test_what_the_log_says_of_its_channels_is_an_alarm_of_the_piece_in_which_it_begins() -> None:
    frozen = Issue("temperature.a", "T1", "frozen at 30 degC", "left out", False, kind="frozen", stretch=(400.0, 900.0))
    died = Issue("torque.a", "tau", "frozen at 0 N*m", "unknown", False, kind="frozen", stretch=(1500.0, 2000.0))
    issues = (frozen, died)
    pieces = [replace(RUN.slice(0.0, 1500.0), issues=issues), replace(RUN.slice(2000.0, 3000.0), issues=issues)]
    first, second = known_faults(pieces, ["a", "b"])
    assert [(alarm.kind, alarm.onset, alarm.channel) for alarm in first] == [
        ("stuck", 400.0, ""),
        ("input", 1500.0, "torque.a"),
    ]
    assert not second
    rows = silent_rows(pieces[0], ["a", "b"])
    assert rows[0, 500]
    assert not rows[0, 300]
    assert not rows[1].any()
