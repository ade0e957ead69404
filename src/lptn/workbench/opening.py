"""What a workbench is opened with: a model file, logs, options."""

from __future__ import annotations

from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

from lptn.identify.fitting import fingerprint_of
from lptn.study import Study


@dataclass(frozen=True)
class Opening:
    """A model file with its logs: the arguments of `lptn.Study`, by their names."""

    model: Path
    fit: tuple[Path, ...]
    holdout: tuple[Path, ...] = ()
    test: tuple[Path, ...] = ()
    holdout_after: float | str | None = None
    columns: tuple[str, ...] = ()
    ambient_error: float | None = None
    torque_error: float | None = None
    surface_error: float | None = None

    def study(self, executor: Executor | None = None) -> Study:
        """Read it all.

        Args:
            executor: where refits run; here by default.

        Raises:
            InputError: a file can't be used.
        """
        return Study(**vars(self), executor=executor)

    def fingerprint(self, study: Study) -> str:
        """What tells one session from another: the model's text, the logs' contents and jobs, the options."""
        groups = study.data.by_job.items()
        logs = [(f"{job} {segment.run.name}", segment.run.fingerprint) for job, group in groups for segment in group]
        options = {
            "holdout_after": self.holdout_after,
            "columns": list(self.columns),
            "errors": [study.ambient_error, study.torque_error, study.surface_error],
        }
        return fingerprint_of(study.file.text, logs, options)
