"""The page of `lptn watch`: what it says of a status, to whom, and what of it is kept."""

from __future__ import annotations

import math
import threading
import urllib.request
from collections.abc import Iterator
from http.cookiejar import CookieJar
from pathlib import Path

import pytest
from starlette.testclient import TestClient

from lptn.basics.errors import InputError
from lptn.live.status import NodeStatus, Status
from lptn.workbench.live import LivePage

ADDRESS = "http://127.0.0.1:8000"


def status(time: float, temperature: float = 55.0, *events: str) -> Status:
    knee = NodeStatus("knee", temperature, 54.0, 56.0, math.nan, 60.0, math.inf, 200.0, math.inf, "trusted")
    return Status(time, (knee,), events=events)


@pytest.fixture
def page() -> Iterator[LivePage]:
    page = LivePage()
    yield page
    page.close()


@pytest.fixture
def browser(page: LivePage) -> Iterator[TestClient]:
    with TestClient(page.application(8000, "secret"), base_url=ADDRESS) as client:
        assert client.get("/live").status_code == 401
        assert client.get("/?token=secret").status_code == 200
        yield client


def test_rows_are_told_once_and_the_newest_always(page: LivePage, browser: TestClient) -> None:
    assert browser.get("/live").json() == {"first": 0, "rows": [], "count": 0, "said": []}
    for time in range(3):
        page.show(status(time, 50.0 + time, f"event {time}"))
    first = browser.get("/live").json()
    assert first["rows"] == [[0.0, [50.0], [None]], [1.0, [51.0], [None]], [2.0, [52.0], [None]]]
    assert first["nodes"]["knee"]["time_to_limit"] is None
    assert first["nodes"]["knee"]["trust"] == "trusted"
    assert first["said"][-1] == [2.0, "event 2"]
    page.show(status(3.0))
    assert browser.get("/live?since=3").json()["rows"] == [[3.0, [55.0], [None]]]


def test_of_a_long_watch_the_last_rows_are_kept(page: LivePage, browser: TestClient) -> None:
    for time in range(7300):
        page.show(status(float(time)))
    first = browser.get("/live?since=-1").json()
    assert (first["first"], first["count"], len(first["rows"])) == (100, 7300, 1000)
    assert browser.get("/live?since=7299").json()["rows"][0][0] == 7299.0
    assert browser.get(f"/live?since={'9' * 5000}").json()["first"] == 100
    page.show(status(20_000.0))  # of a step of hours what is older than two
    assert browser.get("/live").json()["rows"] == [[20_000.0, [55.0], [None]]]


def test_the_page_and_all_that_it_names_is_there(browser: TestClient) -> None:
    page = browser.get("/").text
    for name in ("/uplot/uPlot.css", "/colours.css", "/style.css", "/live.js"):
        assert name in page
        assert browser.get(name).status_code == 200


def test_it_is_served_on_loopback_behind_its_token() -> None:
    addresses, begun = list[str](), threading.Event()

    def ready(address: str, _: Path) -> None:
        addresses.append(address)
        begun.set()

    page = LivePage(ready=ready)
    try:
        begun.wait(30)
        page.show(status(5.0))
        handlers = urllib.request.ProxyHandler({}), urllib.request.HTTPCookieProcessor(CookieJar())
        opened = urllib.request.build_opener(*handlers)
        with opened.open(addresses[0], timeout=10) as answer:
            assert answer.status == 200
        with opened.open(addresses[0].partition("?")[0] + "live", timeout=10) as answer:
            assert b'"time":5.0' in answer.read()
        port = int(addresses[0].partition("/?")[0].rpartition(":")[2])
        with pytest.raises(InputError, match="a port that is free"):
            LivePage(port)
    finally:
        page.close()
