"""Files of any bytes and data frames of any kind as logs: runs, or one line, and no memory without bound."""

from __future__ import annotations

import gzip
import os
import resource
import subprocess
import sys
import zipfile
from collections.abc import Callable
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from lptn.basics.bounds import Bound
from lptn.basics.errors import InputError
from lptn.logs import tables
from lptn.logs.reading import OPENERS, read_log
from tests.logs.recorder_files import RECORDED
from tests.logs.ulog_bytes import FORMATS, battery, definitions, esc_status, header

Refuse = Callable[..., str]
ENDINGS = (*(endings[0] for endings in OPENERS), ".csv.gz", ".db3")
"""One of each format, and what is packed or stored in another way."""
MAGIC = {
    ".csv": b"time,temperature.a\n",
    ".xlsx": b"PK\x03\x04",
    ".csv.gz": b"\x1f\x8b\x08\x00\x00\x00\x00\x00\x00\x03",
    ".parquet": b"PAR1",
    ".mcap": b"\x89MCAP0\r\n\x01\x0f\x00\x00\x00\x00\x00\x00\x00\x04\x00\x00\x00ros2",
    ".db3": b"SQLite format 3\x00",
    ".bag": b"#ROSBAG V2.0\n",
    ".ulg": header(),
    ".mf4": b"MDF     4.10    ",
    ".tdms": b"TDSm",
    ".mat": b"MATLAB 5.0 MAT-file",
    ".h5": b"\x89HDF\r\n\x1a\n",
}


def looked_at(path: Path) -> None:
    """Read a file that may be anything: runs, or one line."""
    try:
        read_log(path)
    except InputError as error:
        line = str(error)
        assert "\n" not in line
        assert line.startswith(f"{path}: ")
        assert len(line) < 5000


@cache
def whole(ending: str) -> bytes:
    """A small good log of a format."""
    rows = 40
    table = pd.DataFrame({"time": np.arange(rows) * 1.0, "temperature.a": 20 + 0.1 * np.arange(rows), "torque.a": 1.0})
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"log{ending}"
        if ending.startswith(".csv"):
            table.to_csv(path, index=False)
        elif ending == ".parquet":
            table.to_parquet(path)
        elif ending == ".xlsx":
            table.to_excel(path, index=False)
        elif ending == ".ulg":
            body = (esc_status(k, 1, [(60, 1.0, 20 + k)] * 4) + battery(k + 0.1, 16.0, 1.0, 25.0) for k in range(rows))
            path.write_bytes(header() + definitions(FORMATS) + b"".join(body))
        elif ending in RECORDED:
            RECORDED[ending](path, {str(name): column.to_numpy() for name, column in table.items()})
        else:
            _bag(Path(folder) / "bag", ending, rows)
            (path,) = (Path(folder) / "bag").glob(f"*{ending}")
        return path.read_bytes()


def _bag(path: Path, ending: str, rows: int) -> None:
    from tests.logs.test_bags import Recorder
    from tests.logs.test_ros1_bags import Recorder1

    path.mkdir() if ending == ".bag" else None
    recorder = (
        Recorder1(path / "log.bag")
        if ending == ".bag"
        else Recorder(path, {".db3": "sqlite3", ".mcap": "mcap"}[ending])
    )
    with recorder.writer:
        for k in range(rows):
            recorder.send("/joint_states", 1.0 * k, recorder.joints(k, ["a"], [1.0], [1.0]))
            recorder.send("/dynamic_joint_states", k + 0.1, recorder.dynamic(k, {"a": {"temperature": 20.0}}))


@pytest.mark.parametrize("ending", ENDINGS)
def test_the_good_ones_are_read(tmp_path: Path, ending: str) -> None:
    (tmp_path / f"log{ending}").write_bytes(whole(ending))
    assert len(read_log(tmp_path / f"log{ending}")) == 1


