"""No cell is read under a name that it does not stand under: rows that lack a cell, names again, comments, no names."""

from __future__ import annotations

import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.basics.errors import InputError
from lptn.logs.columns import ColumnSource
from lptn.logs.reading import read_log
from lptn.logs.run import Run
from tests.logs.conftest import Refuse

N = 60
NAMES = "time,temperature.a,current.a,temperature.b"
TIME = np.arange(N)
A, B, CURRENT = 20.0 + 0.25 * TIME, 40.0 - 0.125 * TIME, TIME % 7
ROWS = [f"{t},{a},{i},{b}" for t, a, i, b in zip(TIME, A, CURRENT, B, strict=True)]
SWAPPED = [f"{t},{b},{i},{a}" for t, a, i, b in zip(TIME, A, CURRENT, B, strict=True)]
COLUMNS = {
    "time": ColumnSource(("column 1",)),
    "temperature.a": ColumnSource(("column 2",)),
    "current.a": ColumnSource(("column 3",)),
    "temperature.b": ColumnSource(("column 4",)),
}

Log = Callable[..., Path]


@pytest.fixture
def log(tmp_path: Path) -> Log:
    """Write lines as a file."""

    def _log(lines: list[str], name: str = "log.csv") -> Path:
        path = tmp_path / name
        text = "\n".join(lines) + "\n"
        path.write_bytes(gzip.compress(text.encode()) if name.endswith(".gz") else text.encode())
        return path

    return _log


def is_true(run: Run) -> None:
    assert run.columns["temperature.a"] == pytest.approx(A[: len(run)])
    assert run.columns["temperature.b"] == pytest.approx(B[: len(run)])
    assert run.columns["current.a"] == pytest.approx(CURRENT[: len(run)])
    assert len(run) == N


@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("block", [1, 7, 64])
def test_a_line_may_lie_across_blocks(log: Log, monkeypatch: pytest.MonkeyPatch, end: str, block: int) -> None:
    """Blocks of characters end anywhere, between the two of a line's end, too."""
    monkeypatch.setattr("lptn.logs.csv_files._BLOCK", block)
    path = log([NAMES, *ROWS])
    path.write_bytes(path.read_bytes().replace(b"\n", end.encode()) + b"60,1")  # a copy that was stopped
    (run,) = read_log(path)
    is_true(run)
    assert any("ends within a line" in note for note in run.notes)


# --- Names that stand again -------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["log.csv", "log.tsv", "log.csv.gz", "log.txt"])
def test_names_again_in_another_order(log: Log, refuse: Refuse, name: str) -> None:
    """What stands below them would be read under other names: refused, as it is another table."""
    separator = {"log.tsv": "\t", "log.txt": "   "}.get(name, ",")
    again = [NAMES, *ROWS[:30], NAMES, *ROWS[30:]]
    (run,) = read_log(log([line.replace(",", separator) for line in again], f"again_{name}"))
    is_true(run)
    lines = [NAMES, *ROWS[:30], "time,temperature.b,current.a,temperature.a", *SWAPPED[30:50], NAMES, *ROWS[50:]]
    path = log([line.replace(",", separator) for line in lines], name)
    assert "line 32" in refuse(path, read_log, path)


@pytest.mark.parametrize(
    "again",
    [
        "time,temperature.a,current.a",  # one is gone
        "time,temperature.a,current.a,temperature.b,current.b",  # one more
        "time,temperature.a,current.a,temperature.c",  # another
        "zeit,eins,zwei,drei",  # all others
    ],
)
def test_other_names_are_refused_with_their_line(log: Log, refuse: Refuse, again: str) -> None:
    path = log([NAMES, *ROWS[:30], again, *SWAPPED[30:]])
    assert "line 32" in refuse(path, read_log, path)


def test_names_again_in_a_spreadsheet(tmp_path: Path, refuse: Refuse) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    sheet = book.active
    for line in [NAMES, *ROWS[:30]]:
        sheet.append([float(cell) if line is not NAMES else cell for cell in line.split(",")])
    sheet.append(NAMES.split(","))
    for line in ROWS[30:]:
        sheet.append([float(cell) for cell in line.split(",")])
    book.save(tmp_path / "log.xlsx")
    (run,) = read_log(tmp_path / "log.xlsx")
    is_true(run)
    sheet["D32"] = "temperature.c"
    book.save(tmp_path / "other.xlsx")
    assert "row 32" in refuse(tmp_path / "other.xlsx", read_log, tmp_path / "other.xlsx")


