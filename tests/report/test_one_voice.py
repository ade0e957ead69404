"""Ten studies, six commands: terminal, Study, page, report and JSON give one verdict, one probability, one error."""

from __future__ import annotations

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from html import escape, unescape
from pathlib import Path
from textwrap import wrap

import numpy as np
import pytest

import lptn
from lptn.cli.main import main
from lptn.report.narrative import errors_in_words
from lptn.report.online_figures import forecast_figure
from lptn.report.sentences import Sentence
from lptn.report.text import kelvin, percent
from lptn.robots.presets import preset_text
from lptn.virtual import Hidden, leg_logs, write_logs
from lptn.workbench.bench import Bench
from lptn.workbench.content import content_of
from lptn.workbench.opening import Opening

EXAMPLES = Path(__file__).parents[2] / "examples"


@dataclass(frozen=True)
class Files:
    """A model and its logs."""

    model: Path
    fit: tuple[Path, ...]
    holdout: tuple[Path, ...] = ()
    after: float | None = None

    @property
    def words(self) -> list[object]:
        """How a command gets the logs."""
        after = ["--holdout-after", self.after] if self.after is not None else []
        return [*self.fit, *(["--holdout", *self.holdout] if self.holdout else []), *after]

    @property
    def opening(self) -> Opening:
        """How the page opens them."""
        return Opening(self.model, self.fit, self.holdout, holdout_after=self.after)


def _example(model: str, log: str, after: float) -> Callable[[Path], Files]:
    return lambda _: Files(EXAMPLES / model, (EXAMPLES / log,), after=after)


def _ur3(_: Path) -> Files:
    folder = EXAMPLES / "ur3"
    return Files(folder / "single_nodes.toml", (folder / "warm_up.parquet",), (folder / "later.parquet",))


def _leg(*hidden: Hidden, seed: int) -> Callable[[Path], Files]:
    def files(folder: Path) -> Files:
        (folder / "leg.toml").write_text(preset_text("leg"), encoding="utf-8")
        *fit, holdout = write_logs(folder, leg_logs(hidden, seed=seed, rate=1.0))
        return Files(folder / "leg.toml", tuple(fit), (holdout,))

    return files


_BLDC = "bldc_stators/two_nodes.toml"
STUDIES: dict[str, Callable[[Path], Files]] = {
    "tclab": _example("tclab/two_heaters.toml", "tclab/log.csv", 300.0),
    "tclab, more to fit": _example("tclab/two_heaters.toml", "tclab/log.csv", 450.0),
    "stator, run 1": _example(_BLDC, "bldc_stators/Run1.csv", 300.0),
    "stator, run 3": _example(_BLDC, "bldc_stators/Run3.csv", 120.0),
    "stator, run 4": _example(_BLDC, "bldc_stators/Run4.csv", 240.0),
    "stator, run 5": _example(_BLDC, "bldc_stators/Run5.csv", 100.0),
    "pmsm": _example("pmsm/winding.toml", "pmsm/log.csv", 3600.0),
    "ur3": _ur3,
    "leg in the wind": _leg(Hidden("forced_convection", "FR_thigh"), seed=3),
    "leg, nothing hidden": _leg(seed=4),
}
SLOW = ("ur3", "leg in the wind", "leg, nothing hidden")


