"""The figure of candidates that leave the same trace: what these data can't tell apart."""

from __future__ import annotations

from matplotlib import colormaps
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from lptn.diagnose.confusable import Confusability
from lptn.report.style import SMALL, TEXT, new_figure, plain
from lptn.report.text import named

_ROW, _FRAME = 0.3, 0.75  # inch
_MAP, _DARK = colormaps["cividis_r"], 0.6  # correlation above which writing must be white


def confusion(found: Confusability) -> Figure:
    """Size of the correlation of the candidates' traces, 1 for two that these data can't tell apart at all."""
    count = len(found.keys)
    figure = new_figure(_FRAME + _ROW * count)
    ax = figure.add_subplot()
    norm = Normalize(0.0, 1.0)
    ax.imshow(found.matrix, cmap=_MAP, norm=norm, aspect="auto", interpolation="nearest")
    for row in range(count):
        for column in range(count):
            value = float(found.matrix[row, column])
            ink = "white" if value > _DARK else "black"
            text = "–" if row == column else f"{value:.2f}"
            ax.text(column, row, text, ha="center", va="center", size=SMALL, color=ink)
    ax.set_xticks(range(count), [str(number) for number in range(1, count + 1)])
    ax.set_yticks(
        range(count),
        [f"{plain(named(*key))}\u2002{number}" for number, key in enumerate(found.keys, start=1)],
    )
    ax.xaxis.tick_top()
    ax.tick_params(length=0, labelsize=SMALL)
    ax.spines[:].set_visible(False)
    bar = figure.colorbar(ScalarMappable(norm, _MAP), ax=ax, fraction=0.025, pad=0.01, aspect=20)
    bar.set_label("likeness of traces [1]", size=TEXT)
    bar.ax.tick_params(labelsize=SMALL)
    return figure
