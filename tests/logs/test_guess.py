"""Columns in other people's naming: proposed with their units, taken only when the user says so."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.basics.errors import InputError
from lptn.cli.main import main
from lptn.identify.data import load_model
from lptn.logs.columns import ColumnSource, parse_columns, parse_map_option
from lptn.logs.guess import format_note, guess, name_of_time
from lptn.logs.reading import open_table, read_log
from lptn.logs.run import Run
from lptn.robots.presets import presets
from lptn.virtual import quadruped_logs
from tests.truth.plans import trial

Write = Callable[..., Path]
Refuse = Callable[..., str]

TIME: list[object] = [float(k) for k in range(60)]
WARM = [30 + 0.05 * k for k in range(60)]
JOINTS = ("FR_hip", "FR_thigh", "FR_calf")
INPUTS = ("temperature.ambient", *(f"torque.{joint}" for joint in JOINTS))
OUTPUTS = tuple(f"temperature.{joint}" for joint in JOINTS)


def lptn(*words: object) -> int:
    """Run a command; its exit status."""
    with pytest.raises(SystemExit) as stop:
        main([str(word) for word in words])
    return int(stop.value.code or 0)


def guessed(path: Path, inputs: tuple[str, ...] = INPUTS, outputs: tuple[str, ...] = OUTPUTS) -> dict[str, str]:
    """Key -> column and unit, after both ways to write each guess were read back and found the same."""
    guesses = {}
    for suggestion in guess(open_table(path), {}, inputs, outputs):
        written = parse_columns(tomllib.loads(suggestion.line), "m.toml", "[columns]")
        assert written == dict([parse_map_option(suggestion.option.removeprefix('--map "').removesuffix('"'))])
        assert written == {suggestion.key: suggestion.source}
        guesses[suggestion.key] = f"{suggestion.source.columns[0]}|{suggestion.source.unit or ''}"
    return guesses


def test_a_log_that_lacks_nothing_is_not_read(write: Write) -> None:
    table = open_table(write({"time": TIME, **dict.fromkeys((*INPUTS, *OUTPUTS), WARM)}))
    assert guess(replace(table, read=lambda _: pytest.fail("read for a guess")), {}, INPUTS, OUTPUTS) == []


@pytest.mark.parametrize(
    ("columns", "time"),
    [
        (("max_time", "t_knee", "time"), "time"),
        (("set_time", "fault_time", "max_t"), None),
        (("log.T", "log.t"), "log.t"),
        (("time [s]", "t"), "time [s]"),
    ],
)
def test_what_is_a_time_and_nothing_else(columns: tuple[str, ...], time: str | None) -> None:
    assert name_of_time(columns) == time


@pytest.mark.parametrize("names", [("rig time", "t"), ("time since start", "motor T")])
def test_a_name_that_says_time_goes_before_a_t(write: Write, names: tuple[str, str]) -> None:
    said = next(name for name in names if "time" in name)
    assert guessed(write({**dict.fromkeys(names, TIME), "FL_calf_temp": WARM}))["time"] == f"{said}|"


def test_names_with_the_joint_in_them(write: Write) -> None:
    table: dict[str, list[object]] = {"t_ms": [1000 * k for k in range(60)], "T_amb": [22.0] * 60}
    for joint in JOINTS:
        table |= {
            f"{joint}_temp": list(WARM),
            f"tau_{joint}": TIME,
            f"tau_cmd_{joint}": TIME,
            f"{joint}_temp_limit": TIME,
        }
    guesses = guessed(write(table))
    assert guesses["time"] == "t_ms|ms"
    assert guesses["temperature.ambient"] == "T_amb|"
    assert guesses["temperature.FR_thigh"] == "FR_thigh_temp|"
    assert guesses["torque.FR_calf"] == "tau_FR_calf|"
    assert set(guesses) == {"time", *INPUTS, *OUTPUTS}


@pytest.mark.parametrize(
    ("key", "column", "unit"),
    [
        ("temperature.FR_calf", "T_FR_calf", ""),
        ("temperature.FR_calf", "frCalfTemperature [degF]", "degF"),
        ("temperature.FR_calf", "FR_calf_joint.temp_K", "K"),
        ("temperature.FR_calf", "calf_FR temp".replace("calf_FR", "FR-calf"), ""),
        ("torque.FR_calf", "effort[FR_calf]", ""),
        ("torque.FR_calf", "FR_calf_torque (mNm)", "mN*m"),
        ("current.FR_calf", "I_q_FR_calf_mA", "mA"),
        ("current.FR_calf", "FR_calf.current [A]", "A"),
        ("velocity.FR_calf", "FR_calf_rpm", "rpm"),
        ("velocity.FR_calf", "dq_FR_calf", ""),
        ("velocity.FR_calf", "FR_calf/vel (deg/s)", "deg/s"),
        ("temperature.ambient", "room", ""),
        ("temperature.ambient", "air temp (degC)", "degC"),
        ("speed.base", "base_velocity_x", ""),
        ("power.pc", "computer_power_W", "W"),
    ],
)
def test_one_name(write: Write, key: str, column: str, unit: str) -> None:
    path = write({"time": TIME, column: WARM, "FL_calf_temp": WARM, "gain": TIME, "FR_calf_foot": TIME})
    inputs = () if key == "temperature.FR_calf" else (key,)
    assert guessed(path, inputs, ("temperature.FR_calf",)).get(key) == f"{column}|{unit}"


@pytest.mark.parametrize(
    "column", ["T_FR_calf_des", "FR_calf_temp_limit", "FL_calf_temp", "calf_temp", "FR_calf_current"]
)
def test_what_is_no_reading_of_this_joint_is_not_proposed(write: Write, column: str) -> None:
    path = write({"time": TIME, column: WARM})
    assert "temperature.FR_calf" not in guessed(path, ("torque.FR_hip",), ("temperature.FR_calf", "temperature.FR_hip"))


def test_a_leg_whose_columns_do_not_say_which_leg_it_is(write: Write) -> None:
    table: dict[str, list[object]] = {"time": TIME, "hip_rpm": TIME}
    for name in ("hip", "thigh", "knee"):
        table |= {f"Temp {name} (F)": list(WARM), f"{name} torque": TIME}
    guesses = guessed(write(table))
    assert [guesses[key] for key in OUTPUTS] == [f"Temp {name} (F)|degF" for name in ("hip", "thigh", "knee")]
    assert guesses["torque.FR_calf"] == "knee torque|"
    two_legs = (*OUTPUTS, *(key.replace("FR", "FL") for key in OUTPUTS))
    assert "temperature.FR_calf" not in guessed(write(table), INPUTS, two_legs)


@pytest.mark.parametrize("places", [("膝", "髋"), ("колено", "бедро"), ("Hüfte", "Müde"), ("ö", "å")])
def test_names_of_any_script(write: Write, places: tuple[str, str]) -> None:
    """Letters beyond A to Z were none: a node without another had no name, which was a traceback."""
    path = write({"time": TIME, **{f"{place} temp": WARM for place in places}})
    guesses = guessed(path, (), tuple(f"temperature.{place}" for place in places))
    assert guesses == {f"temperature.{place}": f"{place} temp|" for place in places}


@pytest.mark.parametrize("places", [("/", "FR_hip"), ("\\", "+"), ("\u202e", "motor")])
def test_a_name_without_a_letter_is_not_guessed(write: Write, places: tuple[str, str]) -> None:
    path = write({"time": TIME, "temp": WARM, "motor_temp": WARM, "hip temp": WARM})
    assert f"temperature.{places[0]}" not in guessed(path, (), tuple(f"temperature.{place}" for place in places))


def test_two_names_as_good_as_each_other_are_left_to_the_user(write: Write) -> None:
    path = write({"time": TIME, "FR_calf_temp1": WARM, "FR_calf_temp2": WARM})
    assert "temperature.FR_calf" not in guessed(path, (), ("temperature.FR_calf", "temperature.FR_hip"))


def test_numbered_columns_in_the_order_of_the_nodes(write: Write) -> None:
    table: dict[str, list[object]] = {"timestamp": [1.7e15 + 1e6 * k for k in range(60)]}
    for number in range(3):
        table |= {f"motor_temperature[{number}]": [value + 273.15 for value in WARM], f"tau_est[{number}]": TIME}
    path = write(table)
    guesses = guessed(path)
    assert guesses["time"] == "timestamp|us"
    assert guesses["temperature.FR_calf"] == "motor_temperature[2]|K"
    assert guesses["torque.FR_hip"] == "tau_est[0]|"
    (one, *_) = (
        suggestion for suggestion in guess(open_table(path), {}, INPUTS, OUTPUTS) if suggestion.key == "torque.FR_hip"
    )
    assert "in the order of the model's nodes: check that" in one.why


def test_motors_are_numbered_and_the_computer_is_not(write: Write) -> None:
    """As a robot's kit logs its motors; their speeds come along, which a model may do without."""
    table: dict[str, list[object]] = {"timestamp_ns": [1.7e18 + 1e9 * k for k in range(60)], "vx_body": TIME}
    for number in range(3):
        names = (f"motor_{number}_{what}" for what in ("tau_est", "dq", "temperature"))
        table |= {name: list(WARM) for name in names}
    speeds = ("speed.base", *(f"velocity_rms.{place}" for place in (*JOINTS, "pc")))
    outputs = (*OUTPUTS, "temperature.pc")
    suggestions = guess(open_table(write(table)), {}, INPUTS, outputs, speeds)
    columns = {suggestion.key: suggestion.source.columns[0] for suggestion in suggestions}
    assert columns["temperature.FR_calf"] == "motor_2_temperature"
    assert columns["torque.FR_thigh"] == "motor_1_tau_est"
    assert columns["velocity.FR_hip"] == "motor_0_dq"
    assert columns["speed.base"] == "vx_body"
    assert not [key for key in columns if key.endswith(".pc")]


