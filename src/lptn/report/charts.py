"""Charts that a reader zooms and hovers on a page: what they show, packed so that many lines stay small.

The page's script (`page/charts.js`) draws them with uPlot, as the workbench does; nothing is loaded from elsewhere.
"""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from datetime import datetime
from typing import Any, Literal

import numpy as np
from markupsafe import Markup

from lptn.basics.arrays import FloatArray

POINTS = 1000
"""Number of points of a line: the smallest and the largest reading of each of 500 intervals."""

Look = Literal["measured", "given", "best", "soft", "heat", "limit", "points"]
_STEPS = 65534  # of a line's range that are told apart; 65535 is a missing value


@dataclass(frozen=True)
class Line:
    """One line of a panel.

    Args:
        name: of its values in a view.
        label: what the legend calls it.
        look: how it is drawn; by default in one of several colours, by `colour`.
        colour: number of the colour of a line without a look; after eight they begin again.
        dots: whether its points are marked.
        steps: whether a value holds until the next point.
    """

    name: str
    label: str
    look: Look | None = None
    colour: int = 0
    dots: bool = False
    steps: bool = False


@dataclass(frozen=True)
class ChartPanel:
    """Axes that share the values across with the other panels of a view.

    Args:
        label: upward, with its unit.
        unit: of the values in the legend.
        lines: those that a view has values for are drawn.
        height: px.
        zero: whether zero is in it, with a line.
        band: names of two lines with their area filled.
        log: whether values grow by factors.
    """

    label: str
    unit: str
    lines: tuple[Line, ...]
    height: int = 150
    zero: bool = False
    band: tuple[str, str] | None = None
    log: bool = False


@dataclass(frozen=True)
class View:
    """What one choice shows.

    Args:
        keys: one for each choice, such as the node and the run.
        title: above it.
        across: key of the values across.
        lines: values by the lines' names, as long as those across, NaN where missing.
        shaded: stretches across that are shaded.
        floor: half-width of a band around zero in the panels that have zero.
        began: the time of day where the values across are zero.
    """

    keys: tuple[str, ...]
    title: str
    across: str
    lines: Mapping[str, FloatArray]
    shaded: Sequence[tuple[float, float]] = ()
    floor: float | None = None
    began: datetime | None = None


@dataclass(frozen=True)
class Charts:
    """Views among which a reader chooses.

    Args:
        across: label of the values across; `time [s]` and `time [min]` get round times.
        panels: above each other.
        views: at least one.
        values: those across, by key.
        choices: what is chosen, with its options in order.
        log: whether the values across grow by factors.
    """

    across: str
    panels: tuple[ChartPanel, ...]
    views: Sequence[View]
    values: Mapping[str, FloatArray]
    choices: Mapping[str, Sequence[str]] = field(default_factory=dict)
    log: bool = False

    def html(self, name: str) -> Markup:
        """The place of the charts and their data, for a page with the script.

        Args:
            name: of the element; `data-charts` of a button that picks a view says it again.
        """
        content: dict[str, Any] = {
            "across": self.across,
            "log": self.log,
            "panels": [asdict(panel) for panel in self.panels],
            "choices": [{"label": label, "options": list(options)} for label, options in self.choices.items()],
            "values": {key: [float(f"{value:.7g}") for value in own.tolist()] for key, own in self.values.items()},
            "views": [
                vars(view)
                | {
                    "lines": {line: packed(values) for line, values in view.lines.items()},
                    "shaded": [[float(f"{end:.7g}") for end in stretch] for stretch in view.shaded],
                    "began": view.began and view.began.timestamp(),
                }
                for view in self.views
            ],
        }
        # It contains users' text, which must not end the element.
        text = json.dumps(content, ensure_ascii=False, separators=(",", ":"), allow_nan=False)
        text = text.replace("<", "\\u003c")
        data = f'<script type="application/json" id="{name}-data">{text}</script>'
        return Markup(f'<div class="charts" id="{name}"></div>{data}')


def packed(values: FloatArray) -> list[Any]:
    """A line as its smallest value, its largest, and steps between them in 16 bits, base64; finer than any screen."""
    finite = np.isfinite(values)
    if not finite.any():
        return [0.0, 0.0, values.size]
    low, high = float(values[finite].min()), float(values[finite].max())
    steps = np.full(values.size, _STEPS + 1, dtype="<u2")
    steps[finite] = np.rint((values[finite] - low) / ((high - low) or 1.0) * _STEPS)
    return [float(f"{low:.9g}"), float(f"{high:.9g}"), base64.b64encode(steps.tobytes()).decode()]
