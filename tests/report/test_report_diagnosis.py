"""The panels of a diagnosis: true to their numbers, a unit on every axis, and words that agree with the verdict."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

from lptn.basics.style import new_figure
from lptn.diagnose.advice import Detectable, smallest
from lptn.diagnose.unexplained_heat import UnexplainedHeat
from lptn.effects import catalogue
from lptn.effects.sensor_lag import SensorLag
from lptn.identify.comparison import compare
from lptn.model.network import EffectDeclaration
from lptn.report.diagnosis_figures import plot_detectability
from lptn.report.heat_figures import field_figures
from lptn.report.heat_story import HeatStory, chosen_links, heat_line_picture, heat_map_picture
from lptn.report.pages import detectability_picture
from lptn.report.shown import InputLink, error_fields, heat_fields, reaches, worst_runs
from lptn.report.tables import effects_table, node_table, refused_table
from lptn.report.text import for_people, named
from tests.report.two_joints import NODES, STEP, Told

HIDDEN = 3.0  # W, what the truth of `missing` has at the first joint


@pytest.fixture(scope="module")
def heat(missing: Told) -> HeatStory:
    return HeatStory.of(missing[0])


def _labels(figure: Figure) -> set[str]:
    return {label for ax in figure.axes if ax.axison for label in (ax.get_xlabel(), ax.get_ylabel()) if label}


def _bursting(estimate: UnexplainedHeat, watts: float) -> UnexplainedHeat:
    """The same run with clear heat at the second joint in its second quarter."""
    made = np.zeros_like(estimate.heat)
    quarter = estimate.time.size // 4
    made[1, quarter : 2 * quarter] = watts
    return replace(estimate, heat=made, band=np.full_like(made, 0.5))


@pytest.mark.long
def test_errors_by_node_and_time_are_the_means_of_the_errors(missing: Told) -> None:
    comparison = compare(missing[0].steps[0].fit.model, missing[1].holdout)
    (field,) = error_fields(comparison)
    error = comparison.predictions[0].error
    counted = np.flatnonzero(np.isfinite(error).any(axis=0))
    assert field.start == comparison.predictions[0].segment.run.time[counted[0]]
    assert field.seconds % STEP == 0
    size = round(field.seconds / STEP)
    block = slice(counted[0] + 2 * size, counted[0] + 3 * size)
    np.testing.assert_allclose(field.values[:, 2], error[:, block].mean(axis=1))
    (figure,) = field_figures([field], [field], "K", 0.1)
    assert _labels(figure) == {"time [s]"}
    (legend,) = figure.legends
    sizes = [text.get_text() for text in legend.get_texts()]
    assert [size[1:] for size in sizes[:3]] == [size[1:] for size in reversed(sizes[3:])]
    assert all(size.endswith(" K") for size in sizes)


def test_heat_within_its_band_is_drawn_as_none(heat: HeatStory) -> None:
    (estimate,) = heat.given[:1]
    made = _bursting(estimate, 4.0)
    (field,) = heat_fields([made])
    quarter = estimate.time.size // 4
    assert set(np.unique(field.values)) == {0.0, 4.0}
    assert (field.values[1, quarter : 2 * quarter] == 4.0).all()
    assert not heat_fields([replace(made, band=np.full_like(made.heat, 5.0))])[0].values.any()


def test_the_worst_runs_are_drawn_in_their_order(heat: HeatStory) -> None:
    runs = [_bursting(heat.given[0], watts) for watts in (3.0, 1.0, 9.0, 2.0, 8.0, 7.0)]
    assert worst_runs(heat_fields(runs)) == [0, 2, 4, 5]


def test_the_line_has_the_heat_and_the_inputs(heat: HeatStory, missing: Told) -> None:
    made = [_bursting(estimate, 4.0) for estimate in heat.given]
    story = replace(heat, given=made, best=[], node=NODES[1])
    drawn = heat_line_picture(story)
    text = str(drawn.drawings[0])
    assert "unexplained heat [W]" in text
    assert "[N·m]" in text
    assert "correlates with the heat by" in text
    assert drawn.caption.endswith(".")
    kinds = [InputLink(column, False, share) for column, share in (("a.x", 0.9), ("a.y", 0.8), ("b.x", 0.1))]
    assert [link.column for link in chosen_links(kinds)] == ["a.x", "b.x", "a.y"]


def test_heat_without_a_burst_has_no_map(adequate: Told) -> None:
    story = HeatStory.of(adequate[0])
    assert story.where(story.peak) == ""
    assert heat_map_picture(story) is None
    assert "No node lacks heat beyond chance" in heat_line_picture(story).caption


def test_detectability_has_a_row_for_each_effect(missing: Told) -> None:
    detectable = smallest(missing[0].last.weighed)
    rows = reaches(detectable)
    assert len(rows) == len({entry.effect for entry in detectable})
    shares = [row.easiest.share_of_typical for row in rows]
    assert shares == sorted(shares)
    figure = new_figure(3.0)
    plot_detectability(detectable, figure.add_subplot())
    assert _labels(figure) == {"smallest size that would show, as a share of the typical size [1]"}
    pair = [Detectable("radiation", at, size, "m^2", size / 0.02) for at, size in (("a", 0.01), ("b", 0.5))]
    (one,) = reaches(pair)
    assert (one.easiest.at, one.hardest.at) == ("a", "b")
    picture = detectability_picture(pair)
    assert picture is not None
    assert "(0 of 1 effects" in picture.caption


def test_tables_hold_size_and_nodes(missing: Told) -> None:
    history, data = missing
    table = effects_table(history)
    (row,) = (dict(zip(table.heads, row, strict=True)) for row in table.rows)
    size, error = re.fullmatch(r"(\S+) ± (\S+) W", row["size"]).groups()  # type: ignore[union-attr]
    assert abs(float(size) - HIDDEN) < 3 * float(error) < 1.0
    assert (row["effect"], row["place"], row["kind"]) == ("constant heat", NODES[0], "finding")
    structure = replace(history.best, declaration=EffectDeclaration(SensorLag(), "*"))
    chosen = replace(history.best, probability=0.0)
    kinds = effects_table(replace(history, steps=(*history.steps, structure, chosen))).rows
    assert [row[3] for row in kinds] == ["finding", "structure", "chosen"]
    assert kinds[-1][5] == "–"
    refused = replace(history.last, refused=(replace(history.best, probability=0.2),))
    assert refused_table(replace(history, last=refused)).rows[0][2:] == (f"{size} ± {error} W", "20 %")
    given, best = (compare(step.fit.model, data.holdout) for step in (history.steps[0], history.best))
    both = node_table(given, best)
    assert [row[0] for row in both.rows] == list(NODES)
    assert float(both.rows[0][2].split()[0]) < float(both.rows[0][1].split()[0])
    assert node_table(given, None).heads == ("node", "RMSE", "max |error|", "noise alone")


def test_a_place_in_one_run_is_said_in_words() -> None:
    assert named("radiation", "*@monday") == "radiation to the surroundings everywhere in run monday"
    assert named("radiation", "calf@monday") == "radiation to the surroundings at calf in run monday"


@pytest.mark.parametrize("key", sorted(catalogue()))
def test_what_is_in_words_already_stays_as_it_is(key: str) -> None:
    text = f"{named(key, 'FR_hip')} and {named(key, '*')}"
    assert for_people(text) == text
    assert for_people(f"{key} at FR_hip") == named(key, "FR_hip")


def test_the_terminals_sentence_as_it_is_printed() -> None:
    text = for_people("At 20 degC sensor_lag at * and radiation at a~b differ by -0.72 W (x-1, 3 N*m).")
    assert text == (
        "At 20 °C sensor lag everywhere and radiation to the surroundings at a~b differ by −0.72 W (x-1, 3 N·m)."
    )


def test_too_cold_is_hatched_so_that_grey_shows_it(missing: Told) -> None:
    comparison = compare(missing[0].steps[0].fit.model, missing[1].holdout)
    (field,) = error_fields(comparison)
    cold = replace(field, values=np.where(np.arange(field.values.shape[1]) % 4 == 1, -1.0, 1.0) * [[1.0], [0.1]])
    (figure,) = field_figures([cold], [], "K", 0.1)
    (hatched,) = (patch.get_path() for patch in figure.axes[0].patches if patch.get_hatch())
    assert np.asarray(hatched.vertices)[:, 1].max() <= 1.0
    assert (np.asarray(hatched.codes) == hatched.MOVETO).sum() == (cold.values[0] < 0).sum()