def test_an_opensourceleg_log(write: Write) -> None:
    table: dict[str, list[object]] = {
        "Time": TIME,
        "Output Position": TIME,
        "Motor Current": [50 * k for k in range(60)],
        "Output Torque": TIME,
        "Case Temperature": list(WARM),
        "Winding Temperature": [value + 5 for value in WARM],
    }
    path = write(table)
    guesses = guessed(path, ("current.motor",), ("temperature.motor",))
    assert guesses["current.motor"] == "Motor Current|mA"
    assert guesses["temperature.motor"] == "Case Temperature|"  # what is measured, and not what is estimated
    both = guessed(path, ("current.winding",), ("temperature.winding", "temperature.housing"))
    assert both["temperature.winding"] == "Winding Temperature|"
    assert both["temperature.housing"] == "Case Temperature|"
    assert "its winding temperature is its own estimate" in format_note(open_table(path))
    (run,) = read_log(path, inputs=["current.motor"], outputs=["temperature.motor"], guessing=True)
    assert run.columns["current.motor"][59] == pytest.approx(2.95)
    assert any(note.startswith("guessed: ") and "mA" in note for note in run.notes)
    assert any("opensourceleg" in note for note in run.notes)


def test_a_housings_speed_is_that_of_its_joint(write: Write) -> None:
    table: dict[str, list[object]] = {"time": TIME, "temperature.ambient": [22.0] * 60, "q7": TIME}
    for joint in ("L_hip", "L_knee"):
        table |= {f"temperature.{joint}": list(WARM), f"torque.{joint}": TIME, f"velocity.{joint}": TIME}
    parts = ("L_hip_case", "L_hip_pitch", "shin_case")
    inputs = ("temperature.ambient", *(f"{quantity}.{part}" for quantity in ("torque", "velocity") for part in parts))
    outputs = ("temperature.L_hip", "temperature.L_knee", *(f"temperature.{part}" for part in parts))
    guesses = guessed(write(table), inputs, outputs)
    # A temperature is not its joint's, another joint bears its own load, and of a shin nothing is logged.
    assert guesses == {"velocity.L_hip_case": "velocity.L_hip|", "torque.L_hip_case": "torque.L_hip|"}
    mapped = {"velocity.L_hip": ColumnSource(("q7",), unit="rpm")}
    of_case = {one.key: one.source for one in guess(open_table(write(table)), mapped, inputs, outputs)}
    assert of_case["velocity.L_hip_case"] == mapped["velocity.L_hip"]


