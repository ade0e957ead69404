"""Where a study begins: files that come, and what may not; what columns mean; one file that says all of it."""

from __future__ import annotations

import contextlib
import json
import multiprocessing
import os
import shutil
import socket
import time
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import httpx2 as httpx
import numpy as np
import pandas as pd
import pytest
from pydantic import ValidationError
from starlette.testclient import TestClient

import lptn
from lptn.basics.bounds import TEXT, Bound
from lptn.basics.errors import InputError
from lptn.logs import reading
from lptn.logs.tables import Table
from lptn.model.file import with_entry
from lptn.robots.presets import preset_text
from lptn.robots.urdf import log_model_text
from lptn.workbench.calculation import _at_desk, recent, reopened
from lptn.workbench.desk import Desk, new_desk, place_for
from lptn.workbench.opening import Opening
from lptn.workbench.orders import AtDesk, Name, order
from lptn.workbench.server import application
from lptn.workbench.session import WorkbenchSession
from tests.logs.test_bags import Recorder
from tests.workbench.conftest import EXAMPLE, OPENING, Server

ADDRESS = "http://127.0.0.1:8000"
ORIGIN = {"origin": ADDRESS}
_MS = 1.7e12


def log_of(path: Path, *, air: str = "room", temp: str = "{}_temp", seed: int = 0, offset: float = 0.0) -> Path:
    """Ten minutes of two bodies of 200 J/K that warm by currents through 0.3 ohm; times in ms since 1970."""
    rng = np.random.default_rng(seed)
    table: dict[str, Any] = {"stamp_ms": _MS + 1e8 * seed + 1000.0 * np.arange(600)}
    for joint in ("hip", "knee"):
        load, above, warm = np.repeat(rng.uniform(1, 8, 20), 30), 0.0, []
        for heat in 0.3 * load**2:
            warm.append(22 + above)
            above += (heat - above / 5) / 200
        table |= {temp.format(joint): np.round(warm, 2) + offset, f"{joint}_current": load}
    if air:
        table[air] = 22.0
    pd.DataFrame(table).to_csv(path, index=False)
    return path


@pytest.fixture
def desk(tmp_path: Path) -> Desk:
    """Two logs, of which one lacks the air."""
    folder = new_desk(tmp_path / "sessions")
    log_of(folder / "monday.csv", air="room_temp")
    log_of(folder / "friday.csv", air="", seed=1)
    return Desk(folder)


def do(desk: Desk, **words: object) -> Opening | None:
    asked = order.validate_python(words)
    assert isinstance(asked, AtDesk)
    return desk.do(asked)


def _log(desk: Desk, name: str) -> dict[str, Any]:
    return next(log for log in desk.content()["logs"] if log["name"] == name)


def _row(desk: Desk, name: str, column: str) -> dict[str, Any]:
    return next(row for row in _log(desk, name)["columns"] if row["name"] == column)


# --- what columns mean, and the one file that says so ----------------------------------------------------------------


def test_the_first_model_is_that_of_the_command(desk: Desk) -> None:
    content = desk.content()
    assert content["text"] == log_model_text(desk.folder / "monday.csv")  # not of friday, which has no air
    assert (desk.folder / "model.toml").read_text() == content["text"]
    row = _row(desk, "monday.csv", "hip_temp")
    assert (row["key"], row["how"], row["why"]) == ("temperature.hip", "mapped", "its name")
    assert row["picture"]["line"][0] == 100  # the lowest reading stands at the foot
    assert _row(desk, "monday.csv", "stamp_ms")["unit"] == "ms"
    assert not content["ready"]


@pytest.mark.parametrize("value", ["start", 21.5])
def test_a_run_without_air_gets_one_of_its_own(desk: Desk, value: object) -> None:
    assert "room_temp" in _log(desk, "friday.csv")["refused"]
    do(desk, what="air", log="friday.csv", value=value)
    do(desk, what="job", log="friday.csv", job="holdout")
    content = desk.content()
    assert content["ready"]
    opening = do(desk, what="begin")
    assert opening is not None
    study = opening.study()
    friday = study.data.holdout[0].run.columns["temperature.ambient"]
    assert friday == pytest.approx(22.0 if value == "start" else 21.5, abs=0.3)
    again = lptn.Study(desk.model, [desk.folder / "monday.csv"], [desk.folder / "friday.csv"])  # as a command reads it
    np.testing.assert_array_equal(again.data.holdout[0].run.columns["temperature.ambient"], friday)


