"""Files of test benches, written by packages of others: they are read as a table of the same numbers is."""

from __future__ import annotations

from collections.abc import Callable
from itertools import product
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from lptn.basics.errors import InputError
from lptn.logs.columns import ColumnSource
from lptn.logs.reading import open_log, read_log

pytest.importorskip("asammdf", reason="pip install 'lptn[bench]'")
pytest.importorskip("h5py", reason="pip install 'lptn[bench]'")
pytest.importorskip("nptdms", reason="pip install 'lptn[bench]'")

RNG = np.random.default_rng(11)
FAST, SLOW = np.arange(0.0, 120.0, 0.1), np.arange(0.0, 120.0)  # s
TORQUES = {f"torque.{joint}": RNG.normal(0.0, 5.0, FAST.size) for joint in ("a", "b")}
WARM = {f"temperature.{joint}": 20 + 0.1 * SLOW + RNG.normal(0.0, 0.1, SLOW.size) for joint in ("a", "b")}


def mdf(path: Path) -> None:
    from asammdf import MDF, Signal

    file = MDF(version="4.10")
    file.append([Signal(values, FAST, name=name, unit="Nm") for name, values in TORQUES.items()])
    fahrenheit = [Signal(values * 1.8 + 32, SLOW, name=name, unit="degF") for name, values in WARM.items()]
    words = Signal(np.array([b"on"] * SLOW.size), SLOW, name="state", encoding="utf-8")
    file.append([*fahrenheit, words])
    file.save(path)
    file.close()


def tdms(path: Path) -> None:
    from nptdms import ChannelObject, TdmsWriter

    def channels(group: str, columns: dict[str, np.ndarray], step: float, unit: str) -> list[object]:
        said = {"wf_increment": step, "unit_string": unit}
        return [ChannelObject(group, name, values, properties=said) for name, values in columns.items()]

    with TdmsWriter(path) as writer:
        writer.write_segment([*channels("fast", TORQUES, 0.1, "Nm"), *channels("slow", WARM, 1.0, "degC")])


def hdf5(path: Path) -> None:
    import h5py

    with h5py.File(path, "w") as file:
        for group, time, columns in (("drive/fast", FAST, TORQUES), ("drive/slow", SLOW, WARM)):
            file[f"{group}/time_ms"] = 1e3 * time
            for name, values in columns.items():
                file[f"{group}/{name}"] = values
        file["operator"] = "nobody"
        file["photo"] = np.zeros((2000, 3000), np.uint8)


def mat(path: Path) -> None:
    from scipy.io import savemat

    # MATLAB's names have no points: matrices in structs, one for each rate.
    fast, slow = np.array([*TORQUES.values()]).T, np.array([*WARM.values()]).T
    savemat(path, {"fast": {"t": FAST, "tau": fast}, "slow": {"t": SLOW, "T": slow}, "by": "nobody"})


def mat_7_3(path: Path) -> None:
    import h5py

    # As MATLAB lays matrices: the transpose, behind 512 bytes of its own.
    with h5py.File(path, "w", userblock_size=512) as file:
        for group, time, columns, name in (("fast", FAST, TORQUES, "tau"), ("slow", SLOW, WARM, "T")):
            file[f"{group}/t"] = time[None]
            file[f"{group}/{name}"] = np.array([*columns.values()])
        file["by"] = np.array([[ord(letter)] for letter in "nobody"], np.uint16)
        file["by"].attrs["MATLAB_class"] = np.bytes_("char")
    with path.open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file")


MATRICES = {f"torque.{joint}": ColumnSource((f"tau.{k}",)) for k, joint in enumerate("ab")} | {
    f"temperature.{joint}": ColumnSource((f"T.{k}",)) for k, joint in enumerate("ab")
}
FORMATS: dict[str, tuple[Callable[[Path], None], dict[str, ColumnSource]]] = {
    "log.mf4": (mdf, {}),
    "log.tdms": (tdms, {}),
    "log.h5": (hdf5, {}),
    "log.mat": (mat, MATRICES),
    "log7.mat": (mat_7_3, MATRICES),
}


@pytest.mark.parametrize("name", FORMATS)
def test_two_rates_are_read_as_a_table_of_both_is(tmp_path: Path, name: str) -> None:
    write, columns = FORMATS[name]
    write(tmp_path / name)
    both = pd.DataFrame({"time": FAST} | TORQUES).merge(pd.DataFrame({"time": SLOW} | WARM), on="time", how="left")
    both.to_csv(tmp_path / "same.csv", index=False)
    needed = {"inputs": list(TORQUES), "outputs": list(WARM)}
    (run,) = read_log(tmp_path / name, columns, **needed)  # type: ignore[arg-type]
    (same,) = read_log(tmp_path / "same.csv", **needed)  # type: ignore[arg-type]
    assert len(run) == len(same)
    for key in (*TORQUES, *WARM):
        np.testing.assert_allclose(run.columns[key], same.columns[key], atol=1e-9)
    assert not run.issues


