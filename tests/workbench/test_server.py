"""The server: who may talk to it, what it answers, what it refuses."""

from __future__ import annotations

import contextlib
import os
import pickle
import queue
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from multiprocessing import Pipe
from pathlib import Path

import httpx2 as httpx
import pytest
import uvicorn
from starlette.applications import Starlette
from starlette.testclient import TestClient

from lptn.basics.errors import InputError
from lptn.basics.files import held
from lptn.workbench.bench import Bench
from lptn.workbench.calculation import _opened, written
from lptn.workbench.content import content_of
from lptn.workbench.opening import EXAMPLES
from lptn.workbench.orders import Keep, order
from lptn.workbench.server import application, listening, serve, serve_site
from lptn.workbench.session import WorkbenchSession
from tests.workbench.conftest import EXAMPLE, OPENING, unpacked

ADDRESS = "http://127.0.0.1:8000"
ORIGIN = {"origin": ADDRESS}


@pytest.fixture(scope="module")
def session(bench: Bench) -> WorkbenchSession:
    """A session that heard of the fit, and whose process does nothing."""
    session = WorkbenchSession(OPENING, bench.folder)
    session._heard_opened(bench.folder)
    session._heard_shown(content_of(bench), bench.news())
    return session


@pytest.fixture
def stranger(session: WorkbenchSession) -> Iterator[TestClient]:
    """A browser that was not given the token."""
    with TestClient(application(session, 8000, "secret"), base_url=ADDRESS, follow_redirects=False) as client:
        yield client


@pytest.fixture
def browser(stranger: TestClient) -> TestClient:
    """A browser that opened the address with the token."""
    assert stranger.get("/?token=secret").status_code == 200
    return stranger


def test_the_token_lets_in_once_and_is_answered_with_a_cookie(stranger: TestClient) -> None:
    assert stranger.get("/").status_code == 401
    assert stranger.get("/?token=guessed").status_code == 401
    assert stranger.get("/state").status_code == 401
    answer = stranger.get("/?token=secret")
    assert answer.status_code == 200
    assert 'content="0; url=/"' in answer.text  # and the history has the address without it
    assert "HttpOnly" in answer.headers["set-cookie"]
    assert "SameSite=strict" in answer.headers["set-cookie"]
    assert "secret" not in answer.headers["set-cookie"]
    assert stranger.get("/").status_code == 200
    assert stranger.get("/", headers={"cookie": "lptn-8000=guessed"}).status_code == 401
    assert stranger.get("/", headers={"cookie": "lptn-8000=secret"}).status_code == 401


def test_a_token_that_was_used_lets_nobody_else_in(session: WorkbenchSession) -> None:
    site = application(session, 8000, "shown", "in the file")

    def opens(token: str) -> int:
        with TestClient(site, base_url=ADDRESS) as client:
            return client.get("/", params={"token": token}).status_code

    assert [opens("shown"), opens("shown"), opens("guessed")] == [200, 401, 401]
    assert [opens("in the file"), opens("in the file")] == [200, 401]
    assert [opens(""), opens("shown")] == [401, 401]


def test_who_is_in_may_open_the_address_again(stranger: TestClient) -> None:
    assert [stranger.get("/?token=secret").status_code for _ in range(3)] == [200] * 3
    assert stranger.get("/?token=old").status_code == 200  # of the server before


@pytest.mark.parametrize("host", ["evil.example", "127.0.0.1", "127.0.0.1:8001", "localhost:80", ""])
def test_another_host_is_refused(browser: TestClient, host: str) -> None:
    assert browser.get("/state", headers={"host": host}).status_code == 421


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://127.0.0.1:8001", "https://127.0.0.1:8000"])
def test_another_page_is_refused(browser: TestClient, origin: str) -> None:
    assert browser.get("/state", headers={"origin": origin}).status_code == 403
    assert browser.post("/order", json={"what": "undo"}, headers={"origin": origin}).status_code == 403


