"""How fast the workbench's page is: first paint, zoom, preview of an answer, memory; clicks to a hidden effect.

`python -m tests.benchmarks.workbench` measures the page with synthetic lines, `... leg` and `... quadruped DIR` drive
`lptn open` to the hidden effect (DIR with `fit1`, `fit2` and `holdout` of `write_quadruped` in `verdict_cases`,
`forced_convection at FR_thigh` hidden, two hours to fit). It needs Playwright and Chromium.
"""

from __future__ import annotations

import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path
from statistics import median

import numpy as np
from playwright.sync_api import Browser, CDPSession, Page, sync_playwright

from lptn.workbench.bench import News
from lptn.workbench.lines import RunLines
from lptn.workbench.opening import Opening
from lptn.workbench.server import serve
from lptn.workbench.session import WorkbenchSession

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
ANSWER: dict[str, object] = {
    "effect": "fan",
    "at": "node0",
    "key": "fan at node0",
    "title": "fan",
    "place": "node0",
    "kind": "finding",
    "probable": "likely",
    "fit": 0.5,
    "holdout": None,
    "size": "",
    "details": "",
    "equations": [],
    "looks_like": "",
    "separate_by": "",
    "same": [],
    "tried": "fan at node0",
}
ANSWERS = {
    "verdict": "missing",
    "answers": [ANSWER],
    "refused": [],
    "weighed": [],
}


def session(nodes: int, readings: int) -> WorkbenchSession:
    """A session whose lines were made up: what a page costs beside any fit."""
    rng = np.random.default_rng(0)
    names = tuple(f"node{k}" for k in range(nodes))
    time_s = np.arange(float(readings))
    measured = np.cumsum(rng.normal(0.0, 0.01, (nodes, readings)), axis=1) + 40
    inputs = {f"torque.{name}": rng.normal(0.0, 1.0, readings) for name in names}
    tile = {"rmse": 0.5, "mean": 0.2, "max": 1.0}
    step = {"name": "as given", "effect": None, "at": None, "parameters": 10, "fit": 0.5, "holdout": None, "test": None}
    segment = {"key": "fit 0", "run": "made", "job": "fitted", "start": 0.0, "stop": float(readings)}
    content = {
        "name": "made up",
        "nodes": list(names),
        "segments": [segment | {"signals": [], "from": 0.0, "to": float(readings)}],
        **{
            name: []
            for name in ("issues", "stretches", "undone", "branches", "advice", "commands", "contents", "parameters")
        },
        "correlations": [],
        "fitted": True,
        "effects": {},
        "python": "",
        "file": "",
        "given": "as given",
        "now": "as given",
        "head": {"which": "fitted", "given": 0.5, "now": 0.5, "floor": 0.1, "against": None, "said": []},
        "steps": [step],
        "tiles": {"fit 0": {"given": [tile] * nodes, "now": [tile] * nodes}},
        "conditions": {"given": [], "now": []},
        "answers": ANSWERS,
    }
    made = WorkbenchSession(Opening(Path("made_up.toml"), ()))
    news = News(runs={"fit 0": RunLines(names, time_s, measured, inputs)})
    news.predicted["fit 0", "as given"] = measured + 0.5
    news.predicted["fit 0", "fan at node0"] = measured + 0.1
    made._heard_shown(content, news)
    return made


def served(made: WorkbenchSession) -> str:
    """Serve it in a thread; its address."""
    address: list[str] = []
    threading.Thread(target=serve, args=(made, 0, lambda shown, _: address.append(shown)), daemon=True).start()
    while not address:
        time.sleep(0.05)
    return address[0]


DRAWN = """
// Tells when all lines that were asked for have come, and what waits for them has run.
const ask = window.fetch;
let waiting = 0;
window.fetch = async (...words) => {
  const answer = await ask(...words);
  if (!String(words[0]).startsWith("/lines")) return answer;
  const read = answer.arrayBuffer.bind(answer);
  answer.arrayBuffer = async () => {
    const lines = await read();
    setTimeout(() => { if (--waiting === 0) window.lptnDrawn?.(); });
    return lines;
  };
  return answer;
};
addEventListener("mouseup", () => { window.lptnReleased = performance.now(); }, true);
const counted = window.fetch;
window.fetch = (...words) => { if (String(words[0]).startsWith("/lines")) waiting++; return counted(...words); };
"""
MEASURE = """async ([what, count]) => {
  const button = id => document.getElementById(id), times = [];
  for (let k = 0; k < count; k++) {
    const drawn = new Promise(done => { window.lptnDrawn = done; });
    const begun = performance.now();
    const key = new KeyboardEvent("keydown", { key: k % 2 ? "-" : "+", bubbles: true });
    if (what === "zoom") document.querySelector(".stack").dispatchEvent(key);
    else button("try fan at node0").click();
    await drawn;
    await new Promise(requestAnimationFrame);
    times.push(performance.now() - begun);
    await new Promise(done => setTimeout(done, 150));
  }
  return times;
}"""
DRAG = """async () => {
  const over = document.querySelectorAll(".u-over");
  const boxes = [...over].map(each => each.getBoundingClientRect());
  const seen = boxes.filter(box => box.bottom > 0 && box.top < innerHeight);
  window.lptnLast = new Promise(done => { window.lptnDrawn = async () => {
    await new Promise(requestAnimationFrame);
    done(performance.now() - window.lptnReleased);
  }; });
  return [seen.length, over.length, seen[0].left, Math.max(seen[0].top, 120) + 20, seen[0].width];
}"""


