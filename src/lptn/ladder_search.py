"""Ladders followed side by side as long as the fitted data can't tell them apart."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import replace

from lptn.diagnose import MUCH_WORSE, SIGNIFICANT, Diagnosis, examine, tied, unless_interrupted
from lptn.evidence import Evidence
from lptn.identify import finished
from lptn.ladder_climb import WORTH, Climb

_WIDTH, _WIDTH_LATER = 4, 2  # ladders followed side by side where the fitted data can't tell them apart
_BY_HOLDOUT = 2  # more ladders that are looked at because they do well on held-out data
_UNOPPOSED = 1e-3  # share by which a held-out error may rise and still speak against nothing
_ALIAS = 1e-3  # two rungs on one ladder whose misfits differ by less are one rung with two names

Report = Callable[[str], None]


class Search:
    """Follows ladders side by side; remembers every diagnosis and every model it came by.

    Args:
        data: the evidence, in the steps of the search.
        executor: where refits run; here, one after the other, by default.
        report: told what is being done.
    """

    def __init__(self, data: Evidence, executor: Executor | None, report: Report) -> None:
        self.data, self.executor, self.report = data, executor, report
        self.paths: list[Climb] = []
        self._diagnoses: dict[frozenset[tuple[str, str]], Diagnosis] = {}

    def climb(self, root: Climb, most: int) -> None:
        """Follow ladders from a root until nothing is left to add or nothing helps; they end up in `paths`.

        Args:
            root: the given model, fitted.
            most: how many effects to add at most.
        """
        self.paths = [root]
        beam = [root]
        best = root.rank
        for depth in range(1, most + 1):
            if any(self.diagnosis(path).verdict == "adequate" for path in beam):
                return  # nothing is left to add; a longer ladder could only be longer
            width = _WIDTH if depth == 1 else _WIDTH_LATER
            beam = self._next([child for path in beam for child in self._children(path)], width)
            if not beam:
                return
            self.paths += beam
            reached = min(path.rank for path in beam)
            self.report(f"rung {depth}: {_in_words(beam)}")
            # The first of a pair may help nobody alone, so one rung without a gain is allowed at the start.
            if reached > (1 - WORTH) * best and depth > 1:
                return
            best = min(best, reached)

    def diagnosis(self, path: Climb) -> Diagnosis:
        """What a ladder's model lacks, asked once."""
        if path.effects not in self._diagnoses:
            self._diagnoses[path.effects] = examine(path.fit, self.data, executor=self.executor)
        return self._diagnoses[path.effects]

    def complete(self, chosen: Climb) -> Climb:
        """The chosen ladder, or one that leaves nothing unexplained where held-out data have nothing against it."""
        if self.diagnosis(chosen).verdict == "adequate":
            return chosen
        known = [path for path in self.paths if path.effects in self._diagnoses]
        whole = [path for path in known if self.diagnosis(path).verdict == "adequate"]
        unopposed = [path for path in whole if path.rank <= chosen.rank * (1 + _UNOPPOSED)]
        return min(unopposed, key=lambda path: len(path.steps), default=chosen)

    def _children(self, path: Climb) -> list[Climb]:
        children: list[Climb] = []
        for finding in self.diagnosis(path).findings:
            cost = finding.refit.fit.cost
            same = any(abs(child.fit.cost - cost) < _ALIAS * cost for child in children)
            hopeless = finding.refit.fit.status == "given up"
            if finding.p_value < SIGNIFICANT and not same and not hopeless:
                children.append(Climb(finding.refit.fit, (*path.steps, finding), self.data))
        return children

    def _next(self, pool: Sequence[Climb], width: int) -> list[Climb]:
        """The best children and those that the fitted data can't tell from it, each set of effects once."""
        unique: dict[frozenset[tuple[str, str]], Climb] = {}
        for path in sorted(pool, key=lambda each: each.fit.cost):
            unique.setdefault(path.effects, path)
        paths = list(unique.values())
        if not paths:
            return []
        level = [path for path in paths if tied(path.fit, paths[0].fit)]
        # A short log may favour an alias; what held-out data prefer by more than any scatter is followed as well.
        least = min(path.rank for path in level)
        preferred = [path for path in paths if path in level or MUCH_WORSE * path.rank < least]
        by_holdout = sorted(preferred, key=lambda each: each.rank)[:_BY_HOLDOUT]
        # Fits that only ranked candidates ended early: where a valley is long, their held-out errors are accidents.
        followed = [*level[:width], *(path for path in by_holdout if path not in level[:width])]
        fits = (self.executor.map if self.executor else map)(finished, [path.fit for path in followed])
        done = [replace(path, fit=unless_interrupted(fit)) for path, fit in zip(followed, fits, strict=True)]
        best = min(done, key=lambda each: each.rank)
        return done[:width] if best in done[:width] else [*done[:width], best]


def _in_words(beam: Sequence[Climb]) -> str:
    """The ladders of a rung and their errors, for progress."""
    kind = "held out" if beam[0].holdout else "misfit"
    unit = " K" if beam[0].holdout else ""
    named = (f"{path.steps[-1].key[0]} at {path.steps[-1].key[1]} ({kind} {path.rank:.3g}{unit})" for path in beam)
    return "; ".join(named)