def test_an_order_needs_an_origin(browser: TestClient) -> None:
    assert browser.post("/order", json={"what": "undo"}).status_code == 403
    assert browser.post("/stop").status_code == 403


def test_every_answer_lets_a_page_load_from_here_alone(stranger: TestClient) -> None:
    for path in ("/", "/?token=secret", "/state", "/page.js", "/nothing"):
        answer = stranger.get(path)
        assert answer.headers["content-security-policy"].startswith("default-src 'none'; script-src 'self'")
        assert answer.headers["cache-control"] == "no-store"


def test_the_page_and_all_that_it_names_is_there(browser: TestClient) -> None:
    page = browser.get("/").text
    for name in ("/uplot/uPlot.css", "/style.css", "/page.js"):
        assert name in page
        assert browser.get(name).status_code == 200
    for name in ("/sections.js", "/begin.js", "/plots.js", "/uplot/uPlot.esm.js"):
        assert browser.get(name).headers["content-type"].startswith("text/javascript")
    assert browser.get("/../pyproject.toml").status_code == 404


def test_the_state_is_told_once_a_version(browser: TestClient) -> None:
    state = browser.get("/state").json()
    assert state["name"] == "two heaters"
    assert state["head"]["given"] == pytest.approx(4.720, abs=1e-3)
    assert [segment["job"] for segment in state["segments"]] == ["fitted", "held out"]
    assert state["tiles"]["holdout 0"]["now"][1]["mean"] > 4  # predicted minus measured: too hot
    assert browser.get(f"/state?since={state['version']}").status_code == 204
    assert "file" not in state
    assert browser.get("/model").text.startswith("#") or "[model]" in browser.get("/model").text


def test_lines_of_a_window(browser: TestClient) -> None:
    asked = {"segment": "holdout 0", "node": "heater2", "points": "100"}
    whole = unpacked(browser.get("/lines", params=asked).content)["heater2"]
    assert 90 <= len(whole["time"]) <= 103
    assert whole["time"][-1] == 598.0
    assert max(whole["error now"]) == pytest.approx(9.94, abs=0.01)
    both = {"segment": "holdout 0", "start": "300", "stop": "310", "node": ["heater2", "heater1"]}
    part = unpacked(browser.get("/lines", params=both).content)
    assert list(part) == ["heater2", "heater1"]
    assert part["heater1"]["time"].tolist() == [float(k) for k in range(299, 312)]
    assert (part["heater1"]["measured"] > part["heater2"]["measured"]).all()


def test_residuals_and_what_is_special_are_answered(browser: TestClient) -> None:
    asked = {"segment": "holdout 0", "node": "heater2"}
    residuals = browser.get("/residuals", params=asked).json()
    assert residuals["correlation"][0] == 1.0
    assert residuals["memory"] is None  # the errors never end: the model lacks something
    special = browser.get("/special", params=asked | {"start": "400", "stop": "450"}).json()
    assert {companion["column"] for companion in special["companions"]} == {"power.heater1", "power.heater2"}
    for path, wrong in (("/residuals", {"node": "elbow"}), ("/special", {"start": "0", "stop": "590"})):
        answer = browser.get(path, params=asked | wrong)
        assert answer.status_code == 422
        assert "\n" not in answer.json()["error"]


@pytest.mark.parametrize(
    "wrong",
    [
        {"node": "elbow"},
        {"segment": "fit 9"},
        {"points": "many"},
        {"points": "1"},
        {"points": "1000000000"},
        {"start": "nan"},
        {"stop": "inf"},
        {"nonsense": "1"},
    ],
)
def test_nonsense_is_answered_in_a_line(browser: TestClient, wrong: dict[str, str]) -> None:
    answer = browser.get("/lines", params={"segment": "holdout 0", "node": "heater1"} | wrong)
    assert answer.status_code == 422
    assert "\n" not in answer.json()["error"]
    assert browser.get("/state?since=x").status_code == 422


