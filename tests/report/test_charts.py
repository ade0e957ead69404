"""Charts of a page: what is packed is what was drawn, and a browser without a network draws, picks and zooms it."""

from __future__ import annotations

import base64
import json
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from lptn.basics.lines import thinned
from lptn.planners.tasks import kind_of, load_task
from lptn.planners.trade import solve_study
from lptn.report.charts import ChartPanel, Charts, Line, View, packed
from lptn.report.pages import story_html
from lptn.report.planning_pages import plan_html, trade_html
from lptn.robots.presets import presets
from tests.cooling.studies import HELD, study
from tests.report.two_joints import NODES, Told

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
EXAMPLES = Path(__file__).parents[2] / "examples"


def _unpacked(line: list[object]) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    low, high, text = line
    assert isinstance(low, float)
    assert isinstance(high, float)
    steps = np.frombuffer(base64.b64decode(str(text)), dtype="<u2")
    return np.where(steps == 65535, np.nan, low + (high - low) * steps / 65534)


def test_a_line_is_packed_to_a_part_in_65534_of_its_range() -> None:
    values = np.random.default_rng(1).normal(40.0, 20.0, 1000)
    values[[3, 500]] = np.nan
    np.testing.assert_allclose(_unpacked(packed(values)), values, atol=np.nanmax(values) - np.nanmin(values), rtol=0)
    assert np.nanmax(np.abs(_unpacked(packed(values)) - values)) <= np.ptp(values[np.isfinite(values)]) / 65534
    assert _unpacked(packed(np.full(3, 7.0))).tolist() == [7.0, 7.0, 7.0]
    assert packed(np.full(3, np.nan)) == [0.0, 0.0, 3]


def test_thinned_lines_keep_each_peak() -> None:
    values = np.random.default_rng(2).normal(size=(2, 20_001))
    values[0, 12_345], values[1, 777] = 90.0, -80.0
    _, thin = thinned(np.arange(20_001.0), values, 1000)
    assert thin.shape[1] <= 1001
    assert thin[0].max() == 90.0
    assert thin[1].min() == -80.0


def test_thinned_lines_keep_gaps_and_short_lines() -> None:
    time = np.arange(10_000.0)
    values = np.where((time > 3000) & (time < 6000), np.nan, time)
    at, (thin,) = thinned(time, values[None], 400)
    inside = (at > 3100) & (at < 5900)
    assert inside.any()
    assert np.isnan(thin[inside]).all()
    assert (np.diff(at) > 0).all()
    assert thinned(time[:400], values[None, :400], 400)[0].size == 400


def test_text_of_users_cannot_end_the_data() -> None:
    name = "</script><script>alert(1)</script>"
    values = {"x": np.arange(3.0)}
    panel = ChartPanel("[K]", "K", (Line("a", name),))
    charts = Charts("time [s]", (panel,), [View((name,), name, "x", {"a": np.ones(3)})], values, {"node": [name]})
    html = charts.html("one")
    assert html.count("</script>") == 1
    match = re.search(r'id="one-data">(.*)</script>', html)
    assert match is not None
    assert json.loads(match[1])["views"][0]["title"] == name


@pytest.mark.long
def test_a_page_on_a_plan_holds_every_joint(tmp_path: Path) -> None:
    from lptn.model.file import read_model_file
    from lptn.model.model import Model

    (tmp_path / "quadruped.toml").write_text(presets()["quadruped"])
    model = Model(read_model_file(tmp_path / "quadruped.toml").network)
    task = EXAMPLES / "plan" / "limit_now.toml"
    table = load_task(task)
    kind = kind_of(table, str(task))
    page = plan_html(kind.run(kind.read(table, str(task), model)), "limits")
    assert all(f'"keys":["{node}"]' in page for node in model.nodes if node != "pc")


@pytest.mark.long
def test_a_trade_page_holds_every_choice_and_the_front() -> None:
    sweep = '[pareto]\nagainst = "mass"\nleast = 0.3\nmost = 0.5\npoints = 2'
    asked = study("held_torque", "duration = 120", HELD, more=sweep, cooling='"passive"')
    result = solve_study(asked)
    page = trade_html(result)
    every = [name for name, points in result.by_option.items() if points]
    assert every
    assert all(f'"label":"{name}"' in page for name in every)
    assert '"label":"Pareto front"' in page


@pytest.mark.long
@pytest.mark.skipif(CHROMIUM is None, reason="no chromium: the report's charts are not looked at in a browser")
def test_a_browser_draws_picks_and_zooms_without_a_network(missing: Told, tmp_path: Path) -> None:
    from playwright.sync_api import sync_playwright

    story = tmp_path / "story.html"
    story.write_text(story_html(*missing, "story"), encoding="utf-8")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        wrong: list[str] = []
        page.on("pageerror", lambda error: wrong.append(str(error)))
        page.on("request", lambda request: None if request.url == story.as_uri() else wrong.append(request.url))
        page.goto(story.as_uri())
        assert page.locator(".charts canvas").count() >= 2
        assert page.locator(".still").first.is_hidden()
        page.locator(".tiles button").nth(3).click()
        title = page.locator(".charts h3").inner_text()
        assert title.startswith(f"{NODES[1]}, ")
        page.locator(".tiles button").nth(0).click(modifiers=["Shift"])
        assert page.locator(".charts h3").count() == 2
        page.locator(".tiles button").nth(0).click(modifiers=["Shift"])
        over = page.locator(".charts .u-over").first
        box = over.bounding_box()
        assert box is not None
        page.mouse.move(box["x"] + 100, box["y"] + 50)
        page.mouse.down()
        page.mouse.move(box["x"] + 300, box["y"] + 50)
        page.mouse.up()
        assert " to " in page.locator(".charts small").inner_text()
        page.mouse.move(box["x"] + 150, box["y"] + 50)
        assert "°C" in page.locator(".charts .u-legend").first.inner_text()
        page.get_by_role("button", name="Whole range").click()
        page.emulate_media(media="print")
        assert page.locator(".still").first.is_visible()
        assert page.locator(".charts").is_hidden()
        browser.close()
    assert not wrong
