"""The page for every eye and hand: axe-core's rules, fewer colours, the order of focus, what stands where."""

from __future__ import annotations

import io
import threading
from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations
from queue import Queue

import matplotlib.image as mpimg
import numpy as np
import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from lptn.basics.arrays import FloatArray
from lptn.live.status import NodeStatus, Status
from lptn.workbench.bench import Bench
from lptn.workbench.content import content_of
from lptn.workbench.live import LivePage
from lptn.workbench.orders import Note, Plain
from lptn.workbench.server import serve
from lptn.workbench.session import WorkbenchSession
from tests.workbench.conftest import CHROMIUM, EXAMPLE, OPENING, Server

axe = pytest.importorskip("axe_playwright_python.sync_playwright", reason="no axe-core: pip install 'lptn[dev]'")
pytestmark = [
    pytest.mark.long,
    pytest.mark.skipif(CHROMIUM is None, reason="no chromium: the workbench is not looked at in a browser"),
]
SIZES = ((1280, 900), (1920, 1080), (390, 844))
_RUNS = ("stand", "trot_0kg_low", "trot_0kg_high", "trot_4kg_low", "multi_gait")
_SEEN, _DIFFER = 5.0, 15.0  # CIE76: of two beside each other 2.3 is just noticed; the second stands apart by itself
_MOST_STOPS = 400  # of the Tab key: the columns of a log alone have a hundred
_WIDER = """() => {
  const scrolls = each => each !== document.body
    && (getComputedStyle(each).overflowX !== 'visible' || scrolls(each.parentElement));
  if (document.documentElement.scrollWidth <= innerWidth) return [];
  return [...document.querySelectorAll('body *')].filter(each => each.getBoundingClientRect().right > innerWidth
    && !scrolls(each))
    .map(each => `${each.tagName} ${each.id} ${each.className} ${each.textContent}`.slice(0, 60));
}"""
_OPENED = "() => document.querySelectorAll('details').forEach(each => { each.open = true; })"


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """Two heaters, with answers."""
    study = OPENING.study()
    study.fit()
    bench = Bench(study, OPENING, tmp_path_factory.mktemp("session"), OPENING.fingerprint(study))
    bench.do(Plain(what="diagnose"))
    bench.look_closer()
    return bench


def studied(bench: Bench, nodes: int) -> WorkbenchSession:
    """A session that shows a study; of more than two nodes as many of the heaters, in five runs."""
    content, news = content_of(bench), bench.news()
    bench._sent.clear()  # the next session is to have the lines, too
    if nodes > 2:
        wide = np.arange(nodes) % 2
        names = [f"T{k // 3}_{('hip', 'thigh', 'calf')[k % 3]}_housing" for k in range(nodes)]
        fitted, held = content["segments"]
        jobs = [held, held, fitted, fitted, fitted]
        signals = {"signals": ["power.heater1", "power.heater2", *(f"temperature.{name}" for name in names)]}
        segments = [
            job | signals | {"key": f"{job['job']} {run}", "run": run} for job, run in zip(jobs, _RUNS, strict=True)
        ]
        old = next(iter(content["tiles"].values()))
        tiles = {which: [row[k] for k in wide] for which, row in old.items()}
        issue = {"run": "stand", "key": f"temperature.{names[0]}", "place": names[0], "kind": "spike", "stretch": None}
        long = f'--map "temperature.{names[0]}={names[0]}_temperature[invalid=85]"'  # wider than a telephone
        issues = [issue | {"problem": "1 reading of exactly 85 °C", "remedy": f"write {long}"}]
        content |= {
            "nodes": names,
            "segments": segments,
            "issues": issues,
            "tiles": {one["key"]: tiles for one in segments},
        }
        for column in (column for columns in content["conditions"].values() for column in columns):
            own = [column["tiles"][k] for k in wide]
            column["tiles"] = [tile and tile | {"segment": segments[0]["key"]} for tile in own]
        lines = next(iter(news.runs.values()))
        news.runs = {one["key"]: replace(lines, nodes=tuple(names), measured=lines.measured[wide]) for one in segments}
        predicted = {model: values for (_, model), values in news.predicted.items()}
        news.predicted = {(one["key"], model): values[wide] for one in segments for model, values in predicted.items()}
        spread = next(iter(news.spreads.values()))
        news.spreads = {one["key"]: replace(spread, size=spread.size[wide]) for one in segments}
        news.heat, news.networks = {}, {one["key"]: next(iter(news.networks.values())) for one in segments}
    session = WorkbenchSession(OPENING, bench.folder)
    session._heard_opened(bench.folder)
    session._heard_shown(content, news)
    first = content["nodes"][0]
    session._written = Note(plots=((f"temperature.{first}", f"predicted.{first}", "power.heater1"), ()))
    return session


