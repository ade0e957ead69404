"""A held-out run that differs from the fitted ones: what would explain it, in words and for programs."""

from __future__ import annotations

from dataclasses import dataclass

CLEARLY = 2.0
"""Times the error on the fitted runs: no model predicts quite as well as it fits."""
_LISTED = 3  # rivals that a sentence can carry


@dataclass(frozen=True)
class Cause:
    """One parameter that may be what differs in a run, and how large it would be there.

    Args:
        effect: key of the effect.
        at: its place: a node, a class, or `"*"`.
        amplitude: its amplitude, in the effect's own unit.
        rmse: error of the run behind its opening with it [K].
        words: what it means, a sentence without its full stop.
    """

    effect: str
    at: str
    amplitude: float
    rmse: float
    words: str


@dataclass(frozen=True)
class Differing:
    """A held-out run that a model predicts clearly worse than it fits, and what would explain it.

    The amplitude was fitted on the run itself, so that `rmse_after` is the error of an explanation and
    not of a prediction.

    Args:
        run: its name.
        rmse_before: error of the prediction behind the run's opening [K].
        rmse_fit: error of the model on the fitted runs [K].
        causes: what explains the run, the best first, then what these data can't tell from it; empty where no one
            parameter removes most of the error.
    """

    run: str
    rmse_before: float
    rmse_fit: float
    causes: tuple[Cause, ...]

    @property
    def effect(self) -> str | None:
        """Key of the effect that explains the run best, `None` without any."""
        return self.causes[0].effect if self.causes else None

    @property
    def at(self) -> str | None:
        """Its place."""
        return self.causes[0].at if self.causes else None

    @property
    def amplitude(self) -> float | None:
        """Its amplitude in this run, in the effect's own unit."""
        return self.causes[0].amplitude if self.causes else None

    @property
    def rmse_after(self) -> float | None:
        """Error of the explained run behind its opening [K]."""
        return self.causes[0].rmse if self.causes else None

    @property
    def alike(self) -> tuple[Cause, ...]:
        """Causes that these data can't tell from the best."""
        return self.causes[1:]

    def text(self) -> str:
        """The finding in a few sentences."""
        if not self.causes:
            return (
                f"{self.run} is predicted with an error of {short(self.rmse_before)} K, against "
                f"{short(self.rmse_fit)} K on the fitted runs, and no one parameter that may differ from run to run "
                "explains half of it."
            )
        best = self.causes[0]
        told = (
            f"{_sentence(best.words)} With that its error goes from {short(self.rmse_before)} to {short(best.rmse)} K "
            "(the size was fitted on this run: an explanation, not a prediction)."
        )
        if best.rmse > CLEARLY * self.rmse_fit:
            told += f" It does not explain all: the fitted runs are met within {short(self.rmse_fit)} K."
        if not self.alike:
            return told
        others = "; or: ".join(_told(each.words) for each in self.alike[:_LISTED])
        more = len(self.alike) - _LISTED
        return f"{told} The run can't tell that from: {others}{f'; or {more} more' if more > 0 else ''}."

    def as_json(self) -> dict[str, object]:
        """The finding as other tools read it; what is `null` is not known."""
        return {
            "run": self.run,
            "effect": self.effect,
            "at": self.at,
            "amplitude": self.amplitude,
            "rmse_before": self.rmse_before,
            "rmse_after": self.rmse_after,
            "rmse_fit": self.rmse_fit,
            "alike": [
                {"effect": each.effect, "at": each.at, "amplitude": each.amplitude, "rmse_after": each.rmse}
                for each in self.alike
            ],
            "text": self.text(),
        }


def short(value: float) -> str:
    """Two digits, whole numbers from a hundred on."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.2g}"


def _sentence(words: str) -> str:
    """A sentence that begins and ends as one; a run's name stays as it is."""
    begun = words.replace("in ", "In ", 1) if words.startswith("in ") else words
    return begun if begun.endswith("?") else f"{begun}."


def _told(words: str) -> str:
    """A sentence without the question behind it."""
    return words.rpartition(": ")[0] if words.endswith("?") else words