# --- Rows of another length --------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["log.csv", "log.tsv", "log.csv.gz", "log.txt"])
@pytest.mark.parametrize("row", ["40,30.0,35.0", "40,30.0", "40,30.0,5,35.0,7", "40"])
def test_a_row_of_another_length_is_refused_with_its_line(log: Log, refuse: Refuse, row: str, name: str) -> None:
    separator = {"log.tsv": "\t", "log.txt": " "}.get(name, ",")
    path = log([line.replace(",", separator) for line in [NAMES, *ROWS[:40], row, *ROWS[41:]]], name)
    said = refuse(path, read_log, path)
    assert "line 42" in said
    assert f"{row.count(',') + 1} cell" in said


def test_empty_cells_behind_the_last_column_are_nothing(log: Log) -> None:
    lines = [NAMES, *ROWS[:20], *(f"{row},," for row in ROWS[20:])]
    is_true(read_log(log(lines))[0])


# --- '#' begins a comment at the start of a line, and nowhere else --------------------------------------


@pytest.mark.parametrize("word", ["1.#INF", "-1.#INF00", "1.#IND", "1.#QNAN0"])
@pytest.mark.parametrize("column", [1, 2])
def test_what_windows_prints_is_no_reading(log: Log, word: str, column: int) -> None:
    rows = [row.split(",") for row in ROWS]
    for row in rows[20:25]:
        row[column] = word
    (run,) = read_log(log([NAMES, *map(",".join, rows)]))
    assert run.columns["temperature.b"] == pytest.approx(B)  # the cells behind it stand where they stood
    for key, truth, at in (("temperature.a", A, 1), ("current.a", CURRENT, 2)):
        values = run.columns[key]
        good = np.arange(N) < 20 if at == column else np.full(N, True)
        assert values[good] == pytest.approx(truth[good])
    said = any(word in note and "no reading" in note for note in run.notes)
    assert said or word == "1.#IND"  # which pandas takes for NaN by itself


@pytest.mark.parametrize("name", ["Loop Counter #1", '"Loop Counter #1"', "#", "cell #2 [V]"])
def test_a_hash_in_a_name(log: Log, name: str) -> None:
    names = NAMES.replace("time,", f"time,{name},")
    rows = [row.replace(",", f",{k},", 1) for k, row in enumerate(ROWS)]
    is_true(read_log(log([names, *rows]))[0])


@pytest.mark.parametrize("name", ["#", "# row", "#1"])
def test_a_hash_at_the_start_of_the_names(log: Log, name: str) -> None:
    rows = [f"{k},{row}" for k, row in enumerate(ROWS)]
    is_true(read_log(log([f"{name},{NAMES}", *rows]))[0])


def test_lines_of_comment_are_left_out_and_lines_counted(log: Log, refuse: Refuse) -> None:
    lines = ["# made by a logger", NAMES, *ROWS[:20], "# a,b,c,d", "#20,1,2,3", "  # pause", *ROWS[20:]]
    is_true(read_log(log(lines))[0])
    path = log([*lines[:50], "x9,1,2,3"])
    assert "line 51" in refuse(path, read_log, path)


# --- A row of units ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "units", ["s,degC,N*m,degC", "s,A,A,degC", "s,degC,rpm,degC", "s,degC,degC,degC", "A,degC,A,degC", "s,V,A,degC"]
)
def test_units_of_another_quantity_are_refused(log: Log, refuse: Refuse, units: str) -> None:
    path = log([NAMES, units, *ROWS])
    said = refuse(path, read_log, path)
    assert "unit in the file" in said
    wrong = next(
        cell for cell, right in zip(units.split(","), ["s", "degC", "A", "degC"], strict=True) if cell != right
    )
    assert wrong in said
    mapped = {
        key: ColumnSource((key,), unit)
        for key, unit in (("time", "s"), ("current.a", "A"), ("temperature.a", "degC"), ("temperature.b", "degC"))
    }
    is_true(read_log(path, mapped)[0])