def test_a_mapping_wins_over_a_guess(write: Write) -> None:
    path = write({"time": TIME, "FR_calf_temp": WARM, "other": WARM})
    columns = {"temperature.FR_calf": ColumnSource(("other",))}
    assert guess(open_table(path), columns, (), ("temperature.FR_calf",)) == []


def test_a_message_proposes_what_it_guesses_and_takes_nothing(write: Write, refuse: Refuse) -> None:
    path = write({"time": TIME, "FR_calf_temp": WARM, "tau_FR_calf": TIME})
    said = refuse(path, read_log, path, inputs=["torque.FR_calf"], outputs=["temperature.FR_calf"])
    assert "--map torque.FR_calf=tau_FR_calf (its name;" in said


def test_no_ambient_column_and_what_can_be_done(write: Write, refuse: Refuse) -> None:
    path = write({"time": TIME, "temperature.a": WARM})
    said = refuse(path, read_log, path, inputs=["temperature.ambient"], outputs=["temperature.a"])
    for line in (
        "--map temperature.ambient=YOURNAME",
        '[model] ambient = "start"',
        "ambient = 22 for a constant",
        "ambient = { value = 22, fixed = false }",
    ):
        assert line in said
    said = refuse(path, read_log, path, inputs=["temperature.coolant"], outputs=["temperature.a"])
    assert '[nodes.coolant] temperature = "start"' in said


