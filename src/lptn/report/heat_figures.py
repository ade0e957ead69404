"""Figures of unexplained heat: maps of nodes by time, one node's line above its inputs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from typing import Any

import numpy as np
from jinja2 import Environment, FunctionLoader, StrictUndefined
from markupsafe import Markup
from matplotlib import colormaps
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Colormap, Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from lptn.basics.arrays import FloatArray
from lptn.basics.style import (
    BEST,
    FAINT,
    GIVEN,
    INK,
    OPENING,
    SMALL,
    TEXT,
    decimated,
    dress,
    inline_svg,
    new_figure,
    plain,
    time_axis,
)
from lptn.diagnose.improvement import History
from lptn.diagnose.unexplained_heat import HeatPeak, InputLink, UnexplainedHeat, input_links, largest, unexplained_heat
from lptn.identify.comparison import Comparison
from lptn.identify.fitting import Fit
from lptn.logs.run import Run
from lptn.report.text import for_people, listed, number

# --- The figure of one node's unexplained heat over time, above the inputs that it goes with ------


MOST_INPUTS = 3
"""Inputs drawn below the heat."""
_HEAT, _INPUT = 2.3, 0.95  # inch
_UNITS = {
    "torque": "N·m",
    "torque_abs": "N·m",
    "current": "A",
    "current_abs": "A",
    "velocity": "rad/s",
    "velocity_rms": "rad/s",
    "speed": "m/s",
    "power": "W",
    "mechanical_power": "W",
    "temperature": "°C",
    "irradiance": "W/m²",
}


@dataclass(frozen=True)
class Worst:
    """The node and run whose heat is drawn.

    Args:
        run: number of the run.
        node: the node.
        stretch: where its heat is largest, `None` where none is beyond its band.
    """

    run: int
    node: str
    stretch: HeatPeak | None


def worst_of(found: Sequence[UnexplainedHeat]) -> Worst:
    """Where the heat is clearest, or where it comes nearest to its band."""
    stretch = largest(found)
    if stretch is not None:
        return Worst([each.run for each in found].index(stretch.run), stretch.node, stretch)
    shares = [(np.abs(each.heat) / np.maximum(each.band, 1e-12)).max(axis=1) for each in found]
    run = max(range(len(found)), key=lambda place: float(shares[place].max()))
    return Worst(run, found[run].nodes[int(shares[run].argmax())], None)


def chosen_links(links: Sequence[InputLink], node: str) -> list[InputLink]:
    """The inputs that the node's heat goes with most closely, one of each kind before a second of any."""
    mine = [link for link in links if link.node == node]
    kinds: dict[str, InputLink] = {}
    for link in mine:
        kinds.setdefault(link.column.partition(".")[0], link)
    first = list(kinds.values())
    return [*first, *(link for link in mine if link not in first)][:MOST_INPUTS]


def heat_line(
    fit: Fit, given: UnexplainedHeat, best: UnexplainedHeat | None, worst: Worst, links: Sequence[InputLink]
) -> Figure:
    """Heat [W] with its band at one node, and below it the inputs, in one run.

    Args:
        fit: of the given model.
        given: its unexplained heat in the run.
        best: the best model's in the same run.
        worst: the node.
        links: the inputs to draw, closest first.
    """
    run = fit.problem.bound_runs[worst.run].run
    figure = new_figure(_HEAT + _INPUT * len(links) + 0.3)
    ratios = [_HEAT, *(_INPUT for _ in links)]
    axes = figure.subplots(len(ratios), 1, squeeze=False, sharex=True, height_ratios=ratios)[:, 0]
    minutes = time_axis(given.time)[1].endswith("[min]")
    per_second = 1 / 60 if minutes else 1.0
    if worst.stretch is not None:
        for ax in axes:
            ax.axvspan(worst.stretch.start * per_second, worst.stretch.stop * per_second, color=OPENING, zorder=0)
    for found, style, name in ((given, GIVEN, "model as given" if best else "model"), (best, BEST, "best model")):
        if found is not None and worst.node in found.nodes:
            _band(axes[0], found, worst.node, style, name, per_second)
    axes[0].axhline(0.0, color=FAINT, linewidth=0.8)
    axes[0].set_ylabel("unexplained heat [W]", size=SMALL)
    axes[0].set_title(plain(f"{worst.node}, run {given.run}"), size=TEXT, loc="left", pad=3)
    axes[0].legend(frameon=False, fontsize=SMALL, loc="lower right", bbox_to_anchor=(1.0, 0.98), ncols=2)
    for ax, link in zip(axes[1:], links, strict=True):
        _input(ax, run, link, per_second)
    for ax in axes:
        dress(ax)
    axes[-1].set_xlabel("time [min]" if minutes else "time [s]", size=SMALL)
    axes[0].set_xlim(given.time[0] * per_second, given.time[-1] * per_second)
    figure.align_ylabels(axes)
    return figure