def test_rows_without_times_get_a_rate(tmp_path: Path) -> None:
    folder = new_desk(tmp_path / "sessions")
    log = log_of(folder / "monday.csv", air="T_room")
    pd.read_csv(log).drop(columns="stamp_ms").to_csv(log, index=False)
    desk = Desk(folder)
    assert "time" in _log(desk, "monday.csv")["missing"]  # a T is no time
    do(desk, what="rate", log="monday.csv", rate=2.0)
    assert desk.content()["ready"]
    assert _log(desk, "monday.csv")["said"].endswith("5 min")


def test_a_column_is_given_another_meaning_and_none(desk: Desk) -> None:
    desk.content()
    do(desk, what="map", log="monday.csv", column="hip_temp", key="temperature.knee", unit="degF")
    text = desk.text
    assert '"temperature.knee" = { column = "hip_temp", unit = "degF" }' in text
    assert '"temperature.hip"' not in text
    assert "guessed" not in text.partition('"temperature.knee"')[2].partition("\n")[0]
    do(desk, what="map", log="monday.csv", column="hip_temp", key="")
    assert "hip_temp" not in desk.text.partition("[columns]")[2]
    with pytest.raises(InputError, match="unit"):
        do(desk, what="map", log="monday.csv", column="hip_temp", key="temperature.hip", unit="furlong per")
    with pytest.raises(InputError, match="key"):
        do(desk, what="map", log="monday.csv", column="hip_temp", key="temperature.*")


def test_a_column_that_other_logs_lack_is_that_of_one_run(desk: Desk) -> None:
    log_of(desk.folder / "sunday.csv", air="T_luft", seed=2)
    desk.content()
    do(desk, what="map", log="sunday.csv", column="T_luft", key="temperature.ambient")
    assert '"temperature.ambient@sunday" = "T_luft"' in desk.text
    assert not _log(desk, "sunday.csv")["refused"]
    assert not _log(desk, "monday.csv")["refused"]


def test_a_remedy_of_the_check_is_one_click(desk: Desk) -> None:
    log_of(desk.folder / "tuesday.csv", air="room_temp", seed=3, offset=273.15)
    issue = next(issue for issue in _row(desk, "tuesday.csv", "hip_temp")["issues"] if issue["line"])
    assert "K" in issue["line"]
    do(desk, what="remedy", log="tuesday.csv", line=issue["line"])
    assert '"temperature.hip@tuesday"' in desk.text  # the other logs are in degC
    assert not [one for one in _row(desk, "tuesday.csv", "hip_temp")["issues"] if one["sure"]]
    assert _row(desk, "monday.csv", "hip_temp")["issues"] == []
    with pytest.raises(InputError, match="none of this log"):
        do(desk, what="remedy", log="tuesday.csv", line='"temperature.hip" = "x"')


def test_guesses_for_another_model_are_those_of_the_option(desk: Desk) -> None:
    text, _, _ = log_model_text(desk.folder / "monday.csv").partition("[columns]")
    (desk.folder / "model.toml").write_text(text)
    log = _log(desk, "monday.csv")
    (run,) = lptn.load_model(desk.model, ["guess"]).runs([desk.folder / "monday.csv"])
    said = [note for note in run.notes if note.startswith("guessed: ")]
    assert log["guesses"] == len(said) == sum(row["how"] == "guessed" for row in log["columns"]) == 6
    do(desk, what="guesses")
    for note in said:  # line and reason
        line, _, why = note.removeprefix("guessed: ").rstrip(".").partition(" (")
        assert f"{line}   # guessed: {why.rstrip(')')}" in desk.text
    assert _log(desk, "monday.csv")["guesses"] == 0


def test_the_text_is_free_and_its_mistake_is_said(desk: Desk) -> None:
    text = desk.content()["text"]
    (desk.folder / "model.toml").write_text(text.replace("[[links]]", "[[likns]]"))
    wrong = desk.content()["wrong"]
    assert "likns" in wrong
    assert wrong.startswith("model.toml: ")
    (desk.folder / "model.toml").write_text("[nodes.a]\nborn = 2024-01-01\n")
    assert json.dumps(desk.content()["tables"])
    (desk.folder / "model.toml").write_text("[model\n")
    assert "TOML" in desk.content()["wrong"]
    with pytest.raises(InputError, match="TOML"):
        do(desk, what="map", log="monday.csv", column="hip_temp", key="temperature.hip")
    do(desk, what="model", source="columns")
    assert desk.text == text