@pytest.fixture(scope="module", params=["start", "desk", 2, 13, 26])
def shown(
    request: pytest.FixtureRequest, browser: Browser, asked: Bench, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Page]:
    """A page of each kind, with all that folds unfolded."""
    server, page = None, browser.new_page(viewport={"width": 1280, "height": 900})
    if isinstance(request.param, int):
        session, ready = studied(asked, request.param), Queue[str]()
        threading.Thread(target=serve, args=(session, 0, lambda address, _: ready.put(address)), daemon=True).start()
        page.goto(ready.get(timeout=30))
        expect(page.locator(".tiles button").first).to_be_visible()
        session._let_go()
    else:
        files = [] if request.param == "start" else [str(EXAMPLE / "log.csv")]
        server = Server(tmp_path_factory.mktemp("state"), files=files)
        page.goto(server.address)
        expect(page.locator(".drop" if request.param == "start" else "table.columns tbody tr").first).to_be_visible()
        expect(page.locator("#stop")).to_be_hidden()
    page.evaluate(_OPENED)
    yield page
    page.close()
    if server is not None:
        server.kill()


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("size", SIZES)
def test_axe_finds_nothing_and_nothing_is_wider_than_the_screen(
    shown: Page, size: tuple[int, int], scheme: str
) -> None:
    shown.set_viewport_size({"width": size[0], "height": size[1]})
    shown.emulate_media(color_scheme=scheme)  # type: ignore[arg-type]
    shown.wait_for_timeout(500)  # colours fade
    found = axe.Axe().run(shown)
    assert not found.response["violations"], found.generate_report()
    assert not shown.evaluate(_WIDER)


@pytest.mark.parametrize("size", SIZES)
def test_axe_finds_nothing_on_the_page_of_a_watched_robot(size: tuple[int, int], browser: Browser) -> None:
    ready = Queue[str]()
    live = LivePage(ready=lambda address, _: ready.put(address))
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    try:
        page.goto(ready.get(timeout=30))
        node = NodeStatus("FR_calf_housing", 55.0, 54.0, 56.0, 55.2, 60.0, 300.0, 200.0, 400.0, "trusted")
        live.show(Status(1.0, (node,), assessed=5.0, events=("begun",)))
        page.get_by_role("button", name="FR_calf").click()
        expect(page.locator(".u-legend")).to_contain_text("limit")
        found = axe.Axe().run(page)
        assert not found.response["violations"], found.generate_report()
        assert not page.evaluate(_WIDER)
    finally:
        page.close()
        live.close()


_FOCUSED = """() => {
  const it = document.activeElement, all = [...document.querySelectorAll('header, main section')];
  return it === document.body ? null : [all.findIndex(each => each.contains(it)), getComputedStyle(it).outlineStyle];
}"""


def test_focus_goes_down_the_page_and_is_seen(shown: Page) -> None:
    shown.set_viewport_size({"width": 1280, "height": 900})
    shown.evaluate("document.activeElement?.blur(); scrollTo(0, 0)")
    places = []
    for _ in range(_MOST_STOPS):
        shown.keyboard.press("Tab")
        if (place := shown.evaluate(_FOCUSED)) is None:
            break
        places.append(place)
    assert places
    assert "none" not in {outline for _, outline in places}
    order = [section for section, _ in places]
    assert order == sorted(order)


