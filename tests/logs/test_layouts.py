"""Files as people have them: lines above the table, units below its names, quotes, spreadsheets, rows without times."""

from __future__ import annotations

import csv
import datetime
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.basics.errors import InputError
from lptn.identify.data import split_data
from lptn.identify.fitting import fit
from lptn.logs.columns import ColumnSource, map_option, parse_columns, parse_map_option, toml_line
from lptn.logs.csv_files import Layout, find_layout
from lptn.logs.reading import open_log, read_log
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.model.network import Network
from tests.builders import AMBIENT, effect, link, node

Refuse = Callable[..., str]

NAMES = ["time", "torque.a", "temperature.a"]
ROWS = [[str(k), str(k % 7), f"{20 + 0.5 * k}"] for k in range(40)]


def read(path: Path) -> Run:
    (run,) = read_log(path)
    np.testing.assert_allclose(run.temperature("a"), 20 + 0.5 * np.arange(40))
    np.testing.assert_allclose(run.columns["torque.a"], np.arange(40) % 7)
    return run


PREAMBLES = {
    "none": "",
    "sentences": "ACME 3000 logger\nFirmware 1.2, rev B\n",
    "keys and values": "Serial,12345\nStart,2025-03-01 12:00:00\n\n",
    "a table of its own": "Parameter,Value\nRate,50\nGain,3\n",
    "as wide as the table": "ACME,3000,logger\nserial,12,x\n",
    "dotted": "\n\nexported by: A. Nobody, 3 rows, 2 columns;\n---\n",
}


@pytest.mark.parametrize("units", ["", "s,Nm,degC", "[s],[N m],[°C]", "s,N*m,-"])
@pytest.mark.parametrize("preamble", PREAMBLES)
def test_what_stands_above_and_below_the_names(tmp_path: Path, preamble: str, units: str) -> None:
    lines = [",".join(NAMES), *filter(None, [units]), *map(",".join, ROWS)]
    (tmp_path / "log.csv").write_text(PREAMBLES[preamble] + "\n".join(lines) + "\n")
    run = read(tmp_path / "log.csv")
    assert any("what stands above is left out" in note for note in run.notes) == bool(PREAMBLES[preamble].strip())
    assert not run.issues


def test_a_line_is_named_as_it_stands_in_the_file(tmp_path: Path, refuse: Refuse) -> None:
    path = tmp_path / "log.csv"
    rows = [*ROWS[:5], ["5", "off", "22.5"], *ROWS[6:]]
    path.write_text("made by: me\n\n" + "\n".join(map(",".join, [NAMES, ["s", "Nm", "degC"], *rows])) + "\n")
    assert "line 10, column 'torque.a': found 'off'" in refuse(path, read_log, path)


def test_a_row_of_units_is_heard(tmp_path: Path, refuse: Refuse) -> None:
    path = tmp_path / "log.csv"
    path.write_text("\n".join(map(",".join, [NAMES, ["ms", "Nm", "°F"], *ROWS])) + "\n")
    said = refuse(path, read_log, path)
    assert "column 'time': found a unit of ms in the file" in said
    columns = {"time": ColumnSource(("time",), "ms")}
    said = refuse(path, read_log, path, columns)
    assert 'write "temperature.a" = { column = "temperature.a", unit = "degF" }' in said
    columns |= {"temperature.a": ColumnSource(("temperature.a",), "degF")}
    assert read_log(path, columns, step=0.001)[0].temperature("a")[0] == pytest.approx(-6.667, abs=0.01)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("ending", [".csv", ".tsv", ".txt"])
def test_quoted_cells_with_commas_in_their_names(tmp_path: Path, separator: str, ending: str) -> None:
    names = ["time", "torque, a, N·m; measured", "temp, a"]
    with (tmp_path / f"log{ending}").open("w", newline="") as file:
        writer = csv.writer(file, delimiter=separator, quoting=csv.QUOTE_ALL)
        writer.writerows([names, *ROWS])
    columns = {"torque.a": ColumnSource((names[1],)), "temperature.a": ColumnSource((names[2],))}
    (run,) = read_log(tmp_path / f"log{ending}", columns)
    np.testing.assert_allclose(run.temperature("a"), 20 + 0.5 * np.arange(40))


