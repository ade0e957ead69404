"""What the two standards ask of single calls: time, modes, statuses, log categories; values that are no numbers."""

from __future__ import annotations

import ctypes
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy.sundials import NV_DATA_S, CVodeSolver
from fmpy.sundials.cvode import sundials_cvode

from lptn.fmu import export
from lptn.model.model import Model
from lptn.model.network import Network
from tests.builders import AMBIENT, effect, link, node
from tests.fmu.conftest import Build
from tests.fmu.raw import DISCARD, ERROR, OK, Raw, doubles
from tests.fmu.truth import ROOM, ZERO, leg_by_hand

NODES = [f"FR_{joint}.temperature" for joint in ("hip", "thigh", "calf")]
EPOCH = 1.7e9  # s; a time stamp of ROS
FMI = pytest.mark.parametrize("fmi", [2, 3])


# --- time -----------------------------------------------------------------------------------------


@FMI
@pytest.mark.parametrize("begin", [0.0, EPOCH])
def test_points_that_repeat_or_leave_gaps_are_refused(fmi: int, begin: float, built: Build, tmp_path: Path) -> None:
    with Raw(built("leg", fmi), tmp_path) as leg:
        leg.start(begin)
        assert leg.step(begin, 0.1) == OK
        for point in (begin, begin + 1.1, begin + 0.1 + 1e-3, begin + 0.1 - 1e-3):
            assert leg.step(point, 0.1) == ERROR
            assert "communication point" in leg.said[-1][1]
        assert leg.step(begin + 0.1, 0.1) == OK


@FMI
@pytest.mark.parametrize("begin", [0.0, EPOCH, -EPOCH])
@pytest.mark.parametrize(("step", "count"), [(1e-4, 5000), (0.1, 1000), (7.3, 50), (3600.0, 5)])
def test_steps_of_any_size_at_any_time_follow_the_leg(
    fmi: int, begin: float, step: float, count: int, built: Build, tmp_path: Path
) -> None:
    """Points as masters make them: counted from the start, each with a rounding of its own."""
    torques = {"FR_hip.torque": 3.0, "FR_thigh.torque": 4.0, "FR_calf.torque": 5.0}
    with Raw(built("leg", fmi), tmp_path) as leg:
        leg.start(begin, begin + count * step)
        assert leg.set_named(torques) == OK
        for k in range(count):
            assert leg.step(begin + k * step, step) == OK, leg.said[-1]
        temperatures = np.array(leg.get(*NODES)[1]) - ZERO
    row = np.array([[ROOM, *torques.values()]])
    assert np.abs(temperatures - leg_by_hand(row, count * step)[-1]).max() < 1e-6


@FMI
def test_a_state_that_is_restored_takes_its_communication_point_along(fmi: int, built: Build, tmp_path: Path) -> None:
    """A step is tried and taken back, as masters that control their error do, at a time stamp of today."""
    save, load = ("GetFMUstate", "SetFMUstate") if fmi == 2 else ("GetFMUState", "SetFMUState")
    with Raw(built("leg", fmi), tmp_path) as leg:
        leg.start(EPOCH)
        assert leg.set_named({"FR_calf.torque": 5.0}) == OK
        assert leg.step(EPOCH, 0.1) == OK
        state = ctypes.c_void_p()
        assert leg.call(save, ctypes.byref(state)) == OK
        assert leg.step(EPOCH + 0.1, 0.1) == OK
        tried = leg.get(*NODES)
        assert leg.step(EPOCH + 0.1, 0.1) == ERROR  # it stands at the end of that step
        assert leg.call(load, state) == OK
        assert leg.step(EPOCH + 0.2, 0.1) == ERROR  # and now at its beginning
        assert leg.step(EPOCH + 0.1, 0.1) == OK
        assert leg.get(*NODES) == tried


def test_a_step_lost_in_rounding_is_refused(built: Build, tmp_path: Path) -> None:
    with Raw(built("leg"), tmp_path) as leg:
        leg.start(EPOCH)
        assert leg.step(EPOCH, 1e-8) == ERROR
        assert "lost in the rounding" in leg.said[-1][1]


@FMI
def test_a_step_beyond_the_stop_time_is_refused(fmi: int, built: Build, tmp_path: Path) -> None:
    with Raw(built("leg", fmi), tmp_path) as leg:
        leg.start(EPOCH, EPOCH + 10.0)
        assert leg.step(EPOCH, 10.5) == ERROR
        assert leg.step(EPOCH, 10.0) == OK


