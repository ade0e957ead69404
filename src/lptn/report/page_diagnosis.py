"""The figures of a diagnosis on the page: how errors fall, probabilities, what can't be told apart, what would show."""

from __future__ import annotations

import numpy as np
from markupsafe import Markup

from lptn.basics.words import short_size
from lptn.diagnose.advice import Detectable
from lptn.diagnose.answers import LIKELY
from lptn.diagnose.improvement import History
from lptn.report.shown import noise_alone, reaches, weighed_effects
from lptn.report.svg import LETTER, WIDE, Drawing, Panel
from lptn.report.text import kelvin, named, percent, place_of, title_of, unit_text

# --- the history: how the errors fall from step to step -----------------------------------------------------


_WIDE = 8.0  # ratio of errors above which only a logarithmic axis shows them all


def history_figure(history: History) -> Markup:
    """RMSE [K] of each step on fit, held-out and test data, above what the sensors' noise alone would leave."""
    noise, best = noise_alone(history.best.fit), len(history.steps) - 1
    lines = {
        "fit data": [step.fit.rmse for step in history.steps],
        "held-out data": [step.holdout.rmse if step.holdout else np.nan for step in history.steps],
        "test data": [step.test.rmse if step.test else np.nan for step in history.steps],
    }
    lines = {name: values for name, values in lines.items() if np.isfinite(values).any()}
    shown = [noise, *(value for values in lines.values() for value in values if np.isfinite(value))]
    log = max(shown) > _WIDE * min(shown)
    up = (0.7 * min(shown), 1.3 * max(shown)) if log else (0.0, 1.1 * max(shown))
    draw = Drawing(292)
    panel = Panel(draw, (60, 28, WIDE - 20, 232), (-0.5, best + 0.5), up, log_up=log)
    looks = {"fit data": "line-fit", "held-out data": "line-held", "test data": "line-test"}
    draw.legend(70, 16, [(looks[name], name) for name in lines])
    panel.level(noise, noise, "zero")
    draw.text(WIDE - 22, float(panel.y(noise)) - 4, f"sensor noise alone, {kelvin(noise, 2)}", "end")
    places = np.arange(best + 1, dtype=float)
    for name, values in lines.items():
        panel.line(places, np.array(values), looks[name])
        for place, value in enumerate(values):
            if np.isfinite(value):
                look = "dot-given" if place == 0 else "dot-best" if place == best else "dot"
                draw.dot(float(panel.x(place)), float(panel.y(value)), look, f"{name}: {kelvin(value)}")
    wide = (WIDE - 80) / (best + 1)
    for place, step in enumerate(history.steps):
        x = float(panel.x(place))
        words = [f"{place}", "as given"] if step.effect is None else [str(place), f"+ {title_of(step.effect)}"]
        words += [place_of(step.at)] if step.at else []
        for number, line in enumerate(words):
            most = max(int(wide / LETTER), 6)
            draw.text(x, 250 + 14 * number, line if len(line) <= most else f"{line[: most - 1]}…", "middle")
    panel.frame("", "RMSE [K]", numbers=False)
    return draw.svg("RMSE of each step on fit, held-out and test data")


# --- how probable each effect is ------------------------------------------------------------------------------


_BAR = 18.0  # px


def probability_figure(history: History) -> Markup:
    """How probable each effect is that was added, and each that was fitted beside that and refused.

    Args:
        history: some effect of which was weighed (see `weighed_effects`).
    """
    shown = weighed_effects(history)
    names = [named(*step.key) for step in shown]
    left = min(LETTER * max(map(len, names)) + 14, 430.0)
    bottom = 6 + _BAR * len(shown)
    draw = Drawing(bottom + 40)
    panel = Panel(draw, (left, 4, WIDE - 20, bottom), (0.0, 1.0), (0.0, 1.0))
    for row, (step, name) in enumerate(zip(shown, names, strict=True)):
        look = "bar-added" if step in history.steps else "bar hollow"
        top = 6 + _BAR * row
        draw.text(left - 6, top + 12, name, "end")
        width = float(panel.x(step.probability)) - left
        draw.rect(left, top + 2, width, _BAR - 5, look, f"{name}: {percent(step.probability)} probable")
    at = float(panel.x(LIKELY))
    draw.line(at, 2, at, bottom, "line-limit")
    panel.frame("probability [1]", rows=True)
    return draw.svg("probability of each effect that was fitted")


# --- what the data could have shown: the smallest size of each effect that they would reveal ----------------


_LEAST_REACH, _MOST_REACH = 1e-3, 1e3  # shares of the typical size beyond which nobody asks for more
_HIDDEN = 1.0  # share of the typical size from which an effect could hide


def detectability_figure(sizes: list[Detectable]) -> Markup:
    """Smallest size that would show, as a share of the typical one, from the easiest place to the hardest.

    Args:
        sizes: of `lptn.diagnose.advice.smallest`.
    """
    rows = reaches(sizes)
    shown = [
        tuple(np.clip([reach.easiest.share_of_typical, reach.hardest.share_of_typical], _LEAST_REACH, _MOST_REACH))
        for reach in rows
    ]
    names = [title_of(reach.easiest.effect) for reach in rows]
    wheres = [
        f"{short_size(reach.easiest.smallest)} {unit_text(reach.easiest.unit)}".removesuffix(" 1")
        + f", {place_of(reach.easiest.at)}"
        for reach in rows
    ]
    left = min(LETTER * max(map(len, names)) + 14, 400.0)
    right = WIDE - min(LETTER * max(map(len, wheres)) + 14, 240.0)
    bottom = 22 + _BAR * len(rows)
    draw = Drawing(bottom + 40)
    low, high = min(min(low for low, _ in shown), _HIDDEN), max(max(high for _, high in shown), _HIDDEN)
    panel = Panel(draw, (left, 18, right, bottom), (0.7 * low, 1.4 * high), (0.0, 1.0), log=True)
    draw.text(WIDE, 12, "smallest, and where", "end", "title")
    for row, (reach, (least, most)) in enumerate(zip(rows, shown, strict=True)):
        y = 22 + _BAR * (row + 0.5)
        first, last = float(panel.x(least)), float(panel.x(most))
        draw.line(first, y, last, y, "line-reach")
        draw.line(last, y - 4, last, y + 4, "line-reach")
        draw.dot(first, y, "dot" if reach.easiest.share_of_typical < _HIDDEN else "dot hollow")
        draw.text(left - 6, y + 4, names[row], "end")
        draw.text(right + 8, y + 4, wheres[row])
    at = float(panel.x(_HIDDEN))
    draw.line(at, 16, at, bottom, "line-limit")
    panel.frame("smallest size that would show, as a share of the typical size [1]", rows=True)
    return draw.svg("smallest size of each effect that would show")
