"""Arrays of FMI 3: the same model, its joints in arrays."""

from __future__ import annotations

import ctypes
from pathlib import Path

import fmpy
import numpy as np
import pytest
from fmpy.validation import validate_fmu

from lptn.basics.errors import InputError
from lptn.basics.places import class_of
from lptn.fmu import Session, export
from lptn.fmu.cosim import cosimulate
from lptn.fmu.joined import places_of
from lptn.fmu.ssp import write_system
from lptn.model.file import parse_model
from lptn.model.model import Model
from tests.fmu.conftest import Build, network
from tests.fmu.raw import ERROR, OK, Raw, doubles
from tests.fmu.truth import ROOM, ZERO, in_kelvin, leg_by_hand, steps

ALL = {"forecast": True, "events": True, "arrays": True}


def test_arrays_have_dimensions_places_and_valid_descriptions(built: Build) -> None:
    exported = built("quadruped", **ALL)
    assert validate_fmu(str(exported.path)) == []
    variables = {rows.name: rows for rows in fmpy.read_model_description(str(exported.path)).modelVariables}
    assert variables["torque"].shape == (12,)
    assert variables["temperature"].shape == (13,)  # the computer too
    assert variables["der(temperature)"].derivative is variables["temperature"]
    assert variables["limit_crossed"].type == "Boolean"
    assert "FR_calf.torque" not in variables
    assert "FR_hip, " in variables["torque"].description


def test_arrays_through_fmpy_follow_the_leg(built: Build) -> None:
    """fmpy 0.3.32 takes inputs that are all arrays of one size; the ambient keeps its start."""
    rows = np.abs(steps(Model(network("leg")), 4))
    rows[:, 0] = ROOM
    signals = np.zeros(8, dtype=[("time", float), ("torque", float, (3,))])
    signals["time"] = np.repeat(10.0 * np.arange(5), 2)[1:-1]
    signals["torque"] = np.repeat(rows[:, 1:], 2, axis=0)
    result = fmpy.simulate_fmu(
        str(built("leg", arrays=True).path),
        fmi_type="CoSimulation",
        stop_time=40.0,
        output_interval=10.0,
        input=signals,
        output=["temperature"],
    )
    assert np.abs(result["temperature"][1:] - ZERO - leg_by_hand(rows, 10.0)).max() < 1e-6


def test_a_session_shows_elements_by_their_places(built: Build) -> None:
    """Whole arrays, parts of them, in another order: as the FMU of scalars to the last bit."""
    model = Model(network("leg"))
    rows = in_kelvin(model, np.abs(steps(model, 20)))
    names = ["FR_calf.torque_scale", "FR_hip.temperature"]
    results = []
    for exported in (built("leg"), built("leg", arrays=True)):
        with Session(exported.path) as session, Session(exported.path, inputs=["FR_calf.torque"], outputs=names) as few:
            assert session.input_names == [
                f"{place}.torque" if place != "ambient" else "ambient.temperature"
                for place in ("ambient", "FR_hip", "FR_thigh", "FR_calf")
            ]
            session.write({"FR_thigh.capacity": 200.0})
            few.reset({"FR_thigh.temperature": 300.0, "FR_hip.torque": 2.0})
            for row in rows:
                session.inputs[:], few.inputs[:] = row, row[-1]
                session.step(1.3)
                few.step(1.3)
            every = [variable.name for variable in exported.component.variables]
            results.append((session.read(every), few.outputs.copy(), few.read(["FR_hip.torque"])))
    for one, other in zip(*results, strict=True):
        assert (one == other).all()


def test_sets_and_gets_count_elements(built: Build, tmp_path: Path) -> None:
    with Raw(built("leg", **ALL), tmp_path) as leg:
        torque = ctypes.c_uint32(leg.names["torque"])
        one, three = ctypes.c_size_t(1), ctypes.c_size_t(3)
        before = doubles(7.0, 7.0, 7.0)
        assert leg.call("SetFloat64", ctypes.byref(torque), one, doubles(1.0, 2.0, 3.0), three) == OK
        assert leg.call("SetFloat64", ctypes.byref(torque), one, doubles(1.0, 2.0), ctypes.c_size_t(2)) == ERROR
        assert "3 scalars, 2 values" in leg.said[-1][1]
        assert leg.call("SetFloat64", ctypes.byref(torque), one, doubles(9.0, float("nan"), 9.0), three) == ERROR
        assert "FR_thigh.torque" in leg.said[-1][1]
        assert leg.call("GetFloat64", ctypes.byref(torque), one, before, three) == OK
        assert list(before) == [1.0, 2.0, 3.0]
        (element,) = (
            variable for variable in built("leg", **ALL).component.variables if variable.name == "FR_calf.torque"
        )
        scalar = ctypes.c_uint32(element.reference)
        assert leg.call("GetFloat64", ctypes.byref(scalar), one, before, one) == ERROR
        assert "array's element" in leg.said[-1][1]