@pytest.mark.parametrize("ending", ENDINGS)
@given(content=st.binary(max_size=2000), begun=st.booleans())
def test_random_bytes(ending: str, content: bytes, begun: bool) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"log{ending}"
        path.write_bytes(MAGIC[ending] * begun + content)
        looked_at(path)


@pytest.mark.parametrize("ending", ENDINGS)
@given(data=st.data())
def test_a_good_log_with_some_bytes_changed_or_cut(ending: str, data: st.DataObject) -> None:
    content = bytearray(whole(ending))
    for _ in range(data.draw(st.integers(0, 6))):
        at = data.draw(st.integers(0, len(content) - 1))
        content[at] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(content)) | st.just(len(content)))
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"log{ending}"
        path.write_bytes(bytes(content[:cut]))
        looked_at(path)


@given(text=st.text(alphabet="time,.0123456789eE+-;\t\n\"'# naif", max_size=400))
def test_random_tables_of_text(text: str) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        path.write_text("time,temperature.a\n" + text, encoding="utf-8")
        looked_at(path)


def test_more_numbers_than_a_memory_holds(tmp_path: Path, refuse: Refuse, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tables, "MOST_NUMBERS", 1000)
    table = pd.DataFrame({"time": np.arange(600.0), "temperature.a": 20.0})
    table.to_parquet(tmp_path / "log.parquet")
    table.to_csv(tmp_path / "log.csv", index=False)
    said = refuse(tmp_path / "log.parquet", read_log, tmp_path / "log.parquet")
    assert "found 600 rows of 2 columns; expected at most 1e+03 numbers; cut the log into pieces" in said
    assert "found 500 rows or more" in refuse(tmp_path / "log.csv", read_log, tmp_path / "log.csv")


@pytest.mark.long
def test_three_hundred_million_rows_in_a_few_bytes(tmp_path: Path) -> None:
    """Run-length encoding packs columns of nothing into nothing: refused before they are unfolded."""
    path = tmp_path / "log.parquet"
    chunk = pa.table({"time": pa.nulls(20_000_000), "temperature.a": pa.nulls(20_000_000)})
    with pq.ParquetWriter(path, chunk.schema) as writer:
        for _ in range(15):
            writer.write_table(chunk, row_group_size=20_000_000)
    assert path.stat().st_size < 1_000_000
    code = (
        "import resource, sys; from lptn.logs import read_log; from lptn.basics.errors import InputError\n"
        "before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "try: read_log(sys.argv[1])\n"
        "except InputError as error: print(error)\n"
        "print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before)"
    )
    done = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, check=True)
    line, kilobytes = done.stdout.strip().splitlines()
    assert "300000000 rows of 2 columns" in line
    assert int(kilobytes) < 200_000


def test_a_line_that_never_ends(tmp_path: Path, refuse: Refuse) -> None:
    path = tmp_path / "log.csv.gz"
    path.write_bytes(gzip.compress(b"a" * 50_000_000))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert "a line of 16 million characters" in refuse(path, read_log, path)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 100_000  # kB


_EXTRAS = {
    "rosbags": (".mcap", "ros"),
    "pyulog": (".ulg", "ulog"),
    "openpyxl": (".xlsx", "excel"),
    "asammdf": (".mf4", "bench"),
    "nptdms": (".tdms", "bench"),
    "h5py": (".h5", "bench"),
}


@pytest.mark.parametrize("module", _EXTRAS)
def test_a_package_that_is_not_installed(
    tmp_path: Path, refuse: Refuse, monkeypatch: pytest.MonkeyPatch, module: str
) -> None:
    ending, extra = _EXTRAS[module]
    monkeypatch.setattr("lptn.logs.tables.find_spec", lambda _: None)
    path = tmp_path / f"log{ending}"
    path.write_bytes(whole(ending))
    assert f"pip install 'lptn[{extra}]'" in refuse(path, read_log, path)


# --- Data frames ------------------------------------------------------------------------------------------------------


