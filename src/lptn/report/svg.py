"""Charts written as SVG: the figures of the pages, light and dark, on screen and on paper, in a few milliseconds.

Colours are classes of the page's style sheet, so that they follow it into the dark and onto paper.
"""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from math import ceil, floor, log10

import numpy as np
from markupsafe import Markup

from lptn.basics.arrays import FloatArray

WIDE = 900.0  # px; fills the page and still prints legibly on A4
LETTER = 6.6  # px, the width of a letter of the figures' text
TEXT = 11.5  # px, its height; as in the style sheet

_TICK_ROOM = 62.0  # px between the numbers of an axis
_FINE = (1.0, 2.0, 5.0)
_TIMES = (1.0, 2.0, 5.0, 10.0, 20.0, 30.0, 60.0, 120.0, 300.0, 600.0, 1200.0, 1800.0)


class Drawing:
    """An SVG that is being written; lengths in px from its upper left corner."""

    def __init__(self, height: float, width: float = WIDE) -> None:
        self.width, self.height = width, height
        self._parts: list[str] = []

    def text(self, x: float, y: float, words: str, anchor: str = "start", look: str = "") -> None:
        """Words at the baseline `y`; `anchor` is start, middle or end."""
        style = f' class="{look}"' if look else ""
        place = "" if anchor == "start" else f' text-anchor="{anchor}"'
        self._parts.append(f'<text x="{x:.1f}" y="{y:.1f}"{place}{style}>{escape(words)}</text>')

    def upright(self, x: float, y: float, words: str) -> None:
        """Words that are read from below, around their middle; lines by `\\n`."""
        lines = words.split("\n")
        for number, line in enumerate(lines):
            at = x - 13 * (len(lines) - 1 - number)
            self._parts.append(
                f'<text transform="translate({at:.1f} {y:.1f}) rotate(-90)" text-anchor="middle">{escape(line)}</text>'
            )

    def rect(
        self, x: float, y: float, width: float, height: float, look: str, title: str = "", share: float = 1.0
    ) -> None:
        """A filled box; `share` is how strong its colour is."""
        about = f"<title>{escape(title)}</title>" if title else ""
        pale = f' fill-opacity="{share:.2f}"' if share < 1 else ""
        size = f'x="{x:.1f}" y="{y:.1f}" width="{max(width, 0):.1f}" height="{max(height, 0):.1f}"'
        self._parts.append(
            f'<rect class="{look}" {size}{pale}>{about}</rect>' if about else f'<rect class="{look}" {size}{pale}/>'
        )

    def line(self, x1: float, y1: float, x2: float, y2: float, look: str) -> None:
        """A straight line."""
        self._parts.append(f'<path class="{look}" d="M{x1:.1f} {y1:.1f}L{x2:.1f} {y2:.1f}"/>')

    def dot(self, x: float, y: float, look: str, title: str = "", radius: float = 4.0) -> None:
        """A round mark."""
        about = f"<title>{escape(title)}</title>" if title else ""
        self._parts.append(f'<circle class="{look}" cx="{x:.1f}" cy="{y:.1f}" r="{radius:g}">{about}</circle>')

    def path(self, xs: FloatArray, ys: FloatArray, look: str) -> None:
        """A line through points; it has a gap where one is missing."""
        drawn, pen = [], False
        for x, y in zip(np.round(xs, 1).tolist(), np.round(ys, 1).tolist(), strict=True):
            if y != y or x != x:
                pen = False
                continue
            drawn.append(f"{'L' if pen else 'M'}{x:g} {y:g}")
            pen = True
        if drawn:
            self._parts.append(f'<path class="{look}" d="{"".join(drawn)}"/>')

    def area(self, xs: FloatArray, low: FloatArray, high: FloatArray, look: str) -> None:
        """What lies between two lines."""
        finite = np.isfinite(low) & np.isfinite(high)
        if finite.any():
            points = np.concatenate([np.stack([xs, high], 1)[finite], np.stack([xs, low], 1)[finite][::-1]])
            drawn = "L".join(f"{x:.1f} {y:.1f}" for x, y in points.tolist())
            self._parts.append(f'<path class="{look}" d="M{drawn}Z"/>')

    def boxes(self, boxes: Sequence[tuple[float, float, float, float]], look: str, share: float) -> None:
        """Many filled boxes (x, y, width, height) of one colour."""
        if boxes:
            drawn = "".join(f"M{x:.1f} {y:.1f}h{width:.1f}v{height:.1f}h{-width:.1f}z" for x, y, width, height in boxes)
            self._parts.append(f'<path class="{look}" fill-opacity="{share:.2f}" d="{drawn}"/>')

    def legend(self, x: float | None, y: float, entries: Sequence[tuple[str, str]]) -> None:
        """A row of what each look means, from `x` or up to the right end: lines of their look, boxes for others."""
        if x is None:
            x = self.width - 6 - sum(46 + LETTER * len(words) for _, words in entries)
        for look, words in entries:
            if look.startswith("line"):
                self.line(x, y - 4, x + 24, y - 4, look)
            else:
                self.rect(x + 4, y - 10, 16, 11, look)
            self.text(x + 30, y, words)
            x += 46 + LETTER * len(words)

    def svg(self, label: str) -> Markup:
        """The `<svg>` element.

        Args:
            label: what it shows, for those who can't see it.
        """
        head = f'viewBox="0 0 {self.width:.0f} {self.height:.0f}" role="img" aria-label="{escape(label)}"'
        return Markup(f'<svg class="chart" {head}>{"".join(self._parts)}</svg>')