def test_a_log_is_read_again_only_where_a_change_of_the_model_takes_other_things_from_it(
    desk: Desk, monkeypatch: pytest.MonkeyPatch
) -> None:
    desk.content()
    read = list[str]()
    opened = reading.open_table

    def seen(path: Path) -> Table:
        read.append(path.name)
        return opened(path)

    monkeypatch.setattr(reading, "open_table", seen)
    text, before = desk.text, desk.content()["logs"]
    edits = {
        "a parameter": text.replace("value = 7.21", "value = 9.5"),
        "a comment": text.replace("its name\n", "a person\n"),
        "a link": text + '\n[[links]]\nbetween = ["hip", "knee"]\nresistance = 3\n',
        "a mistake": text + "\n[[links]\n",
        "as before": text,
    }
    assert len({*edits.values()}) == len(edits)
    for edit in edits.values():
        desk.model.write_text(edit)
        shown = desk.content()["logs"]
        assert [log["said"] for log in shown] == [log["said"] for log in before]
    assert not read
    assert shown == before
    desk.model.write_text(edits["a comment"])
    assert _row(desk, "monday.csv", "hip_temp")["why"] == "a person"
    do(desk, what="air", log="friday.csv", value=20)
    desk.content()
    assert set(read) == {"friday.csv"}
    desk.model.write_text(text.replace('"stamp_ms"', '"hip_current"'))
    desk.content()
    assert set(read) == {"friday.csv", "monday.csv"}


def test_forms_change_the_text_and_nothing_else_in_it(desk: Desk) -> None:
    text = desk.content()["text"]
    ends = {"value": 5, "unit": "K/W", "bounds": [0.2, 200]}
    for keys, value in (
        (["nodes", "*", "capacity", "value"], 350),
        (["links", 0, "resistance", "bounds"], [0.5, 99]),
        (["effects", 0, "resistance"], 0.4),
        (["links", 1], {"between": ["hip", "knee"], "resistance": ends}),
        (["effects", 1], None),
    ):
        do(desk, what="entry", keys=keys, value=value)
    tables = desk.content()["tables"]
    assert tables["nodes"]["*"]["capacity"]["value"] == 350
    assert tables["links"][1] == {"between": ["hip", "knee"], "resistance": ends}
    assert [effect["kind"] for effect in tables["effects"]] == ["copper_loss"]
    values = {one.name: one.value for one in lptn.load_model(desk.model).model.parameters}  # as any command reads it
    assert (values["capacity.hip"], values["capacity.knee"], values["resistance.hip~knee"]) == (350, 350, 5)
    assert 'data-link="hip~knee"' in desk.content()["drawing"]
    kept = [line for line in text.partition("# --- what drives")[0].splitlines() if line.startswith("#")]
    kept += [line for line in text.splitlines() if "# guessed: " in line]
    assert [line for line in desk.text.splitlines() if line in kept] == kept
    first = with_entry("[model]\n", desk.model, ["nodes", "base"], {"capacity": ends})
    assert tomllib.loads(with_entry(first, desk.model, ["links", 0], {"between": ["base", "ambient"]})) == {
        "model": {},
        "nodes": {"base": {"capacity": ends}},
        "links": [{"between": ["base", "ambient"]}],
    }
    for emptied in (
        with_entry(desk.text, desk.model, ["effects", 0], None),
        'effects = [{ kind = "fan" }]\nnodes = {}\n',
    ):
        beside = with_entry(emptied, desk.model, ["nodes", "base"], {"capacity": ends})
        count = len(tomllib.loads(beside)["effects"])
        again = tomllib.loads(with_entry(beside, desk.model, ["effects", count], {"kind": "copper_loss"}))
        assert again["effects"][-1] == {"kind": "copper_loss"}
        assert again["nodes"]["base"] == {"capacity": ends}
    before = desk.text
    for wrong in (["links", 9, "between"], ["links", "a"], ["nodes", "*", "capacity", "value", "more"], ["effects", 7]):
        with pytest.raises(InputError):
            do(desk, what="entry", keys=wrong, value=None)
    assert desk.text == before
    with pytest.raises(ValidationError, match="nodes, links or effects"):
        do(desk, what="entry", keys=["columns", "time"], value="x")


def test_models_of_presets_and_urdfs(desk: Desk) -> None:
    do(desk, what="model", source="leg.single-node")
    assert desk.text == preset_text("leg", "single-node")
    ends = '<parent link="{}"/><child link="{}"/><limit effort="20" velocity="9"/>'
    joints = [("hip", "base", "thigh"), ("knee", "thigh", "shank")]
    parts = [f'<joint name="{n}" type="revolute">{ends.format(a, b)}</joint>' for n, a, b in joints]
    (desk.folder / "two.urdf").write_text(f'<robot name="two">{"".join(parts)}</robot>')
    assert desk.content()["urdfs"] == ["two.urdf"]
    do(desk, what="model", source="two.urdf")
    assert 'input = "current"' in desk.text  # the logs have no torques
    do(desk, what="guesses")
    assert not _log(desk, "monday.csv")["refused"]
    with pytest.raises(InputError):
        do(desk, what="model", source="../two.urdf")


