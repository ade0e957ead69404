"""Figures where somebody looks: below the cell of a notebook."""

from __future__ import annotations

import io
import sys
from importlib import import_module

from matplotlib.figure import Figure


def show(figure: Figure) -> None:
    """Show a figure in a notebook; in a script do nothing.

    Args:
        figure: any figure, such as those of this package, which no window belongs to.
    """
    if "ipykernel" not in sys.modules:
        return
    display = import_module("IPython.display")
    drawn = io.BytesIO()
    figure.savefig(drawn, format="png")
    display.display(display.Image(drawn.getvalue(), width=figure.get_figwidth() * 100))