def frame(rows: int = 60) -> pd.DataFrame:
    """A joint that warms by 0.01 K/s."""
    time = np.arange(rows, dtype=float)
    return pd.DataFrame({"time": time, "temperature.knee": 20 + 0.01 * time, "current.knee": 2.0})


def test_a_data_frame_reads_like_its_file(tmp_path: Path) -> None:
    frame().to_parquet(tmp_path / "log.parquet")
    (read,) = read_log(frame(), name="log")
    (filed,) = read_log(tmp_path / "log.parquet")
    assert read.name == filed.name == "log"
    assert read.step == filed.step
    for column, values in filed.columns.items():
        np.testing.assert_array_equal(read.columns[column], values)


@pytest.mark.parametrize(
    "index",
    [
        pd.date_range("2026-01-01", periods=60, freq="1s"),
        pd.timedelta_range(0, periods=60, freq="1s"),
        pd.Index(np.arange(60.0), name="time"),
    ],
    ids=["dates", "durations", "named"],
)
def test_an_index_of_times_is_the_time(index: pd.Index) -> None:
    indexed = frame().drop(columns="time").set_index(index)
    (run,) = read_log(indexed)
    np.testing.assert_allclose(np.diff(run.time), 1.0)
    np.testing.assert_array_equal(run.columns["temperature.knee"], read_log(frame())[0].columns["temperature.knee"])


def test_the_digest_tells_frames_apart_and_knows_the_same_again() -> None:
    other = frame()
    other.loc[3, "current.knee"] = 2.5
    assert read_log(frame())[0].fingerprint == read_log(frame())[0].fingerprint
    assert read_log(frame())[0].fingerprint != read_log(other)[0].fingerprint


@pytest.mark.parametrize(
    ("broken", "place"),
    [
        (frame().drop(columns="time"), "column time"),
        (frame().iloc[:0], "log"),
        (frame().set_axis(pd.MultiIndex.from_product([["a"], range(3)]), axis="columns"), "columns"),
        (frame().assign(**{"current.knee": "two"}), "row 1, column 'current.knee'"),
    ],
)
def test_a_frame_that_is_no_log_is_refused(broken: pd.DataFrame, place: str) -> None:
    with pytest.raises(InputError, match="monday") as refused:
        read_log(broken, name="monday")
    assert place in str(refused.value)


def test_a_last_line_that_was_cut_is_left_out_and_said(tmp_path: Path) -> None:
    rows = "\n".join(f"{k},21.5" for k in range(30))
    (tmp_path / "whole.csv").write_text(f"time,temperature.a\n{rows}\n")
    (tmp_path / "cut.csv").write_text(f"time,temperature.a\n{rows}\n30,2")
    whole, cut = (read_log(tmp_path / name)[0] for name in ("whole.csv", "cut.csv"))
    assert (cut.columns["temperature.a"] == 21.5).all()
    assert len(cut) == len(whole)
    assert any("may be cut" in note for note in cut.notes)
    assert not any("may be cut" in note for note in whole.notes)


# --- What would take for ever, or fill the memory ------------------------------------------------------


STANDING = {
    "as NumPy writes it": "{:.18e},{:.18e},{:.18e}" + ",0.000000000000000000e+00" * 34,
    "words": "{:.2f},{:.1f},{:.1f}" + ",0.0" * 60 + ",standing" * 20,
    "a message": '{:.3f},{:.1f},{:.1f},"' + "ready " * 100 + '"',
    "a humanoid": "{:.6f},{:.6f},{:.6f}" + ",0.000000" * 180,
}


@pytest.mark.parametrize("row", STANDING.values(), ids=STANDING)
def test_four_hours_of_a_robot_that_stands_may_pack_to_a_hundredth(tmp_path: Path, row: str) -> None:
    seen, hours = 10_000, 4
    text = "".join(row.format(k / 100, 25.0, 0.0) + "\n" for k in range(seen)).encode()
    path, ratio = tmp_path / "log.csv.gz", len(text) / len(gzip.compress(text, 6))
    whole = len(text) / seen * hours * 3600 * 100
    path.touch()
    os.truncate(path, int(whole / ratio))
    assert ratio > tables.TIMES_PACKED
    assert tables.most_unpacked(path, at_once=False) > whole