@pytest.mark.parametrize("line", ['ambient = "start"', "ambient = 22", "ambient = { value = 22, fixed = false }"])
def test_what_the_message_proposes_works(
    tmp_path: Path, write: Write, capsys: pytest.CaptureFixture[str], line: str
) -> None:
    model = tmp_path / "model.toml"
    model.write_text(presets()["single-motor"].replace('ambient = "temperature.ambient"', line))
    assert line in model.read_text()
    path = write({"time": TIME, "temperature.motor": WARM, "torque.motor": [5.0] * 60})
    assert lptn("fit", model, path) == 0
    assert ("temperature.ambient" in capsys.readouterr().out) == ("fixed" in line)


def test_map_guess_says_what_it_takes(tmp_path: Path, write: Write, capsys: pytest.CaptureFixture[str]) -> None:
    model = tmp_path / "model.toml"
    model.write_text(presets()["single-motor"])
    noisy = np.random.default_rng(0).normal(0, 0.05, 60) + WARM
    path = write({"t_ms": [1e3 * k for k in range(60)], "T": noisy.tolist(), "tau": [5.0] * 60, "room": [21.0] * 60})
    out = tmp_path / "fitted.toml"
    assert lptn("fit", model, path, "-o", out) == 2
    assert not out.exists()
    capsys.readouterr()
    assert lptn("fit", model, path, "--map", "guess", "-o", out) == 0
    said = capsys.readouterr().err
    assert out.exists()
    for line in ('time = { column = "t_ms", unit = "ms" }', '"torque.motor" = "tau"', '"temperature.ambient" = "room"'):
        assert f"guessed: {line}" in said


