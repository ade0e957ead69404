"""The figures: no empty panel, a unit on every axis, peaks kept, the worst chosen."""

from __future__ import annotations

import io
import re
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import matplotlib
import pytest
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure

from lptn.basics.errors import InputError
from lptn.basics.style import ERROR, inline_svg, new_figure, show
from lptn.identify.comparison import Comparison, compare
from lptn.identify.data import holdout_segment
from lptn.report.comparison_figures import (
    comparison_figure,
    condition_figures,
    plot_conditions,
    plot_errors,
    plot_temperatures,
    predictions_figure,
)
from lptn.report.diagnosis_figures import plot_history
from lptn.report.shown import views, worst_views
from lptn.report.tables import conditions_of
from tests.report.two_joints import NODES, Told, make_run, robot


def _labels(figure: Figure) -> set[str]:
    axes = [ax for ax in figure.axes if ax.axison]
    return {label for ax in axes for label in (ax.get_xlabel(), ax.get_ylabel()) if label}


def _figure(ax: Axes) -> Figure:
    assert isinstance(ax.figure, Figure)
    return ax.figure


def _comparison(outcome: Told) -> Comparison:
    return compare(outcome[0].steps[0].fit.model, outcome[1].holdout)


def test_every_axis_has_its_unit(missing: Told) -> None:
    history, _ = missing
    given = _comparison(missing)
    assert _labels(predictions_figure(given, given)) == {"temperature [°C]", ERROR, "time [s]"}
    assert _labels(_figure(plot_history(history.steps))) == {"RMSE [K]"}
    titles = [ax.get_title(loc="left") for maps in condition_figures(given, given) for ax in maps.axes]
    assert titles
    assert all("[" in title for title in titles)


@pytest.fixture(autouse=True)
def _closed() -> Iterator[None]:
    """What a test drew of its own is put away."""
    yield
    pyplot.close("all")


def test_figures_take_and_return_axes(missing: Told) -> None:
    history, _ = missing
    given = _comparison(missing)
    temperatures = [cell for cell in given.conditions() if cell.quantity == "temperature [°C]"]
    drawn: list[Callable[[Axes | None], Axes]] = [
        lambda ax: plot_temperatures(given, ax=ax),
        lambda ax: plot_temperatures(given, NODES[1], 0, given, ax),
        lambda ax: plot_errors(given, ax=ax),
        lambda ax: plot_conditions(given, temperatures, ax=ax),
        lambda ax: plot_history(history.steps, ax),
    ]
    for draw in drawn:
        ax = new_figure(3.0).add_subplot()
        assert draw(ax) is ax
        assert ax.has_data()
        assert draw(None) is not ax
    with pytest.raises(InputError, match="a node that is measured"):
        plot_temperatures(given, "nowhere")


def test_the_worst_node_is_drawn_unless_another_is_named(missing: Told) -> None:
    given = _comparison(missing)
    worst = max(NODES, key=lambda node: given.node(node).rmse)
    assert worst.replace("$", r"\$") in plot_temperatures(given).get_title(loc="left")
    assert NODES[1].replace("$", r"\$") in plot_temperatures(given, NODES[1]).get_title(loc="left")


def test_maps_name_every_node_once_on_the_left(missing: Told) -> None:
    given = _comparison(missing)
    maps = condition_figures(given, given)
    for figure in maps:
        left, right = figure.axes
        assert [label.get_text() for label in left.get_yticklabels()] == [NODES[0], NODES[1].replace("$", r"\$")]
        assert not right.get_yticklabels()
    assert {cell.quantity for cell in given.conditions()} == {
        figure.axes[0].get_title(loc="left").removesuffix(", low to high") for figure in maps
    }


def test_long_times_are_in_minutes() -> None:
    model = robot()
    comparison = compare(model, [holdout_segment(make_run(model, 7, "long", count=1800))])
    conditions = conditions_of(comparison)
    times = [condition for condition in conditions if condition.quantity.startswith("time")]
    assert {condition.quantity for condition in times} == {"time since start [min]"}
    assert max(condition.upper for condition in times) < 60.0
    assert "time [min]" in _labels(predictions_figure(comparison))


def test_the_worst_views_are_chosen_in_order(missing: Told) -> None:
    history, data = missing
    runs = [part.run for part in (*data.fit, *data.holdout, *data.test)]
    comparison = compare(history.steps[0].fit.model, [holdout_segment(run) for run in (*runs, *runs)])
    chosen = worst_views(comparison, 3)
    assert len(views(comparison)) == 12
    assert chosen == sorted(chosen, key=lambda view: (view[0], NODES.index(view[1])))
    drawn = [ax for ax in predictions_figure(comparison).axes if ax.axison]
    assert len(drawn) == 2 * 6


def test_comparison_figure_of_a_run_too_short_to_sort() -> None:
    model = robot()
    run = make_run(model, 1, "short")
    cut = replace(holdout_segment(run), evaluation=(580.0, 590.0))
    comparison = compare(model, [cut])
    assert not comparison.conditions()
    assert len([ax for ax in comparison_figure(comparison).axes if ax.axison]) == 4


def test_an_unmeasured_node_is_left_out(missing: Told) -> None:
    model = missing[0].best.fit.model
    run = missing[1].holdout[0].run
    columns = {name: values for name, values in run.columns.items() if name != f"temperature.{NODES[1]}"}
    comparison = compare(model, [holdout_segment(replace(run, columns=columns))])
    assert views(comparison) == [(0, NODES[0])]
    assert comparison_figure(comparison).axes


def test_two_models_are_called_by_their_names(missing: Told) -> None:
    given = _comparison(missing)
    (legend,) = predictions_figure(given, given, names=("a$b", "c")).legends
    assert [text.get_text() for text in legend.get_texts()][1:3] == [r"a\$b", "c"]


def test_a_figure_is_shown_where_a_notebook_runs(missing: Told, monkeypatch: pytest.MonkeyPatch) -> None:
    shown: list[bytes] = []
    display = SimpleNamespace(Image=lambda data, width: data, display=shown.append)
    figure = _figure(plot_history(missing[0].steps))
    show(figure)
    monkeypatch.setitem(sys.modules, "ipykernel", display)
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    show(figure)
    (picture,) = shown
    assert picture.startswith(b"\x89PNG")


LAID_OUT: dict[str, Any] = {"figsize": (4, 3), "dpi": 150, "layout": "constrained"}


def test_a_figure_is_drawn_once_where_its_layout_engine_puts_it() -> None:
    class Counted(Figure):
        draws = 0

        def draw(self, renderer: RendererBase) -> None:
            self.draws += 1
            super().draw(renderer)

    usual, reference, once = io.StringIO(), Figure(**LAID_OUT), Counted(**LAID_OUT)
    for figure in (reference, once):
        figure.add_subplot().set_ylabel("a label of\ntwo lines")
    with matplotlib.rc_context({"svg.fonttype": "none", "svg.hashsalt": "lptn"}):
        reference.savefig(usual, format="svg")
    paths = re.findall(r'<path d="M ([\d.]+)', usual.getvalue())
    assert [f"{float(x):.1f}" for x in re.findall(r'<path d="M ([\d.]+)', inline_svg(once, ""))] == [
        f"{float(x):.1f}" for x in paths
    ]
    assert once.draws == 1
    assert once.get_layout_engine() is not None
