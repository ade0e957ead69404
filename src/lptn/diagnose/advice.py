"""What to do after a diagnosis: the next experiment, where to look, what could not have been seen."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from lptn.diagnose.diagnosis import Diagnosis
from lptn.diagnose.experiment import Experiment, propose
from lptn.diagnose.runs_that_differ import Differing, runs_that_differ
from lptn.diagnose.scores import Detectable, smallest
from lptn.diagnose.unexplained_heat import Stretch, largest, unexplained_heat
from lptn.identify.data import DataSplit
from lptn.identify.fitting import Fit

_RIVALS = 4  # names for one answer among which an experiment has to decide
_LISTED = 40  # smallest sizes that are told to other tools; the page shows fewer
Report = Callable[[str], None]


@dataclass(frozen=True)
class Advice:
    """What a diagnosis leaves to be done.

    Args:
        experiment: the run that best tells the names of the first answer apart; `None` for one name, or where no
            run is possible.
        heat: where and when the last model lacks heat most surely, `None` where it surely lacks none.
        detectable: the smallest size of each effect that the data would reveal, the easiest to see first.
        differing: held-out runs in which one parameter seems to differ.
    """

    experiment: Experiment | None
    heat: Stretch | None
    detectable: list[Detectable]
    differing: list[Differing]

    @property
    def sentences(self) -> list[str]:
        """What a person wants to read, most urgent first."""
        told = [each.text() for each in self.differing]
        if self.heat is not None:
            told.append(f"Where heat is most clearly unexplained: {self.heat.text()}.")
        if self.experiment is not None:
            told.append(f"Next experiment: {self.experiment.text()}")
        return told

    def as_json(self) -> dict[str, object]:
        """The advice as other tools read it."""
        return {
            "experiment": self.experiment.as_json() if self.experiment else None,
            "unexplained_heat": self.heat.text() if self.heat else None,
            "runs_that_differ": [each.as_json() for each in self.differing],
            "detectable": [each.as_json() for each in self.detectable[:_LISTED]],
        }


def advise(found: Diagnosis, last: Fit, data: DataSplit, report: Report = lambda _: None) -> Advice:
    """Work out what to do next.

    Args:
        found: the diagnosis of the model as given.
        last: the fit of the model that it led to, or of the given one.
        data: the runs, in the steps of the search.
        report: told what is being done.
    """
    report("looking for what is left, and for the next experiment")
    answer = found.refits[:1]
    rivals = [step for step in found.refits if answer and step.key in (answer[0].key, *answer[0].indistinguishable)]
    # What is missing shows in held-out runs as well: as long as it is not added, nothing is said of the runs.
    added = last is not found.fit or found.verdict != "missing"
    return Advice(
        propose(rivals[:_RIVALS]) if len(rivals) > 1 else None,
        largest(unexplained_heat(last)),
        smallest(found.scores),
        runs_that_differ(last, data.holdout) if added else [],
    )