def _band(ax: Axes, found: UnexplainedHeat, node: str, style: dict[str, Any], name: str, per_second: float) -> None:
    row = found.nodes.index(node)
    heat, band = found.heat[row], found.band[row]
    time = found.time * per_second
    ax.fill_between(time, heat - band, heat + band, color=style["color"], alpha=0.18, linewidth=0)
    ax.plot(time, heat, label=f"{name} with its 95 % band", **style | {"linewidth": 1.4})


def _input(ax: Axes, run: Run, link: InputLink, per_second: float) -> None:
    quantity = link.column.partition(".")[0]
    ax.plot(*decimated(run.time * per_second, run.columns[link.column]), color=INK, linewidth=0.7)
    ax.set_ylabel(f"[{_UNITS.get(quantity, 'as logged')}]", size=SMALL)
    what = f"{link.column}, whose square" if link.squared else f"{link.column}, which"
    title = f"{what} correlates with the heat by {link.correlation:+.2f}"
    ax.set_title(plain(for_people(title)), size=SMALL, loc="left", pad=2)


# --- Maps of nodes by time: where and when a model fails, and where and when it lacks heat --------


MOST_RUNS = 4
"""Runs in one figure."""
_ROW, _FRAME = 0.24, 0.75  # inch: a node's row, and what surrounds the rows of a map
_LEAST = 1.6  # inch; what the colour bar's label needs
_COLUMNS = 150  # blocks of time in one map
_HATCHED = 0.2  # share of the colour scale from which blue is hatched, so that it can be told from red in grey
_DEEP = 2.5  # multiples of that from which the hatching must be white to be seen
_BOTH: Colormap = colormaps["RdBu_r"].with_extremes(bad="0.8")  # red for more, blue for less, grey for not known


@dataclass(frozen=True)
class Field:
    """One run's values at each node over time.

    Args:
        run: its name.
        start: of the first block in the log's clock [s].
        seconds: length of a block.
        nodes: the rows.
        values: shape (nodes, blocks), NaN where not known.
    """

    run: str
    start: float
    seconds: float
    nodes: tuple[str, ...]
    values: FloatArray


