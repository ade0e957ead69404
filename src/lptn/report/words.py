"""The story in words: what is missing, how sure, which data say so; and what to do next."""

from __future__ import annotations

from math import sqrt

import numpy as np

from lptn.evidence import Evidence
from lptn.identify import Fit
from lptn.ladder import Ladder, Rung
from lptn.report.certainty import how_sure, which_data
from lptn.report.text import experiment_for, kelvin, listed, named, title_of

_FAR = 2.0  # multiples of the noise from which an error is no longer called noise
_HELPED = 0.99  # the share of the error below which an error is called smaller


def story_in_words(ladder: Ladder, data: Evidence) -> list[str]:
    """The story, a few sentences to each of: what is missing, how sure, which data say so."""
    told = {"adequate": _adequate, "missing": _missing, "unexplained": _unexplained}[ladder.verdict]
    return [told(ladder, data), *filter(None, [how_sure(ladder)]), which_data(ladder, data)]


def noise_alone(fit: Fit) -> float:
    """The RMSE that the noise of the measured nodes' sensors alone would leave [K]."""
    measured = np.any([driven.counted.any(axis=1) for driven in fit.problem.drives], axis=0)
    return sqrt(float(np.mean(fit.noise.floor[measured] ** 2)))


def _adequate(ladder: Ladder, data: Evidence) -> str:
    only = ladder.rungs[0]
    told = (
        "Nothing is missing that these data can show: on the fitted runs the model as given is wrong by no more than "
        f"the sensors' noise. {_errors(only)}; noise alone leaves about {kelvin(noise_alone(only.fit), 2)}."
    )
    if only.holdout is not None and only.holdout.rmse > _FAR * noise_alone(only.fit):
        told += (
            " On the held-out runs the error is well above the noise. They hold something that the fitted runs "
            "do not: fit on runs like them as well."
        )
    return f"{told} This holds for what the fitted runs cover: {_covered(ladder, data)}."


def _missing(ladder: Ladder, data: Evidence) -> str:
    given, best = ladder.rungs[0], ladder.best
    if best is given:
        return (
            f"The model as given is wrong by more than noise. {_errors(given)}. On the fitted runs an effect of the "
            "catalogue explains most of it, but none that was tried makes the model better by the rule that ends the "
            "ladder, so none was added. Section 5 lists what was tried."
        )
    return f"Missing: {_added(ladder)}. {_fall(given, best)} {_rest(ladder)}"


def _unexplained(ladder: Ladder, data: Evidence) -> str:
    given, best = ladder.rungs[0], ladder.best
    told = (
        "The model as given is wrong by more than the sensors' noise, and the catalogue does not explain it. "
        f"{_errors(given)}; noise alone leaves about {kelvin(noise_alone(given.fit), 2)}."
    )
    if best is given:
        return f"{told} No effect of the catalogue was worth adding."
    return (
        f"{told} The best that could be done is to add {_added(ladder)}. {_fall(given, best)} "
        "Most of the misfit on the fitted runs stays. Do not read what was added as physics."
    )


def _added(ladder: Ladder) -> str:
    return listed([named(rung.effect, rung.at) for rung in ladder.rungs if rung.effect and rung.at])


def _errors(rung: Rung) -> str:
    told = f"Its RMSE is {kelvin(rung.fit.rmse)} on the fitted runs"
    if rung.holdout is not None:
        told += f" and {kelvin(rung.holdout.rmse)} on the held-out ones (largest error {kelvin(rung.holdout.max)})"
    if rung.proof is not None:
        told += f", {kelvin(rung.proof.rmse)} on the proof runs"
    return told


def _fall(given: Rung, best: Rung) -> str:
    pairs = [("on the fitted runs", given.fit.rmse, best.fit.rmse)]
    if given.holdout and best.holdout:
        pairs.append(("on the held-out runs", given.holdout.rmse, best.holdout.rmse))
    if given.proof and best.proof:
        pairs.append(("on the proof runs", given.proof.rmse, best.proof.rmse))
    changes = [f"from {kelvin(before)} to {kelvin(after)} {where}" for where, before, after in pairs]
    told = f"With that the RMSE goes {listed(changes)}."
    worse = [where for where, before, after in pairs if after > _HELPED * before]
    return f"{told} It does not get better {listed(worse, 'or')}." if worse else told


def _rest(ladder: Ladder) -> str:
    if ladder.remaining == "adequate":
        return "What is left on the fitted runs is no more than the sensors' noise."
    noise = kelvin(noise_alone(ladder.best.fit), 2)
    told = f"The best model is still wrong by more than noise, which alone would leave about {noise}; "
    if ladder.remaining == "unexplained":
        return told + "the catalogue explains little of the rest."
    where = "did not help on the held-out ones" if ladder.best.holdout else "did not pay for their parameters"
    return told + f"further effects lowered the error on the fitted runs but {where}."


def fitted_in_words(ladder: Ladder) -> str:
    """What was fitted at first, and how well it follows the runs that it was fitted to."""
    given = ladder.rungs[0]
    free = given.parameters
    told = f"{free} free parameter{'s' if free != 1 else ''}, fitted by weighted least squares. {_errors(given)}; "
    return f"{told}the sensors' noise alone would leave about {kelvin(noise_alone(given.fit), 2)}."


def next_step(ladder: Ladder) -> str:
    """What to do next, in a sentence or two."""
    if ladder.verdict == "adequate":
        return "use the model. Compare it again when the robot works harder, faster or in other air."
    open_ = [rung for rung in ladder.rungs if rung.alike and rung.declaration]
    if ladder.verdict == "unexplained":
        return (
            "look in section 4 for where and when the error grows, and ask what happened then that the log does "
            "not hold: touch, water, a fan, a moved sensor, a load without a column. Log it, or leave that stretch out."
        )
    if ladder.best is ladder.rungs[0]:
        return "measure a longer run with more contrast (rest, load, speed), and diagnose again."
    if not open_:
        return "use the best model." + ("" if ladder.remaining == "adequate" else " Section 4 shows the rest.")
    advice = " ".join(f"For {title_of(rung.effect or '')}: {_ended(_experiment(rung))}" for rung in open_)
    return f"one experiment would tell the candidates apart. {advice} Then fit again with that log."


def _ended(text: str) -> str:
    return text if text.endswith(("?", ".")) else f"{text}."


def _experiment(rung: Rung) -> str:
    return "" if rung.declaration is None else experiment_for(type(rung.declaration.effect))


def _covered(ladder: Ladder, data: Evidence) -> str:
    drives = ladder.rungs[0].fit.problem.drives
    readings = np.concatenate([driven.measured[driven.counted] for driven in drives])
    seconds = sum(len(driven) * driven.run.step for driven in drives)
    return f"{seconds / 60:.3g} min at {readings.min():.0f} to {readings.max():.0f} °C"
