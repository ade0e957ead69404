"""The answers on the page: what Try shows is what Add does, and both have the sizes that the terminal prints."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from multiprocessing import Pipe
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from lptn.basics.errors import InputError
from lptn.diagnose.answers import Key
from lptn.identify.comparison import Errors
from lptn.report.text import size_text
from lptn.workbench.bench import Bench, name_of
from lptn.workbench.calculation import STUDY, _done, _opened, _save, _set_against
from lptn.workbench.content import content_of
from lptn.workbench.opening import EXAMPLES, Opening
from lptn.workbench.orders import Add, Against, Cut, Plain, Try
from tests.workbench.conftest import EXAMPLE, OPENING


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """Two heaters, and what they lack, drawn."""
    study = OPENING.study()
    study.fit()
    study.diagnose()
    bench = Bench(study, OPENING, tmp_path_factory.mktemp("asked"))
    bench.look_closer()
    return bench


def test_operating_conditions_are_those_of_the_comparison(asked: Bench) -> None:
    rows = content_of(asked)["conditions"]["given"]
    nodes = list(asked.study.model.nodes)
    expected: dict[tuple[str, str], list[float]] = {}
    for condition in asked.study.compare().conditions():
        expected.setdefault((condition.quantity, condition.node), []).append(condition.errors.rmse)
    for (quantity, node), errors in expected.items():
        tiles = [row["tiles"][nodes.index(node)] for row in rows if row["group"] == quantity]
        assert [tile["rmse"] for tile in tiles if tile] == pytest.approx(errors)
        assert {tile["segment"] for tile in tiles if tile} == {"holdout 0"}
    assert {"temperature [°C]", "time since start [s]"} <= {row["group"] for row in rows}
    assert len([row for row in rows if row["group"] == "time since start [s]"]) == 5


def _stator(_: Path) -> Opening:
    folder = EXAMPLE.parent / "bldc_stators"
    return Opening(folder / "two_nodes.toml", (folder / "Run1.csv",), holdout_after=300)


CASES: dict[str, tuple[Callable[[Path], Opening], tuple[Key, ...]]] = {
    "two heaters": (lambda _: OPENING, ()),
    "two heaters with two effects": (lambda _: OPENING, (("sensor_lag", "*"), ("conduction", "heater1~heater2"))),
    "a stator": (_stator, ()),
    "a leg": (EXAMPLES["leg"].opening, ()),
}
"""How each study is opened, and what was added before it is diagnosed."""
_NEXT = 3  # candidates that no diagnosis fitted, of each case


@pytest.mark.long
@pytest.mark.parametrize("case", CASES)
def test_add_keeps_what_try_showed(case: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Answers and less probable candidates alike, on the page's own numbers and lines."""
    opening, added = CASES[case]
    files = opening(tmp_path)
    study = files.study()
    study.fit()
    for effect, at in added:
        study.add(effect, at)
    bench = Bench(study, files, tmp_path)
    bench.do(Plain(what="diagnose"))
    bench.look_closer()
    diagnosis = study.diagnosed
    assert diagnosis is not None
    answers, lines = [step.key for step in diagnosis.steps], bench.news().predicted
    for key in [*answers, *(one.candidate.key for one in bench.weighed_only[:_NEXT])]:
        shown = _shown(bench, key)
        assert bool(shown["tried"]) == (key in answers)
        bench.do(Try(what="try", effect=key[0], at=key[1]))
        tried = _shown(bench, key)
        lines |= bench.news().predicted
        with monkeypatch.context() as no_other_fit:
            no_other_fit.setattr("lptn.study.refit", None)
            bench.do(Add(what="add", effect=key[0], at=key[1]))
        row = content_of(bench)["steps"][-1]
        assert {name: tried[name] for name in row} == row
        name = content_of(bench)["now"]
        assert name == tried["tried"]
        for segment, prediction in bench.predictions(-1).items():
            np.testing.assert_array_equal(prediction.readings, lines[segment, name])
        bench.do(Plain(what="undo"))


def _shown(bench: Bench, key: Key) -> dict[str, Any]:
    """What the page shows of a candidate."""
    answers = content_of(bench)["answers"]
    return next(each for each in answers["answers"] + answers["weighed"] if (each["effect"], each["at"]) == key)