class Panel:
    """Axes within a drawing.

    Args:
        drawing: where.
        box: left, top, right and bottom of what the axes enclose [px].
        across: values at its left and right.
        up: values at its bottom and top.
        log: whether values across grow by factors.
        log_up: whether values upward do.
    """

    def __init__(
        self,
        drawing: Drawing,
        box: tuple[float, float, float, float],
        across: tuple[float, float],
        up: tuple[float, float],
        log: bool = False,
        log_up: bool = False,
    ) -> None:
        self.drawing, self.box = drawing, box
        self.across, self.up, self.log, self.log_up = across, up, log, log_up

    def x(self, values: FloatArray | float) -> FloatArray:
        """Places across [px]."""
        left, _, right, _ = self.box
        return left + (right - left) * _share(values, self.across, self.log)

    def y(self, values: FloatArray | float) -> FloatArray:
        """Places from the top [px]."""
        _, top, _, bottom = self.box
        return bottom - (bottom - top) * _share(values, self.up, self.log_up)

    def line(self, xs: FloatArray, ys: FloatArray, look: str) -> None:
        """A line through points."""
        self.drawing.path(self.x(xs), self.y(ys), look)

    def span(self, start: float, stop: float, look: str) -> None:
        """A shaded stretch across."""
        left, right = (float(self.x(min(max(value, self.across[0]), self.across[1]))) for value in (start, stop))
        if right > left:
            self.drawing.rect(left, self.box[1], right - left, self.box[3] - self.box[1], look)

    def level(self, low: float, high: float, look: str) -> None:
        """A shaded band between two values upward."""
        bottom, top = (float(self.y(min(max(value, self.up[0]), self.up[1]))) for value in (low, high))
        self.drawing.rect(self.box[0], top, self.box[2] - self.box[0], max(bottom - top, 0.6), look)

    def frame(self, below: str = "", beside: str = "", numbers: bool = True, rows: bool = False) -> None:
        """Axes with their numbers and labels.

        Args:
            below: the label across; it also says whether the axis is one of time.
            beside: the label upward.
            numbers: whether numbers and label stand below.
            rows: whether rows with names of their own stand above each other, in place of numbers upward.
        """
        left, top, right, bottom = self.box
        draw = self.drawing
        draw.line(left, top, left, bottom, "axis")
        draw.line(left, bottom, right, bottom, "axis")
        sizes = _TIMES if "time" in below else _FINE
        for value in ticks(*self.across, max(int((right - left) / _TICK_ROOM), 2), self.log, sizes):
            at = float(self.x(value))
            draw.line(at, bottom, at, bottom + 3, "axis")
            if numbers:
                draw.text(at, bottom + 15, plain(value), "middle")
        up = [] if rows else ticks(*self.up, max(int((bottom - top) / 26), 2), self.log_up)
        for value in up:
            at = float(self.y(value))
            draw.line(left - 3, at, left, at, "axis")
            draw.text(left - 6, at + 4, plain(value), "end")
        if below and numbers:
            draw.text((left + right) / 2, bottom + 30, below, "middle")
        if beside:
            draw.upright(left - 40, (top + bottom) / 2, beside)


def _share(values: FloatArray | float, ends: tuple[float, float], log: bool) -> FloatArray:
    low, high = ends
    if log:
        low, high = log10(low), log10(high)
        values = np.log10(np.maximum(values, 1e-300))
    return (np.asarray(values, dtype=float) - low) / ((high - low) or 1.0)


def ticks(low: float, high: float, most: int, log: bool = False, sizes: Sequence[float] = _FINE) -> list[float]:
    """Round numbers from `low` to `high`, at most about so many."""
    if log:
        decades = range(floor(log10(low)) - 1, ceil(log10(high)) + 1)
        for steps in (_FINE, (1.0,)):
            values = [step * 10.0**power for power in decades for step in steps]
            values = [value for value in values if low * 0.999 <= value <= high * 1.001]
            if len(values) <= max(most, 3):
                break
        return values
    span = max(high - low, 1e-12)
    powers = (1.0,) if sizes is not _FINE and span > 3 else tuple(10.0**power for power in range(-9, 12))
    candidates = [size * power for power in powers for size in sizes]
    size = next((candidate for candidate in candidates if span / candidate <= most), candidates[-1])
    if span / size > 2 * most:  # beyond the list of round times
        return ticks(low, high, most)
    return [number * size for number in range(ceil(low / size - 1e-9), floor(high / size + 1e-9) + 1)]


def plain(value: float) -> str:
    """A tick as people write it: no exponent where it can be read without, a minus that is no hyphen."""
    return f"{value:.6g}".replace("-", "−")


def margin(low: float, high: float, share: float = 0.06) -> tuple[float, float]:
    """Ends of an axis around values that lie between `low` and `high`."""
    room = share * (high - low) or 0.5
    return low - room, high + room


# --- colours of cells ----------------------------------------------------------------------------------------


_STRENGTHS = 20  # shades that are told apart in a map


def strength(share: float) -> float:
    """How strong a colour is drawn for a share of the scale's end."""
    return round(min(max(share, 0.0), 1.0) * _STRENGTHS) / _STRENGTHS
