"""A study in one figure: Pareto front, iso-temperature map, time-to-limit curves, sensitivities."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from lptn.basics.errors import InputError
from lptn.basics.style import BAD, FAINT, INK, LIMIT, PALETTE, PAPER, SMALL, TEXT, dress, new_figure, plain

from .answer import FrontPoint, StudyResult, strongest
from .designs import Design
from .study import TradeStudy

RPM = 30 / np.pi
"""Revolutions a minute in a radian a second."""
_DASHES = ("-", (0, (5, 1.5)), (0, (1, 1)), (0, (4, 1, 1, 1)), (0, (2, 1)), (0, (8, 1, 1, 1, 1, 1)))
_AXES = {
    "mass": (1e3, "mass [g]"), "volume": (1e6, "package volume [cm³]"), "price": (1.0, "price [{currency}]"),
    "torque": (1.0, "torque [N·m]"), "duration": (1.0, "duration [s]"), "voltage": (1.0, "supply voltage [V]"),
    "ratio": (1.0, "gear ratio"), "held_torque": (1.0, "held torque [N·m]"),
    "time_to_limit": (1.0, "time to the limit [s]"),
    "worst_temperature": (1.0, "worst winding temperature [°C]"),
}  # fmt: skip


def axis_of(quantity: str, study: TradeStudy) -> tuple[float, str]:
    """Of a goal, or of what a front is swept over: its factor from SI, and its label."""
    factor, label = _AXES[quantity]
    return factor, label.format(currency=plain(study.question.currency))


def front_lines(result: StudyResult) -> dict[str, tuple[FrontPoint, ...]]:
    """Lines of a front's picture by name: each choice drawn; of two quantities the front at levels of the second."""
    sweep = result.study.sweep
    if sweep is None or sweep.also is None:
        return {name: result.by_option[name] for name in result.drawn if result.by_option.get(name)}
    factor, label = axis_of(sweep.also.against, result.study)
    words, _, unit = label.rstrip("]").partition(" [")
    levels = sorted({point.also for point in result.front if point.also is not None})
    return {
        f"{words} {factor * level:.4g} {unit}".rstrip(): tuple(point for point in result.front if point.also == level)
        for level in levels[:: -(-len(levels) // len(_DASHES))]
    }


def study_figure(result: StudyResult) -> Figure:
    """Draw what the study has: two to four panels."""
    panels: list[Callable[[Axes, StudyResult], None]] = [_curves, _sensitivities]
    if result.with_sink is not None:
        panels.insert(0, _map)
    if result.front:
        panels.insert(0, _front)
    rows = (len(panels) + 1) // 2
    figure = new_figure(3.6 * rows + 0.3)
    cells = np.asarray(figure.subfigures(rows, 2)).ravel()  # own margins each: names of parameters are long
    for cell, draw in zip(cells, panels, strict=False):
        ax = cell.subplots()
        draw(ax, result)
        ax.title.set_fontsize(TEXT)
        dress(ax)
    figure.suptitle(plain(result.study.question.name), fontsize=TEXT + 1)
    return figure


def torque_speed_figure(result: StudyResult) -> Figure:
    """How long each torque can be held at each speed, a panel for each of the best designs.

    Raises:
        InputError: neither the voltage nor the speed is limited.
    """
    diagrams = result.torque_speed
    if not diagrams:
        expected = "voltage = … or speed = …, where a torque-speed diagram ends"
        raise InputError(result.study.origin, "limits", "no voltage and no speed", expected)
    columns = min(2, len(diagrams))
    rows = -(-len(diagrams) // columns)
    figure = new_figure(3.2 * rows + 0.9)
    panels = figure.subplots(rows, columns, squeeze=False, sharex=True, sharey=True).ravel()
    for ax, diagram in zip(panels, diagrams, strict=False):
        speed, torque = RPM * diagram.speed, np.nan_to_num(diagram.torque)
        # Bands between the torques of two durations, the darker the shorter.
        for row, shade in enumerate(np.linspace(1.0, 0.15, len(torque)).tolist()):
            below = torque[row + 1] if row + 1 < len(torque) else np.zeros(speed.size)
            label = duration_words(diagram.durations[row])
            ax.fill_between(speed, below, torque[row], color=BAD, alpha=shade, lw=0, label=label)
        ax.set(xlim=(0, speed[-1]), ylim=(0, 1.05 * float(torque.max())))
        ax.set_title(plain(diagram.name), fontsize=TEXT)
        dress(ax)
    for ax in panels[len(diagrams) :]:
        ax.remove()
    for ax in panels[-columns:]:
        ax.set_xlabel("speed [rpm]")
    for ax in panels[::columns]:
        ax.set_ylabel("torque [N·m]")
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, frameon=False, fontsize=SMALL, loc="outside lower center", ncols=5)
    figure.suptitle(
        f"{plain(result.study.question.name)}: how long a torque can be held, behind the gear", fontsize=TEXT + 1
    )
    return figure


def duration_words(seconds: float) -> str:
    """Such as 30 s, 3 min, 1 h; for a moment, and for ever."""
    if not seconds or np.isinf(seconds):
        return "for ever" if seconds else "a moment"
    for unit, name in ((3600.0, "h"), (60.0, "min")):
        if seconds >= unit:
            return f"{seconds / unit:.3g} {name}"
    return f"{seconds:.3g} s"


def number_of(result: StudyResult, name: str) -> int:
    """The number of a choice, the same in all charts; or of a line of a front over two quantities."""
    return list(result.drawn if name in result.drawn else front_lines(result)).index(name)


def _look(result: StudyResult, name: str) -> dict[str, Any]:
    """Colour and dashes of a choice, which has the same colour in the page's charts; six at most are drawn."""
    number = number_of(result, name)
    return {"color": PALETTE[number], "linestyle": _DASHES[number]}


def _front(ax: Axes, result: StudyResult) -> None:
    assert result.study.sweep is not None
    factor, label = axis_of(result.study.sweep.against, result.study)
    scale, goal = axis_of(result.study.question.goal, result.study)
    for name, points in front_lines(result).items():
        amounts, values = ([getattr(point, key) for point in points] for key in ("amount", "value"))
        look = _look(result, name) | {"marker": ".", "ms": 3, "lw": 1.2}
        ax.plot(factor * np.array(amounts), scale * np.array(values), label=plain(name), **look)
    amounts, values = ([getattr(point, key) for point in result.front] for key in ("amount", "value"))
    ax.plot(factor * np.array(amounts), scale * np.array(values), "o", ms=4, color=INK, label="Pareto front", zorder=5)
    ax.set(xlabel=label, ylabel=goal, title="Pareto front: the best choice at each amount")
    ax.legend(frameon=False, fontsize=SMALL)


def _map(ax: Axes, result: StudyResult) -> None:
    design, grid = result.with_sink, result.iso_map
    assert design is not None
    assert grid is not None
    option = design.option
    here = (design.capacity or np.nan, design.resistance or np.nan)
    # Before the contours: their labels cut gaps that hold on the axes' scale of that moment only.
    ax.set(xscale="log", yscale="log", xlabel="sink capacity C [J/K]", ylabel="sink resistance R_h [K/W]")
    ax.set(xlim=option.study.sink.capacity, ylim=option.study.sink.resistance)
    lines = ax.contour(grid.capacity, grid.resistance, grid.winding, levels=8, colors=FAINT, linewidths=1.0)
    spread = float(np.ptp(grid.winding[np.isfinite(grid.winding)]))
    decimals = max(0, int(np.ceil(1 - np.log10(max(spread, 1e-6)))))  # that tell the contours apart
    ax.clabel(lines, fontsize=SMALL, fmt=f"%.{decimals}f")
    _bounds(ax, design, here)
    ax.plot(*here, "o", ms=7, color=_look(result, option.name)["color"], zorder=6, clip_on=False)
    ax.annotate("design", here, (7, 7), textcoords="offset points", fontsize=SMALL)
    peak = "Mean" if option.study.task.repeats is None else "Hottest"
    ax.set_title(f"{peak} winding [°C] at {design.torque:.3g} N·m\n{plain(option.name)}; shaded: can't be built")


def _bounds(ax: Axes, design: Design, here: tuple[float, float]) -> None:
    """Where mass, volume and fins end what can be built; names away from the design, where all of them may meet."""
    option = design.option
    c, r = np.meshgrid(*option.study.sink.grid(200))
    numbers = option.sink(r)
    named = {"all fins": (numbers.fin_share(c, r), 1.0)}
    for name, spent in numbers.spent(c, r).items():
        if name in option.limits:
            named[name] = (option.fixed[name] + spent, option.limits[name])
    for name, (values, level) in named.items():
        drawn = ax.contour(c, r, values, levels=[level], colors=LIMIT, linewidths=1.0)
        points = np.concatenate([np.reshape(path.vertices, (-1, 2)) for path in drawn.get_paths()])
        shown, at = (
            ax.transAxes.inverted().transform(ax.transData.transform(coordinates)) for coordinates in (points, [here])
        )
        inside = (np.abs(shown - 0.5) < 0.38).all(axis=1)  # of the axes; nearer to a side a line's name has no room
        if inside.any():
            farthest = points[inside][np.argmax(np.hypot(*(shown[inside] - at).T))]
            ax.clabel(drawn, fmt={level: name}, fontsize=SMALL, manual=[farthest])
    beyond = np.max([values / level for values, level in named.values()], axis=0)
    ax.contourf(c, r, beyond, levels=[1.0, np.inf], colors=LIMIT, alpha=0.10)


def _curves(ax: Axes, result: StudyResult) -> None:
    most = result.curves[0].current[-1] / 1.3
    for curve in result.curves:
        if curve.name not in result.drawn:
            continue
        reached = np.isfinite(curve.time)
        look = _look(result, curve.name)
        ax.plot(curve.current[reached], curve.time[reached], lw=1.6, label=plain(curve.name), **look)
    ax.axvline(most, color=LIMIT, lw=1.0)
    ax.annotate("most current", (most, 0.98), (3, 0), xycoords=("data", "axes fraction"), textcoords="offset points",
                fontsize=SMALL, color=LIMIT, rotation=90, va="top")  # fmt: skip
    ax.set(xlabel="constant current [A]", ylabel="time to the limit [s]", yscale="log", xlim=(0, 1.3 * most))
    ax.set_title(f"Time until the winding is at {result.curves[0].limit:.0f} °C")
    if not result.front or len(result.curves) <= 5:  # else the lines are those of the front, and there is no room
        ax.legend(frameon=False, fontsize=SMALL)


def _sensitivities(ax: Axes, result: StudyResult) -> None:
    """Of the best choice, and of the best one with a sink."""
    best, sunk = result.designs[0], result.with_sink
    shown = [best] if sunk is None or best.option.has_sink else [best, sunk]
    by_design = [{name: relative for name, _, relative in strongest(design, 99)} for design in shown]
    names = [name for name, _, _ in strongest(shown[-1], 8)][::-1]
    rows, thickness = np.arange(len(names)), 0.7 / len(shown)
    for number, (design, relative) in enumerate(zip(shown, by_design, strict=True)):
        values = [relative.get(name, 0.0) for name in names]
        place = rows + (0.5 * (len(shown) - 1) - number) * thickness
        colour = _look(result, design.option.name)["color"]
        hatch = "////" if design.option.has_sink else None
        ax.barh(place, values, thickness, color=colour, hatch=hatch, ec=PAPER, lw=0, label=plain(design.option.name))
    units = {name: unit for design in shown for name, (_, unit) in design.parameters.items()}
    ax.set_yticks(rows, [plain(name) + (", per K" if units[name] == "degC" else "") for name in names])
    ax.set_ylim(-0.5, max(len(names), 3) - 0.5)
    ax.axvline(0.0, color=INK, lw=0.8)
    ax.set_xlabel(f"% of the {result.study.goal[0]} per %")
    ax.set_title("Sensitivities", pad=20)  # pt: the legend stands between it and the bars
    ax.legend(frameon=False, fontsize=SMALL, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=2)