def test_electrical_turns_are_guessed_and_never_converted_by_a_number_that_nobody_said(write: Write) -> None:
    erpm = [1200.0 + k for k in range(60)]
    path = write({"time": TIME[:60], "knee_erpm": erpm, "temperature.knee": WARM})
    (suggestion,) = guess(open_table(path), {}, ["velocity.knee"], ["temperature.knee"])
    assert (suggestion.key, suggestion.source) == ("velocity.knee", ColumnSource(("knee_erpm",)))
    assert "electrical turns" in suggestion.why
    with pytest.raises(InputError, match=r"for 14 pole pairs, say, write"):
        read_log(path, inputs=["velocity.knee"], outputs=["temperature.knee"], guessing=True)


# --- What is no joint's and no battery's ----------------------------------------------------------------


@pytest.mark.parametrize(
    "column",
    [
        "sensor_combined.baro_temp_celcius",
        "baro_temp",
        "imu.temperature",
        "cpu_temp",
        "gpu temperature",
        "lidar_temp_c",
        "airspeed.air_temperature_celsius",
        "spindle_temp",
    ],
)
@pytest.mark.parametrize("place", ["battery", "motor", "knee"])
def test_another_thing_s_thermometer_is_not_taken_for_the_only_one(write: Write, column: str, place: str) -> None:
    path = write({"time": TIME, column: WARM, "other": TIME})
    assert f"temperature.{place}" not in guessed(path, (), (f"temperature.{place}",))


@pytest.mark.parametrize("column", ["temp", "Case Temperature", "motor_temp_C", "esc.temperature", "T1", "NTC [degC]"])
def test_the_only_thermometer_of_one_motor_is_taken(write: Write, column: str) -> None:
    path = write({"time": TIME, column: WARM, "other": TIME})
    assert guessed(path, (), ("temperature.knee",))["temperature.knee"].split("|")[0] == column


@pytest.mark.parametrize("word", ["imu", "cpu", "gpu", "baro"])
def test_numbered_thermometers_of_other_things_are_no_joints(write: Write, word: str) -> None:
    table: dict[str, list[object]] = {"time": TIME} | {f"{word}_temp_{k}": list(WARM) for k in range(3)}
    assert "temperature.FR_calf" not in guessed(write(table))


# --- Numbered columns are checked against the data ------------------------------------------------------


