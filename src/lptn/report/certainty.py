"""How sure the ladder is: what chance would do, what else fits as well, which data say so."""

from __future__ import annotations

from collections.abc import Sequence

from lptn.diagnose import Finding
from lptn.evidence import Evidence, Part
from lptn.ladder import Ladder, Rung
from lptn.report.text import listed, named, within

_FEW = 4  # names in a row


def how_sure(ladder: Ladder) -> str:
    """How sure each rung is; empty where none was added, or none explains the misfit."""
    if ladder.verdict != "missing":
        return ""
    return " ".join(_sure(ladder, number, rung) for number, rung in enumerate(ladder.rungs) if rung.effect)


def _sure(ladder: Ladder, number: int, rung: Rung) -> str:
    found = finding_of(ladder, rung)
    told = f"How sure is rung {number}, {named(rung.effect or '', rung.at or '')}? "
    if found is not None:
        told += f"Chance alone would score as much in {share_by_chance(ladder, found)} of logs. "
    if not rung.alike:
        return told + "Nothing else in the catalogue explains the fitted runs about as well."
    verb = "explains" if len(rung.alike) == 1 else "explain"
    others = f"{_few([named(*key) for key in rung.alike])} {verb}"
    if all(effect == rung.effect for effect, _ in rung.alike):
        return told + f"The effect is clear, its place is not: {others} the fitted runs about as well."
    chose = "; the held-out runs chose" if rung.holdout else ""
    return told + f"The fitted runs alone cannot tell: {others} them about as well{chose}."


def _few(items: Sequence[str]) -> str:
    """A list that nobody has to read to its end."""
    return listed(items) if len(items) <= _FEW else f"{', '.join(items[: _FEW - 1])} and {len(items) - _FEW + 1} others"


def share_by_chance(ladder: Ladder, found: Finding) -> str:
    """How often chance alone scores as much, in percent; the number of simulated logs sets the finest answer."""
    finest = 1.0 / (1 + len(ladder.first.scores.chance))
    at_most = "at most " if found.p_value <= finest * (1 + 1e-9) else ""
    return f"{at_most}{100 * found.p_value:.2g} %"


def finding_of(ladder: Ladder, rung: Rung) -> Finding | None:
    """What the first diagnosis says of a rung, where it looked at it."""
    if rung is not ladder.rungs[1]:
        return None
    return next((each for each in ladder.first.findings if each.key == (rung.effect, rung.at)), None)


def which_data(ladder: Ladder, data: Evidence) -> str:
    """Which runs fitted, which chose, which proved."""
    told = f"Parameters were fitted, and effects proposed, on {_runs(data.fit)}."
    if not data.holdout:
        told += " No data were held out: the ladder ends where a further effect does not pay for its parameters."
    else:
        among = "" if ladder.considered == 1 else f"chose among the {ladder.considered} models that were followed, and "
        told += (
            f" Held out: {_runs(data.holdout)}. No parameter was fitted to it; it {among}says where the ladder ends."
        )
    if data.proof:
        return f"{told} Proof: {_runs(data.proof)}. It chose nothing, so its error is the one to quote."
    if len(ladder.rungs) == 1:
        return told
    missing = "nothing proves the result" if not data.holdout else "the held-out error is a little flattering"
    return f"{told} There are no proof runs, so {missing}; one more log, given with --proof, would tell."


def _runs(parts: Sequence[Part]) -> str:
    """Runs by name, and which stretch of them counts where it is not all."""
    stretches = [(part.run.name, within(part.counted, part)) for part in parts]
    return _few([name if stretch == "all" else f"{name} ({stretch})" for name, stretch in stretches])
