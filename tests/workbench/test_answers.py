"""The answers on the page: what Try draws is what Add does, and both are told with the sizes of the terminal."""

from __future__ import annotations

from pathlib import Path

import pytest

from lptn.report.text import size_text
from lptn.workbench.bench import Bench, name_of
from lptn.workbench.content import content_of
from tests.workbench.conftest import OPENING


@pytest.fixture(scope="module")
def asked(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    """Two heaters, and what they lack, drawn."""
    study = OPENING.study()
    study.fit()
    study.diagnose()
    bench = Bench(study, tmp_path_factory.mktemp("asked"), "")
    bench.look_closer()
    return bench


@pytest.mark.long
def test_try_draws_what_add_does(asked: Bench) -> None:
    study = asked.study
    diagnosis = study.diagnosed
    assert diagnosis is not None
    assert len(diagnosis.steps) > 1
    answers = {each["key"]: each for each in content_of(asked, OPENING)["answers"]["answers"]}
    for answer in diagnosis.steps:
        tried, added = answers[name_of(answer)], study.add(answer)
        assert not tried["linearised"]
        assert added.holdout is not None
        assert tried["holdout"] == pytest.approx(added.holdout.rmse, rel=0.02)
        assert tried["fit"] == pytest.approx(added.fit.rmse, rel=0.02)
        study.undo()


def test_an_answer_has_its_kind_size_and_probability(asked: Bench) -> None:
    diagnosis = asked.study.diagnosed
    assert diagnosis is not None
    content = content_of(asked, OPENING)
    shown = content["answers"]
    assert [each["key"] for each in shown["answers"]] == [name_of(step) for step in diagnosis.steps]
    for each, step in zip(shown["answers"], diagnosis.steps, strict=True):
        assert each["kind"] == ("structure" if step.is_structure else "finding")
        assert each["size"] == size_text(step, step.fit)
        assert "±" in each["size"]
        assert each["probable"].endswith("%")
    assert [each["effect"] for each in shown["refused"]] == [step.effect for step in diagnosis.refused]
    said = dict(content["head"]["said"])
    assert all(each["size"] in said["Structure"] for each in shown["answers"] if each["kind"] == "structure")


def test_the_head_says_what_study_and_report_say(tmp_path: Path) -> None:
    study = OPENING.study()
    study.improve()
    study.advise()
    head = content_of(Bench(study, tmp_path, ""), OPENING)["head"]
    said = [(sentence.label, sentence.text) for sentence in study.narrative()]
    assert head["said"][:-1] == said
    assert f"→ {head['now']:.2f} K" in dict(said)["Error"]
