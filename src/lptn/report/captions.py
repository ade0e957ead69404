"""One plain sentence under each figure: what to see in it."""

from __future__ import annotations

from collections.abc import Sequence

from lptn.compare import Comparison, Condition
from lptn.diagnose.confusable import ALIKE, Confusability
from lptn.diagnose.detectable import Detectable
from lptn.evidence import Evidence
from lptn.ladder import Ladder
from lptn.report.conditions import worst
from lptn.report.detectability import reaches
from lptn.report.ranking import candidates_shown
from lptn.report.text import kelvin, listed, spanned
from lptn.report.timeseries import MOST, NOISE_BAND, opening_end, views

_PLAIN = 0.5  # share of the RMSE from which its mean is worth a word


def of_ladder(ladder: Ladder) -> str:
    """Under the falling errors."""
    last = len(ladder.rungs) - 1
    held = "the held-out errors say where it ends" if ladder.best.holdout else "no held-out errors check it"
    return f"RMSE from the model as given (rung 0) to the best model (rung {last}), blue and green; {held}."


def of_maps(given: Comparison, best: Comparison | None, which: str) -> str:
    """Under the maps of where a model fails."""
    told = f"RMSE in K on the {which} runs by node and operating condition; the small numbers are each bin's range."
    place = worst(given)
    if place is not None:
        model = "The model as given" if best else "The model"
        told += f" {model} fails worst at {_where(place)}."
    left = worst(best) if best else None
    return told if left is None else f"{told} The best model's worst is {_where(left)}."


def of_predictions(given: Comparison, best: Comparison | None, data: Evidence, which: str) -> str:
    """Under measured and predicted temperatures."""
    lines = (
        "The blue line is the model as given, the green one the best model" if best else "The blue line is the model"
    )
    below = f"below, predicted minus measured, and ±{NOISE_BAND:g} times the sensor noise in grey"
    told = f"Temperatures on the {which} runs. {lines}; {below}."
    if any(opening_end(prediction) is not None for prediction in given.predictions):
        fitted = {part.run.name for part in data.fit}
        same = all(prediction.part.run.name in fitted for prediction in given.predictions)
        found = "the shaded stretch, which was fitted," if same else "the shaded opening"
        told += f" Readings in {found} only set the start; what follows is predicted freely."
    else:
        told += " The start was fitted along with these readings, so this is no proof."
    count = len(views(given))
    return f"{told} {_chosen(count)}"


def of_error_map(which: str) -> str:
    """Under the map of errors by node and time."""
    told = f"Predicted minus measured on the {which} runs: red where the model is too hot, blue where too cold"
    return f"{told} (hatched where clearly so)."


def of_confusion(found: Confusability) -> str:
    """Under the likeness of candidates' traces."""
    told = "How alike the traces are that candidates leave on the fitted runs, once the parameters have adapted."
    if not found.groups():
        return (
            f"{told} No two of the best reach {ALIKE:g}, so these data tell them apart if the effects are large enough."
        )
    numbers = {key: str(number) for number, key in enumerate(found.keys, start=1)}
    groups = "; ".join(
        "all of them" if len(group) == len(numbers) else listed([numbers[key] for key in group])
        for group in found.groups()
    )
    return f"{told} Linked by {ALIKE:g} or more, so to first order one answer with several names: {groups}."


def of_detectability(found: Sequence[Detectable]) -> str:
    """Under what the data could have shown."""
    rows = reaches(found)
    hidden = sum(each.easiest.share >= 1 for each in rows)
    told = "The dot is the place where an effect shows most easily, the end of the line where it hides best."
    told += " An effect that was not found is smaller than that, or absent; right of the dashed line even one of"
    told += f" typical size could hide ({hidden} of {len(rows)} effects wherever they are)."
    return told


def of_ranking(ladder: Ladder) -> str:
    """Under the ranking of candidates."""
    shown, whole = len(candidates_shown(ladder.first)), len(ladder.first.scores.ranked)
    told = "How far each candidate scores beyond chance; chance alone passes the dashed line once in twenty logs."
    if ladder.first.findings:
        told += " Filled bars were refitted."
    if len(ladder.rungs) > 1:
        told += " Green ones stand on the ladder."
    return told if shown == whole else f"{told} The {whole - shown} not shown score lower or nothing."


def _chosen(count: int) -> str:
    return f"Shown are the worst {MOST} of {count} nodes and runs." if count > MOST else "All measured nodes are shown."


def _where(cell: Condition) -> str:
    """A condition, its error, and to which side."""
    told = f"{cell.node}, {spanned(cell.quantity, cell.lower, cell.upper)}, with {kelvin(cell.errors.rmse, 2)}"
    if abs(cell.errors.mean) < _PLAIN * cell.errors.rmse:
        return told
    return f"{told}, predicted too {'hot' if cell.errors.mean > 0 else 'cold'}"