def numbered(order: list[int], *, alike: bool = False, named: str = "", seed: int = 0) -> pd.DataFrame:
    """Four joints in the model's order, whose torques a drive numbers in another one."""
    rng = np.random.default_rng(seed)
    count = 1800
    frame: dict[str, object] = {"time": np.arange(count, dtype=float), "temperature.ambient": 22.0}
    common = np.repeat(rng.choice([0.0, 2.0, 5.0, 8.0], count // 60), 60)
    torques, readings = [], []
    for _ in FOUR:
        torque = (
            common * rng.uniform(0.9, 1.1) if alike else np.repeat(rng.choice([0.0, 2.0, 5.0, 8.0], count // 60), 60)
        )
        rise = np.zeros(count)
        for k in range(count - 1):
            rise[k + 1] = rise[k] + (0.4 * torque[k] ** 2 - rise[k] / 2) / 200
        torques.append(torque)
        readings.append(np.round(22 + rise + rng.normal(0, 0.1, count), 1))
    for k, joint in enumerate(FOUR):
        frame[f"temperature.{joint}" if named == "temperatures" else f"motor_{k}_temp"] = readings[k]
    for number, of in enumerate(order):
        frame[f"torque.{FOUR[number]}" if named == "torques" else f"motor_{number}_tau"] = torques[of]
    return pd.DataFrame(frame)


FOUR = ("L_hip", "L_knee", "R_hip", "R_knee")


def read_guessing(
    frame: pd.DataFrame, joints: Sequence[str] = FOUR, columns: dict[str, ColumnSource] | None = None
) -> Run:
    """The run of a log whose columns are guessed."""
    inputs, outputs = ([f"{quantity}.{joint}" for joint in joints] for quantity in ("torque", "temperature"))
    (run,) = read_log(frame, columns, guessing=True, inputs=inputs, outputs=outputs)
    return run


@pytest.mark.parametrize("order", [[0, 2, 1, 3], [1, 0, 3, 2], [3, 2, 1, 0], [1, 2, 3, 0]])
@pytest.mark.parametrize("named", ["", "temperatures"])
def test_numbers_by_which_temperatures_follow_other_torques_are_refused(order: list[int], named: str) -> None:
    frame = numbered(order, named=named)
    with pytest.raises(InputError, match="follow the torque of another joint better") as caught:
        read_guessing(frame)
    line = str(caught.value).partition("perhaps ")[2]
    columns = parse_columns(tomllib.loads("\n".join(line.split("; "))), "m.toml", "[columns]")
    run = read_guessing(frame, columns=columns)
    truth = numbered([0, 1, 2, 3], named="torques")
    for joint in FOUR:
        np.testing.assert_allclose(run.columns[f"torque.{joint}"], truth[f"torque.{joint}"])


def test_numbered_thermometers_of_named_torques_are_told_in_their_own_lines() -> None:
    frame = numbered([0, 2, 1, 3], named="torques")
    with pytest.raises(InputError, match="of another joint") as caught:
        read_guessing(frame)
    for line in ('"temperature.R_hip" = "motor_1_temp"', '"temperature.L_knee" = "motor_2_temp"'):
        assert line in str(caught.value)


@pytest.mark.parametrize("seed", [1, 2, 3])
@pytest.mark.parametrize("order", [[0, 1, 2, 3], [2, 1, 0, 3]])
def test_joints_that_work_alike_or_stand_right_are_not_refused(seed: int, order: list[int]) -> None:
    read_guessing(numbered([0, 1, 2, 3], seed=seed))
    read_guessing(numbered(order, alike=True, seed=seed))


@pytest.mark.parametrize("seed", [21, 22, 23])
def test_a_healthy_quadruped_is_not_refused_and_an_exchanged_one_is(seed: int) -> None:
    logs = quadruped_logs(seed=seed, runs=trial(seed, fitted=1800))
    frame = logs["fit1"]
    joints = [str(key).partition(".")[2] for key in frame if str(key).startswith("torque.")]
    keys = [f"{quantity}.{joint}" for joint in joints for quantity in ("temperature", "torque")]

    def named(order: list[str]) -> pd.DataFrame:
        names = {f"temperature.{joint}": f"motor_{k}_temp" for k, joint in enumerate(joints)}
        names |= {f"torque.{joint}": f"motor_{k}_tau" for k, joint in enumerate(order)}
        return frame[["time", *keys]].rename(columns=names)

    read_guessing(named(joints), joints)
    with pytest.raises(InputError, match="of another joint"):
        read_guessing(named(sorted(joints, key=lambda joint: joint.split("_")[::-1])), joints)


def test_all_guesses_are_told_and_of_a_second_log_that_they_are_the_same(tmp_path: Path) -> None:
    told: list[str] = []
    frame = quadruped_logs(seed=24, runs=trial(24, fitted=1800))["fit1"]
    (tmp_path / "model.toml").write_text(presets()["quadruped"])
    loaded = load_model(tmp_path / "model.toml", ["guess"])
    joints = [key.partition(".")[2] for key in loaded.model.inputs if key.startswith("torque.")]
    names = {f"torque.{joint}": f"motor_{k}_tau" for k, joint in enumerate(joints)}
    names |= {f"temperature.{joint}": f"motor_{k}_temp" for k, joint in enumerate(joints)}
    renamed = frame.rename(columns=names)
    loaded.runs([renamed, renamed.iloc[: len(renamed) // 2]], notify=lambda _, note: told.append(note))
    lines = [note for note in told if note.startswith("guessed: ")]
    for key, column in names.items():
        assert any(f'"{key}" = "{column}"' in line for line in lines)
    assert sum("the same" in line for line in lines) == 1
