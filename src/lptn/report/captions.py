"""Captions of figures: one plain sentence on what to see in each."""

from __future__ import annotations

from collections.abc import Sequence

from lptn.diagnose.advice import Detectable
from lptn.diagnose.improvement import History
from lptn.identify.comparison import Comparison, Condition
from lptn.identify.data import DataSplit
from lptn.report.shown import MOST, NOISE_BAND, initialisation_end, reaches, views
from lptn.report.tables import worst_condition
from lptn.report.text import bin_text, kelvin

_PLAIN = 0.5  # share of the RMSE from which its mean is worth a word


def of_history(history: History) -> str:
    """Under the falling errors."""
    last = len(history.steps) - 1
    held = "the held-out errors say how good it is" if history.best.holdout else "no held-out errors check it"
    return f"RMSE from the model as given (step 0, blue) to the best model (step {last}, green); {held}."


def of_conditions(given: Comparison, best: Comparison | None, which: str) -> str:
    """Under the maps of where a model fails."""
    text = f"RMSE in K on the {which} runs by node and operating condition; the small numbers are each bin's range."
    for model, comparison in (("model as given" if best else "model", given), ("best model", best)):
        if comparison is not None and (worst := worst_in_words(comparison)):
            text += f" The {model} {worst}."
    return text


def worst_in_words(comparison: Comparison) -> str:
    """Where a model errs most, such as `fails worst at ...`; an error like noise is none. Empty without bins."""
    worst = worst_condition(comparison)
    if worst is None:
        return ""
    cell, is_far = worst
    if not is_far:
        noise = kelvin(comparison.floor(cell.node), 2)
        return f"is nowhere wrong by much more than noise ({noise} there), most at {_where_it_fails(cell)}"
    return f"fails worst at {_where_it_fails(cell)}"


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
        "The dot is the place where an effect shows most easily, the end of the line where it hides best. An effect "
        "that was not found is smaller than that, or absent; right of the dashed line even one of typical size could "
        f"hide ({hidden} of {len(rows)} effects wherever they are)."
    )


OF_PROBABILITIES = (
    "How probable each effect is, beside all else in the model; green ones were added, hollow ones were not. Right of "
    "the dashed line one is missing more probably than not."
)


def _where_it_fails(cell: Condition) -> str:
    """A condition, its error, and to which side."""
    text = f"{cell.node}, {bin_text(cell.quantity, cell.lower, cell.upper)}, with {kelvin(cell.errors.rmse, 2)}"
    if abs(cell.errors.mean) < _PLAIN * cell.errors.rmse:
        return text
    return f"{text}, predicted too {'hot' if cell.errors.mean > 0 else 'cold'}"
