"""Which segments of which runs are fitted, held out, or test."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from lptn.basics.errors import InputError
from lptn.identify.data import Segment, holdout_segment, load_model, split_data
from lptn.logs.run import Run
from lptn.robots.presets import presets
from tests.builders import make_run

ALWAYS = (float("-inf"), float("inf"))


def _run(n: int, step: float = 1.0, name: str = "run") -> Run:
    return make_run({"temperature.a": np.full(n, 20.0)}, step=step, name=name)


def test_fitted_runs_count_as_a_whole() -> None:
    split = split_data([_run(100), _run(200)])
    assert [(segment.initialisation, segment.evaluation) for segment in split.fit] == [(ALWAYS, ALWAYS)] * 2
    assert split.holdout == split.test == ()


def test_held_out_runs_are_predicted_behind_their_initialisation_window() -> None:
    split = split_data([_run(100)], [_run(2000)], [_run(3000)])
    for segment, border in ((split.holdout[0], 200.0), (split.test[0], 300.0)):
        assert segment.initialisation == (float("-inf"), border)
        assert segment.evaluation == (border, float("inf"))


@pytest.mark.parametrize(
    ("n", "step", "border"),
    [(1000, 1.0, 100.0), (300, 1.0, 60.0), (100, 10.0, 100.0), (80, 1.0, 40.0), (12, 10.0, 60.0)],
    ids=["a tenth", "at least a minute", "at least ten steps", "half of a short run", "half of a few steps"],
)
def test_an_initialisation_window_is_a_tenth_but_long_enough_and_never_over_half(
    n: int, step: float, border: float
) -> None:
    segment = holdout_segment(_run(n, step))
    assert segment.initialisation[1] == segment.evaluation[0] == pytest.approx(border)


def test_an_initialisation_window_counts_from_the_start_of_the_log() -> None:
    run = _run(2000).slice(500.0, 1500.0)
    assert holdout_segment(run).initialisation[1] == pytest.approx(600.0)


def test_holding_out_the_end_of_each_log_starts_from_where_the_fit_ended() -> None:
    split = split_data([_run(1000), _run(400)], holdout_after=600.0)
    assert [segment.evaluation for segment in split.fit] == [(float("-inf"), 600.0)] * 2
    (later,) = split.holdout  # the short log has nothing after it
    assert later.run is split.fit[0].run
    assert later.initialisation == (float("-inf"), 600.0)
    assert later.evaluation == (600.0, float("inf"))


def test_logs_that_begin_later_are_not_fitted() -> None:
    late = make_run({"temperature.a": np.full(500, 20.0)})
    late = Run(late.name, 1.0, late.time + 700.0, late.columns, False, "late.csv", "00")
    split = split_data([_run(1000), late], holdout_after=600.0)
    assert len(split.fit) == len(split.holdout) == 1


def test_whole_held_out_runs_join_those_behind_the_border() -> None:
    split = split_data([_run(1000)], [_run(2000, name="other")], holdout_after=600.0)
    assert [segment.run.name for segment in split.holdout] == ["run", "other"]


@pytest.mark.parametrize("border", [0.0, 5.0, 995.0, 5000.0])
def test_a_border_that_leaves_nothing_on_one_side_is_refused(border: float) -> None:
    with pytest.raises(InputError, match=r"--holdout-after: .*0 to 999 s.*a time inside a log") as caught:
        split_data([_run(1000)], holdout_after=border)
    assert "\n" not in str(caught.value)


def test_coarsening_spares_short_runs() -> None:
    runs = [replace(_run(steps), source=f"{steps}.csv") for steps in (6000, 700, 400)]
    coarse = split_data(runs, [_run(4000)]).coarsened(10.0)
    assert [segment.run.step for segment in coarse.fit] == [10.0, 2.0, 1.0]
    assert coarse.holdout[0].run.step == 10.0
    assert coarse.holdout[0].evaluation == (400.0, float("inf"))


def test_pieces_of_one_log_spare_what_all_of_it_can() -> None:
    """Twenty minutes between gaps are twenty minutes; of the shortest piece ten steps are left."""
    coarse = split_data([_run(700), _run(460), _run(35), _run(5)]).coarsened(5.0)
    assert [segment.run.step for segment in coarse.fit] == [4.0, 4.0, 3.0, 1.0]


def test_coarsening_to_a_finer_step_changes_nothing() -> None:
    segment = Segment(_run(1000, 5.0), ALWAYS, ALWAYS)
    assert segment.coarsened(1.0) is segment


def test_so_many_logs_that_no_command_would_end_are_refused_before_one_is_read(tmp_path: Path) -> None:
    (tmp_path / "leg.toml").write_text(presets()["leg"], encoding="utf-8")
    loaded = load_model(tmp_path / "leg.toml")
    with pytest.raises(InputError, match=r"2,001 logs; expected at most 2,000"):
        loaded.runs(["log.csv"] * 2001)
    with pytest.raises(InputError, match="no such file"):
        loaded.runs(["log.csv"] * 2000)