def test_logs_of_one_name_but_for_its_ending_have_airs_of_their_own(desk: Desk) -> None:
    desk.content()
    do(desk, what="air", log="monday.csv", value=20)
    shutil.copy(desk.folder / "monday.csv", desk.folder / "monday.txt")
    do(desk, what="air", log="monday.txt", value=10)
    do(desk, what="air", log="friday.csv", value=15)
    airs = {log["name"]: log["air"]["value"] for log in desk.content()["logs"]}
    assert airs == {"monday.csv": 20, "monday.txt": 10, "friday.csv": 15}
    do(desk, what="map", log="monday.txt", column="room_temp", key="temperature.ambient")
    assert _log(desk, "monday.txt")["air"] == {"value": None, "column": "room_temp"}
    assert _log(desk, "monday.csv")["air"]["value"] == 20
    (desk.folder / "monday.txt").unlink()
    do(desk, what="air", log="monday.csv", value=21)
    assert _log(desk, "monday.csv")["air"]["value"] == 21


def test_a_urdf_that_is_refused_is_gone_and_its_like_are_taken(desk: Desk) -> None:
    (desk.folder / "two.urdf").write_text('<robot name="two"><link name="base"/></robot>')
    with pytest.raises(InputError, match=r"two\.urdf"):
        do(desk, what="model", source="two.urdf")
    assert desk.content()["urdfs"] == []
    with pytest.raises(InputError, match="no such URDF"):
        do(desk, what="model", source="monday.csv")
    assert (desk.folder / "monday.csv").exists()
    (desk.folder / "two.urdf").touch()
    assert place_for(desk.folder, "two.URDF", None) == desk.folder / "two.urdf"


def test_what_an_order_is_refused_for_has_names_without_folders(desk: Desk) -> None:
    (desk.folder / "two.urdf").touch()
    ours, theirs = multiprocessing.Pipe()
    for words in ({"what": "model", "source": "two.urdf"}, {"what": "begin"}):
        ours.send(order.validate_python(words))
    assert _at_desk(theirs, desk, reading=False) is not None
    theirs.close()
    failed = list[str]()
    with contextlib.suppress(EOFError):
        while True:
            kind, *rest = ours.recv()
            failed += rest if kind == "failed" else []
    (said,) = failed
    assert said.startswith("two.urdf: ")


def test_why_there_is_no_model_is_said_while_it_holds(tmp_path: Path) -> None:
    desk = Desk(new_desk(tmp_path / "sessions"))
    (desk.folder / "zz.csv").write_text("u,v\n1,2\n2,3\n3,4\n")
    assert desk.content()["wrong"].startswith("zz.csv: ")
    do(desk, what="remove", name="zz.csv")
    assert desk.content()["wrong"] == ""


def test_a_log_is_removed_and_files_of_the_command_line_stay(desk: Desk, tmp_path: Path) -> None:
    desk.content()
    do(desk, what="job", log="friday.csv", job="unused")
    assert Desk(desk.folder).content()["ready"]
    assert _log(Desk(desk.folder), "friday.csv")["said"] == "not read yet"  # what is not used need not be
    do(desk, what="remove", name="friday.csv")
    assert not (desk.folder / "friday.csv").exists()
    own = log_of(tmp_path / "own.csv", air="room_temp")
    other = Desk.of(tmp_path / "sessions", Opening(None, (own,)))
    (log,) = other.content()["logs"]
    assert log["name"] == str(own)
    assert not log["refused"]
    do(other, what="remove", name=str(own))
    assert own.exists()
    assert Desk.of(tmp_path / "sessions", Opening(None, (own,))).folder == other.folder


def test_what_a_command_line_says_of_columns_stands_in_the_file(tmp_path: Path) -> None:
    log = log_of(tmp_path / "own.csv", air="T9")
    pd.read_csv(log).drop(columns="stamp_ms").to_csv(log, index=False)
    given = Opening(None, (log,), columns=("temperature.ambient=T9", "time=[rate=1]", "guess"))
    desk = Desk.of(tmp_path / "sessions", given)
    content = desk.content()
    assert "time = { rate = 1 }" in content["text"]
    assert '"temperature.ambient" = "T9"' in content["text"]
    assert 'ambient = "start"' in content["text"]  # which the columns alone said
    opening = do(desk, what="begin")
    assert opening is not None
    assert opening.columns == ()
    assert opening.study().data.fit


