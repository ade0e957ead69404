"""The server: who may talk to it, what it answers, what it refuses."""

from __future__ import annotations

import os
import pickle
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from multiprocessing import Pipe
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from lptn.basics.errors import InputError
from lptn.workbench.bench import Bench
from lptn.workbench.calculation import _opened
from lptn.workbench.content import content_of
from lptn.workbench.orders import Keep, order
from lptn.workbench.server import application, listening
from lptn.workbench.session import Session
from lptn.workbench.tour import EXAMPLES
from tests.workbench.conftest import EXAMPLE, OPENING, unpacked

ADDRESS = "http://127.0.0.1:8000"
ORIGIN = {"origin": ADDRESS}


@pytest.fixture(scope="module")
def session(bench: Bench) -> Session:
    """A session that heard of the fit, and whose process does nothing."""
    session = Session(OPENING, bench.folder)
    session._heard_opened(bench.folder)
    session._heard_shown(content_of(bench, OPENING), bench.news())
    return session


@pytest.fixture
def stranger(session: Session) -> Iterator[TestClient]:
    """A browser that was not given the token."""
    with TestClient(application(session, 8000, "secret"), base_url=ADDRESS, follow_redirects=False) as client:
        yield client


@pytest.fixture
def browser(stranger: TestClient) -> TestClient:
    """A browser that opened the address with the token."""
    assert stranger.get("/?token=secret").status_code == 303
    return stranger


def test_the_token_is_answered_with_a_cookie_and_an_address_without_it(stranger: TestClient) -> None:
    assert stranger.get("/").status_code == 401
    assert stranger.get("/?token=guessed").status_code == 401
    assert stranger.get("/state").status_code == 401
    answer = stranger.get("/?token=secret")
    assert (answer.status_code, answer.headers["location"]) == (303, "/")
    assert "HttpOnly" in answer.headers["set-cookie"]
    assert "SameSite=strict" in answer.headers["set-cookie"]
    assert stranger.get("/").status_code == 200
    assert stranger.get("/", headers={"cookie": "lptn-8000=guessed"}).status_code == 401


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
    for name in ("/uPlot.css", "/style.css", "/page.js"):
        assert name in page
        assert browser.get(name).status_code == 200
    for name in ("/sections.js", "/plots.js", "/uPlot.js"):
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
        b'{"what": "add", "effect": "fan", "at": "' + b"x" * 20_000 + b'"}',
    ],
)
def test_a_nonsense_order_is_refused(browser: TestClient, sent: bytes) -> None:
    answer = browser.post("/order", content=sent, headers=ORIGIN)
    assert answer.status_code == 422
    assert answer.json()["error"]


def test_nothing_else_of_the_folder_is_given_away(browser: TestClient, session: Session) -> None:
    assert session.folder is not None
    (session.folder / "study.pickle").write_bytes(b"")
    assert browser.get("/result/study.pickle").status_code == 404
    assert browser.get("/result/story.html").status_code == 404
    (session.folder / "story.html").write_text("told")
    assert browser.get("/result/story.html").text == "told"
    assert "attachment" in browser.get("/result/story.html").headers["content-disposition"]


def test_a_stopped_search_keeps_its_steps(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
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
    study.symlink_to(elsewhere)
    _opened(theirs, OPENING, tmp_path, after_a_stop=True)
    study.unlink()
    study.write_bytes(elsewhere.read_bytes())
    study.parent.chmod(0o777)
    with pytest.raises(PermissionError, match="others can write"):
        _opened(theirs, OPENING, tmp_path, after_a_stop=True)
    assert not touched.exists()


def test_the_example_in_the_package_is_the_example(tmp_path: Path) -> None:
    opening = EXAMPLES["tclab"].opening(tmp_path)
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
    content = content_of(bench, OPENING)
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