@pytest.mark.parametrize(
    "sent",
    [
        b"",
        b"[]",
        b'{"what": "format"}',
        b'{"what": "undo", "more": 1}',
        b'{"what": "keep", "steps": []}',
        b'{"what": "back", "number": -1}',
        b'{"what": "set", "name": "gain", "value": 1, "bounds": [0, 1e999], "fixed": true}',
        b'{"what": "example", "name": "../etc"}',
        b'{"what": "add", "effect": "fan"}',
        b'{"what": "leave_out", "run": "log", "start": 5, "stop": 5}',
        b'{"what": "leave_out", "run": "log", "start": 0, "stop": 1e999}',
    ],
)
def test_a_nonsense_order_is_refused(browser: TestClient, sent: bytes) -> None:
    answer = browser.post("/order", content=sent, headers=ORIGIN)
    assert answer.status_code == 422
    assert answer.json()["error"]


def test_notes_stay_with_the_study_and_only_what_is_said_is_changed(
    browser: TestClient, session: WorkbenchSession
) -> None:
    mark = {"run": "log", "time": 120.0, "text": "the door stood open"}
    plots = [["power.heater1", "error.heater2"], []]
    kept = {"text": "a note", "tags": ["left leg", "<b>"], "limits": {"heater1": 70.0}, "marks": [mark], "plots": plots}
    for sent in ({name: said} for name, said in kept.items()):
        assert browser.post("/order", json={"what": "note", **sent}, headers=ORIGIN).status_code == 202
    assert browser.get("/state").json()["written"] == kept
    assert session.folder is not None
    assert written(session.folder).model_dump(exclude={"what"}, mode="json") == kept
    (spoilt := session.folder / "notes.json").write_text("half a no")
    assert not written(session.folder).text
    assert spoilt.with_name("unread-notes.json").read_text() == "half a no"
    long, half = {"tags": ["x" * 41]}, {"marks": [{"run": "log"}]}
    for wrong in ({"limits": {"heater1": "hot"}}, {"text": "x" * 2001}, long, half):
        assert browser.post("/order", json={"what": "note", **wrong}, headers=ORIGIN).status_code == 422


@pytest.mark.parametrize(
    ("sent", "status"),
    [
        (b"\xff\xfe", 400),
        (b'{"what": "undo\xe9"}', 400),
        ('{"what": "undo"}'.encode("utf-16"), 400),
        (b'{"what": "add", "effect": "\xc3', 400),
        (b"\xef\xbb\xbf{}", 422),
        (b"[" * 9000, 422),
        (b'{"what": "add", "effect": "fan", "at": "' + b"x" * 20_000 + b'"}', 413),
        (b"[" * 20_000, 413),
    ],
)
def test_an_order_is_a_short_text(browser: TestClient, sent: bytes, status: int) -> None:
    for content in (sent, iter([sent[:5], sent[5:]])):  # the second says no length before
        answer = browser.post("/order", content=content, headers=ORIGIN)
        assert answer.status_code == status
        assert "\n" not in answer.json()["error"]


def test_what_is_refused_is_answered_by_where_it_came_to(
    browser: TestClient, session: WorkbenchSession, monkeypatch: pytest.MonkeyPatch
) -> None:
    busy = browser.post("/order", json={"what": "leave"}, headers=ORIGIN)
    assert (busy.status_code, busy.headers.get("connection")) == (409, None)  # its body was read
    file = browser.post("/file?name=a.csv", content=b"x", headers=ORIGIN)
    assert (file.status_code, file.headers["connection"]) == (409, "close")

    def fails(error: Exception) -> None:
        raise error

    monkeypatch.setattr(session, "stop", lambda: fails(InputError("a", "b", "c", "d")))
    assert browser.post("/stop", headers=ORIGIN).status_code == 422
    monkeypatch.setattr(session, "stop", lambda: fails(TimeoutError()))
    with pytest.raises(TimeoutError):  # no order that does not end
        browser.post("/stop", headers=ORIGIN)