@pytest.mark.long
@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW)) for name in STUDIES])
def test_all_media_say_the_same(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    files = STUDIES[name](tmp_path)

    _run("diagnose", files.model, *files.words, "--json", tmp_path / "found.json")
    printed, written = _lines(capsys), json.loads((tmp_path / "found.json").read_text())
    study = files.opening.study()
    study.fit()
    found = study.diagnose()
    said = study.narrative()
    assert printed[0] == str(said[0])
    assert {str(each) for each in said if each.label in ("Error", "Next")} <= set(printed)
    probabilities = {(step.effect, step.at): step.probability for step in found.steps}
    assert {(one["effect"], one["at"]): one["probability"] for one in written["candidates"]} == pytest.approx(
        probabilities
    )
    assert all(any(percent(share) in line for line in printed) for share in probabilities.values())
    content = content_of(Bench(study, files.opening, tmp_path))
    assert content["answers"]["verdict"] == written["verdict"] == found.verdict
    likeliest = sorted(probabilities.values(), reverse=True)
    assert [each["probable"] for each in content["answers"]["answers"]] == list(map(percent, likeliest))
    _same(said, content["head"]["said"], study._repr_html_())

    better = tmp_path / "better.toml"
    story, best = tmp_path / "story.html", tmp_path / "best.json"
    _run("improve", files.model, *files.words, "-o", better, "--report", story, "--json", best)
    printed, written = _lines(capsys), json.loads(best.read_text())
    study.improve()
    said = study.narrative()
    assert printed[: len(said)] == list(map(str, said))
    assert sum(len(wrap(line.replace(str(tmp_path), ""), 80)) for line in printed) <= 15
    head = content_of(Bench(study, files.opening, tmp_path))["head"]
    _same(said, head["said"], study._repr_html_(), story)
    assert written["remaining"] == study.selection().remaining
    held_out = study.compare()
    assert kelvin(written["history"][-1]["rmse_holdout"]) == kelvin(held_out.all.rmse)
    assert kelvin(held_out.all.rmse) in dict(head["said"])["Error"]

    _run("check", files.model, *files.fit, *files.holdout)
    unfitted = files.opening.study()
    held = [each for each in unfitted.check() if each.label in ("Sensors", "Excitation", "Effects")]
    assert set(map(str, held)) <= set(_lines(capsys))
    _same(held, [], unfitted._repr_html_(), story)
    contents = content_of(Bench(unfitted, files.opening, tmp_path))["contents"]
    assert contents == [(each.label, each.text) for each in held]
    _run("fit", files.model, *files.words, "-o", tmp_path / "fitted.toml")
    assert _lines(capsys)[0] == f"Error: {errors_in_words(study.steps[:1])}"

    log = (files.holdout or files.fit)[0]
    _run("compare", better, log, "--report", tmp_path / "errors.html")
    fitted, given = lptn.Study(better, holdout=log), lptn.Study(files.model, holdout=log)
    _told(fitted.compare().narrative(), _lines(capsys), fitted.compare()._repr_html_(), tmp_path / "errors.html")
    _run("compare", better, log, "--against", files.model, "--report", tmp_path / "versus.html")
    both = fitted.compare(given)
    _told(both.narrative(), _lines(capsys), both._repr_html_(), tmp_path / "versus.html")
    assert "Not fitted" in [each.label for each in both.narrative()]

    readings = [run.columns[f"temperature.{node}"] for run in fitted.runs for node in fitted.model.nodes]
    hottest = float(np.nanmax(np.concatenate(readings)))
    for limit in (hottest - 5.0, hottest + 5.0):
        _run("forecast", better, log, "--limit", f"{limit:.0f}")
        ahead = fitted.forecast(float(f"{limit:.0f}"))
        _told(ahead.narrative(), _lines(capsys), ahead._repr_html_())
        titles = [panel.get_title(loc="left") for panel in forecast_figure(ahead.result).axes]
        never = "No node reaches its limit" in ahead.narrative()[0].text
        assert never == all(": never" in title for title in titles if title)


def _run(*words: object) -> None:
    """A command as it is typed."""
    with pytest.raises(SystemExit, match="0"):
        main([str(word) for word in words])


def _lines(capsys: pytest.CaptureFixture[str]) -> list[str]:
    return capsys.readouterr().out.splitlines()


def _told(said: Sequence[Sentence], printed: Sequence[str], notebook: str, page: Path | None = None) -> None:
    """These sentences head what the terminal prints, and are in the notebook and on the report's page."""
    assert list(printed[: len(said)]) == list(map(str, said))
    _same(said, [], notebook, page)


def _same(said: Sequence[Sentence], head: Sequence[tuple[str, str]], notebook: str, page: Path | None = None) -> None:
    assert not head or list(head[:-1]) == [(each.label, each.text) for each in said]
    assert all(escape(each.text) in notebook for each in said)
    if page is not None:
        text = unescape(page.read_text(encoding="utf-8")).replace("\N{NO-BREAK SPACE}", " ")
        assert all(each.text in text for each in said)
