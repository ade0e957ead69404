"""From an empty folder to an FMU with the mouse alone: logs of robots that nobody has a model of."""

from __future__ import annotations

import re
import time
import zipfile
from collections.abc import Sequence
from pathlib import Path

import pandas as pd
import pytest
from playwright.sync_api import Browser, Page, expect

from lptn.virtual import quadruped_logs
from lptn.virtual.runs import plan
from tests.logs.test_bags import Recorder
from tests.workbench.conftest import CHROMIUM, Server

pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium: the workbench is not looked at in a browser"),
]
_JOINTS = ("FR_hip", "FR_thigh", "FR_calf", "FL_hip", "FL_thigh", "FL_calf")
_AMPERES = 1 / 0.84357  # a newton metre: the virtual quadruped's gear of 9.1 and torque constant of 0.0927 N·m/A
_EPOCH = 1.7e12  # ms


def robot(folder: Path, names: Sequence[str], seed: int, without_air: str = "") -> list[Path]:
    """Three runs of half an hour, of six joints with currents, times in ms since 1970, in columns of other names."""
    planned = plan("tests", seed)
    runs = {name: planned[name] for name in list(planned)[:3]}
    paths = []
    for number, (name, log) in enumerate(quadruped_logs(seed=seed, runs=runs, physics="plain").items()):
        table = {"timestamp_ms": (log["time"] * 1e3 + _EPOCH + number * 1e8).astype("int64")}
        table |= {own.format("temp"): log[f"temperature.{joint}"] for joint, own in zip(_JOINTS, names, strict=True)}
        currents = {joint: log[f"torque.{joint}"] * _AMPERES for joint in _JOINTS}
        table |= {own.format("current"): currents[joint].round(3) for joint, own in zip(_JOINTS, names, strict=True)}
        if name != without_air:
            table["T_ambient"] = log["temperature.ambient"]
        paths.append(folder / f"{name}.csv")
        pd.DataFrame(table).to_csv(paths[-1], index=False)
    return paths


class Mouse:
    """The mouse on a page; it counts what a hand does."""

    def __init__(self, page: Page) -> None:
        self.page, self.clicks, self.begun = page, 0, time.monotonic()

    def click(self, element: str) -> None:
        """Press a button, once it can be pressed."""
        self.page.locator(f"[id='{element}']").click()
        self.clicks += 1

    def drag(self, element: str, onto: str) -> None:
        """Draw a log from one list to another."""
        self.page.locator("li.log", has_text=element).locator("b").drag_to(self.page.locator(f"[id='{onto}']"))
        self.clicks += 1

    def idle(self) -> None:
        """Wait until nothing is being done."""
        expect(self.page.locator("#stop")).to_be_hidden()


ROBOTS = {
    "numbered": ([f"joint{k}_{{}}" for k in range(1, 7)], 3, ""),
    "indexed, one run without air": ([f"motor_{{}}[{k}]" for k in range(6)], 4, "trot_0kg_low"),
    "an arm": ([f"{place}_{{}}" for place in ("pan", "lift", "elbow", "wrist1", "wrist2", "wrist3")], 5, ""),
}


@pytest.mark.parametrize(
    "kind", [name if "air" in name else pytest.param(name, marks=pytest.mark.slow) for name in ROBOTS]
)
def test_from_logs_to_an_fmu_with_the_mouse_alone(kind: str, browser: Browser, tmp_path: Path) -> None:
    names, seed, without_air = ROBOTS[kind]
    logs = robot(tmp_path, names, seed, without_air)
    server, complaints = Server(tmp_path / "state", files=[]), list[str]()
    try:
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("console", lambda message: complaints.append(message.text))
        page.goto(server.address)
        page.wait_for_url(f"{server.home}/")
        mouse = Mouse(page)
        with page.expect_file_chooser() as chosen:
            mouse.click("pick")
        chosen.value.set_files(logs)
        expect(page.locator("li.log")).to_have_count(3)
        expect(page.locator("table.columns tbody tr")).to_have_count(13 if without_air else 14)
        expect(page.locator("#model")).to_contain_text("6 nodes")
        if without_air:
            expect(page.locator("#open")).to_be_disabled()
            mouse.click(f"start {without_air}.csv")
        expect(page.locator("#open")).to_be_enabled()
        mouse.drag("stand.csv", "list holdout")
        expect(page.locator("[id='list holdout'] li.log")).to_have_count(1)
        mouse.click("open")
        expect(page.locator(".tiles button")).to_have_count(18)
        mouse.idle()
        with page.expect_download() as download:
            mouse.click("make fmu")
        with zipfile.ZipFile(download.value.path()) as archive:
            assert "modelDescription.xml" in archive.namelist()
        expect(page.locator("#out [role=status]")).to_contain_text("model.fmu is in your downloads, and in ")
        seconds = time.monotonic() - mouse.begun
        assert mouse.clicks == (5 if without_air else 4)
        print(f"{kind}: {mouse.clicks} clicks, {seconds:.0f} s")
        (model,) = tmp_path.glob("state/lptn/sessions/begin-*/model.toml")
        text = model.read_text()
        assert 'time = { column = "timestamp_ms", unit = "ms" }' in text
        assert (f'"temperature.ambient@{without_air}" = {{ value = "start" }}' in text) == bool(without_air)
        assert not complaints
    finally:
        server.kill()