# --- a whole server -----------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def served(session: WorkbenchSession) -> Iterator[tuple[str, Path]]:
    """The address and the file that `lptn open` shows."""
    ready: queue.Queue[tuple[str, Path]] = queue.Queue()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("lptn.workbench.server._PATIENCE", 1.0)
        patch.setattr(session, "close", lambda: None)
        patch.setattr("uvicorn.Server.capture_signals", lambda _: contextlib.nullcontext())
        serving = threading.Thread(target=serve, args=(session, 0, lambda *told: ready.put(told)), daemon=True)
        serving.start()
        yield ready.get(timeout=30)


def _port(address: str) -> int:
    return int(address.partition("127.0.0.1:")[2].partition("/")[0])


def test_no_command_line_has_a_token(served: tuple[str, Path], monkeypatch: pytest.MonkeyPatch) -> None:
    from lptn.cli.open import show_in_browser

    address, page = served
    opened: list[str] = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr("webbrowser.open", opened.append)
    show_in_browser(page)
    assert opened == [page.as_uri()]
    assert "token" not in opened[0]
    assert (page.stat().st_mode & 0o777, page.parent.stat().st_mode & 0o777) == (0o600, 0o700)
    url = page.read_text().partition("url=")[2].partition('"')[0]
    assert url.partition("=")[0] == address.partition("=")[0]
    assert url != address  # each lets in once
    assert [httpx.get(url).status_code for _ in range(2)] == [200, 401]


@pytest.mark.parametrize(
    "sent",
    [
        b"",
        b"GET / HT",
        b"GET / HTTP/1.1\r\nhost: x\r\na: b",
        b"POST /order HTTP/1.1\r\nhost: {host}\r\norigin: http://{host}\r\ncookie: {cookie}\r\n"
        b"content-length: 9\r\n\r\n{",
        b"GET /style.css HTTP/1.1\r\nhost: {host}\r\n\r\nGET /sty",
    ],
)
def test_a_request_that_does_not_come_is_not_waited_for(served: tuple[str, Path], cookie: str, sent: bytes) -> None:
    host = f"127.0.0.1:{_port(served[0])}"
    for name, text in ((b"{host}", host), (b"{cookie}", cookie)):
        sent = sent.replace(name, text.encode())
    begun = time.monotonic()
    with socket.create_connection(("127.0.0.1", _port(served[0]))) as client:
        client.settimeout(10)
        client.sendall(sent)
        while client.recv(4096):
            pass
    assert 0.9 < time.monotonic() - begun < 9


@pytest.fixture(scope="module")
def cookie(served: tuple[str, Path]) -> str:
    """What a browser was let in with."""
    return httpx.get(served[0]).headers["set-cookie"].partition(";")[0]


@pytest.mark.parametrize("framing", [b"content-length: 300000000", b"transfer-encoding: chunked"])
def test_a_body_of_300_megabytes_is_refused_before_it_is_held(
    served: tuple[str, Path], cookie: str, framing: bytes
) -> None:
    host = f"127.0.0.1:{_port(served[0])}"
    head = f"POST /order HTTP/1.1\r\nhost: {host}\r\norigin: http://{host}\r\ncookie: {cookie}\r\n".encode()
    sent, piece = 0, b"x" * (1 << 20)
    with socket.create_connection(("127.0.0.1", _port(served[0]))) as client:
        client.settimeout(10)
        client.sendall(head + framing + b"\r\n\r\n")
        with contextlib.suppress(ConnectionError):
            while sent < 300:
                client.sendall(piece if b"length" in framing else b"100000\r\n" + piece + b"\r\n")
                sent += 1
        answer = b""
        with contextlib.suppress(ConnectionError):
            answer = client.recv(4096)
    assert sent < 20
    assert answer == b"" or b" 413 " in answer
    assert httpx.get(f"http://{host}/state", headers={"cookie": cookie}).status_code == 200