@FMI
@pytest.mark.parametrize(
    ("begin", "stop", "rate"), [(0.0, 3600.0, 60), (0.0, 600.0, 240), (0.0, 300.0, 1000), (1000.0, 1900.0, 30)]
)
def test_a_master_that_adds_up_its_time_comes_to_the_stop_time_and_not_beyond(
    fmi: int, begin: float, stop: float, rate: int, built: Build, tmp_path: Path
) -> None:
    """A sum of 216,000 rounded steps ends up to 1e-7 s beside the stop time, on either side."""
    time, step = begin, 1 / rate
    with Raw(built("leg", fmi), tmp_path) as leg:
        leg.start(begin, stop)
        for _ in range(round((stop - begin) * rate)):
            assert leg.step(time, step) == OK
            time += step
        assert abs(time - stop) < 1e-3 * step
        for beyond in (step, 0.5 * step, 0.01 * step):
            assert leg.step(time, beyond) == ERROR
            assert "beyond the stop time" in leg.said[-1][1]


@pytest.mark.parametrize(("asked", "expected"), [(2.0, 2.0), (3.5, 4.0), (50.0, 10.0)])
def test_an_early_return_comes_at_the_next_inner_step(
    asked: float, expected: float, built: Build, tmp_path: Path
) -> None:
    """Inner steps are of 1 s here; a return that is asked for beyond the step's end is none."""
    updates = []

    def update(time: float, inputs: bool) -> float | None:
        updates.append(time)
        return asked if time == 1.0 and not inputs else None

    with Raw(built("leg", step=1.0), tmp_path, update=update) as leg:
        leg.start()
        assert leg.step(0.0, 10.0) == OK
        assert (leg.time, leg.early) == (expected, expected < 10.0)
        assert leg.step(leg.time, 1.0) == OK
    assert updates[0] == 1.0


# --- modes ----------------------------------------------------------------------------------------


@FMI
def test_states_and_parameters_are_set_where_the_standard_lets_them(fmi: int, built: Build, tmp_path: Path) -> None:
    """FMI 2.0.4, 3.2.3; FMI 3.0.1, 2.3 and 3.2."""
    state, parameter, entrance = {"FR_calf.temperature": 300.0}, {"FR_calf.capacity": 310.0}, {"FR_calf.torque": 1.0}
    continuous_state = OK if fmi == 3 else ERROR
    expected = {
        "instantiated": (OK, OK, OK),
        "event": (ERROR, OK, OK),
        "continuous": (continuous_state, ERROR, OK),
        "terminated": (ERROR, ERROR, ERROR),
    }
    with Raw(built("leg", fmi), tmp_path, exchange=True) as leg:
        statuses = {"instantiated": tuple(map(leg.set_named, (state, parameter, entrance)))}
        leg.start()
        statuses["event"] = tuple(map(leg.set_named, (state, parameter, entrance)))
        states = (doubles(300.0, 300.0, 300.0), ctypes.c_size_t(3))
        assert leg.call("SetContinuousStates", *states) == ERROR
        leg.go_continuous()
        statuses["continuous"] = tuple(map(leg.set_named, (state, parameter, entrance)))
        assert leg.call("SetContinuousStates", *states) == OK
        assert leg.call("Terminate") == OK
        statuses["terminated"] = tuple(map(leg.set_named, (state, parameter, entrance)))
        assert leg.get("FR_calf.temperature")[0] == OK
    assert statuses == expected


def test_fmi_2_gives_no_values_before_initialization(built: Build, tmp_path: Path) -> None:
    with Raw(built("leg", 2), tmp_path) as leg:
        assert leg.get("FR_calf.temperature")[0] == ERROR


@FMI
def test_functions_of_the_other_interface_are_refused(fmi: int, built: Build, tmp_path: Path) -> None:
    x = (doubles(0.0, 0.0, 0.0), ctypes.c_size_t(3))
    with Raw(built("leg", fmi), tmp_path) as leg:
        leg.start()
        assert leg.call("Terminate") == OK
        assert leg.call("GetContinuousStates", *x) == ERROR
        assert leg.call("GetDerivatives" if fmi == 2 else "GetContinuousStateDerivatives", *x) == ERROR
        assert "Model Exchange" in leg.said[-1][1]


def test_slopes_of_inputs_are_taken_before_the_first_step(built: Build, tmp_path: Path) -> None:
    """FMI 2.0.4, 4.2.4: in the instantiated state and in initialization mode too."""
    with Raw(built("leg", 2), tmp_path) as leg:
        words = ((ctypes.c_uint32 * 1)(leg.names["FR_calf.torque"]), ctypes.c_size_t(1), (ctypes.c_int * 1)(1))
        assert leg.call("SetRealInputDerivatives", *words, doubles(1.0)) == OK


