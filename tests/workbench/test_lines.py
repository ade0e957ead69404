"""Lines of plots: thinned without losing a peak or the last readings, and cut to the window that is asked for."""

from __future__ import annotations

from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.basics.lines import thinned
from lptn.identify.validation import spread_of
from lptn.simulate.simulation import simulate
from lptn.workbench.bench import Bench
from lptn.workbench.lines import _BLOCK, RunLines, packed
from tests.workbench.conftest import unpacked

TIME: FloatArray = np.linspace(0.0, 10_000.2, 100_003)


def test_every_peak_stays_and_so_does_the_end() -> None:
    rng = np.random.default_rng(0)
    lines = rng.normal(0.0, 1.0, (3, TIME.size))
    lines[0, 777], lines[1, -2], lines[2, -1] = 50.0, -60.0, 70.0
    at, kept = thinned(TIME, lines, 1000)
    assert at.size == kept.shape[1] <= 1003
    assert (np.diff(at) > 0).all()
    assert (at[0], at[-1]) == (TIME[0], TIME[-1])
    np.testing.assert_array_equal(kept.max(axis=1), lines.max(axis=1))
    np.testing.assert_array_equal(kept.min(axis=1), lines.min(axis=1))
    np.testing.assert_array_equal(kept[:, -1], lines[:, -1])
    assert abs(at[kept[0].argmax()] - TIME[777]) < 0.1 * TIME.size / 400


def test_a_gap_stays_a_gap_and_a_short_line_itself() -> None:
    values = np.sin(TIME)
    values[30_000:40_000] = np.nan
    at, kept = thinned(TIME, values[None, :], 500)
    inside = (at > 3020) & (at < 3980)
    assert inside.any()
    assert np.isnan(kept[0, inside]).all()
    assert np.isfinite(kept[0, ~((at > 2980) & (at < 4020))]).all()
    short = thinned(TIME[:100], values[None, :100], 500)
    np.testing.assert_array_equal(short[1][0], values[:100])


def _lines() -> RunLines:
    measured = np.stack([20 + TIME / 1000, np.full(TIME.size, np.nan)])
    inputs = {"torque.hip": np.sin(TIME), "torque.knee": np.cos(TIME), "speed.base": TIME}
    lines = RunLines(("hip", "knee"), TIME, measured, inputs)
    return lines.with_line("as given", measured + 1.5)


def test_a_window_has_the_readings_of_its_time() -> None:
    shown = _lines().window("hip", {"now": "as given"}, 500.0, 510.0)
    assert shown["time"][0] == pytest.approx(499.9)
    assert shown["time"][-1] == pytest.approx(510.1)
    assert len(shown["time"]) == 103
    assert all(error == pytest.approx(1.5, abs=1e-4) for error in shown["error now"])
    assert {"torque.hip", "speed.base"} <= set(shown)
    assert "torque.knee" not in shown


@pytest.mark.parametrize(("start", "stop"), [(None, None), (1000.0, 9000.0), (4000.0, None), (None, 8000.03)])
def test_a_long_window_keeps_every_peak_without_reading_the_log_again(start: float | None, stop: float | None) -> None:
    rng = np.random.default_rng(1)
    measured = rng.normal(0.0, 1.0, (1, TIME.size))
    measured[0, [50_000, 60_007, -1]] = 90.0, -80.0, 50.0
    measured[0, 70_000:71_000] = np.nan
    lines = RunLines(("hip",), TIME, measured, {"torque.hip": rng.normal(0.0, 1.0, TIME.size)})
    lines = lines.with_line("as given", np.zeros((1, TIME.size))).with_line("fan", np.sin(TIME)[None, :])
    first = lines.window("hip", {"now": "as given", "attempt": "fan"}, start, stop, points=100)
    measured[:] = 0.0  # what is asked again is drawn from what was kept, and from single readings of the log
    again = lines.window("hip", {"now": "as given", "attempt": "fan"}, start, stop, points=100)
    for shown in (first, again):
        assert np.nanmax(shown["measured"]) == 90.0
        assert (np.diff(shown["time"]) > 0).all()
        assert shown["time"].size <= 103
        assert shown["time"][0] <= (start or 0.0) < shown["time"][0] + 0.1 * _BLOCK + 0.3
        assert shown["time"][-1] >= (stop or TIME[-1]) > shown["time"][-1] - 0.1 * _BLOCK - 0.3
        assert np.nanmax(shown["error now"]) == 80.0
        assert np.nanmin(shown["error now"]) == -90.0
        assert np.ptp(shown["attempt"]) == pytest.approx(2.0, abs=0.1)
    if stop is None:
        assert first["measured"][-1] == 50.0