@pytest.mark.long
@pytest.mark.parametrize("how", [signal.SIGTERM, signal.SIGINT])
def test_the_file_that_leads_to_the_page_goes_with_the_server(how: signal.Signals, tmp_path: Path) -> None:
    words = [sys.executable, "-m", "lptn", "open", str(OPENING.model), str(OPENING.fit[0]), "--no-browser"]
    places = {"TMPDIR": str(tmp_path), "XDG_STATE_HOME": str(tmp_path / "state")}
    with subprocess.Popen(words, env=os.environ | places, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        while "token=" not in process.stdout.readline():
            pass
        (page,) = tmp_path.glob("lptn-open-*/workbench.html")
        assert page.stat().st_mode & 0o777 == 0o600
        process.send_signal(how)
    assert not page.parent.exists()


def test_the_address_is_told_once_the_server_answers_and_signals_end_it_in_peace() -> None:
    """One that came before interrupted an import: its lock was held for ever, and the end waited for it."""
    servers, told = list[uvicorn.Server](), list[bool]()

    def ready(*_: object) -> None:
        told.append(servers[0].started)
        servers[0].should_exit = True

    serve_site(lambda *_: Starlette(), listening(0), ready, servers.append)
    assert told == [True]


# --- two of one study -----------------------------------------------------------------------------------------------


def test_a_second_session_of_one_study_is_refused_until_the_first_ends(tmp_path: Path) -> None:
    first, second, other = (WorkbenchSession(OPENING, tmp_path) for _ in range(3))
    (tmp_path / "other").mkdir()
    first._heard_opened(tmp_path)
    second._heard_opened(tmp_path)
    other._heard_opened(tmp_path / "other")
    assert (first._refused, second.folder, other.folder) == (None, None, tmp_path / "other")
    assert "open already in another `lptn open`" in str(second._refused)
    first._heard_opened(tmp_path)  # after a stop
    assert first.folder == tmp_path
    first.close()
    third = WorkbenchSession(OPENING, tmp_path)
    third._heard_opened(tmp_path)
    assert third.folder == tmp_path
    third.close()
    other.close()


def test_a_session_that_was_killed_holds_nothing(tmp_path: Path) -> None:
    script = (
        "import sys, pathlib; from lptn.basics.files import held; held(pathlib.Path(sys.argv[1])); print(flush=True)"
    )
    hold = [sys.executable, "-c", f"{script}; input()", str(tmp_path / "lock")]
    with subprocess.Popen(hold, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        assert held(tmp_path / "lock") is None
        process.kill()
    handle = held(tmp_path / "lock")
    assert handle is not None
    os.close(handle)


def test_nothing_else_of_the_folder_is_given_away(browser: TestClient, session: WorkbenchSession) -> None:
    assert session.folder is not None
    (session.folder / "study.pickle").write_bytes(b"")
    assert browser.get("/result/study.pickle").status_code == 404
    assert browser.get("/result/story.html").status_code == 404
    (session.folder / "story.html").write_text("told")
    assert browser.get("/result/story.html").text == "told"
    assert "attachment" in browser.get("/result/story.html").headers["content-disposition"]


def test_a_stopped_search_keeps_its_steps(session: WorkbenchSession, monkeypatch: pytest.MonkeyPatch) -> None:
    ours, theirs = Pipe()
    monkeypatch.setattr(session, "_begin", lambda after_a_stop: None)
    monkeypatch.setattr(session, "_pipe", ours)
    session.do(order.validate_python({"what": "improve"}))
    assert theirs.recv().what == "improve"
    rows = [{"effect": "sensor_lag", "at": "*"}, {"effect": "conduction", "at": "heater1~heater2"}]
    session._heard_found(rows)
    state = session.state()
    assert state is not None
    assert state["busy"]["found"] == rows
    session.stop()
    session._heard_done()  # the new process has read the study
    assert theirs.recv() == Keep(steps=(("sensor_lag", "*"), ("conduction", "heater1~heater2")))
    session._heard_done()
    assert session._busy is None


class _Payload:
    """Leaves a file behind if anybody unpickles it."""

    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> tuple[object, tuple[Path]]:
        return Path.touch, (self.path,)


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="Windows keeps a user's folders to the user")
def test_no_study_is_taken_from_where_others_can_write(tmp_path: Path) -> None:
    touched, elsewhere = tmp_path / "touched", tmp_path / "elsewhere"
    elsewhere.write_bytes(pickle.dumps(_Payload(touched)))
    ours, theirs = Pipe()
    study = _opened(theirs, OPENING, tmp_path, after_a_stop=True).folder / "study.pickle"
    assert ours.recv() == ("opened", study.parent)
    study.write_bytes(elsewhere.read_bytes())
    study.parent.chmod(0o777)
    with pytest.raises(PermissionError, match="others can write"):
        _opened(theirs, OPENING, tmp_path, after_a_stop=True)
    assert not touched.exists()


@pytest.mark.parametrize("name", ["study.pickle", "steps.json", "lock", "story.html"])
def test_nothing_is_read_or_written_through_a_link_in_a_study(name: str, tmp_path: Path) -> None:
    touched, elsewhere = tmp_path / "touched", tmp_path / "elsewhere"
    elsewhere.write_bytes(pickle.dumps(_Payload(touched)))
    before = elsewhere.read_bytes()
    _, theirs = Pipe()
    folder = _opened(theirs, OPENING, tmp_path, after_a_stop=True).folder
    (folder / name).unlink(missing_ok=True)
    (folder / name).symlink_to(elsewhere)
    again = WorkbenchSession(OPENING, tmp_path)
    with pytest.raises(InputError, match=f"{name}: a link"):
        again.open()
    again.close()
    assert elsewhere.read_bytes() == before
    assert not touched.exists()


def test_the_example_in_the_package_is_the_example(tmp_path: Path) -> None:
    opening = EXAMPLES["tclab"].opening(tmp_path)
    assert opening.model is not None
    for path, name in ((opening.model, "two_heaters.toml"), (opening.fit[0], "log.csv")):
        assert path.read_bytes() == (EXAMPLE / name).read_bytes()
    assert opening.study().data.holdout


def test_a_taken_port_is_said() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        with pytest.raises(InputError, match="--port"):
            listening(other.getsockname()[1])


def test_the_commands_and_python_lines_do_the_same(bench: Bench, tmp_path: Path) -> None:
    content = content_of(bench)
    assert content["commands"][-1].startswith("lptn fit ")
    script = content["python"].replace("better.toml", str(tmp_path / "better.toml"))
    there: dict[str, object] = {}
    exec(script.replace('study.report("story.html")\n', ""), there)
    assert repr(there["study"]) == repr(bench.study)
    assert (tmp_path / "better.toml").is_file()


def test_other_commands_do_not_wait_for_the_server_to_load() -> None:
    script = "import sys, lptn.cli.main; sys.exit(bool({'starlette', 'uvicorn'} & set(sys.modules)))"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0


def test_the_network_at_a_moment_has_that_moments_temperatures(browser: TestClient, bench: Bench) -> None:
    prediction = bench.predictions(0)["fit 0"]
    time = float(prediction.bound.run.time[100])
    answer = browser.get("/network", params={"segment": "fit 0", "time": time})
    assert answer.status_code == 200
    said = re.findall(r">(-?[0-9.]+) °C<", answer.json()["drawing"])
    near = [float(row[100]) for row in prediction.states[:2]]  # moments are some seconds apart
    assert [float(number) for number in said[:2]] == pytest.approx(near, abs=0.3)
    hottest = browser.get("/network", params={"segment": "fit 0"}).json()
    assert hottest["time"] > time
    assert browser.get("/network", params={"segment": "fit 7"}).status_code == 422
    assert browser.get("/network", params={"segment": "fit 0", "time": "now"}).status_code == 422
