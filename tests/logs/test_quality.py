"""What is wrong with a log: another unit, counters that wrap, dead or coarse sensors; said with what corrects it."""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from lptn.cli.main import main
from lptn.logs.channels import quantisation_step
from lptn.logs.columns import ColumnSource, parse_columns, parse_map_option
from lptn.logs.reading import read_log
from lptn.logs.run import Run
from lptn.robots.presets import presets

Write = Callable[..., Path]
Refuse = Callable[..., str]

TIME: list[object] = [float(k) for k in range(100)]
WARMING = [round(20 + 0.1 * k, 3) for k in range(100)]


def proposed(said: str) -> dict[str, ColumnSource]:
    """The entry that a message proposes, read as the model file's and as the option: both have to be the same."""
    line = re.search(r"write (\S+ = .+?) in \[columns\]", said)
    option = re.search(r'--map "([^"]+)"', said)
    assert line
    assert option
    columns = parse_columns(tomllib.loads(line[1]), "m.toml", "[columns]")
    assert columns == dict([parse_map_option(option[1])])
    return columns


def only(path: Path, columns: dict[str, ColumnSource] | None = None, **options: bool) -> Run:
    (run,) = read_log(path, columns, **options)  # type: ignore[arg-type]
    return run


@pytest.mark.parametrize(
    ("key", "values", "looks_like", "truth"),
    [
        ("temperature.a", np.array(WARMING) + 273.15, "kelvin", WARMING),
        ("temperature.a", np.array(WARMING) * 1000, "values around", WARMING),
        ("temperature.a", np.array(WARMING) * 100, "values around", WARMING),
        ("current.a", np.array(WARMING) * 1000, "mA", WARMING),
        ("velocity.a", np.array(WARMING) * 100, "rpm", np.array(WARMING) * 100 * np.pi / 30),
        ("torque.a", 2048 + np.arange(100.0), "converter of 12 bit", 50 / 2048 * np.arange(100.0)),
    ],
)
def test_a_unit_that_can_not_be_is_refused_and_its_remedy_corrects_it(
    write: Write, refuse: Refuse, key: str, values: np.ndarray, looks_like: str, truth: np.ndarray
) -> None:
    path = write({"time": TIME, key: values.tolist(), "power.b": TIME})
    said = refuse(path, read_log, path)
    assert looks_like in said
    np.testing.assert_allclose(only(path, proposed(said)).columns[key], truth, rtol=1e-9)
    # The user's word for what stands there is taken: its unit, and that it can be so large.
    if key != "torque.a":  # which no joint bears, in whatever converter's counts
        unit = {"temperature.a": "degC", "current.a": "A", "velocity.a": "rad/s"}[key]
        stated = ColumnSource((key,), unit, valid=(-1e6, 1e6))
        assert not only(path, {key: stated}).issues


@pytest.mark.parametrize(
    ("key", "name", "unit"),
    [
        ("current.a", "I_mA", "mA"),
        ("velocity.a", "motor rpm", "rpm"),
        ("torque.a", "tau [mNm]", "mN*m"),
        ("temperature.a", "T_degF", "degF"),
        ("torque.a", "tau_Ncm", "N*cm"),
        ("speed.base", "v_kmh", "km/h"),
        ("power.a", "P_kW", "kW"),
    ],
)
def test_a_name_that_says_another_unit_is_heard(write: Write, refuse: Refuse, key: str, name: str, unit: str) -> None:
    path = write({"time": TIME, name: WARMING, "power.b": TIME})
    said = refuse(path, read_log, path, {key: ColumnSource((name,))})
    assert f"whose name says {unit}" in said
    assert proposed(said) == {key: ColumnSource((name,), unit)}


def test_electrical_turns_are_not_taken_for_the_shaft_s(write: Write, refuse: Refuse) -> None:
    path = write({"time": TIME, "erpm": [1400.0 * k for k in range(100)], "temperature.a": WARMING})
    said = refuse(path, read_log, path, {"velocity.a": ColumnSource(("erpm",))})
    assert "electrical turns, by the column's name" in said
    run = only(path, proposed(said))  # as proposed, for 14 pole pairs
    assert run.columns["velocity.a"][60] == pytest.approx(60 * 100 * np.pi / 30)