@FMI
def test_an_fmu_for_casadi_takes_states_and_parameters_in_any_mode(fmi: int, built: Build, tmp_path: Path) -> None:
    exported = built("leg", fmi, casadi=True)
    with Raw(exported, tmp_path / "unpacked", exchange=True) as leg:
        leg.start()
        assert leg.set_named({"FR_calf.temperature": 300.0}) == OK
        leg.go_continuous()
        assert leg.set_named({"FR_calf.temperature": 300.0, "FR_calf.capacity": 310.0}) == OK


# --- discard, and numbers that are none -----------------------------------------------------------


@FMI
def test_a_trial_step_out_of_range_is_discarded_and_the_simulation_goes_on(
    fmi: int, built: Build, tmp_path: Path
) -> None:
    with Raw(built("leg", fmi), tmp_path, exchange=True) as leg:
        leg.start()
        leg.go_continuous()
        for wild in (-5.0, float("nan"), float("inf")):
            assert leg.call("SetContinuousStates", doubles(300.0, wild, 300.0), ctypes.c_size_t(3)) == DISCARD
            assert leg.said[-1][0] == "logStatusDiscard"
            assert leg.set_named({"FR_calf.torque": wild if wild != -5.0 else float("nan")}) == DISCARD
        assert leg.get(*NODES) == (OK, [ZERO + ROOM] * 3)
        assert leg.call("SetContinuousStates", doubles(300.0, 301.0, 302.0), ctypes.c_size_t(3)) == OK


class _Patient(CVodeSolver):  # type: ignore[misc]
    """fmpy's CVODES with what the standard asks of an importer: a discarded call is a trial step to be made smaller."""

    def __init__(self, leg: Raw, first: float) -> None:
        self.leg, self.discarded = leg, 0

        def read(name: str) -> Callable[[Any, int], int]:
            return lambda x, n: leg.call(name, x, ctypes.c_size_t(n))

        super().__init__(
            nx=3,
            nz=0,
            get_x=read("GetContinuousStates"),
            set_x=read("SetContinuousStates"),
            get_dx=read("GetDerivatives" if leg.fmi == 2 else "GetContinuousStateDerivatives"),
            get_z=lambda x, n: OK,
            get_nominals=read("GetNominalsOfContinuousStates"),
            set_time=lambda time: leg.call("SetTime", ctypes.c_double(time)),
            input=None,
            startTime=0.0,
            relativeTolerance=1e-9,
        )
        set_first = sundials_cvode.CVodeSetInitStep
        assert set_first(ctypes.c_void_p(self.cvode_mem), ctypes.c_double(first)) == 0

    def f(self, t: float, y: Any, ydot: Any, data: Any) -> int:
        self.set_time(t)
        if self.set_x(NV_DATA_S(y), self.nx) == DISCARD or self.get_dx(NV_DATA_S(ydot), self.nx) == DISCARD:
            self.discarded += 1
            return 1  # recoverable
        return 0


@FMI
def test_cvodes_goes_on_after_trial_steps_out_of_range(fmi: int, built: Build, tmp_path: Path) -> None:
    """A first step of a day in air of 150 K: its predictor lies 4000 K below absolute zero."""
    with Raw(built("leg", fmi), tmp_path, exchange=True) as leg:
        assert leg.set_named({"ambient.temperature": 150.0, "FR_calf.torque": 5.0}) == OK
        leg.start()
        leg.go_continuous()
        solver = _Patient(leg, 86400.0)
        solver.step(0.0, 100.0)
        temperatures = np.array(leg.get(*NODES)[1]) - ZERO
    assert solver.discarded > 0
    assert np.abs(temperatures - leg_by_hand(np.array([[150.0 - ZERO, 0.0, 0.0, 5.0]]), 100.0)[-1]).max() < 1e-3


@pytest.mark.slow
@FMI
@pytest.mark.parametrize("exchange", [False, True])
def test_no_call_gives_a_number_that_is_none_with_status_ok(
    fmi: int, exchange: bool, built: Build, tmp_path: Path
) -> None:
    """Inputs and parameters that are finite, and so large that what is made of them is not."""
    with Raw(built("everything", fmi), tmp_path, exchange=exchange) as every:
        every.start()
        assert every.set_named({"a.torque": 1e200, "b.current": 1e300, "base.speed": 1e308}) == OK
        outputs = [name for name in every.names if not name.endswith("time_to_limit")]
        bad = DISCARD if exchange else ERROR
        for name in outputs:
            status, (value,) = every.get(name)
            assert status == (OK if np.isfinite(value) else bad), name
        assert every.get("a.copper_loss.heat_flow")[0] == bad
        assert "not finite" in every.said[-1][1]
        if exchange:
            every.go_continuous()
            rates = doubles(*[0.0] * sum(name.startswith("der(") for name in every.names))
            function = "GetDerivatives" if fmi == 2 else "GetContinuousStateDerivatives"
            assert every.call(function, rates, ctypes.c_size_t(len(rates))) == DISCARD