def error_fields(comparison: Comparison) -> list[Field]:
    """Predicted minus measured [K] of each run where it counts, means over blocks of time."""
    found = []
    for prediction in comparison.predictions:
        error, run = prediction.error, prediction.segment.run
        rows = np.flatnonzero(np.isfinite(error).any(axis=1))
        counted = np.flatnonzero(np.isfinite(error).any(axis=0))
        first, length = int(counted[0]), int(counted[-1] - counted[0]) + 1
        size = max(1, length // _COLUMNS)
        split = error[rows, first : first + length // size * size].reshape(len(rows), -1, size)
        known = np.isfinite(split)
        total = np.where(known, split, 0.0).sum(axis=2)
        means = np.where(known.any(axis=2), total / np.maximum(known.sum(axis=2), 1), np.nan)
        nodes = tuple(comparison.model.nodes[row] for row in rows)
        found.append(Field(run.name, float(run.time[first]), size * run.step, nodes, means))
    return found


def heat_fields(found: Sequence[UnexplainedHeat]) -> list[Field]:
    """Unexplained heat [W] of each run, 0 where zero lies within its band."""
    return [
        Field(
            each.run,
            float(each.time[0] - each.seconds / 2),
            each.seconds,
            each.nodes,
            np.where(np.abs(each.heat) > each.band, each.heat, 0.0),
        )
        for each in found
    ]


def node_time_map(given: Sequence[Field], best: Sequence[Field], label: str, least: float) -> Figure:
    """The worst runs of the given model, above each other; the best model's beside them on one colour scale.

    Args:
        given: of the given model.
        best: of the best model on the same runs; empty where there is none.
        label: of the colour bar, with its unit.
        least: what the colour scale reaches at least, so that noise stays pale.
    """
    chosen = worst_runs(given)
    columns = 2 if best else 1
    heights = [_FRAME + _ROW * len(given[place].nodes) for place in chosen]
    figure = new_figure(max(sum(heights), _LEAST))
    grid = figure.subplots(len(chosen), columns, squeeze=False, height_ratios=heights)
    norm = _norm([*given, *best], least)
    headed = (("model as given", GIVEN["color"], given), ("best model", BEST["color"], best))
    for row, place in enumerate(chosen):
        for column in range(columns):
            heading, colour, fields = headed[column]
            ax = grid[row, column]
            _draw(ax, fields[place], norm, labelled=column == 0)
            if best:
                ax.set_title(heading, size=SMALL, loc="right", pad=3, color=colour, weight="bold")
    bar = figure.colorbar(ScalarMappable(norm, _BOTH), ax=grid, fraction=0.025, pad=0.01, aspect=20)
    bar.set_label(label, size=TEXT)
    bar.ax.tick_params(labelsize=SMALL)
    return figure


def worst_runs(fields: Sequence[Field]) -> list[int]:
    """Numbers of the runs with the largest values, in the order of the runs."""
    order = sorted(range(len(fields)), key=lambda place: -float(np.nanmean(fields[place].values ** 2)))
    return sorted(order[:MOST_RUNS])


def _hatch(ax: Axes, field: Field, span: tuple[float, float], below: float) -> None:
    """Lines over what is clearly negative: blue and red are one grey on a grey printer."""
    width = (span[1] - span[0]) / field.values.shape[1]
    for row, values in enumerate(field.values):
        low = np.concatenate([[False], values < below, [False]]).astype(np.int8)
        edges = np.flatnonzero(np.diff(low)).reshape(-1, 2)
        for start, stop in edges:
            ink = "white" if float(np.mean(values[start:stop])) < _DEEP * below else "0.25"
            corner = (span[0] + start * width, row)
            ax.add_patch(
                Rectangle(corner, (stop - start) * width, 1.0, fill=False, hatch="///", edgecolor=ink, linewidth=0)
            )


def _norm(fields: Sequence[Field], least: float) -> Normalize:
    largest = max(float(np.nanmax(np.abs(field.values), initial=0.0)) for field in fields)
    return Normalize(-max(largest, least), max(largest, least))


def _draw(ax: Axes, field: Field, norm: Normalize, *, labelled: bool) -> None:
    ends = np.array([field.start, field.start + field.seconds * field.values.shape[1]])
    (first, last), label = time_axis(ends)
    rows = len(field.nodes)
    ax.imshow(
        field.values, aspect="auto", extent=(first, last, rows, 0.0), cmap=_BOTH, norm=norm, interpolation="nearest"
    )
    ax.set_yticks([row + 0.5 for row in range(rows)], [plain(node) if labelled else "" for node in field.nodes])
    _hatch(ax, field, (first, last), _HATCHED * float(norm.vmin or 0.0))
    for row in range(1, rows):
        ax.axhline(row, color="white", linewidth=1.0)
    ax.tick_params(labelsize=SMALL)
    ax.tick_params(axis="y", length=0)
    ax.set_xlabel(label, size=SMALL)
    ax.set_title(plain(f"run {field.run}"), size=SMALL, loc="left", pad=3)


# --- Templates filled in: pictures with their sentence, tables, one page without anything from outside ---


@dataclass(frozen=True)
class Picture:
    """Drawings that share one sentence on what to see."""

    drawings: tuple[Markup, ...]
    caption: str


def picture(caption: str, *figures: Figure) -> Picture:
    """Figures and the sentence below them."""
    return Picture(tuple(inline_svg(figure, caption) for figure in figures), caption)


def render(template: str, **content: object) -> str:
    """A template of this folder, filled in; all text is escaped."""
    # The style sheet is ours; as a template it would be read for braces.
    return _environment().get_template(template).render(css=Markup(_text("style.css")), **content)


def _environment() -> Environment:
    return Environment(
        loader=FunctionLoader(_text),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


def _text(name: str) -> str:
    return files("lptn.report").joinpath(name).read_text(encoding="utf-8")


# --- Unexplained heat as the page shows it: a map, one node's line above its inputs, and a sentence ---


_STAYS = 0.5  # share of the heat from which it is called unexplained by what was added
_CLOSE = 0.5  # correlation from which an input is worth a word
_PALE = 2.0  # the colour scale reaches so many times the usual band at least


@dataclass(frozen=True)
class HeatStory:
    """The heat that the given model lacks on the fitted runs, and the best one still.

    Args:
        fit: of the given model.
        given: its unexplained heat, one a run.
        best: the best model's; empty where no effect was added.
        worst: where the given model lacks heat most clearly.
        links: inputs that the worst node's heat goes with, closest first.
    """

    fit: Fit
    given: list[UnexplainedHeat]
    best: list[UnexplainedHeat]
    worst: Worst
    links: list[InputLink]

    @property
    def widest(self) -> float:
        """The widest of all nodes' usual bands [W]: less heat than that can hide."""
        return max(float(np.median(row)) for each in self.given for row in each.band)

    @property
    def where(self) -> str:
        """Where and when heat is missing, in words; empty where none is beyond chance."""
        return self._in_words(self.worst.stretch)

    @property
    def left(self) -> str:
        """Where and when the best model still lacks heat; empty where none is beyond chance."""
        return self._in_words(largest(self.best))

    @property
    def event(self) -> str:
        """Run, node and time at which most of the heat stays missing with the best model, too; empty without one."""
        before, after = self.worst.stretch, largest(self.best)
        if not self.best:
            return self._place(before) if before else ""
        stays = before is not None and after is not None and abs(after.heat) > _STAYS * abs(before.heat)
        return self._place(after) if after is not None and stays else ""

    def _in_words(self, stretch: HeatPeak | None) -> str:
        if stretch is None:
            return ""
        missing = "heat is missing" if stretch.heat > 0 else "there is too much heat"
        about = replace(stretch, heat=abs(stretch.heat)).text().removeprefix(stretch.place)
        return for_people(f"{missing} most clearly {self._place(stretch)}{about}")

    def _place(self, stretch: HeatPeak) -> str:
        return f"{stretch.place} of run {stretch.run}" if len(self.given) > 1 else stretch.place


def heat_story(history: History) -> HeatStory:
    """Work out what the page shows of unexplained heat."""
    fit = history.steps[0].fit
    given = unexplained_heat(fit)
    best = unexplained_heat(history.best.fit) if len(history.steps) > 1 else []
    worst = worst_of(given)
    return HeatStory(fit, given, best, worst, chosen_links(input_links(fit, given), worst.node))


def heat_map_picture(story: HeatStory) -> Picture | None:
    """The map of nodes by time; none where no heat is beyond chance."""
    if story.worst.stretch is None:
        return None
    least = _PALE * float(np.median(np.concatenate([each.band.ravel() for each in story.given])))
    figure = node_time_map(heat_fields(story.given), heat_fields(story.best), "heat [W]", least)
    told = "Heat that the model lacks (red) or has too much of (blue, hatched); white where zero lies within"
    told += " the 95 % band."
    told += f" With the model as given {story.where}"
    told += f"; with the best one {story.left or 'none stands out'}." if story.best else "."
    told += " Trust where and when more than the watts: the fitted parameters absorb part."
    if len(story.given) > MOST_RUNS:
        told += f" Shown are the {MOST_RUNS} of {len(story.given)} runs that lack most."
    return picture(told, figure)


def heat_line_picture(story: HeatStory) -> Picture:
    """The worst node's heat in its run, above the inputs that it goes with."""
    place = story.worst.run
    best = story.best[place] if story.best else None
    figure = heat_line(story.fit, story.given[place], best, story.worst, story.links)
    if story.worst.stretch is None:
        told = f"No node asks for heat beyond chance; {story.worst.node} comes nearest to it."
    else:
        told = f"The heat that {story.worst.node} asks for; the stretch where it is clearest is shaded."
    return picture(f"{told} {_inputs(story.links)}", figure)


def _inputs(links: Sequence[InputLink]) -> str:
    close = [link for link in links if abs(link.correlation) >= _CLOSE]
    if not links:
        return "The log holds no input that varies."
    if not close:
        return f"It follows no input closely: the closest, {links[0].what}, correlates by {links[0].correlation:+.2f}."
    named = listed([f"{link.what} ({link.correlation:+.2f})" for link in close])
    return for_people(f"It goes with {named}, which suggests a cause and proves none.")


def hiding(story: HeatStory) -> str:
    """How much heat could hide in the bands, in words."""
    return f"no node asks for heat beyond chance; its 95 % band is ±{number(story.widest, 2)} W where it is widest"