def test_dashes_and_the_right_units_are_none_of_another_quantity(log: Log) -> None:
    for units in ("s,degC,A,-", "[s],[°C],[A],[°C]", "s,,,"):
        is_true(read_log(log([NAMES, units, *ROWS]))[0])


# --- Tables without names ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("separator", "name"), [(" ", "log.txt"), ("   ", "log.csv"), (",", "log.csv"), ("\t", "log.tsv"), (";", "log.csv")]
)
@pytest.mark.parametrize("above", [[], ["Logger 3"], ["# a comment"]])
def test_columns_without_names_can_be_mapped(
    log: Log, refuse: Refuse, separator: str, name: str, above: list[str]
) -> None:
    path = log([*above, *(row.replace(",", separator) for row in ROWS)], name)
    said = refuse(path, read_log, path)
    assert "column 1, column 2, column 3, column 4" in said
    (run,) = read_log(path, COLUMNS)
    is_true(run)
    assert any("no names" in note for note in run.notes)


def test_blanks_with_names_and_decimal_commas(log: Log) -> None:
    lines = [line.replace(",", "  ").replace(".", ",") for line in ROWS]
    is_true(read_log(log([NAMES.replace(",", "\t "), *(line.replace("  ", "\t ") for line in lines)]))[0])
    is_true(read_log(log([NAMES.replace(",", "   "), *(f"   {line}" for line in lines)]))[0])


def test_names_with_blanks_in_a_table_of_blanks(log: Log, refuse: Refuse) -> None:
    lines = ["Total Time   Loop Counter #1    temperature.a", *(f"{k}.0   {k % 5}     {20 + k / 4}" for k in range(N))]
    path = log(lines, "log.txt")
    assert "Total Time, Loop Counter #1, temperature.a" in refuse(path, read_log, path)
    (run,) = read_log(path, {"time": ColumnSource(("Total Time",)), "current.a": ColumnSource(("Loop Counter #1",))})
    assert run.columns["temperature.a"] == pytest.approx(A)
    assert run.columns["current.a"] == pytest.approx(TIME % 5)


@pytest.mark.parametrize("mark", ["# ", "#"])
def test_names_in_a_comment_above_the_table(log: Log, mark: str) -> None:
    """As numpy.savetxt writes them."""
    is_true(read_log(log([f"{mark}{NAMES}", *ROWS]))[0])
    is_true(read_log(log([f"{mark}{NAMES}".replace(",", " "), *(row.replace(",", " ") for row in ROWS)]))[0])


def test_a_name_that_is_not_there_is_the_column_s_number(log: Log, refuse: Refuse) -> None:
    path = log([NAMES.replace("time", ""), *ROWS])
    assert "column 1, temperature.a" in refuse(path, read_log, path)
    is_true(read_log(path, {"time": ColumnSource(("column 1",))})[0])
    frame = pd.DataFrame({"time": TIME, "temperature.a": A, "current.a": CURRENT, "temperature.b": B}).set_index("time")
    frame.index.name = None
    frame.to_csv(path)
    is_true(read_log(path, {"time": ColumnSource(("column 1",))})[0])


# --- True and false --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "words", [("False", "True"), ("false", "true"), ("FALSE", "TRUE"), ("off", "on"), ("No", "Yes")]
)
@pytest.mark.parametrize("gap", [False, True])
def test_true_is_one_and_false_is_none(log: Log, words: tuple[str, str], gap: bool) -> None:
    rows = [f"{k},{20 + k / 8},{'' if gap and k == 30 else words[k % 2]}" for k in range(N)]
    (run,) = read_log(log(["time,temperature.a,power.a", *rows]))
    expected = np.arange(N) % 2
    expected[30] = 1 if gap else 0
    assert run.columns["power.a"] == pytest.approx(expected)


