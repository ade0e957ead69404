"""The workbench in a real browser: from opening to a fallen error, and on from where a killed server was."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from queue import Queue
from xml.etree import ElementTree

import pytest
from playwright.sync_api import Browser, Page, Response, expect
from playwright.sync_api import TimeoutError as NeverSeen

from lptn.live.status import NodeStatus, Status
from lptn.workbench.live import LivePage
from tests.workbench.conftest import CHROMIUM, PATIENCE, Server, unpacked

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium: the workbench is not looked at in a browser"),
]
BEGINS = 10_000  # ms, within which work is shown that takes longer than a look of the page at the server


def _order(page: Page, button: str) -> None:
    """Press a button, and wait until what it orders is done."""
    with page.expect_response(lambda response: response.request.method == "POST") as answer:
        page.locator(f"[id='{button}']").click()
    assert answer.value.ok
    with suppress(AssertionError):  # what is done between two looks of the page is never seen at work
        expect(page.locator("#stop")).to_be_visible(timeout=BEGINS)
    expect(page.locator("#stop")).to_be_hidden()


def _drag(page: Page, start: float, stop: float) -> None:
    """Draw the mouse over a stretch of the first plot, from and to a share of its width."""
    plot = page.locator(".u-over").first
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    assert box is not None
    page.mouse.move(box["x"] + start * box["width"], box["y"] + 40)
    page.mouse.down()
    page.mouse.move(box["x"] + stop * box["width"], box["y"] + 40, steps=4)
    page.mouse.up()


def _window(start: float) -> Callable[[Response], bool]:
    """Whether lines were asked for that begin near a time [s]; the page may ask for those it had once more."""

    def begins(response: Response) -> bool:
        asked = re.search(r"/lines\?.*\bstart=([\d.]+)", response.url)
        return asked is not None and abs(float(asked[1]) - start) < 5

    return begins


def _now(page: Page) -> float:
    return float(page.locator(".figures .now b").inner_text().removesuffix(" K"))


def test_from_opening_to_a_fallen_error(browser: Browser, tmp_path: Path) -> None:
    server = Server(tmp_path)
    asked: list[str] = []
    complaints: list[str] = []
    try:
        context = browser.new_context(viewport={"width": 1280, "height": 900})
        page = context.new_page()
        page.on("request", lambda request: asked.append(request.url))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("console", lambda message: complaints.append(message.text))
        page.goto(server.address)
        page.wait_for_url(f"{server.home}/")
        expect(page.locator(".figures .given b")).to_have_text("4.72 K")
        assert page.url == f"{server.home}/"  # the token is not in the history
        expect(page.locator(".view h3")).to_contain_text("heater2 in log (held out)")  # the worst tile

        _order(page, "diagnose")
        expect(page.locator("#missing > .answers li")).to_have_count(3)
        page.locator(".answers li", has_text="sensor lag everywhere").hover()  # what it would change, at once
        expect(page.locator("#steps tbody")).to_contain_text("try: sensor lag")
        page.locator("#weighed summary").click()  # what no diagnosis fitted is fitted when it is tried
        _order(page, page.locator("#weighed button").first.get_attribute("id") or "")
        expect(page.locator(".view h3")).to_contain_text("dotted: with ")
        expect(page.locator("#steps tbody tr").nth(1)).to_contain_text("try: ")
        expect(page.locator("#steps tbody tr").nth(1).locator("td").nth(4)).to_contain_text(re.compile(r"^\d\.\d+ K$"))
        page.locator("#weighed button").first.click()
        _order(page, "add sensor_lag at *")
        assert _now(page) == pytest.approx(3.88, abs=0.02)

        other = context.new_page()  # a second tab sees the same
        other.goto(f"{server.home}/")
        expect(other.locator("#steps tbody tr")).to_have_count(2)

        page.locator("#other summary").click()
        page.locator("[id='other effect']").select_option("conduction")
        page.locator("[id='other place']").fill("heater1~heater2")
        page.locator("#other button").click()
        expect(other.locator(".figures .now b")).to_have_text("0.998 K")
        expect(page.locator("#steps tbody tr")).to_have_count(3)

        page.locator("#diagnose").click()  # and stopped, unless it is done first
        with suppress(NeverSeen):
            page.locator("#stop").click(timeout=BEGINS)
        expect(page.locator("#stop")).to_be_hidden()
        assert _now(page) == pytest.approx(0.998, abs=0.01)
        page.locator("#undo").click()
        expect(page.locator(".figures .now b")).to_have_text("3.88 K")
        page.locator("#redo").click()
        expect(page.locator(".figures .now b")).to_have_text("0.998 K")

        with page.expect_download() as download:
            page.locator("[id='get model']").click()
        assert 'kind = "conduction"' in Path(download.value.path()).read_text()
        page.locator("#commands summary").click()
        expect(page.locator("#commands")).to_contain_text("lptn add step1.toml conduction --at 'heater1~heater2'")

        server.kill()
        server = Server(tmp_path, server.port)
        expect(page.locator("#work .failed")).to_be_visible()  # its token is of the old server
        page.goto(server.address)
        page.wait_for_url(f"{server.home}/")
        expect(page.locator(".figures .now b")).to_have_text("0.998 K")
        assert {url[: len(server.home)] for url in asked} == {server.home}
        assert not [
            complaint
            for complaint in complaints
            if "401" not in complaint and "ERR_CONNECTION_REFUSED" not in complaint
        ]
    finally:
        server.kill()


def test_a_plot_is_turned_limited_recoloured_and_taken_away(browser: Browser, tmp_path: Path) -> None:
    server = Server(tmp_path)
    complaints: list[str] = []
    try:
        page = browser.new_context(viewport={"width": 1280, "height": 900}).new_page()
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("console", lambda message: complaints.append(message.text))
        page.goto(server.address)
        page.wait_for_url(f"{server.home}/")
        plot = page.locator(".u-over").first
        expect(plot).to_be_visible()
        expect(page.locator("#stop")).to_be_hidden()
        paper = "getComputedStyle(document.documentElement).backgroundColor"
        assert page.evaluate(paper) == "rgb(255, 255, 255)"  # of a light system
        page.locator("#look").click()
        assert page.evaluate(paper) == "rgb(255, 255, 255)"
        page.locator("#look").click()
        assert page.evaluate(paper) == "rgb(22, 23, 25)"
        page.reload()
        expect(plot).to_be_visible()
        assert page.evaluate(paper) == "rgb(22, 23, 25)"

        page.locator("#limit").fill("70")
        with page.expect_response(re.compile("/lines")):
            page.locator("#limit").press("Enter")
        expect(page.locator("#limit")).to_have_value("70")
        wheel = (
            "([over, how]) => over.dispatchEvent(new WheelEvent('wheel', {bubbles: true, cancelable: true, ...how}))"
        )
        box = plot.bounding_box()
        assert box is not None
        at = {"clientX": box["x"] + box["width"] / 2, "clientY": box["y"] + 40, "deltaY": -350}  # zooms to a half
        assert page.evaluate(wheel, [plot.element_handle(), at])  # alone it moves the page
        assert not page.evaluate(wheel, [plot.element_handle(), {**at, "shiftKey": True}])
        expect(page.locator("#whole")).to_be_enabled()  # the values are zoomed
        with page.expect_response(_window(150), timeout=PATIENCE):
            assert not page.evaluate(wheel, [plot.element_handle(), {**at, "ctrlKey": True}])
        for kind, begins in (
            ("PNG", b"\x89PNG"),
            ("SVG", b"<svg xmlns"),
            ("CSV", b"time since start [s],measured,now"),
        ):
            with page.expect_download() as download:
                page.get_by_role("button", name=f"heater2 as {kind}").click()
            assert download.value.suggested_filename == f"heater2 log.{kind.lower()}"
            content = Path(download.value.path()).read_bytes()
            assert content.startswith(begins)
            if kind == "SVG":
                drawing = ElementTree.fromstring(content)
                assert drawing.findall("{http://www.w3.org/2000/svg}path")
                said = [text.text for text in drawing.findall("{http://www.w3.org/2000/svg}text")]
                legend = [text for text in said if text and text.startswith("— ")]
                assert legend[:3] == ["— 95 % band", "— measured", "— model as given"]
            if kind == "CSV":  # with the neighbours of the window's ends, that lines run to the edge
                times = [float(line.partition(b",")[0]) for line in content.splitlines()[1:]]
                assert [times[0], times[-1]] == pytest.approx([150, 450], abs=3)
                assert len(times) == pytest.approx(300, abs=4)
        page.locator("#whole").click()
        expect(page.locator("#whole")).to_be_disabled()
        assert not complaints
    finally:
        server.kill()


@pytest.mark.slow
@pytest.mark.parametrize("example", ["tclab", pytest.param("leg", marks=pytest.mark.slow)])
def test_the_tour_ends_where_the_error_has_fallen(browser: Browser, tmp_path: Path, example: str) -> None:
    server = Server(tmp_path, files=[])
    complaints: list[str] = []
    try:
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(server.address)
        page.wait_for_url(f"{server.home}/")
        page.locator(f"[id='example {example}']").click()
        tour = page.locator("#tour")
        expect(tour).to_contain_text("1 of 7")
        ringed = page.locator(".tiles .here")  # the one that it speaks of
        expect(ringed).to_have_attribute("aria-pressed", "true")
        page.locator(".tiles button").first.click()
        expect(tour).to_contain_text("2 of 7")
        expect(page.locator(".u-over").first).to_be_visible()
        _drag(page, 0.4, 0.6)
        expect(tour).to_contain_text("3 of 7")
        page.locator("#whole").click()
        expect(tour).to_contain_text("4 of 7")
        _order(page, "diagnose")
        page.locator("#missing > .answers li").first.hover()
        expect(page.locator("#steps tbody")).to_contain_text("try: ")
        add = page.locator("#missing > .answers button.first").get_attribute("id")
        assert add is not None
        _order(page, add)
        if example == "tclab":  # one answer is not all: the search adds the others
            page.locator("#undo").click()
            expect(page.locator("#undo")).to_be_disabled()
            _order(page, "improve")
            # After a finished search nothing is offered that would make it worse, or find the same again.
            expect(page.locator("#missing button.first")).to_have_count(0)
            expect(page.locator("#improve")).to_have_count(0)
        expect(tour).to_contain_text("Done.")
        assert list(tmp_path.rglob("example-*/*.toml"))  # the example's files stand beside the session
        assert not complaints
    finally:
        server.kill()


@pytest.mark.slow
def test_parameters_conditions_and_ways_that_were_left(browser: Browser, tmp_path: Path) -> None:
    server = Server(tmp_path)
    complaints: list[str] = []
    try:
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(server.address)
        page.wait_for_url(f"{server.home}/")
        page.locator("[id='by condition']").click(timeout=PATIENCE)
        expect(page.locator("[id='tile time since start [s] 6 heater2']")).to_have_count(0)  # of five parts
        expect(page.locator("[id='tile time since start [s] 5 heater2']")).to_be_visible()
        page.locator("[id='residual details'] summary").click()
        expect(page.locator("[id='residual details'] canvas")).to_have_count(2)
        ellipses = page.get_by_role("img", name=re.compile("^95 % ellipse of "))
        expect(ellipses).to_have_count(3)  # of the pairs of three parameters
        for effect, place in (("sensor_lag", "*"), ("conduction", "heater1~heater2")):
            if page.locator("#other").get_attribute("open") is None:
                page.locator("#other summary").click()
            page.locator("[id='other effect']").select_option(effect)
            page.locator("[id='other place']").fill(place)
            page.locator("#other button").click()
            expect(page.locator("#steps tbody")).to_contain_text(effect.replace("_", " "))
            expect(page.locator("#stop")).to_be_hidden()
            if effect == "sensor_lag":
                page.locator("#undo").click()
                expect(page.locator("#redo")).to_be_enabled()
        expect(page.locator(".lead")).to_contain_text("Added by hand: Conduction heater1–heater2")
        page.locator("#branches summary").click()
        page.locator("[id='back 0']").click()
        expect(page.locator("#steps tbody")).to_contain_text("sensor lag")
        expect(page.locator("#steps tbody")).not_to_contain_text("conduction")
        page.locator("#parameters summary").click()
        page.locator("[id='edit capacity.heater*']").click()
        page.locator("[id='set value']").fill("5")
        page.locator("[id='set other']").click()
        row = page.locator("#parameters tr", has_text="capacity.heater*")
        expect(row).to_contain_text("fixed")
        expect(row).to_contain_text("5.000")
        page.locator("#python summary").click()
        expect(page.locator("#python")).to_contain_text("set_parameter('capacity.heater*', value=5.0, fixed=True)")
        assert not complaints
    finally:
        server.kill()


@pytest.mark.slow
def test_zoom_and_a_stretch_left_out(browser: Browser, tmp_path: Path) -> None:
    server = Server(tmp_path)
    try:
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.goto(server.address)
        page.wait_for_url(f"{server.home}/")
        page.locator("[id='tile fit 0 heater1']").click(timeout=PATIENCE)
        expect(page.locator(".view h3")).to_contain_text("heater1 in log (fitted)")
        with page.expect_response(_window(120), timeout=PATIENCE) as answered:
            _drag(page, 0.4, 0.6)
        times = unpacked(answered.value.body())["heater1"]["time"]
        assert (times[0], times[-1]) == (pytest.approx(120, abs=3), pytest.approx(180, abs=3))
        with page.expect_response(_window(135), timeout=PATIENCE) as answered:
            page.locator(".stack").press("ArrowRight")
        assert unpacked(answered.value.body())["heater1"]["time"][0] == pytest.approx(135, abs=4)
        for name in ("tile fit 0 heater2", "tile holdout 0 heater1", "tile holdout 0 heater2"):
            page.locator(f"[id='{name}']").click(modifiers=["Shift"])
        last = page.locator(".view").last
        expect(page.locator(".view")).to_have_count(4)
        expect(page.locator(".u-over").nth(3)).to_be_attached()
        expect(last.locator(".u-over")).to_have_count(0)  # not on the screen, so not drawn yet
        last.scroll_into_view_if_needed()
        expect(last.locator(".u-over")).to_have_count(2)
        page.locator("[id='tile fit 0 heater1']").click()
        page.locator(".u-over").first.hover()  # the network goes with the mouse
        expect(page.locator("#network small")).to_contain_text(re.compile(r"^log at 16\d"))
        page.locator("[data-link='ambient~heater1']").click(force=True)
        expect(page.locator("[id='edit resistance.ambient~heater*']")).to_be_visible()
        expect(page.locator("[id='set value']")).to_be_visible()
        page.locator("#special").click()
        expect(page.locator("#companions tbody tr")).to_have_count(2)  # the inputs of both heaters
        _order(page, "fit_on")
        expect(page.locator("#data li")).to_have_count(2)  # the time before and after it is held out
        _order(page, "use_all")
        expect(page.locator("#data li")).to_have_count(0)
        with page.expect_response(_window(135), timeout=PATIENCE):
            _drag(page, 0.45, 0.65)
        _order(page, "leave_out")
        expect(page.locator("#data li")).to_contain_text("left out")
        expect(page.locator("[id='tile fit 1 heater1']")).to_be_visible()  # the log's two pieces
        page.context.clear_cookies()
        answer = page.goto(f"{server.home}/?token=guessed")
        assert answer is not None
        assert answer.status == 401
    finally:
        server.kill()


def test_a_running_robot_is_drawn_as_it_is_told(browser: Browser) -> None:
    addresses = Queue[str]()
    live = LivePage(ready=lambda address, _: addresses.put(address))
    try:
        page = browser.new_page()
        problems = list[str]()
        page.on("pageerror", lambda error: problems.append(str(error)))
        page.goto(addresses.get(timeout=30))
        for time in range(60):
            nodes = [
                NodeStatus(name, 40.0 + time / 10, 39.0, 41.0, 40.0 + time / 10, 60.0, 300.0, 200.0, 400.0, "trusted")
                for name in ("knee", "hip")
            ]
            live.show(
                Status(
                    float(time), tuple(nodes), assessed=5.0, counts={"messages": 60}, events=("begun",) * (time == 0)
                )
            )
        expect(page.locator("#table tbody tr")).to_have_count(2)
        expect(page.locator("#table tbody tr").first).to_contain_text("5 min (3 min to 7 min)")
        expect(page.locator("#said")).to_contain_text("begun")
        expect(page.locator(".u-legend tr")).to_have_count(3)  # time, and both nodes
        page.get_by_role("button", name="knee").click()
        expect(page.locator(".u-legend")).to_contain_text("limit")
        live.show(Status(60.0, tuple(replace(node, temperature=50.0) for node in nodes), assessed=6.0))
        expect(page.locator("#table tbody tr").first).to_contain_text("50.0")
        expect(page.get_by_role("button", name="knee")).to_be_focused()  # though the table is another
        live.close()
        expect(page.locator("#work")).to_contain_text("The watch has ended.")
        assert problems == []
    finally:
        live.close()


def test_signals_are_found_and_drawn_in_plots_of_ones_own(browser: Browser, tmp_path: Path) -> None:
    server = Server(tmp_path)
    complaints: list[str] = []
    try:
        page = browser.new_page(viewport={"width": 1280, "height": 2000})
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("console", lambda message: complaints.append(message.text))
        page.goto(server.address)
        page.wait_for_url(f"{server.home}/")
        page.locator("#own > summary").click(timeout=PATIENCE)
        expect(page.locator("#signals details")).to_have_text(["heater1", "heater2"], use_inner_text=True)
        page.locator("#filter").fill("R2 e")
        names = [f"{quantity}.heater2" for quantity in ("power", "temperature", "predicted", "error")]
        expect(page.locator("#signals .leaf")).to_have_text(names)
        page.locator("[id='signal power.heater2']").click()
        plots = page.locator("[id='own plots'] .view")
        expect(plots.locator("h3")).to_have_text(["power.heater2 in log (held out)"])
        page.locator("[id='signal error.heater2']").press("Enter")
        expect(plots.locator("canvas")).to_have_count(2)  # watts, and kelvins
        page.locator("[id='signal temperature.heater2']").drag_to(page.locator("[id='new plot']"))
        expect(plots).to_have_count(2)
        page.locator("[id='signal power.heater2']").drag_to(plots.last.locator(".u-over"))
        expect(plots.last.locator("h3")).to_have_text("temperature.heater2 power.heater2 in log (held out)")
        with page.expect_download() as download:
            plots.first.get_by_role("button", name="plot 1 as CSV").click()
        assert Path(download.value.path()).read_text().startswith("time since start [s],power.heater2,error.heater2\n")
        page.get_by_role("button", name="Remove error.heater2").click()
        expect(plots.first.locator("canvas")).to_have_count(1)
        page.reload()
        page.locator("#own > summary").click()
        expect(plots.locator("canvas")).to_have_count(3)  # they stay with the study
        page.locator("[id='fewer plots']").click()
        expect(plots).to_have_count(1)
        assert not complaints
    finally:
        server.kill()