@pytest.mark.parametrize(
    ("name", "factor", "start", "unit"),
    [("t_ms", 1e3, 0.0, "ms"), ("time", 1e3, 1.7e12, "ms"), ("time", 1e6, 1.7e15, "us"), ("time", 1e9, 1.7e18, "ns")],
)
def test_time_in_another_unit(write: Write, refuse: Refuse, name: str, factor: float, start: float, unit: str) -> None:
    path = write({name: [start + factor * k for k in range(100)], "temperature.a": WARMING})
    columns = {} if name == "time" else {"time": ColumnSource((name,))}
    said = refuse(path, read_log, path, columns)
    assert proposed(said) == {"time": ColumnSource((name,), unit)}
    run = only(path, proposed(said))
    assert run.step == pytest.approx(1.0, rel=1e-3)


def test_long_steps_of_whole_numbers_are_an_uncertain_issue(write: Write) -> None:
    path = write({"time": [100 * k for k in range(2000)], "temperature.a": [20 + k % 7 for k in range(2000)]})
    (issue,) = only(path).issues
    assert (issue.key, issue.certain) == ("time", False)
    assert "ms" in issue.remedy


def test_surroundings_like_a_room_in_fahrenheit_are_an_issue(write: Write, refuse: Refuse) -> None:
    path = write({"time": TIME, "temperature.a": WARMING, "temperature.ambient": [58.0] * 100})
    (issue,) = only(path).issues
    assert issue.key == "temperature.ambient"
    assert "degF" in issue.problem
    assert only(path, proposed(issue.sentence)).columns["temperature.ambient"][0] == pytest.approx(14.44, abs=0.01)
    path = write({"time": TIME, "temperature.a": WARMING, "temperature.ambient": [72.0] * 100})
    said = refuse(path, read_log, path)  # no chamber is as hot
    assert only(path, proposed(said)).columns["temperature.ambient"][0] == pytest.approx(22.22, abs=0.01)


def test_motors_in_fahrenheit_beside_a_room_in_celsius_are_an_issue(write: Write) -> None:
    fahrenheit = [1.8 * value + 32 for value in WARMING]
    path = write({"time": TIME, "temperature.a": fahrenheit, "temperature.ambient": [20.0] * 100})
    (issue,) = only(path).issues
    assert issue.key == "temperature.a"
    assert proposed(issue.sentence)["temperature.a"].unit == "degF"


def test_a_time_counter_of_16_bit(write: Write, refuse: Refuse) -> None:
    path = write({"t": [(5000 + 1000 * k) % 65536 for k in range(100)], "temperature.a": WARMING})
    said = refuse(path, read_log, path, {"time": ColumnSource(("t",), "ms")})
    source = proposed(said)["time"]
    assert (source.wrap, source.unit) == (65536.0, "ms")
    run = only(path, {"time": source})
    np.testing.assert_allclose(run.time, 5.0 + np.arange(100))


def test_time_that_leaps_ahead_is_a_gap_and_no_counter_that_wraps(write: Write) -> None:
    time: list[object] = [*range(0, 5000, 100), *range(60000, 65000, 100)]
    path = write({"time": time, "temperature.a": WARMING[: len(time)], "torque.a": [1.0] * len(time)})
    runs = read_log(path, {"time": ColumnSource(("time",), unit="ms")}, step=0.1)
    assert [len(run) for run in runs] == [50, 50]


def test_a_current_in_counts_of_16_bit(write: Write, refuse: Refuse) -> None:
    truth = np.round(3000 * np.sin(np.arange(100) / 9))  # mA, written without its sign
    path = write({"time": TIME, "c": (truth % 65536).tolist(), "temperature.a": WARMING})
    columns = {"current.a": ColumnSource(("c",), "mA")}
    said = refuse(path, read_log, path, columns)
    assert "a counter of 16 bit that wraps" in said
    run = only(path, proposed(said))
    np.testing.assert_allclose(run.columns["current.a"], np.abs(truth) / 1000)


def test_counts_that_change_their_sign_from_row_to_row(write: Write, refuse: Refuse) -> None:
    truth = [100 * (-1) ** k + k for k in range(100)]
    path = write({"time": TIME, "c": [value % 65536 for value in truth], "temperature.a": WARMING})
    said = refuse(path, read_log, path, {"current.a": ColumnSource(("c",), "mA")})
    assert "a counter of 16 bit that wraps" in said
    np.testing.assert_allclose(only(path, proposed(said)).columns["current.a"], np.abs(truth) / 1000)