def test_decimal_commas_between_tabs(tmp_path: Path) -> None:
    rows = [[cell.replace(".", ",") for cell in row] for row in ROWS]
    (tmp_path / "log.txt").write_text("\n".join(map("\t".join, [NAMES, *rows])))
    (run,) = read_log(tmp_path / "log.txt")
    np.testing.assert_allclose(run.temperature("a"), 20 + 0.5 * np.arange(39))  # the last line has no end


@pytest.mark.parametrize(
    ("clock", "seconds"),
    [
        ("{h}:{m:02}:{s:02}", 61.0),
        ("{h:02}:{m:02}:{s:02}.5", 61.0),
        ("{whole}:{s:02}.25", 61.0),
    ],
)
def test_times_of_the_day(tmp_path: Path, clock: str, seconds: float) -> None:
    at = [int(seconds * k) for k in range(40)]
    stamps = [clock.format(h=t // 3600, m=t % 3600 // 60, s=t % 60, whole=t // 60) for t in at]
    rows = [[stamp, *row[1:]] for stamp, row in zip(stamps, ROWS, strict=True)]
    (tmp_path / "log.csv").write_text("\n".join(map(",".join, [NAMES, *rows])) + "\n")
    (run,) = read_log(tmp_path / "log.csv")
    assert run.step == seconds


def test_hours_and_minutes_are_not_taken_for_minutes_and_seconds(tmp_path: Path, refuse: Refuse) -> None:
    path = tmp_path / "log.csv"
    path.write_text("\n".join(map(",".join, [NAMES, *([f"12:{k:02}", *row[1:]] for k, row in enumerate(ROWS))])))
    assert "line 2, column 'time': found '12:00'; expected a number" in refuse(path, read_log, path)


@pytest.mark.parametrize(
    ("rows", "header", "units"),
    [
        ([["a", "b"], ["1", "2"]], 0, ()),
        ([["a", "b"], ["m", "s"], ["1", "2"]], 0, ("m", "s")),
        ([["x", "y"], ["time", "power"], ["1", "2"]], 1, ()),  # two lines of words: the second is no unit
        ([["time", "T"], ["1", "2"], ["3", "4"], ["time", "T"], ["5", "6"]], 0, ()),  # a logger that was restarted
        ([["1", "2"], ["3", "4"]], 0, ()),
        ([["nan", "nan"], ["a", "b"], ["2026-01-01T00:00:00Z", "nan"]], 1, ()),
    ],
)
def test_the_layout(rows: Sequence[Sequence[str]], header: int, units: tuple[str, ...]) -> None:
    layout = find_layout(rows)
    assert (layout.header, layout.units) == (header, units)
    assert isinstance(layout, Layout)


# --- Spreadsheets -----------------------------------------------------------------------------------------------------


def workbook(path: Path, sheets: Mapping[str, Sequence[Sequence[object]]]) -> Path:
    from openpyxl import Workbook

    book = Workbook()
    book.remove(book.worksheets[0])
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


VALUES: list[list[object]] = [[k, k % 7, 20 + 0.5 * k] for k in range(40)]


def test_a_spreadsheet_with_metadata_units_and_another_sheet(tmp_path: Path, refuse: Refuse) -> None:
    above: list[list[object]] = [["measured by", "me"], ["on", datetime.date(2026, 1, 1)], []]
    table: list[list[object]] = [*above, list(NAMES), ["s", "Nm", "degC"], *VALUES]
    path = workbook(tmp_path / "log.xlsx", {"notes": [["nothing"]], "data": table, "old": [["a", "b"], [1, 2]]})
    run = read(path)
    assert any("sheet 'data' is read; 'old' not" in note for note in run.notes)
    assert any("begins on sheet 'data', row 4" in note for note in run.notes)
    broken = workbook(tmp_path / "off.xlsx", {"data": [*table[:7], [2, "off", 21.0], *table[8:]]})
    assert "sheet 'data', row 8, column 'torque.a': found 'off'" in refuse(broken, read_log, broken)


def test_times_of_a_spreadsheet(tmp_path: Path) -> None:
    begin = datetime.datetime(2026, 1, 1, 23, 59, 50)
    dated = [[begin + datetime.timedelta(seconds=k), *row[1:]] for k, row in enumerate(VALUES)]
    read(workbook(tmp_path / "dates.xlsx", {"data": [list(NAMES), *dated]}))
    clock = [[datetime.time(1, k // 60, k % 60), *row[1:]] for k, row in enumerate(VALUES)]
    assert read(workbook(tmp_path / "clock.xlsx", {"data": [list(NAMES), *clock]})).time[0] == 3600.0


def test_a_spreadsheet_without_a_table(tmp_path: Path, refuse: Refuse) -> None:
    path = workbook(tmp_path / "log.xlsx", {"data": [["nothing", "here"]]})
    assert "no table in any sheet" in refuse(path, read_log, path)


# --- Rows without times -----------------------------------------------------------------------------------------------


def test_rows_at_a_rate(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("\n".join(",".join(row[1:]) for row in [NAMES, *ROWS]) + "\n")
    _, source = parse_map_option("time=[rate=0.5]")
    (run,) = read_log(tmp_path / "log.csv", {"time": source})
    assert run.step == 2.0
    assert any("counted from its rows, 0.5 a second" in note for note in run.notes)
    (framed,) = read_log(pd.read_csv(tmp_path / "log.csv"), {"time": source})
    np.testing.assert_array_equal(framed.temperature("a"), run.temperature("a"))


def test_columns_that_stand_are_told_of_rows_at_a_rate(tmp_path: Path) -> None:
    rng, rows = np.random.default_rng(4), np.minimum(np.arange(400), 100) + np.maximum(np.arange(400) - 200, 0)
    noisy = {f"temperature.{name}": 30 + rng.normal(0, 0.01, 400)[rows] for name in ("a", "b", "c")}
    pd.DataFrame(noisy).to_csv(tmp_path / "log.csv", index=False)
    _, source = parse_map_option("time=[rate=10]")
    (run,) = read_log(tmp_path / "log.csv", {"time": source})
    assert [(one.key, one.column) for one in run.issues if "all columns stand" in one.problem] == [("time", "time")]


def test_slow_rows_at_a_rate_are_not_asked_and_can_say_that_they_are_means(tmp_path: Path) -> None:
    (tmp_path / "log.csv").write_text("\n".join(",".join(row[1:]) for row in [NAMES, *ROWS]) + "\n")
    for option, averaged, begins in (("rate=0.01", False, 0.0), ("rate=0.01; rows=means before", True, -100.0)):
        key, source = parse_map_option(f"time=[{option}]")
        (run,) = read_log(tmp_path / "log.csv", {key: source})
        assert (run.averaged, run.time[0]) == (averaged, begins)
        assert not any("read as samples" in note for note in run.notes)
        assert parse_columns(tomllib.loads(toml_line(key, source)), "m", "c") == {key: source}
        assert parse_map_option(map_option(key, source).removeprefix('--map "').removesuffix('"')) == (key, source)


def test_a_log_without_times_is_told_of_the_rate(tmp_path: Path, refuse: Refuse) -> None:
    path = tmp_path / "log.csv"
    path.write_text("\n".join(",".join(row[1:]) for row in [NAMES, *ROWS]) + "\n")
    assert "--rate 50 for 50 a second" in refuse(path, read_log, path)


@pytest.mark.parametrize("name", ["time", "t", "Uhr [s]", "header.stamp"])
def test_two_logs_of_which_one_has_no_times(tmp_path: Path, name: str) -> None:
    time = np.arange(400.0)
    heat = np.where(time > 60, 30.0, 0.0)
    warm = 20 + 0.05 * np.maximum(time - 60, 0)
    pd.DataFrame({name: time, "temperature.a": warm}).to_csv(tmp_path / "warm.csv", index=False)
    pd.DataFrame({"power.a": heat}).to_csv(tmp_path / "heat.csv", index=False)
    columns = {"time": ColumnSource((name,)), "time.2": parse_map_option("time.2=[rate=1]")[1]}
    table, left = open_log(tmp_path / "warm.csv+heat.csv@0", columns)
    assert "time.2" not in left
    numbers = table.numbers(["power.a"])
    np.testing.assert_array_equal(numbers["power.a"], heat)


def test_a_log_that_ends_early_ends_the_run_and_is_no_zero_afterwards(tmp_path: Path) -> None:
    time = np.arange(400.0)
    frame = pd.DataFrame({"time": time, "power.a": 30.0, "temperature.a": 20 + 0.05 * time})
    frame[["time", "temperature.a"]].to_csv(tmp_path / "warm.csv", index=False)
    frame[["time", "power.a"]].iloc[:150].to_csv(tmp_path / "heat.csv", index=False)
    (run,) = read_log(tmp_path / "warm.csv+heat.csv@0", inputs=["power.a"], outputs=["temperature.a"])
    assert len(run) == 150
    assert (run.columns["power.a"] == 30.0).all()
    (note,) = (note for note in run.notes if note.startswith("power.a: no value in the last 250 s; cut off; "))
    assert "afterwards = 0" in note


def test_what_holds_after_a_log_that_ends_early_can_be_said(tmp_path: Path) -> None:
    time = np.arange(400.0)
    frame = pd.DataFrame({"time": time, "P_mW": 3e4, "temperature.a": 20 + 0.05 * time})
    frame[["time", "temperature.a"]].to_csv(tmp_path / "warm.csv", index=False)
    frame[["time", "P_mW"]].iloc[:150].to_csv(tmp_path / "heat.csv", index=False)
    key, source = parse_map_option("power.a=P_mW[mW; afterwards=0]")
    (run,) = read_log(tmp_path / "warm.csv+heat.csv@0", {key: source}, inputs=[key], outputs=["temperature.a"])
    assert len(run) == 400
    assert (run.columns["power.a"][:150] == 30.0).all()
    assert not run.columns["power.a"][151:].any()
    assert parse_columns({key: {"column": "P_mW", "unit": "mW", "afterwards": 0}}, "m", "c") == {key: source}
    assert toml_line(key, source) == '"power.a" = { column = "P_mW", unit = "mW", afterwards = 0 }'


def test_a_vesc_log_is_known_by_its_names_over_midnight(tmp_path: Path) -> None:
    step = np.arange(400)
    columns = {
        "ms_today": (86_300_000 + 500 * step) % 86_400_000,
        "input_voltage": np.full(400, 48.0),
        "temp_mos_max": 30 + 0.01 * step,
        "temp_motor": 25 + 0.05 * step,
        "current_motor": np.full(400, 5.0),
        "current_in": np.full(400, 2.0),
        "d_axis_current": np.full(400, 3.0) + 0.01 * (step % 7),
        "q_axis_current": np.full(400, -4.0) + 0.01 * (step % 5),
        "erpm": np.full(400, 7000.0),
    }
    path = tmp_path / "vesc.csv"
    pd.DataFrame(columns).to_csv(path, index=False, sep=";")
    outputs = ["temperature.motor", "temperature.mosfet"]
    (run,) = read_log(path, inputs=["current.motor", "power.battery"], outputs=outputs)
    assert len(run) * run.step == pytest.approx(200)
    np.testing.assert_allclose(run.temperature("motor"), columns["temp_motor"][:: round(2 * run.step)], atol=0.2)
    assert run.columns["current.motor"].mean() == pytest.approx(5.0, abs=0.03)
    assert run.columns["power.battery"].mean() == pytest.approx(96.0)
    assert any('amperes = "amplitude"' in note for note in run.notes)


def test_a_table_of_moteus_registers_is_known_in_its_own_units(tmp_path: Path) -> None:
    time = np.arange(300.0)
    columns = {
        "time": time, "MODE": 10, "POSITION": 0.1 * time, "VELOCITY": 1.5, "TORQUE": 2.0, "Q_CURRENT": -4.0,
        "D_CURRENT": 3.0, "POWER": 30.0, "MOTOR_TEMPERATURE": 25 + 0.05 * time, "VOLTAGE": 24.0,
        "TEMPERATURE": 30 + 0.02 * time, "FAULT": 0,
    }  # fmt: skip
    pd.DataFrame(columns).to_csv(tmp_path / "moteus.csv", index=False)
    inputs = ["current.motor", "torque.motor", "velocity.motor"]
    (run,) = read_log(tmp_path / "moteus.csv", inputs=inputs, outputs=["temperature.motor", "temperature.board"])
    np.testing.assert_allclose(run.temperature("motor"), 25 + 0.05 * time)
    np.testing.assert_allclose(run.temperature("board"), 30 + 0.02 * time)
    found = [float(run.columns[name].mean()) for name in inputs]
    np.testing.assert_allclose(found, [5.0, 2.0, 3 * np.pi])  # registers' turns a second
    assert any("known by moteus's names; torque and speed are those of its output shaft" in one for one in run.notes)


@pytest.mark.parametrize("foc", ["current_control", "foc"])
@pytest.mark.parametrize(("own", "place"), [("", "axis0"), ("odrv1.", "odrv1_axis0")])
def test_a_table_of_an_odrives_properties_is_known_by_their_paths(
    own: str, place: str, foc: str, tmp_path: Path
) -> None:
    time = np.arange(300.0)
    axis = f"{own}axis0"
    columns = {
        "time": time,
        f"{axis}.motor.{foc}.Iq_measured": 12.0,
        f"{axis}.motor.{foc}.Id_measured": 5.0,
        f"{axis}.{'encoder.' if foc != 'foc' else ''}vel_estimate": -2.0,
        f"{axis}.motor.motor_thermistor.temperature": 25 + 0.05 * time,
        f"{axis}.motor.fet_thermistor.temperature": 30 + 0.02 * time,
        f"{own}axis1.motor.fet_thermistor.temperature": 21.0,
    }
    pd.DataFrame(columns).to_csv(tmp_path / "odrive.csv", index=False)
    inputs, outputs = [f"current.{place}", f"velocity.{place}"], [f"temperature.{place}", f"temperature.{place}_mosfet"]
    (run,) = read_log(tmp_path / "odrive.csv", inputs=inputs, outputs=outputs)
    np.testing.assert_allclose(run.temperature(place), 25 + 0.05 * time)
    np.testing.assert_allclose(run.temperature(f"{place}_mosfet"), 30 + 0.02 * time)
    np.testing.assert_allclose([run.columns[name].mean() for name in inputs], [13.0, 4 * np.pi])
    assert any("known by ODrive's names" in note and 'amperes = "amplitude"' in note for note in run.notes)


def test_what_is_logged_on_change_or_once_stands_until_the_next(tmp_path: Path) -> None:
    """A torque that is written when it changes, once in a minute, and the room's temperature that is written once."""
    time = np.arange(600.0)
    torque = np.random.default_rng(3).normal(0.0, 5.0, 10)[(time // 60).astype(int)]
    changes = np.where(time % 60 == 20, torque, np.nan)
    room = np.where(time == 300, 21.5, np.nan)
    frame = pd.DataFrame({"time": time, "torque.a": changes, "room": room, "temperature.a": 22 + 0.01 * time})
    frame.to_csv(tmp_path / "log.csv", index=False)
    inputs, outputs = ["torque.a", "temperature.ambient"], ["temperature.a"]
    once = {"temperature.ambient": ColumnSource(("room",))}
    with pytest.raises(InputError, match="or hold = true in its entry of"):
        read_log(tmp_path / "log.csv", once, inputs=["temperature.ambient"], outputs=outputs)
    columns = dict(map(parse_map_option, ("torque.a=torque.a[hold=true]", "temperature.ambient=room[degC; hold=true]")))
    (run,) = read_log(tmp_path / "log.csv", columns, inputs=inputs, outputs=outputs)
    assert not run.issues
    held = torque[20 + 60 * np.maximum((time - 20) // 60, 0).astype(int)]  # before the first, the first
    np.testing.assert_allclose(run.columns["torque.a"], np.abs(held))  # a root mean square
    assert (run.columns["temperature.ambient"] == 21.5).all()
    key, source = "torque.a", ColumnSource(("torque.a",), hold=True)
    assert columns[key] == source
    assert parse_columns({key: {"column": "torque.a", "hold": True}}, "m", "c") == {key: source}
    assert tomllib.loads(toml_line(key, source)) == {key: {"column": "torque.a", "hold": True}}
    assert map_option(key, source) == '--map "torque.a=torque.a[hold=true]"'


# --- Rows that are means ----------------------------------------------------------------------------------------------

_ROW = 300.0  # s


def _heater_in_means(stamp: float, lag: float = 400.0) -> pd.DataFrame:
    """Five hours of a body of 2 K/W that lags by so many seconds, heated by turns, as means over rows; exact."""
    seconds = np.arange(18000)
    heat = np.random.default_rng(5).uniform(0, 20, 60).repeat(300)
    keep, at = np.exp(-1 / lag), [20.0]
    for power in heat:
        steady = 20 + 2.0 * power
        at.append(steady + (at[-1] - steady) * keep)
    middles = 0.5 * (np.array(at[:-1]) + at[1:])
    rows = pd.DataFrame({"t": seconds, "power.a": heat, "temperature.a": middles}).groupby(seconds // int(_ROW)).mean()
    rows["t"] = _ROW * (np.arange(len(rows)) + stamp)
    rows["temperature.ambient"] = 20.0
    return rows


@pytest.mark.parametrize("lag", [60.0, 400.0])
@pytest.mark.parametrize(("rows", "stamp"), [("means after", 0.0), ("means around", 0.5), ("means before", 1.0)])
def test_rows_that_are_means_give_the_capacity_that_samples_would_miss(rows: str, stamp: float, lag: float) -> None:
    network = Network("body", (node("a", 100.0), AMBIENT), (link("a", "ambient", 1.0),), (effect("heat_input", "a"),))
    held = replace(network.effects[0], parameters=tuple(replace(p, fixed=True) for p in network.effects[0].parameters))
    model = Model(replace(network, effects=(held,)))
    wanted = {"inputs": model.inputs, "outputs": ["temperature.a"]}
    key, said = parse_map_option(f"time=t[s; rows={rows}]")
    assert parse_columns({key: {"column": "t", "unit": "s", "rows": rows}}, "m", "c") == {key: said}
    assert toml_line(key, said) == f'time = {{ column = "t", unit = "s", rows = "{rows}" }}'
    log = _heater_in_means(stamp, lag)
    (means,) = read_log(log, {key: said}, **wanted)  # type: ignore[arg-type]
    (samples,) = read_log(log, {key: replace(said, rows="")}, **wanted)  # type: ignore[arg-type]
    assert means.averaged
    assert means.time[0] == 0.0
    right, wrong = (fit(model, [run]) for run in (means, samples))
    fitted = {parameter.name: parameter.value for parameter in right.model.parameters}
    assert fitted["capacity.a"] == pytest.approx(lag / 2.0, rel=0.005)
    assert fitted["resistance.a~ambient"] == pytest.approx(2, rel=0.001)
    assert right.rmse < 0.02 < wrong.rmse


def test_means_in_longer_rows_are_means_of_the_seconds_that_they_share() -> None:
    log = pd.DataFrame({"t": 100.0 * np.arange(25), "temperature.a": 10.0 * np.arange(1, 26)})
    log = log.drop(index=4)  # a row is lacking
    log.loc[6, "temperature.a"] = np.nan
    (run,) = read_log(log, {"time": ColumnSource(("t",), rows="means after")}, step=250.0, max_gap=500.0)
    assert run.step == 250.0
    # 0 to 250 s; 250 to 500 s, of which 400 to 500 s are lacking; 500 to 750 s, where 600 to 700 s have no reading.
    gappy = [(0.5 * 30 + 40) / 1.5, (60 + 0.5 * 80) / 1.5]
    np.testing.assert_allclose(run.temperature("a"), [18, *gappy, 92, 118, 142, 168, 192, 218, 242])
    assert run.log_end == 2500.0


def test_a_column_of_means_that_is_read_every_second_row_keeps_its_readings() -> None:
    temperatures = np.where(np.arange(40) % 2 == 0, 20.0 + 0.1 * np.arange(40), np.nan)
    log = pd.DataFrame({"t": 60.0 * np.arange(40), "temperature.a": temperatures, "power.a": 1.0})
    (run,) = read_log(log, {"time": ColumnSource(("t",), rows="means after")}, step=120.0)
    assert np.isfinite(run.temperature("a")).all()
    np.testing.assert_allclose(np.diff(run.temperature("a"))[1:-1], 0.2)


def test_slow_rows_are_said_to_be_read_as_samples_until_somebody_says_what_they_are() -> None:
    log = _heater_in_means(0.0)
    (run,) = read_log(log, {"time": ColumnSource(("t",))})
    assert any(note.startswith("time: a row every 300 s, read as samples") for note in run.notes)
    for rows in ("means after", "samples"):
        (said,) = read_log(log, {"time": ColumnSource(("t",), rows=rows)})
        assert not any(note.startswith("time: ") for note in said.notes)
        assert said.averaged == (rows == "means after")


def test_means_of_columns_at_rates_of_their_own_are_refused(tmp_path: Path, refuse: Refuse) -> None:
    log = _heater_in_means(0.0)
    for name, columns in (("warm", ["t", "temperature.a"]), ("heat", ["t", "power.a"])):
        log[columns].to_csv(tmp_path / f"{name}.csv", index=False)
    both = tmp_path / "warm.csv+heat.csv@0"
    key, said = parse_map_option("time=t[rows=means before]")
    _, other = parse_map_option("time.2=t")
    assert "rows that hold all columns" in refuse(both, read_log, both, {key: said, "time.2": other})


# --- A mean of several columns ----------------------------------------------------------------------------------------


def test_a_mean_whose_one_sensor_dies_says_so_and_loses_what_both_say_then() -> None:
    rng, time = np.random.default_rng(2), np.arange(1500.0)
    one, other = (30 + 0.01 * time + rng.normal(0, 0.05, 1500) for _ in range(2))
    other[400:900] = other[400]
    one[1200:1202] = -127.0
    frame = pd.DataFrame({"time": time, "T1": one, "T2": other})
    _, source = parse_map_option("temperature.a=[mean=T1,T2]")
    (run,) = read_log(frame, {"temperature.a": source}, outputs=["temperature.a"])
    missing = np.flatnonzero(np.isnan(run.temperature("a"))).tolist()
    assert missing == [*range(400, 900), 1200, 1201]
    frozen, coded = sorted(run.issues, key=lambda issue: issue.kind, reverse=True)
    assert frozen.problem.startswith("its column 'T2' is frozen at ")
    assert (frozen.column, coded.column) == ("T2", "T1")
    assert "invalid = [-127]" in coded.remedy


# --- From when on a log is held out -----------------------------------------------------------------------------------


def pieces() -> list[Run]:
    """A log that begins at 1000 s, with a gap in its input from 1200 to 1400 s."""
    time = np.arange(1000.0, 1600.0)
    power = np.where((time >= 1200) & (time < 1400), np.nan, 5.0)
    return read_log(pd.DataFrame({"time": time, "power.a": power, "temperature.a": 20.0 + 0.01 * time}))


def test_seconds_after_the_start_count_from_the_log_s() -> None:
    runs = pieces()
    assert len(runs) == 2
    data = split_data(runs, holdout_after="+450")
    assert [segment.evaluation for segment in data.holdout] == [(1450.0, np.inf)]
    assert data == split_data(runs, holdout_after=1450.0)


@pytest.mark.parametrize(
    ("after", "said"),
    [
        ("+9000", "found logs from 1000 to 1599 s; expected a time inside a log"),
        ("450", "found '450'; expected a time in s, or with a plus"),
        ("+x", "found '+x'"),
        (450.0, "with a plus, such as +300, so many seconds after each log's start"),
    ],
)
def test_a_time_that_holds_out_nothing(after: float | str, said: str) -> None:
    with pytest.raises(InputError) as refused:
        split_data(pieces(), holdout_after=after)
    assert said in str(refused.value)