@pytest.mark.long
def test_a_log_of_a_robot_that_stands_is_read(tmp_path: Path) -> None:
    row, count = STANDING["as NumPy writes it"], 110_000
    names = ["time", "temperature.a", "torque.a", *(f"c{k}" for k in range(row.count(",") - 2))]
    text = "\n".join([",".join(names), *(row.format(k / 100, 25.0, 0.0) for k in range(count)), ""]).encode()
    path = tmp_path / "log.csv.gz"
    path.write_bytes(gzip.compress(text, 6))
    assert len(text) > max(tables.UNPACKED_AT_ONCE, tables.TIMES_PACKED * path.stat().st_size)
    (run,) = read_log(path)
    assert run.time.size == count // 100


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_pipe_is_not_waited_for(tmp_path: Path, refuse: Refuse, ending: str) -> None:
    path = tmp_path / f"log{ending}"
    os.mkfifo(path)
    assert "a pipe or a device" in refuse(path, read_log, path)


@pytest.mark.parametrize("piece", [b"0,1,20\n", b"\n", b"# x\n", b"0,1,\n", b"\0", b"0,1,20,,,,\n"])
def test_a_table_that_unfolds_to_a_hundred_times_its_size(
    tmp_path: Path, refuse: Refuse, monkeypatch: pytest.MonkeyPatch, piece: bytes
) -> None:
    monkeypatch.setattr("lptn.logs.tables.UNPACKED", 1_000_000)
    path = tmp_path / "bomb.csv.gz"
    path.write_bytes(
        gzip.compress(b"time,torque.a,temperature.a\n" + 20 * b"0,1,20\n" + 20_000_000 // len(piece) * piece)
    )
    assert "unfolds to more than 0.001" in refuse(path, read_log, path)


_WHOLE = b"time,torque.a,temperature.a\n" + b"".join(b"%d,1,20\n" % k for k in range(200))


@pytest.mark.parametrize(
    ("name", "content", "said"),
    [
        ("log.csv", b"\n" * 9_000, "no table within its first 2,501 characters"),
        ("log.csv", b"# a comment\n" * 900, "no table within its first 2,508 characters"),
        ("log.csv", _WHOLE + b"0" * 9_000, "line 202: found a line of 16 million characters"),
        ("log.csv", b"a,b\n" + b"," * 9_000, "line 2: found a line of 16 million characters"),
        ("log.csv", _WHOLE + b"# x\n" + b"\n" * 9_000, "more than 4,000 lines"),
        ("log.csv", _WHOLE + 6_000 * b"# x\n", "more than 4,000 lines"),
        (
            "log.txt",
            b"time torque.a temperature.a\n" + 6_000 * b"1 1 20\n",
            "more than 4,000 lines",
        ),
        ("log.csv", _WHOLE + 900 * b"hot,hot,hot\n", "501 lines of words without a number"),
    ],
)
def test_what_is_looked_through_is_bounded(
    tmp_path: Path, refuse: Refuse, monkeypatch: pytest.MonkeyPatch, name: str, content: bytes, said: str
) -> None:
    """Packed, each takes next to nothing: 2 GB of blank lines, comments, words, rows without commas, or one line."""
    monkeypatch.setattr("lptn.logs.csv_files._LONGEST", 2_500)
    monkeypatch.setattr("lptn.logs.csv_files._MOST_LINES", 4_000)
    monkeypatch.setattr("lptn.logs.csv_files._WORDS", Bound(500, "lines of words without a number"))
    for path, bytes_of in ((tmp_path / name, content), (tmp_path / f"{name}.gz", gzip.compress(content))):
        path.write_bytes(bytes_of)
        assert said in refuse(path, read_log, path)


def test_a_log_of_a_robot_at_rest_is_no_bomb(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lptn.logs.tables.UNPACKED", 1000)
    rows = b"".join(b"%d,0,20.0\n" % k for k in range(20_000))
    path = tmp_path / "rest.csv.gz"
    path.write_bytes(gzip.compress(b"time,torque.a,temperature.a\n" + rows, 9))
    (run,) = read_log(path)
    assert len(run) == 20_000


@pytest.mark.parametrize("ending", [".csv", ".csv.gz", ".txt", ".parquet"])
def test_more_columns_than_any_log_has(
    tmp_path: Path, refuse: Refuse, monkeypatch: pytest.MonkeyPatch, ending: str
) -> None:
    monkeypatch.setattr("lptn.logs.tables.COLUMNS", Bound(100, "columns"))
    frame = pd.DataFrame({f"c{k}": range(20) for k in range(300)})
    path = tmp_path / f"wide{ending}"
    if ending == ".parquet":
        frame.to_parquet(path)
    else:
        frame.to_csv(path, index=False, sep=" " if ending == ".txt" else ",")
    assert "300 columns" in refuse(path, read_log, path)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (b'<row r="20"', b'<row r="999999999999"', "beyond 1048576"),
        (b"</sheetData>", 2_000_000 * b"<row/>" + b"</sheetData>", "beyond 1048576"),
        (b'r="C20"', b'r="ZZZ20"', "18278 cells under 3 names"),
    ],
)
def test_rows_and_cells_that_no_sheet_has(tmp_path: Path, refuse: Refuse, old: bytes, new: bytes, said: str) -> None:
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in [("time", "torque.a", "temperature.a"), *((k, 1, 20 + k / 10) for k in range(30))]:
        book.active.append(row)
    book.save(tmp_path / "good.xlsx")
    path = tmp_path / "log.xlsx"
    with zipfile.ZipFile(tmp_path / "good.xlsx") as good, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as spoilt:
        for part in good.namelist():
            content = good.read(part)
            spoilt.writestr(part, content.replace(old, new) if part.endswith("sheet1.xml") else content)
    assert said in refuse(path, read_log, path)


