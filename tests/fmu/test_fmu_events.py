"""Events: a limit that is crossed, and a run that begins, as the two standards have importers handle them."""

from __future__ import annotations

import ctypes
from pathlib import Path
from typing import Any

import fmpy
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from lptn.fmu import Exported
from tests.fmu.conftest import Build
from tests.fmu.raw import ERROR, OK, Raw, doubles
from tests.fmu.truth import ROOM, ZERO

FMI = pytest.mark.parametrize("fmi", [2, 3])
LIMIT = 32.0  # degC of the calf, which the torque below passes within minutes
NODES = ("FR_hip", "FR_thigh", "FR_calf")
ON, OFF = 40.0, 200.0  # s: the torque acts that long; the simulation ends


def truth(torque: float = 20.0) -> tuple[float, float]:
    """When the calf of the preset `leg` passes `LIMIT`, and when it is back: the leg written out, solved by SciPy."""
    heat = 0.15 * (torque / 0.84357) ** 2

    def rates(time: float, x: Any) -> Any:
        along = np.array([x[1] - x[0], x[0] - 2 * x[1] + x[2], x[1] - x[2]]) / 3.0
        return (np.array([0.0, 0.0, heat * (time < ON)]) + (ROOM - x) / 10.0 + along) / 300.0

    def crossing(_: float, x: Any) -> float:
        return float(x[2] - LIMIT)

    options: dict[str, Any] = {"events": crossing, "method": "DOP853", "rtol": 1e-12, "atol": 1e-12}
    up = solve_ivp(rates, (0.0, ON), np.full(3, ROOM), **options)
    down = solve_ivp(rates, (ON, 4 * OFF), up.y[:, -1], **options)
    assert up.t_events is not None
    assert down.t_events is not None
    return float(up.t_events[0][0]), float(down.t_events[0][0])


def limits(raw: Raw, fmi: int) -> list[int]:
    """Which limits count as passed."""
    references = (ctypes.c_uint32 * 3)(*(raw.names[f"{node}.limit_crossed"] for node in NODES))
    three = ctypes.c_size_t(3)
    if fmi == 2:
        values: Any = (ctypes.c_int * 3)()
        assert raw.call("GetBoolean", references, three, values) == OK
    else:
        values = (ctypes.c_bool * 3)()
        assert raw.call("GetBoolean", references, three, values, three) == OK
    return [int(value) for value in values]


def simulated(exported: Exported, **options: Any) -> tuple[float, float]:
    """When fmpy sees the calf's limit passed and left."""
    torque = np.array(
        [(0.0, 20.0), (ON, 20.0), (ON, 0.0), (4 * OFF, 0.0)], dtype=[("time", float), ("FR_calf.torque", float)]
    )
    values = {"FR_calf.temperature_limit": LIMIT + ZERO}
    result = fmpy.simulate_fmu(
        str(exported.path),
        stop_time=4 * OFF,
        input=torque,
        start_values=values,
        output=["FR_calf.limit_crossed"],
        output_interval=5.0,
        relative_tolerance=1e-9,
        **options,
    )
    crossed = result["FR_calf.limit_crossed"].astype(int)
    changes = np.flatnonzero(np.diff(crossed)) + 1
    assert crossed[changes].tolist() == [1, 0]
    return float(result["time"][changes[0]]), float(result["time"][changes[1]])


@FMI
def test_fmpy_finds_the_instant_in_model_exchange(fmi: int, built: Build) -> None:
    up, down = simulated(built("leg", fmi, events=True), fmi_type="ModelExchange")
    expected_up, expected_down = truth()
    assert up == pytest.approx(expected_up, abs=1e-3)
    assert down == pytest.approx(expected_down, abs=0.2)  # it is back 1 mK below the limit


def test_fmpy_gets_the_instant_by_event_mode_in_co_simulation(built: Build) -> None:
    exported = built("leg", events=True)
    options = {"fmi_type": "CoSimulation", "use_event_mode": True}
    up, down = simulated(exported, early_return_allowed=True, **options)
    expected_up, expected_down = truth()
    assert up == pytest.approx(expected_up, abs=1e-6)
    assert down == pytest.approx(expected_down, abs=0.2)
    late, _ = simulated(exported, early_return_allowed=False, **options)
    assert expected_up < late < expected_up + 5.0 + 1e-9


@FMI
def test_without_event_mode_a_limit_changes_at_the_end_of_a_step(fmi: int, built: Build) -> None:
    up, down = simulated(built("leg", fmi, events=True), fmi_type="CoSimulation")
    expected_up, expected_down = truth()
    assert expected_up < up < expected_up + 5.0
    assert expected_down < down < expected_down + 6.0