@pytest.mark.parametrize("swings", [10, 25])
def test_a_torque_that_swings_farther_over_zero_than_else_is_a_counter_and_rare_spikes_are_none(
    write: Write, refuse: Refuse, swings: int
) -> None:
    """As of a leg that stands and swings: a gait's steps over zero are larger than those of 19 rows in 20."""
    rng = np.random.default_rng(5)
    level = np.where(np.arange(600) // swings % 2, 13.0, -4.5)
    truth = np.round(level + rng.normal(0, 0.1, 600), 2)
    table = {"time": np.arange(600).tolist(), "temperature.a": np.linspace(30, 50, 600).tolist()}
    path = write({**table, "torque.a": np.round(truth % 655.36, 2).tolist()})
    said = refuse(path, read_log, path)
    assert "a counter of 16 bit that wraps" in said
    np.testing.assert_allclose(only(path, proposed(said)).columns["torque.a"], np.abs(truth))
    spiky = np.abs(truth)
    spiky[[100, 300, 500]] = 640.0, 645.0, 650.0
    path = write({**table, "torque.a": spiky.tolist()})
    assert not any(issue.kind == "wrap" for issue in only(path).issues)


def test_a_fault_code_is_said_and_no_reading(write: Write) -> None:
    readings = list(WARMING)
    for row in (10, 11, 40):
        readings[row] = 850.0
    path = write({"time": TIME, "temperature.a": readings, "power.b": TIME})
    run = only(path)
    (issue,) = run.issues
    assert issue.problem.startswith("3 readings of exactly 850 degC")
    assert issue.sentence in run.notes
    assert np.flatnonzero(np.isnan(run.temperature("a"))).tolist() == [10, 11, 40]
    run = only(path, proposed(issue.sentence))
    assert np.flatnonzero(np.isnan(run.temperature("a"))).tolist() == [10, 11, 40]
    assert "temperature.a: 3 of 100 numbers are no readings, by its entry in [columns]." in run.notes
    assert not run.issues


@pytest.mark.parametrize("code", [-127.0, 0.0, 85.0])
def test_what_a_thermometer_gives_when_it_fails(write: Write, code: float) -> None:
    readings = list(WARMING)
    readings[50] = code
    (issue,) = only(write({"time": TIME, "temperature.a": readings})).issues
    assert f"invalid = [{code:g}]" in issue.remedy


def test_a_motor_that_passes_85_degrees_is_no_fault(write: Write) -> None:
    readings = [40 + 0.5 * k for k in range(100)]
    assert not only(write({"time": TIME, "temperature.a": readings})).issues


def test_a_range_of_valid_readings(write: Write) -> None:
    readings = [*WARMING[:50], 400.0, -60.0, *WARMING[52:]]
    columns = {"temperature.a": ColumnSource(("temperature.a",), valid=(-40.0, 200.0))}
    run = only(write({"time": TIME, "temperature.a": readings}), columns)
    assert np.flatnonzero(np.isnan(run.temperature("a"))).tolist() == [50, 51]


def test_a_sensor_that_is_stuck(write: Write) -> None:
    rng = np.random.default_rng(1)
    moving = np.round(30 + 0.01 * np.arange(2000) + rng.normal(0, 0.03, 2000), 3)
    stuck = moving.copy()
    stuck[500:1500] = stuck[500]
    path = write({"time": list(range(2000)), "temperature.a": moving.tolist(), "temperature.b": stuck.tolist()})
    (issue,) = only(path).issues
    assert issue.key == "temperature.b"
    assert issue.problem == "frozen at 34.959 degC from 500 to 1499 s (line 502 to 1501)"
    assert (issue.kind, issue.stretch) == ("frozen", (500.0, 1499.0))
    (run,) = read_log(path, outputs=["temperature.a", "temperature.b"])
    assert np.flatnonzero(np.isnan(run.temperature("b"))).tolist() == list(range(500, 1500))
    assert not np.isnan(run.temperature("a")).any()


def test_coarse_sensors_and_quiet_rooms_are_not_stuck(write: Write) -> None:
    coarse = [float(round(20 + 0.002 * k)) for k in range(4000)]
    path = write({"time": list(range(4000)), "temperature.a": coarse, "temperature.ambient": [21.0] * 4000})
    assert not only(path).issues


def test_a_product_of_voltage_and_current(write: Write) -> None:
    columns = parse_columns({"power.a": {"product": ["u", "i"], "unit": "mW"}}, "m.toml", "[columns]")
    path = write({"time": TIME, "u": [48.0] * 100, "i": TIME, "temperature.a": WARMING})
    np.testing.assert_allclose(only(path, columns).columns["power.a"], 0.048 * np.arange(100))


def test_issues_do_not_stop_a_reader_who_only_looks(write: Write) -> None:
    path = write({"time": TIME, "temperature.a": [value + 273.15 for value in WARMING]})
    run = only(path, strict=False)
    assert [issue.certain for issue in run.issues] == [True]


def test_a_sensor_that_never_moves_while_others_do(write: Write) -> None:
    warm = [20 + 0.01 * k for k in range(700)]
    table: dict[str, list[object]] = {"time": list(range(700)), "temperature.a": [25.0] * 700}
    assert not only(write(table)).issues
    (issue,) = only(write(table | {"temperature.b": list(warm)})).issues
    assert issue.problem == "reads 25 degC throughout, 699 s, while another one moves"


def test_every_command_warns_of_issues(write: Write, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    readings = [*WARMING[:50], 850.0, *WARMING[51:]]
    path = write(
        {"time": TIME, "temperature.motor": readings, "torque.motor": TIME, "temperature.ambient": [20.0] * 100}
    )
    model = tmp_path / "model.toml"
    model.write_text(presets()["single-motor"])
    with pytest.raises(SystemExit) as stop:
        main(["compare", str(model), str(path)])
    assert not stop.value.code
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert said.startswith(f"lptn: {path}: temperature.motor: 1 reading of exactly 850 degC")


# --- The step of a coarse sensor is found where there is one, and only there ------------------------------------------


rng = np.random.default_rng(3)
SMOOTH = 25 + 15 * (1 - np.exp(-np.arange(3000) / 800)) + 0.05 * rng.normal(size=3000)


@pytest.mark.parametrize("step", [1.0, 0.5, 0.0625, 0.1, 5 / 9])
def test_a_step_is_found(step: float) -> None:
    assert quantisation_step(np.round(SMOOTH / step) * step) == pytest.approx(step, rel=1e-3)


@pytest.mark.parametrize("step", [0.02, 1.0, 0.0])
def test_a_step_of_very_many_readings_is_found_as_of_few(step: float) -> None:
    rng = np.random.default_rng(7)
    readings = 20 + 40 * np.sin(np.linspace(0.0, 9.0, 200_000)) ** 2 + rng.normal(0.0, 0.1, 200_000)
    assert quantisation_step(np.round(readings / step) * step if step else readings) == step


def test_nan_and_float32_do_not_hide_a_step() -> None:
    values = (np.round(SMOOTH / 0.0625) * 0.0625 - 273.15 + 273.15).astype(np.float32).astype(np.float64)
    values[::7] = np.nan
    assert quantisation_step(values) == pytest.approx(0.0625, rel=1e-3)


def test_a_rounded_step_is_found_or_not_but_never_wrong() -> None:
    adc = 3.3 / 4096 * 400
    step = quantisation_step(np.round(np.round(SMOOTH / adc) * adc, 2))
    assert step == 0.0 or step == pytest.approx(adc, rel=0.02)


@pytest.mark.parametrize(
    "values",
    [
        SMOOTH,
        np.round(SMOOTH, 2),
        20 + 0.1 * np.arange(200),
        np.full(100, 25.0),
        np.full(100, np.nan),
        np.array([]),
        np.repeat([25.0, 85.0], 50),
    ],
    ids=["smooth", "two decimals", "ramp", "constant", "nan", "none", "fault code"],
)
def test_no_step_where_there_is_none(values: np.ndarray) -> None:
    assert quantisation_step(values) == 0.0


def test_a_robot_that_was_warm_is_not_called_fahrenheit(write: Write) -> None:
    """Without the room's temperature: sensors that begin apart were not at rest in one."""
    falling = np.linspace(74.0, 66.0, 100)
    warm = write({"time": TIME, "temperature.a": falling, "temperature.b": falling - 7.0})
    assert not [issue for run in read_log(warm) for issue in run.issues]
    cools = write({"time": TIME, "temperature.a": falling, "temperature.b": falling - 2.0})
    assert [issue.certain for run in read_log(cools) for issue in run.issues] == [False, False]
    rising = {"temperature.a": TIME, "temperature.b": TIME, "temperature.ambient": [22.0] * 100}
    rising["temperature.a"], rising["temperature.b"] = (list(start + 0.1 * np.arange(100)) for start in (66.0, 74.0))
    assert not only(write({"time": TIME, **rising})).issues  # in degF both would be near the room's 22 degC


def test_one_hot_motor_of_a_warm_robot_is_not_called_fahrenheit(write: Write) -> None:
    """At 66 degC it reads what 19 degC is in degF, in a room of 17; but the others aren't at rest."""
    hot = {"temperature.a": np.linspace(66.0, 60.0, 100), "temperature.ambient": [17.4] * 100}
    others = {"temperature.b": np.linspace(45.0, 41.0, 100), "temperature.c": np.linspace(56.0, 50.0, 100)}
    assert not only(write({"time": TIME, **hot, **others})).issues
    rested = {name: np.linspace(18.0, 18.0 + 0.01 * len(name) * row, 100) for row, name in enumerate(others, start=3)}
    (issue,) = only(write({"time": TIME, **hot, **rested})).issues
    assert issue.key == "temperature.a"


def test_a_whole_log_in_fahrenheit_waits_until_its_unit_is_named(write: Write, refuse: Refuse) -> None:
    """Nothing in degC begins at rest at 68 degC, and a robot that is so warm cools when it does less."""
    path = write({"time": TIME, "temperature.a": 1.8 * np.array(WARMING) + 32, "temperature.b": [68.0] * 99 + [70.0]})
    said = refuse(path, read_log, path)
    assert "as all sensors do, and none of them ever cools: which looks like degF" in said
    columns = proposed(said)
    assert "column 'temperature.b'" in refuse(path, read_log, path, columns)  # one is named, the other not yet
    columns |= {"temperature.b": ColumnSource(("temperature.b",), "degF")}
    assert only(path, columns).temperature("b")[0] == pytest.approx(20.0)
    stated = {f"temperature.{name}": ColumnSource((f"temperature.{name}",), "degC") for name in "ab"}
    assert not only(path, stated).issues


def test_a_torque_that_always_brakes_has_its_sign_turned_round(write: Write) -> None:
    speed = [5.0 + 0.01 * k for k in range(100)]
    torque = [2.0 + 0.02 * k for k in range(100)]
    columns = {"time": TIME, "velocity.a": speed, "temperature.a": WARMING}
    run = only(write(columns | {"torque.a": [-value for value in torque]}))
    (issue,) = run.issues
    assert issue.kind == "sign"
    assert "100% of its work" in issue.problem
    assert "scale = -1" in issue.remedy
    assert not only(write(columns | {"torque.a": torque})).issues
    in_turn = [value * (-1) ** (k // 10) for k, value in enumerate(torque)]
    assert not only(write(columns | {"torque.a": in_turn})).issues


def test_spikes_that_hit_one_number_twice_by_chance_are_no_codes(write: Write) -> None:
    rng = np.random.default_rng(4)
    time, readings = np.arange(2000.0), np.round(30 + rng.normal(0, 0.1, 2000), 1)
    rows = rng.choice(np.arange(5, 1995, 4), 60, replace=False)
    readings[rows] = np.round(30 + rng.choice([-1, 1], 60) * rng.uniform(31, 40, 60), 1)
    assert np.unique(readings[rows]).size < 60
    run = only(write({"time": time.tolist(), "temperature.a": readings.tolist()}))
    assert [issue.kind for issue in run.issues] == ["spike"]


@pytest.mark.parametrize("first", [1.74135e9, 1e7, 3.6e3, 0.0])
def test_a_time_is_counted_from_where_the_log_began_if_its_clock_did_not(write: Write, first: float) -> None:
    rng, time = np.random.default_rng(1), np.arange(1800.0)
    readings = np.round(25 + 0.01 * time + rng.normal(0, 0.1, 1800), 3)
    readings[600:1201] = readings[600]
    path = write({"time": (first + time).tolist(), "temperature.a": readings.tolist(), "power.b": time.tolist()})
    (issue,) = only(path).issues
    shown = "from 600 to 1200 s after the log began" if first > 1e6 else f"from {first + 600:g} to {first + 1200:g} s"
    assert f"{shown} (line 602 to 1202)" in issue.problem
    assert issue.stretch == (first + 600, first + 1200)