def test_a_spreadsheet_that_unfolds_to_a_hundred_times_its_size(
    tmp_path: Path, refuse: Refuse, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lptn.logs.tables.UNPACKED_AT_ONCE", 1_000_000)
    path = tmp_path / "bomb.xlsx"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("xl/sharedStrings.xml", b" " * 20_000_000)
    assert "unpacked" in refuse(path, read_log, path)


@pytest.mark.parametrize(
    ("stored", "found"), [("string", "'xxx"), ("large_string", "'xxx"), ("binary", "a cell of type bytes")]
)
def test_texts_that_a_parquet_file_holds_once_stand_once_in_memory(
    tmp_path: Path, refuse: Refuse, stored: str, found: str
) -> None:
    text = pa.DictionaryArray.from_arrays(pa.array(np.zeros(3000, np.int32)), pa.array(["x" * 1_000_000]).cast(stored))
    table = {"time": np.arange(3000.0), "temperature.a": np.full(3000, 25.0), "torque.a": text}
    path, most = tmp_path / "bomb.parquet", max(pa.default_memory_pool().max_memory(), 500_000_000)
    pq.write_table(pa.table(table), path)
    assert f"row 1, column 'torque.a': found {found}" in refuse(path, read_log, path)
    assert pa.default_memory_pool().max_memory() <= most  # of 3 GB


@pytest.mark.parametrize("error", [MemoryError("malloc failed"), pa.ArrowMemoryError("malloc failed")])
def test_a_lack_of_memory_is_not_called_a_broken_file(error: MemoryError) -> None:
    with pytest.raises(MemoryError, match="malloc failed"), tables.one_line_if_broken(Path("x"), "a whole file"):
        raise error
