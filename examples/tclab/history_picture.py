# %% [markdown]
# # The picture of the errors falling, as the README shows it
#
# Two heaters fitted on 300 s and predicted for 300 s more, as given and with what `lptn improve` adds; beside it the
# held-out error, step by step. Run it as `python history_picture.py history.png`, or open it as a notebook.

# %%
import sys
from pathlib import Path
from textwrap import wrap

import numpy as np
from matplotlib.figure import Figure

from lptn.basics.style import BEST, FAINT, GIVEN, INK, MEASURED, SHADE, dress, show
from lptn.diagnose.improvement import History, improve
from lptn.identify.comparison import Prediction, compare
from lptn.identify.data import load_model, split_data
from lptn.report.outcome import short_name

here = Path(__file__).parent if "__file__" in globals() else Path.cwd()
loaded = load_model(here / "two_heaters.toml")
data = split_data(loaded.runs([here / "log.csv"]), holdout_after=300.0)
history = improve(loaded.model, data)

# %% Measured black, the model as given blue, the best model green; shaded what was fitted
NODE = 1  # heater2, whose model lacks its neighbour


def draw(history: History, given: Prediction, best: Prediction) -> Figure:
    """Two panels: temperatures in time, errors by step."""
    figure = Figure(figsize=(9.0, 3.0), dpi=100, layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1.25, 1.0])
    time = given.bound.run.time
    left.axvspan(time[0], given.segment.initialisation[1], color=SHADE, linewidth=0)
    left.plot(time, given.readings[NODE], label="model as given", **GIVEN)
    left.plot(time, best.readings[NODE], label="with what was added", **BEST)
    left.plot(time, given.bound.measured[NODE], label="measured", **(MEASURED | {"linewidth": 1.2}))
    left.set_xlabel("time [s]")
    left.set_ylabel("temperature of heater 2 [°C]")
    left.text(230, 21, "fitted", ha="center")
    left.text(450, 21, "predicted", ha="center")
    left.legend(frameon=False, loc="upper left", fontsize=9)
    steps = [step for step in history.steps if step.holdout]
    errors = np.array([step.holdout.rmse for step in steps if step.holdout])
    right.plot(errors, color=FAINT, linewidth=1.2, zorder=1)
    for place, error in enumerate(errors):
        colour = {0: GIVEN["color"], len(errors) - 1: BEST["color"]}.get(place, INK)
        right.plot(place, error, "s", markersize=9, color=colour)
        right.annotate(f"{error:.2f} K", (place, error), (9, 5), textcoords="offset points")
    names = [f"+ {short_name(step)}" if step.effect else "as given" for step in steps]
    right.set_xticks(range(len(steps)), ["\n".join(wrap(name, 12)) for name in names])
    right.set_xlim(-0.4, len(steps) - 0.5)
    right.set_ylim(0.0, 1.15 * errors.max())
    right.set_ylabel("held-out error, RMSE [K]")
    for ax in (left, right):
        dress(ax)
    return figure


models = history.steps[0].fit.model, history.best.fit.model
given, best = (compare(model, data.holdout).predictions[0] for model in models)
figure = draw(history, given, best)
show(figure)
if sys.argv[1:] and sys.argv[1].endswith(".png"):
    figure.savefig(sys.argv[1], metadata={"Software": None})