def test_a_fit_that_was_tried_is_of_the_data_and_the_model_as_they_are() -> None:
    study = OPENING.study()
    study.fit()
    before = study.attempt("sensor_lag", "*")
    assert study.attempt("sensor_lag", "*") is before
    assert [step.key for step in study.attempts] == [("sensor_lag", "*")]
    study.leave_out("log", 100.0, 200.0)
    assert not study.attempts
    assert study.attempt("sensor_lag", "*").fit.rmse != before.fit.rmse
    study.add("conduction", "heater1~heater2")
    assert not study.attempts
    study.undo()
    assert study.attempts


def test_an_answer_has_its_kind_size_and_probability(asked: Bench) -> None:
    diagnosis = asked.study.diagnosed
    assert diagnosis is not None
    content = content_of(asked)
    shown = content["answers"]
    likeliest = sorted(diagnosis.steps, key=lambda step: -step.probability)
    assert [each["key"] for each in shown["answers"]] == [name_of(step) for step in likeliest]
    for each, step in zip(shown["answers"], likeliest, strict=True):
        assert each["kind"] == ("structure" if step.is_structure else "finding")
        assert each["size"] == size_text(step, step.fit)
        assert "±" in each["size"]
        assert each["probable"].endswith("%")
    assert [each["effect"] for each in shown["refused"]] == [step.effect for step in diagnosis.refused]
    said = dict(content["head"]["said"])
    assert all(each["size"] in said["Structure"] for each in shown["answers"] if each["kind"] == "structure")


def test_another_studys_model_stands_beside_with_its_own_errors(tmp_path: Path) -> None:
    text = (EXAMPLE / "two_heaters.toml").read_text()
    (tmp_path / "other.toml").write_text(f"# another\n{text}")
    files = {"mine": OPENING, "other": replace(OPENING, model=tmp_path / "other.toml")}
    ours, theirs = Pipe()
    benches = {name: _opened(theirs, opening, tmp_path, after_a_stop=False) for name, opening in files.items()}
    other = benches["other"]
    other.do(Add(what="add", effect="sensor_lag", at="*"))
    _save(other)
    mine = benches["mine"]
    _done(theirs, mine, Against(what="against", study=other.folder.name))
    mine = _opened(theirs, OPENING, tmp_path, after_a_stop=True)  # as somebody else opens it on another day
    content, news = content_of(mine), mine.news()
    step = other.study.steps[-1]
    assert step.holdout is not None
    assert content["head"]["against"] == pytest.approx(step.holdout.rmse, rel=1e-3)  # as its own page says
    assert content["against"] == f"against {other.folder.name}"
    for key, prediction in other.predictions(1).items():
        if key.startswith("holdout"):
            np.testing.assert_allclose(news.predicted[key, content["against"]], prediction.readings, atol=0.01)
    assert [tile["rmse"] for tile in content["tiles"]["holdout 0"]["against"]] == pytest.approx(
        [Errors.of(row).rmse for row in other.predictions(1)["holdout 0"].error], rel=1e-3
    )
    _done(theirs, mine, Cut(what="hold_out", run="log", start=100.0, stop=200.0))
    tiles = content_of(mine)["tiles"]
    assert list(tiles) == ["fit 0", "fit 1", "holdout 0", "holdout 1"]
    assert all(tile["against"] for tile in tiles.values())
    (mine.folder / STUDY).unlink()  # as another version of lptn finds it
    assert _opened(theirs, OPENING, tmp_path, after_a_stop=False).against[0] == other.folder.name
    _done(theirs, mine, Against(what="against", study=""))
    assert content_of(mine)["head"]["against"] is None
    assert not _opened(theirs, OPENING, tmp_path, after_a_stop=False).against[0]
    for name in ("../elsewhere", "nothing"):
        with pytest.raises(InputError, match="none of that name"):
            _set_against(mine, name)
    ours.close()


def test_the_head_says_what_study_and_report_say(tmp_path: Path) -> None:
    study = OPENING.study()
    study.improve()
    study.advise()
    head = content_of(Bench(study, OPENING, tmp_path))["head"]
    said = [(sentence.label, sentence.text) for sentence in study.narrative()]
    assert head["said"][:-1] == said
    assert f"→ {head['now']:.2f} K" in dict(said)["Error"]