def test_a_model_that_is_no_text_is_said(desk: Desk) -> None:
    (desk.folder / "model.toml").write_bytes(b"\xff\xfe\x00")
    content = desk.content()
    assert "UTF-8" in content["wrong"]
    assert not content["ready"]


@pytest.mark.parametrize("text", ["a = " + "[" * 5000, f"a = {'1' * 5000}", "a = 1\na = 2"])
def test_a_model_that_is_no_toml_is_said(desk: Desk, text: str) -> None:
    (desk.folder / "model.toml").write_text(text)
    content = desk.content()
    assert content["wrong"].startswith("model.toml: ")
    assert content["text"] == text
    assert not content["tables"]


# --- files that come ------------------------------------------------------------------------------------------------


@pytest.fixture
def session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> WorkbenchSession:
    """A workbench that begins without files; its process does nothing."""
    session = WorkbenchSession(None, tmp_path / "sessions")
    monkeypatch.setattr(session, "_begin", lambda: None)
    monkeypatch.setattr(session, "_send", lambda order: None)
    return session


@pytest.fixture
def site(session: WorkbenchSession) -> Iterator[TestClient]:
    with TestClient(application(session, 8000, "secret"), base_url=ADDRESS) as client:
        client.get("/?token=secret")
        yield client


def _files(session: WorkbenchSession) -> list[str]:
    folder = session.opening
    return sorted(path.name for path in folder.iterdir()) if isinstance(folder, Path) else []


def _sent(site: TestClient, name: str, content: Any = b"time,a\n", **words: str) -> httpx.Response:
    answer: httpx.Response = site.post("/file", params={"name": name, **words}, content=content, headers=ORIGIN)
    return answer