def test_true_and_false_of_a_frame_and_none_of_a_temperature(log: Log, refuse: Refuse) -> None:
    frame = pd.DataFrame({"time": TIME, "temperature.a": A, "power.a": TIME % 2 == 1})
    for column in (frame["power.a"], frame["power.a"].astype(object), frame["power.a"].astype("boolean")):
        (run,) = read_log(frame.assign(**{"power.a": column}))
        assert run.columns["power.a"] == pytest.approx(TIME % 2)
    path = log(["time,temperature.a,current.a", *(f"{k},{k % 2 == 0},{k % 5}" for k in range(N))])
    assert "'True'" in refuse(path, read_log, path)


# --- Numbers in other ways ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("cell", "decimal"),
    [("1.000,00", ","), ("1.234.567,5", ","), ("1'000,0", ","), ("1 000,00", ","), ('"1,000.00"', ".")],
)
def test_points_between_thousands_are_named_with_their_line(log: Log, refuse: Refuse, cell: str, decimal: str) -> None:
    lines = [
        "time;temperature.a;current.a",
        *(f"{k},00;{20 + k / 8:.3f};{k % 5},0".replace(".", ",") for k in range(N)),
    ]
    if decimal == ".":
        lines = [line.replace(",", ".").replace(";", ",") for line in lines]
    sign = ";" if decimal == "," else ","
    lines[42] = sign.join([cell, *lines[42].split(sign)[1:]])
    path = log(lines)
    said = refuse(path, read_log, path)
    assert "line 43, column 'time'" in said
    assert cell.strip('"') in said
    assert "between thousands" in said


def test_years_that_no_clock_says(log: Log, refuse: Refuse) -> None:
    for year in ("1500", "9999", "0001", "10000"):
        rows = [f"{year}-01-01T00:00:{k:02d},{20 + k / 8},{k % 5}" for k in range(N)]
        path = log(["time,temperature.a,current.a", *rows])
        assert "line 2, column 'time'" in refuse(path, read_log, path)
        frame = pd.DataFrame({"time": [row.split(",")[0] for row in rows], "temperature.a": A, "current.a": CURRENT})
        with pytest.raises(InputError, match="column 'time'"):
            read_log(frame)


def test_bytes_in_a_column_of_a_parquet_file(tmp_path: Path, refuse: Refuse) -> None:
    frame = pd.DataFrame({"time": TIME, "temperature.a": A, "current.a": CURRENT, "temperature.b": B})
    kinds: list[list[object]] = [[b"\x00\xff"] * N, [[1, 2]] * N, [{"x": 1.0}] * N]
    for cells in kinds:
        path = tmp_path / "log.parquet"
        frame["temperature.a"] = pd.Series(cells, dtype=object)
        frame.to_parquet(path)
        assert "row 1, column 'temperature.a'" in refuse(path, read_log, path)


# --- Rows out of order ---------------------------------------------------------------------------------------


def shuffled(order: list[int], stamps: list[float]) -> list[str]:
    return [NAMES, *(f"{stamps[k]},{A[k]},{CURRENT[k]},{B[k]}" for k in order)]


@pytest.mark.parametrize(
    "order",
    [
        [1, 0, *range(2, N)],
        [*range(20), 21, 20, *range(22, N)],
        [*range(20), 21, 22, 20, *range(23, N)],
        [*range(N - 2), N - 1, N - 2],
    ],
)
def test_rows_out_of_order_by_a_few_are_sorted_and_it_is_said(log: Log, order: list[int]) -> None:
    (run,) = read_log(log(shuffled(order, [float(t) for t in TIME])))
    is_true(run)
    assert any("out of order" in note for note in run.notes)


def test_first_rows_by_a_hair(log: Log) -> None:
    stamps = [0.24, 0.2386, *(0.24 + k for k in range(1, N - 1))]
    (run,) = read_log(log(shuffled(list(range(N)), stamps)))
    assert any("out of order" in note for note in run.notes)


def test_a_clock_that_goes_back_is_refused_as_before(log: Log, refuse: Refuse) -> None:
    path = log(shuffled(list(range(N)), [*range(30), *range(10, 40)]))
    assert "line 32, column 'time': found 10 s after 29 s" in refuse(path, read_log, path)


def _in_turn(first: list[int], second: list[int]) -> list[int]:
    return [k for pair in zip(first, second, strict=True) for k in pair]


