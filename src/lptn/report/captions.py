"""Captions of figures: one plain sentence on what to see in each."""

from __future__ import annotations

from collections.abc import Sequence

from lptn.diagnose.advice import Detectable
from lptn.diagnose.improvement import History
from lptn.identify.comparison import Comparison
from lptn.identify.data import DataSplit
from lptn.report.narrative import largest_error
from lptn.report.shown import MOST, NOISE_BAND, initialisation_end, reaches, views


def of_history(history: History) -> str:
    """Under the falling errors."""
    last = len(history.steps) - 1
    held = "judge it by the held-out errors" if history.best.holdout else "no data were held out to test it"
    return f"RMSE from the model as given (step 0, blue) to the best model (step {last}, green); {held}."


def of_conditions(given: Comparison, best: Comparison | None, which: str) -> str:
    """Under the maps of where a model fails."""
    text = f"RMSE in K on the {which} runs by node and operating condition; the small numbers are each bin's range."
    for model, comparison in (("model as given" if best else "model", given), ("best model", best)):
        if comparison is not None:
            text += f" Largest error of the {model}: {largest_error(comparison).text}"
    return text


def of_predictions(
    given: Comparison,
    best: Comparison | None,
    data: DataSplit,
    which: str,
    names: tuple[str, str] = ("the model as given", "the best model"),
) -> str:
    """Under measured and predicted temperatures."""
    lines = f"The blue line is {names[0]}, the green one {names[1]}" if best else "The blue line is the model"
    below = f"below, the error (predicted − measured), and ±{NOISE_BAND:g} times the sensor noise in grey"
    text = f"Temperatures on the {which} runs. {lines}; {below}."
    if any(initialisation_end(prediction) is not None for prediction in given.predictions):
        fitted = {segment.run.name for segment in data.fit}
        same = all(prediction.segment.run.name in fitted for prediction in given.predictions)
        shaded = "the shaded time, which was fitted," if same else "the shaded time"
        text += f" Readings in {shaded} only set the start; what follows is predicted freely."
    else:
        text += " The start was fitted along with these readings, so this is no test."
    count = len(views(given))
    chosen = f"the worst {MOST} of {count}" if count > MOST else "all measured"
    return f"{text} Shown are {chosen} nodes and runs."


def of_errors(which: str) -> str:
    """Under the map of errors by node and time."""
    text = f"Error (predicted − measured) on the {which} runs: red where the model is too hot, blue where too cold"
    return f"{text} (hatched where clearly so)."


def of_detectability(sizes: Sequence[Detectable]) -> str:
    """Under what the data could have shown."""
    rows = reaches(sizes)
    hidden = sum(reach.easiest.share_of_typical >= 1 for reach in rows)
    return (
        "The dot is the place where the smallest effect would be detected, the end of the line the place where only "
        "the largest would. An effect that was not found is smaller, or absent. Right of the dashed line even one of "
        f"typical size could be missed ({hidden} of {len(rows)} effects wherever they are)."
    )