def test_lines_are_packed_as_they_are() -> None:
    windows = {"Hüfte": {"time": TIME[:3], "measured": np.array([1.5, np.nan, -2e-300])}, "b": {"time": TIME[:1]}}
    read = unpacked(packed(windows))
    for node, lines in windows.items():
        for name, values in lines.items():
            np.testing.assert_array_equal(read[node][name], values)


def test_what_was_not_measured_is_missing_and_an_unknown_node_refused() -> None:
    assert np.isnan(_lines().window("knee", {"now": "as given"}, points=50)["measured"]).all()
    with pytest.raises(InputError, match="hip, knee"):
        _lines().window("elbow", {})


def test_a_clock_that_counts_from_1970_keeps_its_milliseconds() -> None:
    lines = _lines()
    epoch = RunLines(lines.nodes, TIME + 1.7e9, lines.measured, lines.inputs)
    at = epoch.window("hip", {}, 1.7e9, 1.7e9 + 1.0)["time"]
    assert np.diff(np.array(at, dtype=float)) == pytest.approx(0.1, abs=1e-3)


def test_signals_come_by_their_own_names() -> None:
    names = ["torque.knee", "error.hip", "predicted.hip", "temperature.hip"]
    shown = _lines().window(names, {"now": "as given"}, 500.0, 510.0)
    assert list(shown) == ["time", *names]
    np.testing.assert_allclose(shown["predicted.hip"] - shown["temperature.hip"], shown["error.hip"])
    for name in ("torque.elbow", "power.hip", "predicted.elbow"):
        with pytest.raises(InputError, match=r"elbow|power\.hip"):
            _lines().window([name], {"now": "as given"})


def test_the_band_of_a_prediction_is_where_other_parameters_of_the_fit_lead(bench: Bench) -> None:
    fit, rng = bench.study.steps[-1].fit, np.random.default_rng(0)
    prediction = bench.predictions(-1)["holdout 0"]
    spread, noise = spread_of(fit, prediction), fit.noise.floor[:, None]
    small = 0.1  # of a standard error: to first order
    unknowns = rng.multivariate_normal(np.zeros(len(fit.free)), small**2 * fit.uncertainty.covariance, 400)
    start, others = prediction.path.states[:, 0], []
    for moved in unknowns:
        z = fit.z.copy()
        z[: len(moved)] += moved
        values = fit.problem.point(z).values
        others.append(simulate(fit.model, prediction.bound, values, start).readings + rng.normal(0.0, small * noise))
    at = np.searchsorted(prediction.bound.run.time, spread.time)
    np.testing.assert_allclose(spread.size, np.std(others, axis=0)[:, at] / small, rtol=0.2)

    run = RunLines.of(prediction, tuple(fit.model.nodes)).with_line("model", prediction.readings)
    shown = replace(run, spread=spread).window("heater2", {"now": "model"})
    wide = NormalDist().inv_cdf(0.975) * spread.size[1]
    np.testing.assert_allclose(shown["now high"] - shown["now"], wide, rtol=1e-6)
    np.testing.assert_allclose(shown["now"] - shown["now low"], wide, rtol=1e-6)
    assert "now low" not in run.window("heater2", {"now": "model"})