def test_derivatives_of_arrays_are_those_of_their_elements(built: Build, tmp_path: Path) -> None:
    warm = {f"FR_{joint}.torque": 4.0 for joint in ("hip", "thigh", "calf")}
    with (
        Session(built("leg").path, values=warm) as plain,
        Session(built("leg", arrays=True).path, values=warm) as joined,
    ):
        names = [f"FR_{joint}" for joint in ("hip", "thigh", "calf")]
        seed = [1.0, -2.0, 0.5]
        scalars = [
            [plain.variables[f"{name}.{member}"].valueReference for name in names]
            for member in ("copper_loss.heat_flow", "torque")
        ]
        arrays = [
            [joined.variables[f"FR_hip.{member}"].valueReference] for member in ("copper_loss.heat_flow", "torque")
        ]
        forward = joined._fmu.getDirectionalDerivative(*arrays, seed, nSensitivity=3)
        assert forward == plain._fmu.getDirectionalDerivative(*scalars, seed)
        assert np.abs(forward).min() > 0
        adjoint = joined._fmu.getAdjointDerivative(*arrays, seed, nSensitivity=3)
        assert adjoint == plain._fmu.getAdjointDerivative(*scalars, seed)


def test_a_state_goes_on_with_arrays(built: Build) -> None:
    with Session(built("leg", arrays=True).path) as session:
        session.inputs[:] = [295.0, 3.0, 4.0, 5.0]
        session.step(1.0)
        state = session._fmu.getFMUState()
        content = session._fmu.serializeFMUState(state)
        expected = session.step(1.0).copy()
        session._fmu.setFMUState(session._fmu.deserializeFMUState(content))
        session.time = 1.0
        assert (session.step(1.0) == expected).all()


def test_fmi_2_and_ssp_have_no_arrays(built: Build, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="FMI 2"):
        export(Model(network("leg")), tmp_path / "x.fmu", fmi=2, arrays=True, platforms=())
    with pytest.raises(InputError, match="arrays"):
        write_system(tmp_path / "x.ssd", {"leg": built("leg", arrays=True).path}, [])


@pytest.mark.long
def test_logs_drive_arrays(tmp_path: Path, built: Build) -> None:
    file = tmp_path / "leg.csv"
    header = "time,torque.FR_hip,torque.FR_thigh,torque.FR_calf,temperature.ambient,temperature.FR_calf\n"
    file.write_text(header + "".join(f"{k},1,2,{3 + k % 2},20,25\n" for k in range(60)))
    done = [
        cosimulate(built("leg", arrays=on).path, [file], mapped={"FR_calf.torque": "torque.FR_calf"})
        for on in (False, True)
    ]
    (one,), (other,) = (cosimulation.runs for cosimulation in done)
    assert one.table.keys() == other.table.keys()
    assert all((one.table[name] == other.table[name]).all() for name in one.table)


ROBOTS = {
    "two legs": [f"{side}_{part}" for side in ("left", "right") for part in ("hip", "knee", "ankle")],
    "six legs": [f"leg{leg}_{part}" for leg in (4, 2, 6, 1, 3, 5) for part in ("coxa", "tibia")],
    "children first": ["R_knee", "L_knee", "R_hip", "L_hip"],
    "an arm": ["Schulter", "a10", "a2", "z_Ellenbogen"],
}


@pytest.mark.parametrize("joints", ROBOTS.values(), ids=ROBOTS)
def test_every_array_has_the_order_in_which_the_file_lists_joints(joints: list[str], tmp_path: Path) -> None:
    kinds = dict.fromkeys(map(class_of, joints))
    text = f'[model]\njoints = {joints}\nambient = "temperature.ambient"\n'
    for size, kind in enumerate(kinds, start=1):  # the file declares joints of a kind together
        text += f'[nodes."{kind}"]\ncapacity = {100 * size}\n[[links]]\nbetween = ["{kind}", "ambient"]\n'
        text += f'resistance = {size}\n[[effects]]\nkind = "copper_loss"\nat = "{kind}"\n'
    exported = export(parse_model(text, tmp_path / "robot.toml"), tmp_path / "x.fmu", arrays=True, platforms=())
    arrays = {variable.name: places_of(variable.elements) for variable in exported.arrays}
    assert {"temperature", "torque", "capacity", "to_ambient.heat_flow", "copper_loss.torque_constant"} <= arrays.keys()
    for name, places in arrays.items():
        assert places == [joint for joint in joints if joint in places], name
