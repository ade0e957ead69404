"""`lptn fmu` and `lptn cosim` as a user runs them; archives that are not what they seem."""

from __future__ import annotations

import io
import json
import re
import stat
import struct
import zipfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import fmpy.validation
import numpy as np
import pandas as pd
import pytest

from lptn.basics.bounds import Bound
from lptn.cli.main import main
from lptn.fmu import cosimulate, export, write_system
from lptn.fmu.compile import universal
from lptn.fmu.library import fault
from lptn.model.file import parse_model
from lptn.robots.presets import presets
from tests.builders import effect
from tests.fmu.conftest import Build
from tests.fmu.truth import leg_by_hand

STEP = 2.0


def _run(*words: object) -> None:
    with pytest.raises(SystemExit) as stop:
        main([str(word) for word in words])
    assert stop.value.code == 0


@pytest.fixture(scope="module")
def table() -> pd.DataFrame:
    """A log of the leg, with temperatures from the leg written by hand, sampled, started at rest."""
    n = 200
    rng = np.random.default_rng(2)
    inputs = np.column_stack([np.full(n, 25.0), np.repeat(rng.uniform(0, 5, (n // 20, 3)), 20, axis=0)])
    ends = np.vstack([np.full((1, 3), 25.0), leg_by_hand(inputs, STEP)[:-1]])
    table = pd.DataFrame({"time": STEP * np.arange(n), "temperature.ambient": inputs[:, 0]})
    for row, joint in enumerate(("FR_hip", "FR_thigh", "FR_calf")):
        table[f"temperature.{joint}"] = ends[:, row]
        table[f"torque.{joint}"] = inputs[:, row + 1]
    return table


@pytest.fixture
def log(table: pd.DataFrame, tmp_path: Path) -> Path:
    """The same as a file."""
    path = tmp_path / "log.csv"
    table.to_csv(path, index=False)
    return path


@pytest.fixture
def exported(tmp_path: Path, built: Build) -> Path:
    """An FMU of the preset, exported by the command with its model file inside."""
    model, path = tmp_path / "leg.toml", tmp_path / "leg.fmu"
    model.write_text(presets()["leg"])
    _run("fmu", model, "-o", path, "--limit", "70", "--limit", "FR_calf=90")
    return path


def _refused(words: list[object], capsys: pytest.CaptureFixture[str]) -> str:
    capsys.readouterr()
    with pytest.raises(SystemExit) as stop:
        main([str(word) for word in words])
    seen = capsys.readouterr()
    assert stop.value.code == 2
    assert seen.err.count("\n") == 1
    return seen.err


@pytest.mark.long
def test_an_fmu_follows_a_log_as_its_model_does(exported: Path, log: Path, tmp_path: Path) -> None:
    target, outputs = tmp_path / "found.json", tmp_path / "outputs.csv"
    _run("cosim", exported, log, "--json", target, "-o", outputs)
    said = json.loads(target.read_text())
    assert said["fmi"] == "3.0"
    assert said["all"]["from_model"] < 1e-6
    assert said["all"]["rmse"] < 1e-3
    table = pd.read_csv(outputs)
    heat = table["heat_flow.FR_calf.copper_loss"].to_numpy()
    assert heat[50] == pytest.approx(0.15 * (pd.read_csv(log)["torque.FR_calf"][50] / 0.84357) ** 2)
    assert table["temperature.FR_calf"].between(20, 90).all()


def test_an_fmu_without_a_model_inside_reads_the_log_by_its_names(built: Build, log: Path, tmp_path: Path) -> None:
    target = tmp_path / "found.json"
    _run("cosim", built("leg", 2).path, log, "--json", target)
    said = json.loads(target.read_text())
    assert said["all"]["from_model"] is None
    assert said["all"]["rmse"] < 1e-3


@pytest.mark.parametrize("fmi", [2, 3])
def test_inputs_in_straight_lines_differ_from_held_ones(fmi: int, built: Build, log: Path, tmp_path: Path) -> None:
    target = tmp_path / "found.json"
    _run("cosim", built("leg", fmi).path, log, "--ramps", "--json", target)
    assert 1e-3 < json.loads(target.read_text())["all"]["rmse"] < 0.5  # the log was made with held inputs


@pytest.mark.long
@pytest.mark.usefixtures("built")  # the trust store in a folder of its own
def test_cosimulation_says_to_the_fmu_which_run_it_is(tmp_path: Path) -> None:
    model = parse_model(presets()["leg"], tmp_path / "leg.toml")
    confined = model.with_effects([replace(effect("constant_heat", "FR_calf", power=8.0), run="hot")])
    path = export(confined, tmp_path / "leg.fmu").path
    ends = {}
    for name in ("hot", "cool"):
        rng, n = np.random.default_rng(1), 300
        table = pd.DataFrame({"time": 2.0 * np.arange(n), "temperature.ambient": 22.0})
        for joint in ("FR_hip", "FR_thigh", "FR_calf"):
            table[f"temperature.{joint}"] = 22.0
            table[f"torque.{joint}"] = rng.uniform(0.0, 4.0, n // 20).repeat(20)
        table.to_csv(tmp_path / f"{name}.csv", index=False)
        done = cosimulate(path, [tmp_path / f"{name}.csv"])
        assert done.from_model is not None
        assert done.from_model < 1e-3
        ends[name] = done.runs[0].readings[:, -1]
    assert ends["hot"][2] - ends["cool"][2] > 3.0


@pytest.mark.long
def test_an_fmu_has_the_same_means_over_rows_as_its_model(log: Path, tmp_path: Path) -> None:
    """Rows that a node bends within, and the start that comes before the first row's mean."""
    model, fmu = tmp_path / "quick.toml", tmp_path / "quick.fmu"
    model.write_text(re.sub(r"(capacity = .*value = )[0-9.]+", r"\g<1>20", presets()["leg"]))
    _run("fmu", model, "-o", fmu)
    rows = pd.read_csv(log)
    fine = rows.loc[rows.index.repeat(20)].assign(time=0.1 * np.arange(20 * len(rows)))
    fine.to_csv(log, index=False)
    (done,) = cosimulate(fmu, [log]).runs
    assert done.run.averaged
    assert max(done.from_model(row) or np.nan for row in range(3)) < 1e-5


@pytest.mark.long
def test_a_refused_table_or_model_writes_nothing(
    exported: Path, log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    target, other = tmp_path / "found.json", tmp_path / "other.toml"
    other.write_text(presets()["leg"].replace('"temperature.ambient"', "22"))
    assert ".csv or .parquet" in _refused(["cosim", exported, log, "-o", tmp_path / "x.txt", "--json", target], capsys)
    said = _refused(["cosim", exported, log, "--model", other, "--json", target], capsys)
    assert "ambient.temperature, which the model lacks" in said
    assert not target.exists()


@pytest.mark.long
@pytest.mark.parametrize("option", ["--json", "-o", "--plot"])
def test_a_result_never_takes_the_place_of_an_fmu_of_the_system(
    exported: Path, log: Path, tmp_path: Path, option: str, capsys: pytest.CaptureFixture[str]
) -> None:
    system, before = tmp_path / "legs.ssd", exported.read_bytes()
    write_system(system, {"leg": exported}, [])
    assert "a file that is read" in _refused(["cosim", system, log, option, exported], capsys)
    assert exported.read_bytes() == before


@pytest.mark.long
@pytest.mark.usefixtures("built")  # the trust store in a folder of its own
def test_names_of_any_letters_cannot_get_into_the_code_or_break_the_xml(tmp_path: Path) -> None:
    model, path, log, target = (tmp_path / name for name in ("x.toml", "x.fmu", "x.csv", "found.json"))
    model.write_text(
        r"""
        [model]
        name = "a */ #error \" <b>\u0001"
        ambient = "temperature.ambient"
        [nodes."größe-1"]
        capacity = 300
        [[links]]
        between = ["größe-1", "ambient"]
        resistance = 3
        [[effects]]
        kind = "copper_loss"
        at = "*"
        """,
        encoding="utf-8",
    )
    rows = [f"{k},{25 + k % 3},{k % 5},22" for k in range(30)]
    header = "time,temperature.größe-1,torque.größe-1,temperature.ambient"
    log.write_text("\n".join([header, *rows]) + "\n", encoding="utf-8")
    _run("fmu", model, "-o", path)
    _run("cosim", path, log, "--json", target)
    assert json.loads(target.read_text())["all"]["from_model"] < 1e-6
    assert fmpy.validation.validate_fmu(str(path)) == []


@pytest.mark.long
def test_native_code_from_elsewhere_runs_only_when_asked(
    exported: Path, log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    foreign = tmp_path / "foreign.fmu"
    foreign.write_bytes(exported.read_bytes() + b"x")
    assert "--trust" in _refused(["cosim", foreign, log], capsys)
    _run("cosim", foreign, log, "--trust")
    assert "FR_calf" in capsys.readouterr().out


def _archive(entries: list[tuple[zipfile.ZipInfo | str, bytes]]) -> bytes:
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w") as archive:
        for name, content in entries:
            archive.writestr(name, content)
    return stream.getvalue()


def _link() -> zipfile.ZipInfo:
    info = zipfile.ZipInfo("binaries")
    info.external_attr = (stat.S_IFLNK | 0o777) << 16
    return info


XML = b'<fmiModelDescription fmiVersion="3.0"/>'
TRICKS: dict[str, tuple[bytes, str]] = {
    "no archive": (b"hello", "ZIP"),
    "empty": (b"", "ZIP"),
    "outside": (_archive([("../outside", b"x"), ("modelDescription.xml", XML)]), "inside the FMU"),
    "absolute": (_archive([("/tmp/outside", b"x"), ("modelDescription.xml", XML)]), "inside the FMU"),
    "backslash": (_archive([("a\\..\\b", b"x"), ("modelDescription.xml", XML)]), "inside the FMU"),
    "drive": (_archive([("C:x", b"x"), ("modelDescription.xml", XML)]), "inside the FMU"),
    "link": (_archive([(_link(), b"/etc"), ("modelDescription.xml", XML)]), "link"),
    "twice": (_archive([("modelDescription.xml", XML), ("ModelDescription.xml", XML)]), "twice"),
    "nothing in it": (_archive([("readme", b"x")]), "no modelDescription.xml"),
    "entities": (_archive([("modelDescription.xml", b'<!DOCTYPE x [<!ENTITY a "b">]>' + XML)]), "entities"),
    "encoding": (
        _archive([("modelDescription.xml", b'<?xml version="1.0" encoding="UTF-7" standalone="yes"?>' + XML)]),
        "UTF-8",
    ),
    "UTF-16": (_archive([("modelDescription.xml", XML.decode().encode("utf-16"))]), "UTF-8"),
    "no FMI": (_archive([("modelDescription.xml", b"<x/>")]), "FMI"),
    "identifier": (
        _archive(
            [
                (
                    "modelDescription.xml",
                    b'<fmiModelDescription><CoSimulation modelIdentifier="../x"/></fmiModelDescription>',
                )
            ]
        ),
        "identifier",
    ),
}


@pytest.mark.parametrize("trick", TRICKS)
def test_an_archive_that_is_not_what_it_seems_is_refused(
    trick: str, tmp_path: Path, log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    content, said = TRICKS[trick]
    path = tmp_path / "x.fmu"
    path.write_bytes(content)
    before = sorted(tmp_path.rglob("*"))
    assert said in _refused(["cosim", path, log, "--trust"], capsys)
    assert sorted(tmp_path.rglob("*")) == before


def test_an_archive_that_unpacks_without_end_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, log: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr("lptn.fmu.archive.ARCHIVE", Bound(1 << 20, "bytes"))
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("modelDescription.xml", XML)
        archive.writestr("resources/zeros", bytes(1 << 22))
    path = tmp_path / "x.fmu"
    path.write_bytes(stream.getvalue())
    assert "unpacked" in _refused(["cosim", path, log, "--trust"], capsys)


@pytest.mark.parametrize(
    ("spoil", "said"),
    [
        (lambda words: [*words, "--fmi", "4"], "--fmi"),
        (lambda words: [*words, "--platforms", "vax"], "--platforms"),
        (lambda words: [*words, "--platforms", ","], "--platforms"),
        (lambda words: [*words[:2], "-o", words[1]], "ending in .fmu"),
        (lambda words: [*words, "--limit", "hot"], "--limit"),
        (lambda words: [*words, "--compiler", "tcc"], "--compiler"),
        (lambda words: [words[0], "absent.toml", *words[2:]], "absent.toml"),
    ],
)
def test_a_mistake_in_the_command_is_one_line(
    spoil: Callable[[list[str]], list[object]], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = tmp_path / "leg.toml"
    model.write_text(presets()["leg"])
    words = ["fmu", str(model), "-o", str(tmp_path / "x.fmu")]
    assert said in _refused(spoil(words), capsys)
    assert not (tmp_path / "x.fmu").exists()
    assert model.read_text() == presets()["leg"]


def test_sources_alone_need_no_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("lptn.fmu.compile._compile", None)
    model, path, target = tmp_path / "leg.toml", tmp_path / "leg.fmu", tmp_path / "found.json"
    model.write_text(presets()["leg"])
    _run("fmu", model, "-o", path, "--platforms", "source", "--json", target)
    with zipfile.ZipFile(path) as archive:
        assert not any(name.startswith("binaries") for name in archive.namelist())
    assert json.loads(target.read_text())["platforms"] == []


# --- libraries that were cut off: one line, where loading one kills the process ---------------------


def _with_library(fmu: Path, change: Callable[[bytes], bytes], target: Path) -> Path:
    with zipfile.ZipFile(fmu) as archive, zipfile.ZipFile(target, "w") as changed:
        for name in archive.namelist():
            content = archive.read(name)
            changed.writestr(name, change(content) if name.startswith("binaries/") else content)
    return target


@pytest.mark.parametrize("share", [0.0, 0.001, 0.01, 0.3, 0.6, 0.9, 0.999])
@pytest.mark.parametrize("fmi", [2, 3])
def test_a_library_that_was_cut_off_gives_a_line(
    fmi: int, share: float, built: Build, log: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def cut(content: bytes) -> bytes:
        return content[: int(share * len(content))]

    path = _with_library(built("leg", fmi).path, cut, tmp_path / "cut.fmu")
    said = _refused(["cosim", path, log, "--trust"], capsys)
    assert "binaries/" in said
    assert "a library that loads" in said


@pytest.mark.parametrize("platform", ["linux64", "linux-aarch64", "win64", "darwin-x86_64", "darwin-arm64"])
def test_headers_of_a_whole_library_end_inside_it(platform: str, tmp_path: Path) -> None:
    """Made by hand after the formats' descriptions: one segment, which ends with the file."""
    body, size = b"code" * 100, 400
    if platform.startswith("linux"):
        head = b"\x7fELF\x02\x01\x01".ljust(16, b"\0") + struct.pack(
            "<HHIQQQIHHHHHH", 3, 62, 1, 0, 64, 0, 0, 64, 56, 1, 0, 0, 0
        )
        head += struct.pack("<IIQQQQQQ", 1, 5, 120, 0, 0, size, size, 4096)
    elif platform == "win64":
        head = b"MZ".ljust(60, b"\0") + struct.pack("<I", 64) + b"PE\0\0"
        head += struct.pack("<HHIIIHH", 0x8664, 1, 0, 0, 0, 0, 0x2000)
        head += b".text\0\0\0" + struct.pack("<IIIIIIHHI", size, 4096, size, 128, 0, 0, 0, 0, 0)
    else:
        head = struct.pack("<IIIIIIII", 0xFEEDFACF, 7, 3, 6, 1, 72, 0, 0)
        head += struct.pack("<II16sQQQQIIII", 0x19, 72, b"__TEXT", 0, 4096, 104, size, 5, 5, 0, 0)
    path = tmp_path / "library"
    path.write_bytes(head + body)
    assert fault(path) is None
    path.write_bytes((head + body)[:-1])
    assert "cut off" in str(fault(path))
    if platform.startswith("darwin"):
        one = head + body
        path.write_bytes(universal([one, one]))
        assert fault(path) is None
    path.write_bytes(b"not a library at all")
    assert fault(path) == "no shared library of 64 bits"
