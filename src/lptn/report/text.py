"""Numbers and names as people read them."""

from __future__ import annotations

import math
import re
from dataclasses import replace

from lptn.basics.words import short_size
from lptn.diagnose.answers import Step
from lptn.effects import Effect, catalogue
from lptn.identify.data import Segment, Window
from lptn.identify.fitting import Fit
from lptn.logs.columns import column_unit

NOTHING = "–"
_EVERYWHERE = "everywhere"
_MINUS = re.compile(r"(?<![\w.-])-(?=\d)")


def kelvin(value: float | None, digits: int = 3) -> str:
    """A temperature difference with its unit; a dash for none."""
    return NOTHING if value is None or not math.isfinite(value) else f"{significant(value, digits)} K"


def signed_kelvin(value: float) -> str:
    """A mean error with its sign, two digits."""
    return NOTHING if not math.isfinite(value) else f"{value:+#.2g} K".replace("-", "−").replace(". K", " K")


def significant(value: float, digits: int) -> str:
    """So many digits, zeros among them: 1.00, not 1; all of those before the point."""
    if abs(value) >= 10.0**digits:
        return f"{value:.0f}"
    return f"{value:#.{digits}g}".rstrip(".")


def number(value: float, digits: int = 4) -> str:
    """A number with so many significant digits."""
    return f"{value:.{digits}g}" if math.isfinite(value) else NOTHING


def short(value: float) -> str:
    """Three digits, and no exponent in the thousands."""
    return f"{value:.0f}" if 1000 <= abs(value) < 1e6 else f"{value:.3g}"


_CERTAIN = 0.99


def percent(probability: float) -> str:
    """A probability; what is nearly certain is `> 99 %`, what hardly can be `< 1 %`."""
    if probability > _CERTAIN:
        return "> 99 %"
    return "< 1 %" if probability < 1 - _CERTAIN else f"{100 * probability:.0f} %"


_IN_WORDS = ((0.99, "virtually certain"), (0.9, "very likely"), (0.66, "likely"), (0.33, "about as likely as not"))
"""From which probability on which word: the scale of the IPCC's guidance note on uncertainties (2010)."""


def certainty(probability: float) -> str:
    """A probability in a word and a number, such as `very likely, 98 %`."""
    word = next((word for least, word in _IN_WORDS if probability >= least), "unlikely")
    return f"{word}, {percent(probability)}"


def unit_text(unit: str) -> str:
    """`m^2` as people write it."""
    return unit.replace("^2", "²").replace("*", "·").replace("ohm", "Ω")


def unit_of(column: str) -> str:
    """The unit of a log's column, `as logged` where its quantity has none."""
    unit = column_unit(column)
    return "as logged" if unit in ("", "1") else unit_text(unit).replace("degC", "°C")


def time_span(seconds: float) -> str:
    """A length of time in s, min or h."""
    if seconds < 99.5:
        return f"{seconds:.3g} s"
    return f"{seconds / 60:.3g} min" if seconds < 36000 else f"{seconds / 3600:.3g} h"


def bin_text(quantity: str, lower: float, upper: float) -> str:
    """A bin of an operating condition: `temperature 46.7 to 54.8 °C`."""
    name, _, unit = quantity.partition(" [")
    return f"{name} {short(lower)} to {short(upper)} {unit.rstrip(']')}".rstrip()


def window_text(window: Window, segment: Segment) -> str:
    """A window of a run, counted from the run's origin; "all" for the whole run."""
    run = segment.run
    first, last = float(run.time[0]), float(run.time[-1] + run.step)
    start, stop = max(window[0], first), min(window[1], last)
    return "all" if (start, stop) == (first, last) else f"{start - run.origin:g} to {stop - run.origin:g} s"


# --- effects and places ---------------------------------------------------------------------------


def title_of(effect: str) -> str:
    """An effect's title."""
    return catalogue()[effect].title if effect in catalogue() else effect


def place_of(at: str) -> str:
    """A place as people call it, and the run where the effect acts in one alone."""
    place, _, run = at.partition("@")
    place = _EVERYWHERE if place == "*" else place
    name = run if run.lower().startswith("run") else f"run {run}"
    return f"{place} in {name}" if run else place


def named(effect: str, at: str) -> str:
    """An effect and its place, in words."""
    place = place_of(at)
    return f"{title_of(effect)} {place}" if place.startswith(_EVERYWHERE) else f"{title_of(effect)} at {place}"


def experiment_for(effect: type[Effect]) -> str:
    """The experiment that separates an effect from its rivals."""
    return effect.signature.separate_by.replace("degC", "°C")


# --- sizes of effects ---------------------------------------------------------------------------------


def size_text(step: Step, last: Fit) -> str:
    """The size of an effect with its standard error, such as `0.11 ± 0.014 W`; empty where it has none.

    A deviation from the common value is printed with its sign; what a place has in place of it, beside it.

    Args:
        step: the effect.
        last: a fit of a model that has it.
    """
    size = replace(step, fit=last).size_parameter
    if size is None or step.declaration is None:
        return ""
    sign = "+" if step.declaration.difference and size.value > 0 else ""
    error = last.standard_errors.get(size.name, math.inf)
    text = f"{sign}{value_in_words(size.value, error, size.declared.unit_behind)}"
    common = last.model.network.instead_of(step.declaration)
    shared = last.model.named.get(common.shared_name(size.declared.name)) if common else None
    return f"{text} where others have {short_size(shared.value)}" if shared else text


def value_in_words(value: float, error: float, unit: str) -> str:
    """A fitted value with its standard error and unit, such as `3 ± 0.04 W`."""
    spread = f" ± {short_size(error)}" if math.isfinite(error) else ""
    return f"{'−' if value < 0 else ''}{short_size(abs(value))}{spread}{unit_text(unit)}"


# --- sentences --------------------------------------------------------------------------------------


def capitalised(text: str) -> str:
    """A text as the beginning of a sentence."""
    return text[:1].upper() + text[1:]


def for_people(text: str) -> str:
    """A sentence of the library as it is printed: titles for keys, `°C` for `degC`, a minus that is no hyphen.

    Text that has this form already is unchanged.
    """
    keys = "|".join(sorted(catalogue(), key=len, reverse=True))

    def titled(match: re.Match[str]) -> str:
        # "air of a logged fan at a_hip" ends in the key "fan".
        title = match.string[: match.end(1)].endswith(title_of(match[1]))
        return match[0] if title else named(match[1], match[2])

    text = re.sub(rf"\b({keys}) at ([^\s,;]*[^\s,;.])", titled, text)
    return _MINUS.sub("−", text.replace("degC", "°C").replace("N*m", "N·m"))