def test_a_file_of_one_rate_is_a_plain_table(tmp_path: Path) -> None:
    from scipy.io import savemat

    time = np.arange(1e3, 1e3 + 100)
    savemat(tmp_path / "log.mat", {"time": time, "T1": 20 + 0.1 * time, "P": 3.0 * np.ones(100), "gain": 2.0})
    table, _ = open_log(tmp_path / "log.mat", {})
    assert (table.names, table.mixed) == (("time", "T1", "P"), False)
    np.testing.assert_array_equal(table.numbers(["T1"])["T1"], 20 + 0.1 * time)


def test_channels_of_one_name_are_told_apart_by_their_groups(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "log.h5", "w") as file:
        for group in ("left", "right"):
            file[f"{group}/time"], file[f"{group}/T"] = SLOW, SLOW
        file["lost/x"], file["lost/y"] = np.zeros(7), np.zeros(7)
    table, _ = open_log(tmp_path / "log.h5", {})
    assert table.names == ("time", "left.T", "right.T")
    assert table.notes == ["lost: no channel called time or t of that length; left out."]


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.parametrize("share", [0.0, 0.02, 0.5, 0.97])
def test_a_file_that_ends_early_is_one_line_or_a_shorter_log(tmp_path: Path, name: str, share: float) -> None:
    path = tmp_path / name
    FORMATS[name][0](path)
    whole = path.read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    line = ""
    try:
        open_log(path, {})[0].numbers(["time"])
    except InputError as error:
        line = str(error)
    assert line.startswith(f"{path}: " * bool(line))
    assert "\n" not in line


def test_a_small_file_of_many_numbers_is_refused(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "log.h5", "w") as file:
        for name in ("time", "T"):
            file.create_dataset(name, shape=(400_000_000,), dtype=np.float64, chunks=True)
    table, _ = open_log(tmp_path / "log.h5", {})
    with pytest.raises(InputError, match="at most 5e\\+08 numbers"):
        table.numbers(["time", "T"])


@pytest.mark.parametrize(
    ("kind", "other"),
    [*product(["raw", "virtual"], ["/etc/passwd", "../up", "beside"]), ("virtual", ".")],
)
def test_a_log_leads_to_no_file_of_another_folder(
    tmp_path: Path, kind: str, other: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    import h5py

    monkeypatch.chdir(tmp_path)
    if kind == "raw":
        (tmp_path / "beside").write_bytes(SLOW.tobytes())
    else:
        with h5py.File(tmp_path / "beside", "w") as file:
            file["time"] = SLOW
    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["time"] = SLOW
        if kind == "raw":
            file.create_dataset("T", SLOW.shape, "f8", external=[(other, 0, 8 * SLOW.size)])
        else:
            layout = h5py.VirtualLayout(SLOW.shape, "f8")
            layout[:] = h5py.VirtualSource(other, "time", SLOW.shape)
            file.create_virtual_dataset("T", layout)
    if "/" in other:
        with pytest.raises(
            InputError, match=f"log.h5: T: found numbers of the file '{other}'; expected numbers in the"
        ):
            open_log(tmp_path / "log.h5", {})
    else:
        table, _ = open_log(tmp_path / "log.h5", {})
        np.testing.assert_array_equal(table.numbers(["T"])["T"], SLOW)


def test_groups_within_each_other_have_a_bound(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "log.h5", "w") as file:
        group: h5py.Group = file
        for _ in range(102):
            group = group.create_group("g")
    with pytest.raises(InputError, match="found 101 groups within each other; expected at most 100"):
        open_log(tmp_path / "log.h5", {})


def test_what_has_no_times_is_left_out_or_has_those_of_what_it_is_in(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["t"], file["T"], file["gains"] = SLOW, SLOW, np.arange(3.0)
        file["nothing"] = h5py.Empty("f")
        file.create_dataset("of_words", data=np.zeros(5, [("name", "S4"), ("many", "f8", 3), ("x", "f8")]))
    table, _ = open_log(tmp_path / "log.h5", {})
    assert set(table.names) == {"t", "T"}
    with h5py.File(tmp_path / "nested.h5", "w") as file:
        for group in "ab":
            file[f"{group}/t"], file[f"{group}/motor/T_{group}"] = SLOW, SLOW
    table, _ = open_log(tmp_path / "nested.h5", {})
    assert table.names == ("time", "motor.T_a", "motor.T_b")


def test_channels_of_one_name_in_a_group(tmp_path: Path) -> None:
    from asammdf import MDF, Signal

    file = MDF(version="4.10")
    file.append([Signal(SLOW + k, SLOW, name="T") for k in range(2)])
    file.save(tmp_path / "log.mf4")
    file.close()
    table, _ = open_log(tmp_path / "log.mf4", {})
    first, second = table.names[1:]
    numbers = table.numbers([first, second])
    np.testing.assert_array_equal(numbers[second] - numbers[first], 1.0)


def test_a_file_without_numbers_is_one_line(tmp_path: Path) -> None:
    import h5py

    with h5py.File(tmp_path / "log.h5", "w") as file:
        file["by"] = "nobody"
    with pytest.raises(InputError, match="no channel of two numbers or more"):
        open_log(tmp_path / "log.h5", {})