@pytest.mark.parametrize(
    "order",
    [
        _in_turn(list(range(0, N, 2)), list(range(N - 1, 0, -2))),
        _in_turn(list(range(N // 2)), list(range(N // 2, N))),
        _in_turn(list(range(N // 2, N)), list(range(N // 2))),
        np.random.default_rng(1).permutation(N).tolist(),
        [*range(20), *_in_turn(list(range(20, 30)), list(range(30, 40))), *range(40, N)],
    ],
)
def test_rows_far_out_of_order_are_refused(log: Log, refuse: Refuse, order: list[int]) -> None:
    """Their usual step is as large as the disorder; each was "out of order, by a few steps"."""
    path = log(shuffled(order, [float(t) for t in TIME]))
    assert "time that runs forwards" in refuse(path, read_log, path)


# --- Clocks of the day ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("unit", "day"), [("us", 86400e6), ("ms", 86400e3), ("s", 86400.0), ("min", 1440.0), ("h", 24.0)]
)
def test_midnight_is_mended_in_the_user_s_own_unit(log: Log, unit: str, day: float) -> None:
    clock = (86370.0 + TIME) % 86400 * day / 86400
    rows = [f"{t:.12g},{row.partition(',')[2]}" for t, row in zip(clock, ROWS, strict=True)]
    path = log([NAMES.replace("time", "clock"), *rows])
    source = ColumnSource(("clock",), unit, rows="samples")
    with pytest.raises(InputError, match=f"wrap = {day:.12g}") as caught:
        read_log(path, {"time": source})
    assert f'unit = "{unit}"' in str(caught.value)
    assert 'rows = "samples"' in str(caught.value)
    (run,) = read_log(path, {"time": ColumnSource(("clock",), unit, wrap=day)})
    assert np.diff(run.time) == pytest.approx(1.0)


def test_midnight_of_a_scaled_clock(log: Log) -> None:
    clock = (86370.0 + TIME) % 86400 * 4  # quarters of a second
    rows = [f"{t:.12g},{row.partition(',')[2]}" for t, row in zip(clock, ROWS, strict=True)]
    path = log([NAMES, *rows])
    with pytest.raises(InputError, match=r"scale = 0\.25, wrap = 345600"):
        read_log(path, {"time": ColumnSource(("time",), scale=0.25)})


@pytest.mark.parametrize("form", ["%Y-%m-%d %H:%M:%S", "%d.%m.%Y %H:%M:%S", "%Y-%m-%dT%H:%M:%S.%f"])
@pytest.mark.parametrize(
    ("zone", "date"), [("Europe/Berlin", "2026-10-25 00:30"), ("America/New_York", "2026-11-01 05:30")]
)
def test_the_hour_that_comes_twice(log: Log, refuse: Refuse, form: str, zone: str, date: str) -> None:
    times = pd.date_range(date, periods=3600, freq="s", tz="UTC").tz_convert(zone)
    rows = [f"{time.strftime(form)},{20 + k / 500},{k % 7}" for k, time in enumerate(times)]
    path = log(["time,temperature.a,current.a", *rows])
    said = refuse(path, read_log, path)
    assert "line 1802" in said
    for k in (1799, 1800):
        assert times[k].strftime(form) in said
    assert "summer time" in said
    assert "UTC" in said


# --- The one who cuts the log is named --------------------------------------------------------------------------


@pytest.mark.parametrize("key", ["temperature.ambient", "current.a", "torque.a"])
@pytest.mark.parametrize("rows", [[0], [0, 1, 2], [7]])
def test_an_input_that_is_hardly_there_is_named(log: Log, refuse: Refuse, key: str, rows: list[int]) -> None:
    values = ["25.0" if k in rows else "" for k in range(600)]
    lines = [f"{k},{20 + k / 100},{value}" for k, value in enumerate(values)]
    path = log([f"time,temperature.a,{key}", *lines])
    said = refuse(path, read_log, path, inputs=[key], outputs=["temperature.a"])
    assert f"column '{key}'" in said
    assert f"{len(rows)} value" in said
    assert ("ambient = 25" in said) == (key == "temperature.ambient")