# --- log categories -------------------------------------------------------------------------------


def _log(leg: Raw, on: bool, *categories: str) -> int:
    names = (ctypes.c_char_p * len(categories))(*(name.encode() for name in categories))
    yes = int(on) if leg.fmi == 2 else ctypes.c_bool(on)
    return leg.call("SetDebugLogging", yes, ctypes.c_size_t(len(categories)), names if categories else None)


@FMI
def test_log_categories_filter_and_unknown_ones_are_refused(fmi: int, built: Build, tmp_path: Path) -> None:
    with Raw(built("leg", fmi), tmp_path) as leg:

        def heard() -> list[str]:
            leg.said.clear()
            leg.set_named({"ambient.temperature": float("nan")})
            leg.call("Reset")
            leg.set_named({"ambient.temperature": 20.0})  # a warning: that is kelvin
            return [category for category, _ in leg.said]

        assert heard() == ["logStatusError", "logStatusWarning"]
        assert _log(leg, True, "logStatusWarning") == OK
        assert heard() == ["logStatusWarning"]
        assert _log(leg, True, "logStatusError", "logStatusWarning") == OK
        assert len(heard()) == 2
        assert _log(leg, True, "logEvents") == ERROR
        assert '"logEvents"' in leg.said[-1][1]
        assert len(heard()) == 2  # as it was
        assert _log(leg, False) == OK
        # FMI 3: no call at all; FMI 2: no debug logging, but errors are none.
        assert heard() == ([] if fmi == 3 else ["logStatusError"])
        assert _log(leg, True) == OK
        assert len(heard()) == 2


# --- one velocity is enough -----------------------------------------------------------------------

HEATS = ("viscous_friction", "iron_loss", "coulomb_friction", "gear_loss", "driver_loss")


def _geared() -> Network:
    """A motor with every loss that goes with a mean of its motion; `velocity_rms` alone would do for the first two."""
    ends = (node("a", 400.0), AMBIENT)
    return Network("geared", ends, (link("a", "ambient", 3.0),), tuple(effect(key, "a") for key in HEATS))


@pytest.mark.long
def test_one_velocity_gives_the_heat_of_its_means(tmp_path: Path) -> None:
    exported = export(Model(_geared()), tmp_path / "x.fmu")
    flows = [f"a.{key}.heat_flow" for key in HEATS]
    means = ("a.velocity_rms", "a.torque_abs", "a.mechanical_power")
    assert {"a.velocity", "a.torque", *means} <= set(exported.variables)
    with Raw(exported, tmp_path / "unpacked") as motor:
        motor.start()
        assert motor.set_named({"a.velocity": -3.0, "a.torque": 2.0}) == OK
        derived = motor.get(*flows)
        assert derived[0] == OK
        assert all(heat > 0 for heat in derived[1])
        assert motor.set_named(dict(zip(means, (3.0, 2.0, 6.0), strict=True))) == OK
        assert motor.get(*flows)[1] == pytest.approx(derived[1], rel=1e-15)
        assert motor.set_named({"a.velocity_rms": 6.0}) == OK  # a mean of its own counts
        assert motor.get(flows[0])[1][0] == pytest.approx(4 * derived[1][0])
        assert motor.set_named({"a.velocity_rms": -1.0}) == OK
        assert motor.get(flows[0])[1][0] == pytest.approx(derived[1][0])


@pytest.mark.long
def test_a_model_that_wants_only_a_mean_takes_the_velocity_too(tmp_path: Path) -> None:
    ends = (node("a", 400.0), AMBIENT)
    slow = Network("slow", ends, (link("a", "ambient", 3.0),), (effect("viscous_friction", "a"),))
    exported = export(Model(slow), tmp_path / "x.fmu")
    with Raw(exported, tmp_path / "unpacked") as motor:
        motor.start()
        assert motor.set_named({"a.velocity": -3.0}) == OK
        assert motor.get("a.viscous_friction.heat_flow")[1][0] == pytest.approx(9 * 0.04)