def page_times(browser: Browser, nodes: int, readings: int, views: int, height: int = 900) -> None:
    """First paint, zoom, preview with so many nodes shown."""
    page = browser.new_page(viewport={"width": 1280, "height": height})
    page.add_init_script(DRAWN)
    begun = time.perf_counter()
    page.goto(served(session(nodes, readings)))
    page.locator(".u-over").first.wait_for()
    settled = time.perf_counter() - begun
    paint = page.evaluate("performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? 0")
    for k in range(1, views):
        page.locator(f"[id='tile fit 0 node{k}']").click(modifiers=["Shift"])
    page.locator(".view").nth(views // 2).evaluate("view => view.scrollIntoView()")
    page.wait_for_timeout(1500)
    print(f"{nodes} nodes × {readings:,} readings, {views} shown on 1280 × {height}:", end=" ")
    print(f"first paint {paint:.0f} ms, plots {settled * 1e3:.0f} ms")
    page_cpu = page.context.new_cdp_session(page)
    page_cpu.send("Performance.enable", {"timeDomain": "threadTicks"})
    for what, count in (("zoom", 12), ("try", 8)):
        before = _seconds(page_cpu)
        times = page.evaluate(MEASURE, [what, count])
        server, script = (
            1e3 * (after - first) / count for after, first in zip(_seconds(page_cpu), before, strict=True)
        )
        print(f"  {what}: {median(times):.0f} ms (worst {max(times):.0f});", end=" ")
        print(f"CPU: server {server:.0f}, page {script:.0f} ms")
    times = []
    for number in range(8):
        seen, plots, left, top, width = page.evaluate(DRAG)
        page.mouse.move(left + (0.1 + 0.02 * number) * width, top)
        page.mouse.down()
        page.mouse.move(left + 0.8 * width, top, steps=4)
        page.mouse.up()
        times.append(page.evaluate("window.lptnLast"))
        page.wait_for_timeout(300)
    print(f"  from the mouse let go to the last of {seen} plots on the screen, {plots} in all:", end=" ")
    print(f"{median(times):.0f} ms (worst {max(times):.0f})")
    page.close()


def _seconds(page_cpu: CDPSession) -> tuple[float, float]:
    """CPU time of this process, which serves, and of the page's main thread: what a busy machine does not change."""
    metrics = {metric["name"]: metric["value"] for metric in page_cpu.send("Performance.getMetrics")["metrics"]}
    return time.process_time(), float(metrics["TaskDuration"])


def memory(nodes: int = 13, readings: int = 1_000_000) -> None:
    """Memory of the server's process that holds the lines, and the time of a window."""
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    lines = session(nodes, readings)._lines["fit 0"]
    held = sum(array.nbytes for array in (lines.measured, *lines.predicted.values(), *lines.inputs.values()))
    begun = time.process_time()
    lines.window("node3", {"now": "as given"})
    whole = time.process_time() - begun
    begun = time.process_time()
    lines.window("node3", {"now": "as given"}, 5e5, 5e5 + 200)
    part = time.process_time() - begun
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(
        f"{nodes} nodes × {readings:,} readings: {held / 1e9:.2f} GB held, peak +{(peak - before) / 1e6:.2f} GB; "
        f"a window of all {whole * 1000:.0f} ms, of 200 s {part * 1000:.0f} ms (CPU)"
    )


def find(browser: Browser, words: list[str], example: str = "") -> None:
    """Drive `lptn open` from opening to a fallen error."""
    surroundings = os.environ | {"XDG_STATE_HOME": tempfile.mkdtemp(), "PYTHONUNBUFFERED": "1"}
    begun = time.perf_counter()
    server = subprocess.Popen(
        [sys.executable, "-m", "lptn", "open", *words, "--no-browser"],
        env=surroundings,
        stdout=subprocess.PIPE,
        text=True,
    )
    with server:
        assert server.stdout is not None
        server.stdout.readline()
        address = re.search(r"http://\S+", server.stdout.readline())
        assert address
        page = browser.new_page(viewport={"width": 1280, "height": 900})
        page.set_default_timeout(1_800_000)
        page.goto(address[0])
        clicks = 0
        if example:
            page.locator(f"[id='example {example}']").click()
            clicks += 1
        page.locator("#diagnose:enabled").wait_for()
        opened = time.perf_counter() - begun
        steps = []
        for button in ("#diagnose", ".answers button.first"):
            page.locator(button).click()
            clicks += 1
            _until_done(page)
            steps.append(time.perf_counter() - begun)
        errors = [page.locator(f".figures .{name} b").inner_text() for name in ("given", "now", "floor")]
        added = page.locator("#steps tbody tr").nth(1).locator("td").nth(1).inner_text()
        times = f"opened and fitted {opened:.0f} s, answers {steps[0]:.0f} s, added {steps[1]:.0f} s"
        print(f"{example or 'quadruped'}: {times}, {clicks} clicks;", end=" ")
        print(f"{added}: {' → '.join(errors[:2])}, floor {errors[2]}")
        page.close()
        server.kill()


def _until_done(page: Page) -> None:
    page.locator("#stop").wait_for()
    page.locator("#stop").wait_for(state="hidden")


def main() -> None:
    """Measure what is asked for."""
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        match sys.argv[1:]:
            case ["leg"]:
                find(browser, [], "leg")
            case ["quadruped", folder]:
                model = Path(__file__).with_name("quadruped_plain.toml")
                fitted = sorted(map(str, Path(folder).glob("fit*.parquet")))
                held_out = sorted(map(str, Path(folder).glob("holdout*.parquet")))
                find(browser, [str(model), *fitted, "--holdout", *held_out])
            case _:
                page_times(browser, 13, 100_000, 1)
                page_times(browser, 26, 100_000, 13)
                page_times(browser, 26, 100_000, 13, height=2160)
                memory()
        browser.close()


if __name__ == "__main__":
    main()