HOSTILE = {
    "a path": "../../x.csv",
    "a path from the root": "/etc/x.csv",
    "a path of Windows": "..\\x.csv",
    "a drive": "c:x.csv",
    "a zero byte": "a\0b.csv",
    "a line": "a\nb.csv",
    "a terminal's colours": "a\x1b[31m.csv",
    "hidden": ".x.csv",
    "nothing": "",
    "300 characters": "x" * 296 + ".csv",
    "300 bytes of other letters": "ж" * 148 + ".csv",
    "the other way round": "a\u202ecsv.exe.csv",
    "another kind": "x.pdf",
    "a program": "x.py",
    "a kind in disguise": "x.csv.exe",
    "the study's own": "study.pickle",
    "a folder in a folder": "a/b/metadata.yaml",
    "a folder above": "../metadata.yaml",
    "a hidden folder": ".git/metadata.yaml",
    "a folder without a name": "/metadata.yaml",
    "another kind in a bag": "bag/x.csv",
    "a bag in the model's place": "model.toml/metadata.yaml",
    "a bag in the opening's place": "Opening.json/metadata.yaml",
    "a path of Windows in a bag": "bag\\..\\../x.mcap",
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_hostile_name_is_refused_in_a_line_and_nothing_is_kept(
    kind: str, site: TestClient, session: WorkbenchSession, tmp_path: Path
) -> None:
    name = HOSTILE[kind].encode()
    answer = site.post(f"/file?name={''.join(f'%{byte:02x}' for byte in name)}", content=b"x", headers=ORIGIN)
    assert answer.status_code == 413
    assert answer.json()["error"].isprintable()
    assert "\n" not in answer.json()["error"]
    assert not list(tmp_path.rglob("*.csv*")) + list(tmp_path.rglob("*.exe"))
    assert session.opening is None


def test_a_bag_comes_file_by_file_and_is_a_log_with_its_metadata(
    site: TestClient, session: WorkbenchSession, tmp_path: Path
) -> None:
    recorder = Recorder(tmp_path / "walk", "sqlite3")
    with recorder.writer:
        for k in range(600):
            recorder.send("/joint_states", 1.0 * k, recorder.joints(k, ["knee"], [1.0], [1.0]))
            recorder.send(
                "/dynamic_joint_states", k + 0.1, recorder.dynamic(k, {"knee": {"temperature": 20.0 + k / 60}})
            )
    files = sorted((tmp_path / "walk").iterdir(), key=lambda path: path.name == "metadata.yaml")
    assert _sent(site, "torn/torn_0.db3", files[0].read_bytes()).status_code == 202
    assert _sent(site, "torn/metadata.yaml", b"x" * (TEXT.most + 1)).status_code == 413
    assert "torn" not in _files(session)  # what can't be a log takes no room
    for number, file in enumerate(files):
        for _ in range(2 if number == 0 else 1):  # one that broke off may come again
            assert _sent(site, f"walk/{file.name}", file.read_bytes()).status_code == 202
    assert isinstance(session.opening, Path)
    assert sorted(path.name for path in (session.opening / "walk").iterdir()) == sorted(file.name for file in files)
    desk = Desk(session.opening)
    (log,) = desk.content()["logs"]
    assert (log["name"], log["opened"], log["size"]) == ("walk", True, sum(file.stat().st_size for file in files))
    assert _sent(site, "walk/more.db3").status_code == 413
    do(desk, what="remove", name="walk")
    assert not (desk.folder / "walk").exists()


def test_a_desk_on_which_nothing_stayed_is_gone_when_it_is_left(site: TestClient, session: WorkbenchSession) -> None:
    for stays, folders in (("", 0), ("model.toml", 1)):
        _sent(site, "a.csv")
        assert isinstance(session.opening, Path)
        (session.opening / "a.csv").unlink()
        if stays:
            (session.opening / stays).touch()
        session.do(order.validate_python({"what": "leave"}))
        assert len(list(session._sessions.glob("begin-*"))) == folders


def test_a_name_may_have_signs_of_html_and_other_scripts(site: TestClient, session: WorkbenchSession) -> None:
    names = ["<img src=x onerror=alert(1)>.csv", 'лог & "b".csv', "2026-11-30T12:00.csv", "a+b@12.csv"]
    assert [_sent(site, name).status_code for name in names] == [202] * 4
    assert set(_files(session)) >= set(names)


def test_a_file_comes_whole_or_not_at_all(
    site: TestClient, session: WorkbenchSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = os.urandom(3_000_000)
    assert _sent(site, "a.csv", content).status_code == 202
    assert isinstance(session.opening, Path)
    assert (session.opening / "a.csv").read_bytes() == content
    assert _sent(site, "a.csv", b"other").status_code == 413  # it would take the place of the first
    assert (session.opening / "a.csv").read_bytes() == content
    monkeypatch.setattr("lptn.workbench.desk.FILE", Bound(1_000_000, "bytes"))

    def pieces() -> Iterator[bytes]:
        yield from (b"x" * 300_000 for _ in range(5))

    assert _sent(site, "b.csv", content).status_code == 413
    assert _sent(site, "c.csv", pieces()).status_code == 413  # no length was stated
    assert _sent(site, "model.toml", b"#" * 600_000).status_code == 413  # of a text a person edits less may come
    assert _files(session) == ["a.csv"]


@pytest.mark.parametrize(("name", "first"), [("a.csv", 413), ("model.toml", 413), ("a.urdf", 202)])
def test_what_came_meanwhile_is_not_replaced(
    name: str, first: int, site: TestClient, session: WorkbenchSession
) -> None:
    def slow() -> Iterator[bytes]:
        yield b"# slow"
        assert isinstance(session.opening, Path)
        (session.opening / name).write_text("# quick")

    assert _sent(site, name, slow(), based="").status_code == first
    assert isinstance(session.opening, Path)
    assert (session.opening / name).read_text() == ("# quick" if first == 413 else "# slow")
    assert _files(session) == [name]


def test_an_ending_may_have_large_letters(site: TestClient, session: WorkbenchSession) -> None:
    for name in ("LOG.CSV", "Log.csv.GZ", "Two.URDF", "My.TOML"):
        assert _sent(site, name).status_code == 202
    assert _files(session) == ["LOG.csv", "Log.csv.gz", "Two.urdf", "model.toml"]
    assert _sent(site, "LOG.Csv").status_code == 413


def test_who_has_no_token_or_another_page_sends_nothing(session: WorkbenchSession) -> None:
    with TestClient(application(session, 8000, "secret"), base_url=ADDRESS) as client:
        assert _sent(client, "a.csv").status_code == 401
        client.get("/?token=secret")
        assert client.post("/file?name=a.csv", content=b"x").status_code == 403
        evil = {"origin": "http://evil.example"}
        assert client.post("/file?name=a.csv", content=b"x", headers=evil).status_code == 403
    assert session.opening is None


def test_a_full_disk_is_said(site: TestClient, session: WorkbenchSession, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    _sent(site, "a.csv")
    monkeypatch.setattr("lptn.basics.files.os.fsync", full)
    answer = _sent(site, "b.csv")
    assert answer.status_code == 507
    assert "No space left" in answer.json()["error"]
    assert _files(session) == ["a.csv"]


def test_a_text_that_another_tab_changed_is_not_lost(site: TestClient, session: WorkbenchSession) -> None:
    assert _sent(site, "model.toml", b"[model]\n", based="").status_code == 202
    assert isinstance(session.opening, Path)
    first = Desk(session.opening).content()["based"]
    assert _sent(site, "model.toml", b"# one\n", based=first).status_code == 202
    assert _sent(site, "model.toml", b"# two\n", based=first).status_code == 413
    assert (session.opening / "model.toml").read_text() == "# one\n"
    assert _sent(site, "other.TOML", b"# a file that is dropped is the model\n").status_code == 202
    assert "dropped" in (session.opening / "model.toml").read_text()


def test_files_are_for_the_page_that_a_workbench_begins_with(tmp_path: Path) -> None:
    session = WorkbenchSession(OPENING, tmp_path)
    with TestClient(application(session, 8000, "secret"), base_url=ADDRESS) as client:
        client.get("/?token=secret")
        assert _sent(client, "a.csv").status_code == 409
        assert client.post("/order", json={"what": "leave"}, headers=ORIGIN).status_code == 409


def test_what_was_refused_is_said_until_a_person_orders(site: TestClient, session: WorkbenchSession) -> None:
    session._pipe, there = multiprocessing.Pipe()
    for name in ("bad.mcap", "good.csv", "worse.mcap"):  # dropped together
        _sent(site, name)
        WorkbenchSession._send(session, Name(what="look"))
        if name.endswith(".mcap"):
            session._heard_failed(f"{name}: no log")
        session._heard_done()
    assert (session.state() or {})["failed"] == "bad.mcap: no log · worse.mcap: no log"
    session.do(order.validate_python({"what": "guesses"}))
    assert (session.state() or {})["failed"] == ""
    there.close()


def test_what_waits_for_the_desk_is_no_order_for_a_study(
    site: TestClient, session: WorkbenchSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    sent: list[object] = []
    monkeypatch.setattr(session, "_send", sent.append)
    _sent(site, "a.csv")
    session._busy = {"what": "begin"}
    _sent(site, "b.csv")
    assert len(sent) == 1
    session._heard_opening(OPENING)
    session._heard_done()
    assert len(sent) == 1


@pytest.mark.parametrize(
    "sent",
    [
        {"what": "job", "log": "a.csv", "job": "win"},
        {"what": "map", "log": "a.csv", "column": "", "key": "time"},
        {"what": "air", "log": "a.csv", "value": "warm"},
        {"what": "holdout_after", "seconds": -3},
        {"what": "model", "source": ""},
        {"what": "recent", "name": ""},
    ],
)
def test_nonsense_orders_of_files_are_refused(sent: dict[str, object], site: TestClient) -> None:
    assert site.post("/order", json=sent, headers=ORIGIN).status_code == 422


def test_only_what_the_page_lists_is_opened_again(site: TestClient, tmp_path: Path) -> None:
    (tmp_path / "sessions").mkdir(exist_ok=True)
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "opening.json").write_text("{}")
    for name in ("../elsewhere", "begin-../../elsewhere", str(tmp_path / "elsewhere"), "nothing"):
        answer = site.post("/order", json={"what": "recent", "name": name}, headers=ORIGIN)
        assert answer.status_code == 413
        assert "none of that name" in answer.json()["error"]


# --- with the process that works -----------------------------------------------------------------------------------


def _wait(until: Callable[[], Any]) -> Any:
    deadline = time.monotonic() + 60
    while not (found := until()):
        assert time.monotonic() < deadline
        time.sleep(0.05)
    return found


@pytest.mark.long
def test_a_killed_server_loses_nothing_and_lets_nothing_half_in(tmp_path: Path) -> None:
    whole = log_of(tmp_path / "monday.csv", air="room_temp").read_bytes()
    server = Server(tmp_path / "state", files=[])
    sessions = tmp_path / "state" / "lptn" / "sessions"
    try:
        with httpx.Client(base_url=server.home, headers={"origin": server.home}) as client:
            client.get(server.address)
            assert client.post("/file?name=monday.csv", content=whole).status_code == 202
            cookie = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
            _wait(lambda: client.get("/state").json().get("desk", {}).get("text"))
            with socket.create_connection(("127.0.0.1", server.port)) as half:
                head = (
                    f"POST /file?name=half.csv HTTP/1.1\r\nhost: 127.0.0.1:{server.port}\r\norigin: {server.home}\r\n"
                )
                half.sendall(f"{head}cookie: {cookie}\r\ncontent-length: 9000000\r\n\r\n".encode() + b"x" * 4_000_000)
                _wait(lambda: [p for p in sessions.rglob("*.part") if p.stat().st_size > 1_000_000])
                server.kill()
    finally:
        server.kill()
    assert not list(sessions.rglob("half.csv"))
    (one,) = recent(sessions)
    assert one["logs"] == ["monday.csv"]
    desk = reopened(sessions, one["desk"])
    assert isinstance(desk, Path)
    assert (desk / "monday.csv").read_bytes() == whole
    assert Desk(desk).content()["ready"]


@pytest.mark.long
def test_an_upload_that_breaks_off_leaves_nothing(tmp_path: Path) -> None:
    server = Server(tmp_path / "state", files=[])
    sessions = tmp_path / "state" / "lptn" / "sessions"
    try:
        with httpx.Client(base_url=server.home) as client:
            client.get(server.address)
            cookie = "; ".join(f"{name}={value}" for name, value in client.cookies.items())
        with socket.create_connection(("127.0.0.1", server.port)) as half:
            head = f"POST /file?name=half.csv HTTP/1.1\r\nhost: 127.0.0.1:{server.port}\r\norigin: {server.home}\r\n"
            half.sendall(f"{head}cookie: {cookie}\r\ncontent-length: 9000000\r\n\r\n".encode() + b"x" * 4_000_000)
            _wait(lambda: list(sessions.rglob("*.part")))
        _wait(lambda: not list(sessions.rglob("*.part")))
        assert not list(sessions.rglob("half.csv"))
    finally:
        server.kill()


@pytest.mark.long
@pytest.mark.parametrize("with_model", [True, False])
def test_files_of_the_command_line_that_lack_columns_lead_to_the_page(with_model: bool, tmp_path: Path) -> None:
    log = log_of(tmp_path / "monday.csv", air="room_temp")
    files = [str(log)]
    if with_model:
        (tmp_path / "leg.toml").write_text(log_model_text(log).partition("[columns]")[0])
        files = [str(tmp_path / "leg.toml"), *files]
    server = Server(tmp_path / "state", files=files)
    try:
        with httpx.Client(base_url=server.home, headers={"origin": server.home}) as client:
            client.get(server.address)
            state = _wait(lambda: (now := client.get("/state").json()).get("desk") and now)
            (shown,) = state["desk"]["logs"]
            assert shown["name"] == str(log)
            if with_model:
                assert "no such column" in state["failed"]
                assert not state["desk"]["ready"]
                assert shown["guesses"] == 6
                _wait(lambda: not client.get("/state").json()["busy"])
                assert client.post("/order", json={"what": "guesses"}).status_code == 202
                _wait(lambda: client.get("/state").json()["desk"]["ready"])
            _wait(lambda: not client.get("/state").json()["busy"])
            assert client.post("/order", json={"what": "begin"}).status_code == 202
            state = _wait(lambda: (now := client.get("/state").json()).get("steps") and now)
            assert state["head"]["given"] < 1
    finally:
        server.kill()


@pytest.mark.long
def test_a_study_of_before_is_listed_and_opened_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sessions = tmp_path / "sessions"
    for name in ("two_heaters.toml", "log.csv"):
        shutil.copy(EXAMPLE / name, tmp_path)
    monkeypatch.chdir(tmp_path)
    opening = Opening(Path("two_heaters.toml"), (Path("log.csv"),), holdout_after=300.0)
    first = WorkbenchSession(opening, sessions).open()
    _wait(lambda: (first.state() or {}).get("steps"))
    _wait(lambda: not (first.state() or {})["busy"])
    first.close()
    monkeypatch.chdir(sessions)  # from any folder
    second = WorkbenchSession(None, sessions)
    with contextlib.closing(second):
        (one,) = (second.state() or {})["recent"]
        assert (one["name"], one["logs"], one["desk"]) == ("two heaters", ["log.csv"], "")
        second.do(order.validate_python({"what": "recent", "name": one["study"]}))
        state = _wait(lambda: (now := second.state()) and now.get("steps") and now)
        assert state["head"]["which"] == "held out"
        assert second.folder == sessions / one["study"]
        second.do(order.validate_python({"what": "leave"}))
        assert (second.state() or {})["recent"]
        (tmp_path / "log.csv").unlink()  # then it can't be read, and the page it began with says so
        second.do(order.validate_python({"what": "recent", "name": one["study"]}))
        state = _wait(lambda: (now := second.state()) and now["failed"] and now)
        assert "no such file" in state["failed"]
        assert state["recent"]
        assert not state["busy"]