@FMI
def test_a_temperature_that_rests_at_its_limit_makes_one_event(fmi: int, built: Build, tmp_path: Path) -> None:
    """The indicator has a sign right after the event, whether an importer stops a little early or late."""
    with Raw(built("leg", fmi, events=True), tmp_path, exchange=True) as leg:
        assert leg.set_named({"FR_calf.temperature_limit": LIMIT + ZERO}) == OK
        leg.start()
        leg.go_continuous()
        indicators = doubles(0.0, 0.0, 0.0)
        for missed, crossed in ((-0.1, 0), (-1e-9, 1), (1e-9, 1), (-2e-4, 1), (-2e-3, 0)):
            states = doubles(ROOM + ZERO, ROOM + ZERO, LIMIT + ZERO + missed)
            assert leg.call("SetContinuousStates", states, ctypes.c_size_t(3)) == OK
            assert leg.call("EnterEventMode") == OK
            assert limits(leg, fmi) == [0, 0, crossed]
            _updated(leg, fmi)
            leg.go_continuous()
            assert leg.call("GetEventIndicators", indicators, ctypes.c_size_t(3)) == OK
            assert (indicators[2] < 0) == bool(crossed)
            assert abs(indicators[2]) > 1e-4


def _updated(raw: Raw, fmi: int) -> bool:
    """End the event's iteration; whether the states jumped."""
    if fmi == 2:
        info = (ctypes.c_int * 16)()
        assert raw.call("NewDiscreteStates", info) == OK
        return bool(info[3])
    flags = [ctypes.c_bool() for _ in range(5)]
    assert raw.call("UpdateDiscreteStates", *map(ctypes.byref, flags), ctypes.byref(ctypes.c_double())) == OK
    return flags[3].value


def clock(raw: Raw, name: str) -> bool:
    """Whether a clock is active."""
    value = ctypes.c_bool()
    reference = ctypes.c_uint32(raw.names[f"clocks.{name}"])
    assert raw.call("GetClock", ctypes.byref(reference), ctypes.c_size_t(1), ctypes.byref(value)) == OK
    return value.value


def test_clocks_tick_where_a_limit_is_crossed_and_a_run_begins(built: Build, tmp_path: Path) -> None:
    with Raw(built("leg", events=True), tmp_path, events=True) as leg:
        assert leg.set_named({"FR_calf.temperature_limit": LIMIT + ZERO, "FR_hip.temperature": 299.0}) == OK
        leg.start()
        assert not clock(leg, "limit_crossed")
        _updated(leg, 3)
        assert leg.call("EnterStepMode") == OK
        assert leg.set_named({"FR_calf.torque": 20.0}) == OK
        assert leg.step(0.0, 40.0) == OK
        assert (leg.event, leg.early) == (True, True)
        assert leg.time == pytest.approx(truth()[0], abs=0.1)  # the hip is a little warmer here
        assert limits(leg, 3) == [0, 0, 0]
        assert leg.call("EnterEventMode") == OK
        assert (clock(leg, "limit_crossed"), limits(leg, 3)) == (True, [0, 0, 1])
        assert not _updated(leg, 3)
        assert not clock(leg, "limit_crossed")
        assert leg.call("EnterStepMode") == OK
        at = leg.time
        assert leg.step(at, 5.0) == OK
        assert (leg.event, leg.early) == (False, False)

        assert leg.call("EnterEventMode") == OK
        begins, yes = ctypes.c_uint32(leg.names["clocks.run_begins"]), ctypes.c_bool(True)
        one = ctypes.c_size_t(1)
        assert leg.call("SetClock", ctypes.byref(begins), one, ctypes.byref(yes)) == OK
        assert _updated(leg, 3)
        temperatures = [f"{node}.temperature" for node in NODES]
        assert leg.get(*temperatures)[1] == [299.0, ROOM + ZERO, ROOM + ZERO]
        assert limits(leg, 3) == [0, 0, 0]
        assert leg.call("EnterStepMode") == OK
        assert leg.call("SetClock", ctypes.byref(begins), one, ctypes.byref(yes)) == ERROR
        assert leg.step(at + 5.0, 1.0) == OK


def test_an_event_that_waits_holds_no_step_up(built: Build, tmp_path: Path) -> None:
    """An importer that handles no events goes on; it is told each time."""
    with Raw(built("leg", events=True), tmp_path, events=True) as leg:
        assert leg.set_named({"FR_calf.temperature_limit": LIMIT + ZERO}) == OK
        leg.start()
        assert leg.call("EnterStepMode") == OK
        assert leg.set_named({"FR_calf.torque": 20.0}) == OK
        assert leg.step(0.0, 40.0) == OK
        at = leg.time
        assert leg.step(at, 5.0) == OK
        assert (leg.event, leg.early, leg.time) == (True, False, at + 5.0)


def test_an_fmu_without_events_has_no_event_mode(built: Build, tmp_path: Path) -> None:
    description = fmpy.read_model_description(str(built("leg").path))
    assert not description.coSimulation.hasEventMode
    assert description.numberOfEventIndicators == 0
    with pytest.raises(AssertionError):
        Raw(built("leg"), tmp_path, events=True)
