"""What a workbench is opened with: a model file, logs, options; or an example."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from importlib.resources import files
from pathlib import Path

from lptn.basics.errors import InputError
from lptn.basics.files import write_whole
from lptn.identify.fitting import fingerprint_of
from lptn.robots.presets import preset_text
from lptn.study import Study


@dataclass(frozen=True)
class Opening:
    """A model file with its logs: the arguments of `lptn.Study`, by their names; without a model it is no study yet."""

    model: Path | None
    fit: tuple[Path, ...] = ()
    holdout: tuple[Path, ...] = ()
    test: tuple[Path, ...] = ()
    holdout_after: float | str | None = None
    columns: tuple[str, ...] = ()
    ambient_error: float | None = None
    torque_error: float | None = None
    surface_error: float | None = None

    @property
    def logs(self) -> tuple[Path, ...]:
        """All of them: to fit, held out, for the test."""
        return (*self.fit, *self.holdout, *self.test)

    def absolute(self) -> Opening:
        """The same files from any folder."""
        fit, holdout, test = (tuple(path.absolute() for path in job) for job in (self.fit, self.holdout, self.test))
        return replace(self, model=self.model and self.model.absolute(), fit=fit, holdout=holdout, test=test)

    def study(self, executor: Executor | None = None) -> Study:
        """Read it all.

        Args:
            executor: where refits run; here by default.

        Raises:
            InputError: a file can't be used, or there is no model.
        """
        if self.model is None:
            raise InputError("the study", "model", "none", "a model file")
        return Study(**vars(self) | {"model": self.model}, executor=executor)

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


# --- the examples that are offered where no files are given: an effect is hidden, or really was missing -----------


_LEG_SEED = 3  # arbitrary: the effect is found with any seed


@dataclass(frozen=True)
class Example:
    """A model with its logs.

    Args:
        title: its name on the page.
        about: what is measured, and what is not in the model.
        solved: what there was to find, told at the end.
        opening: writes what is needed into a folder, and says how it is opened.
    """

    title: str
    about: str
    solved: str
    opening: Callable[[Path], Opening]


def _heaters(folder: Path) -> Opening:
    for name in ("two_heaters.toml", "log.csv"):
        write_whole(folder / name, files("lptn.workbench").joinpath("examples", name).read_text(encoding="utf-8"))
    return Opening(folder / "two_heaters.toml", (folder / "log.csv",), holdout_after=300.0)


def _leg(folder: Path) -> Opening:
    from lptn.virtual import Hidden, leg_logs, write_logs

    write_whole(folder / "leg.toml", preset_text("leg"))
    logs = leg_logs([Hidden("forced_convection", "FR_thigh")], seed=_LEG_SEED, rate=1.0)
    *fitted, held_out = write_logs(folder, logs)
    return Opening(folder / "leg.toml", tuple(fitted), (held_out,))


EXAMPLES = {
    "tclab": Example(
        "Two heaters, measured",
        "Ten minutes of a heater board with two transistors and two sensors. The model has each heater lose heat to "
        "the air, and nothing else; it is fitted to the first five minutes and tested on the rest.",
        "The sensors lag behind the heaters, and the losses differ from one constant resistance: the model had "
        "neither. The log can't tell these losses from heat that passes between the heaters.",
        _heaters,
    ),
    "leg": Example(
        "A robot's leg, with a secret",
        "Three joints of a virtual leg: two runs to fit, one held out. The simulation behind the logs shares no code "
        "with the model, and has one effect that the model lacks.",
        "The thigh's cooling grows with the robot's speed: forced convection, which the model did not have.",
        _leg,
    ),
}
"""By the name that the page orders."""