_HTML = "<img src=x onerror=document.title='let-in'>.csv"
_DROP = """files => {
  const carried = new DataTransfer();
  for (const [name, text] of files) carried.items.add(new File([text], name));
  window.dispatchEvent(new DragEvent("drop", { dataTransfer: carried, bubbles: true, cancelable: true }));
}"""


def test_what_is_dropped_in_two_tabs(browser: Browser, tmp_path: Path) -> None:
    """A file of another kind, a name with HTML in it, a table that is none; an edit that another tab has overtaken."""
    names = [f"joint{k}_{{}}" for k in range(1, 7)]
    text = robot(tmp_path, names, 3)[0].read_text()
    server, complaints = Server(tmp_path / "state", files=[]), list[str]()
    try:
        context = browser.new_context(viewport={"width": 1280, "height": 900})
        page = context.new_page()
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(server.address)
        page.wait_for_url(f"{server.home}/")
        expect(page.locator(".drop")).to_be_visible()
        page.evaluate(_DROP, [[_HTML, text], ["paper.pdf", "x"]])
        expect(page.locator("#work .failed")).to_contain_text("paper.pdf: file: found the ending '.pdf'")
        expect(page.locator("li.log b")).to_have_text([_HTML])
        expect(page.locator("#open")).to_be_enabled()
        page.evaluate(_DROP, [["poem.csv", "Shall I compare thee\nto a summer's day?\n"]])
        expect(page.locator("#work .failed")).to_contain_text("poem.csv: ")
        expect(page.locator("li.log b")).to_have_text([_HTML])
        assert not list((tmp_path / "state").rglob("p*.*"))

        other = context.new_page()
        other.goto(f"{server.home}/")
        area = other.locator("#text")
        expect(area).to_have_value(page.locator("#text").input_value())
        page.locator("#text").fill(page.locator("#text").input_value() + "# mine\n")
        page.locator("#save").click()
        expect(area).to_have_value(page.locator("#text").input_value())  # nobody edits there
        area.fill(area.input_value() + "# theirs\n")
        page.locator("#text").fill(page.locator("#text").input_value() + "[[links]]\nbetween = 3\n")
        page.locator("#save").click()
        expect(page.locator("#wrong")).to_contain_text("model.toml: line")
        expect(page.locator("#open")).to_be_disabled()
        expect(other.locator("#wrong")).to_be_visible()
        other.locator("#save").click()
        expect(other.locator("#work .failed")).to_contain_text("changed meanwhile, in another tab")
        assert "# theirs" in area.input_value()  # it can still be taken from there
        page.locator("#source").select_option("columns")
        expect(page.locator("#open")).to_be_enabled()
        page.locator(f'[id="job {_HTML}"]').select_option("holdout")  # with the keyboard
        expect(other.locator("[id='list holdout'] li.log")).to_have_count(1)

        page.locator("#leave").click()
        expect(other.locator(".recent li")).to_contain_text(_HTML)
        assert page.title() == "lptn"
        assert not complaints
    finally:
        server.kill()


def test_the_folder_of_a_bag_is_chosen_and_a_form_changes_the_text(browser: Browser, tmp_path: Path) -> None:
    recorder = Recorder(tmp_path / "walk", "sqlite3")
    with recorder.writer:
        for k in range(600):
            recorder.send("/joint_states", 1.0 * k, recorder.joints(k, ["knee"], [1.0], [1.0]))
            warm = recorder.dynamic(k, {"knee": {"temperature": 20.0 + k / 60}})
            recorder.send("/dynamic_joint_states", k + 0.1, warm)
    server, complaints = Server(tmp_path / "state", files=[]), list[str]()
    try:
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.goto(server.address)
        page.wait_for_url(f"{server.home}/")
        with page.expect_file_chooser() as chosen:
            page.locator("[id='pick folder']").click()
        chosen.value.set_files(tmp_path / "walk")
        expect(page.locator("li.log b")).to_have_text("walk")
        expect(page.locator(".drawing svg")).to_be_visible()
        expect(page.locator("#stop")).to_be_hidden()
        capacity = page.get_by_label("capacity").first
        capacity.fill("321")
        capacity.press("Enter")
        expect(page.locator("#text")).to_have_value(re.compile("capacity = { value = 321,"))
        assert not complaints
    finally:
        server.kill()
