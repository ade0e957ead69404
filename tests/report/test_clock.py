"""A log whose clock began long before it gives the same pictures and sentences as one whose clock began with it."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from lptn.diagnose.improvement import improve
from lptn.diagnose.unexplained_heat import HeatPeak
from lptn.identify.comparison import compare
from lptn.identify.data import holdout_segment, split_data
from lptn.logs.run import Run
from lptn.report.comparison_figures import predictions_figure
from lptn.report.heat_figures import field_figures, heat_figure
from lptn.report.heat_story import HeatStory
from lptn.report.narrative import details, narrative
from lptn.report.pages import comparison_html, story_html
from lptn.report.shown import error_fields, heat_fields
from tests.report.two_joints import NODES, Told, make_run, robot

SINCE_1970 = 1.74e9  # s
SINCE_SWITCHED_ON = 5e6  # s, two months


def _later(run: Run, seconds: float) -> Run:
    return replace(run, time=run.time + seconds)


def _shifted(missing: Told, seconds: float) -> Told:
    """The same logs, stamped with a clock that began long before."""
    data = missing[1]
    fit, holdout, test = (
        [_later(segment.run, seconds) for segment in part] for part in (data.fit, data.holdout, data.test)
    )
    later = split_data(fit, holdout, test)
    return improve(robot(), later), later


@pytest.fixture(scope="module")
def shifted(missing: Told) -> Told:
    return _shifted(missing, SINCE_1970)


def test_the_story_is_the_same(missing: Told, shifted: Told) -> None:
    assert details(*shifted) == details(*missing)
    assert narrative(shifted[0].steps, shifted[0].last) == narrative(missing[0].steps, missing[0].last)
    later, story = story_html(*shifted, "story"), story_html(*missing, "story")
    assert _without_the_day(later) == _without_the_day(story)
    assert later.count("2025-02-19 21:20 UTC") == len([*shifted[1].fit, *shifted[1].holdout, *shifted[1].test])
    assert "began" not in _words(story)


def _words(page: str) -> str:
    """What a page says, without its script and data."""
    return re.sub(r"<script.*?</script>", "", page, flags=re.DOTALL)


def _without_the_day(page: str) -> str:
    """A page without what only a clock that counts from 1970 can say."""
    page = re.sub(r'"began":(null|[\d.]+)', "", page)
    return re.sub(r"<th>began</th>|<td>\d{4}-\d\d-\d\d \d\d:\d\d UTC</td>", "", page)


@pytest.mark.long
def test_a_clock_that_began_with_the_robot_says_nothing_of_the_day(missing: Told) -> None:
    later = _shifted(missing, SINCE_SWITCHED_ON)
    assert later[1].fit[0].run.began is None
    assert story_html(*later, "story") == story_html(*missing, "story")


@pytest.mark.parametrize("seconds", [SINCE_1970, SINCE_SWITCHED_ON])
def test_a_comparison_is_the_same(missing: Told, seconds: float) -> None:
    model, run = missing[0].best.fit.model, make_run(robot(), 5, "later")
    pages = [comparison_html(compare(model, [holdout_segment(one)]), "page") for one in (run, _later(run, seconds))]
    assert _without_the_day(pages[0]) == _without_the_day(pages[1])


def test_figures_begin_at_zero(shifted: Told) -> None:
    history, data = shifted
    story = HeatStory.of(history)
    run, comparison = data.fit[0].run, compare(history.best.fit.model, data.holdout)
    peak = HeatPeak(run.name, NODES[0], SINCE_1970 + 100.0, SINCE_1970 + 200.0, 4.0, 0.5, origin=run.origin)
    assert peak.place == f"at {NODES[0]} from 100 to 200 s"
    figures: list[Figure] = [
        predictions_figure(comparison),
        heat_figure(run, story.given[0], NODES[0], story.best[0], peak),
        *field_figures(error_fields(comparison), [], "K", 0.0),
        *field_figures(heat_fields(story.given), heat_fields(story.best), "W", 0.0),
    ]
    for figure in figures:
        for ax in figure.axes:
            for axis in (ax.xaxis, ax.yaxis):
                assert np.abs(axis.get_view_interval()).max() < 1e4, ax.get_title()


def test_a_piece_of_a_log_counts_from_the_start_of_the_log() -> None:
    run = replace(make_run(robot(), 5, "whole"), log_start=0.0)
    piece = run.slice(100.0, 200.0)
    assert piece.elapsed[0] == 100.0
    later = replace(_later(run, SINCE_1970), log_start=SINCE_1970).slice(SINCE_1970 + 100.0, SINCE_1970 + 200.0)
    assert later.elapsed[0] == 100.0
    assert (piece.origin, later.origin) == (0.0, SINCE_1970)