_PIECES = """() => [...document.querySelectorAll('.tiles th')].flatMap(head => {
  const walk = document.createTreeWalker(head, NodeFilter.SHOW_TEXT), found = [];
  for (let text; (text = walk.nextNode());) {
    const range = new Range();
    range.selectNodeContents(text);
    found.push(range.getClientRects().length);
  }
  return found;
})"""


@pytest.mark.parametrize("size", SIZES)
def test_plots_stand_beside_the_tiles_and_no_head_is_broken_in_a_word(shown: Page, size: tuple[int, int]) -> None:
    if not shown.locator(".tiles").count():
        pytest.skip("no study")
    shown.set_viewport_size({"width": size[0], "height": size[1]})
    shown.evaluate("scrollTo(0, 0)")  # the tiles go with the page as far as the plots do
    tiles, plots = shown.locator("#where").bounding_box(), shown.locator("#plots").bounding_box()
    assert tiles is not None
    assert plots is not None
    if size[0] > 900:
        assert plots["x"] >= tiles["x"] + tiles["width"]
        assert plots["y"] == tiles["y"]
        assert plots["width"] > 400
    assert set(shown.evaluate(_PIECES)) == {1}


# --- colours as they are without cones for red, green or blue ------------------------------------------------------


def _lab(rgb: FloatArray) -> FloatArray:
    """CIE L*a*b* of sRGB, D65."""
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    to_xyz = np.array([[0.4124, 0.3576, 0.1805], [0.2126, 0.7152, 0.0722], [0.0193, 0.1192, 0.9505]])
    x, y, z = np.cbrt(np.maximum(to_xyz @ linear / [0.9505, 1.0, 1.089], 0.008856))
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


def _colour(element: Locator) -> FloatArray:
    """The most frequent colour of an element on the screen."""
    pixels = mpimg.imread(io.BytesIO(element.screenshot()))[..., :3].reshape(-1, 3)
    colours, counts = np.unique(np.round(pixels * 255).astype(int), axis=0, return_counts=True)
    return _lab(colours[counts.argmax()] / 255)


_SWATCHES = """names => document.body.replaceChildren(...names.map(name => {
  const it = document.createElement('div');
  it.style.cssText = `width: 40px; height: 40px; background: var(${name})`;
  it.id = name;
  return it;
}))"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("kind", ["none", "protanopia", "deuteranopia", "tritanopia"])
def test_lines_and_tiles_are_told_apart_without_some_cones(
    kind: str, scheme: str, browser: Browser, asked: Bench
) -> None:
    session, ready = studied(asked, 2), Queue[str]()
    threading.Thread(target=serve, args=(session, 0, lambda address, _: ready.put(address)), daemon=True).start()
    page = browser.new_page(viewport={"width": 1280, "height": 900}, color_scheme=scheme)  # type: ignore[arg-type]
    page.goto(ready.get(timeout=30))
    page.context.new_cdp_session(page).send("Emulation.setEmulatedVisionDeficiency", {"type": kind})
    tiles = page.locator(".tiles button")
    expect(tiles.first).to_be_visible()
    hot, cold = (tiles.filter(has_text=sign) for sign in ("+", "−"))
    assert hot.count() + cold.count() == tiles.count()  # the sign says it, too
    # A line as given is dashed, one that is tried dotted: their colours are not all that tells them from the others.
    kinds = dict.fromkeys(("--measured", "--best", "--limit"), "solid") | {"--given": "dashed", "--heat": "dotted"}
    kinds |= {"--hot": "tile", "--cold": "tile"}
    page.evaluate(_SWATCHES, list(kinds))
    colours = {name: _colour(page.locator(f"[id='{name}']")) for name in kinds}
    page.close()
    session._let_go()
    for one, other in combinations(kinds, 2):
        if "tile" not in (kinds[one], kinds[other]) or kinds[one] == kinds[other]:
            differ = np.linalg.norm(colours[one] - colours[other])
            assert differ > (_DIFFER if kinds[one] == kinds[other] else _SEEN), (one, other)
