"""The logged input with which unexplained heat correlates, a curve over it with a band, and the offer to add it.

A model is taken linear about its fit, with an unknown heat at each node that wanders (`unexplained_heat`), and now with
a curve over one input besides: the rises of its pieces are unknowns with the prior of a random walk, a smoothness
prior. The filter's innovations, whitened, are linear in them, so that one pass of it gives the posterior and the
evidence of every input alone, in closed form. What is told of the likeliest is an exact fit with that curve in the
model, `lptn.effects.learned_heat`: it explains nothing, and is offered only where it predicts held-out runs better.

Source: a latent function in a grey-box model by Bayesian smoothing and regression ([Kouw2024]).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.processes import one_blas_thread
from lptn.basics.words import listed, short_size
from lptn.diagnose.answers import Step
from lptn.diagnose.candidates import OCCAM
from lptn.diagnose.diagnosis import Diagnosis
from lptn.diagnose.fit_statistics import WORTH
from lptn.diagnose.refits import refit
from lptn.diagnose.unexplained_heat import WIDE, WanderingHeat, means_in_blocks, smoothed, stretches
from lptn.effects.excitation import CHANGE
from lptn.effects.learned_heat import OWN_TEMPERATURE, PIECES, UNNAMED, LearnedHeat
from lptn.identify.bounded_minimum import bounded_minimum
from lptn.identify.data import DataSplit
from lptn.identify.fitting import Fit
from lptn.identify.validation import holdout_errors
from lptn.logs.clock import DAY
from lptn.logs.columns import column_unit
from lptn.logs.run import Run
from lptn.model.heat_balance import input_column
from lptn.model.network import EffectDeclaration

TIME_OF_DAY = "time of day"
"""An input for logs of a day and more, whose clock is assumed to be the day's."""


@dataclass(frozen=True)
class InputShare:
    """One input at one node, and the share of the node's unexplained heat that a curve over it explains.

    Args:
        node: the node.
        column: of the log, or `"time of day"`.
        key: what `LearnedHeat` calls it; empty where the effect has no such input.
        driven_by: the winding that logs it, where that is not the node.
        start: of the curve, in the input's SI unit or degC.
        span: how far it goes.
        share: of the heat's square over all runs, 0 to 1.
        log_odds: logarithm of the odds of the curve to none.
    """

    node: str
    column: str
    key: str
    driven_by: str
    start: float
    span: float
    share: float = 0.0
    log_odds: float = 0.0

    def declaration(self, scale: float) -> EffectDeclaration | None:
        """The curve as an effect at its prior, with all that is given rounded as it is typed; `None` without a key."""
        if not self.key:
            return None
        given = {"scale": scale, "start": self.start, "span": self.span}
        parameters = tuple(
            replace(one, value=float(f"{given[one.name]:.3g}")) if one.name in given else one
            for one in LearnedHeat.parameters
        )
        return EffectDeclaration(LearnedHeat(input=self.key), self.node, parameters, driven_by=self.driven_by)


@dataclass(frozen=True, repr=False)
class LearnedCurve:
    """The inputs with which a node's unexplained heat correlates, and a curve where `learned_heat` has such an input.

    Args:
        inputs: the most probable first.
        values: of the first input, in its SI unit or degC, shape (n,).
        heat: W, shape (n,).
        band: half-width of the 95 % band [W], shape (n,).
        step: the exact fit with the curve in the model, with held-out errors; `None` without a curve.
        without: held-out error without the curve, the lower of the given model's and that with all that was found [K].
        beside: whether the fit has effects that were found and are not in the model as given.
    """

    inputs: tuple[InputShare, ...]
    values: FloatArray = field(default_factory=lambda: np.zeros(0))
    heat: FloatArray = field(default_factory=lambda: np.zeros(0))
    band: FloatArray = field(default_factory=lambda: np.zeros(0))
    step: Step | None = None
    without: float | None = None
    beside: bool = False

    @property
    def held_out(self) -> float | None:
        """Held-out error with the curve [K], `None` where nothing is held out, or without a curve."""
        return self.step.holdout.rmse if self.step and self.step.holdout else None

    @property
    def offered(self) -> bool:
        """Whether the curve lowers the held-out error by more than chance."""
        return bool(self.without and self.held_out is not None and self.held_out < (1 - WORTH) * self.without)

    def __repr__(self) -> str:
        return f"<LearnedCurve: {self.text()}>"

    def text(self) -> str:
        """The inputs, the curve at one third, two thirds and the end of its range, and how to add it."""
        first, *others = self.inputs
        text = f"The heat at {first.node} is {UNNAMED}{first.column}: {100 * first.share:.0f} % of it"
        beside = [f"{100 * other.share:.0f} % with {other.column} alone" for other in others[:2]]
        text += f" ({', '.join(beside)})" if beside else ""
        if self.step is None:
            return f"{text}. That suggests a cause but does not prove it."
        unit = column_unit(first.column) or "as logged"
        points = [
            f"{short_size(self.heat[k])} ± {short_size(self.band[k])} W at {short_size(self.values[k])} {unit}"
            for k in (len(self.values) // 3, 2 * len(self.values) // 3, -1)
        ]
        text += f", {listed(points)}. That suggests a cause but does not prove it."
        if self.offered and self.without and self.held_out:
            before, after = short_size(self.without), short_size(self.held_out)
            text += f" As a learned heat without a name it lowers the held-out error from {before} to {after} K. "
            text += self.offer
        return text

    @property
    def offer(self) -> str:
        """How to add it, in a sentence."""
        return f"To add it to the model {'with all findings' if self.beside else 'as given'}: `{self.command}`"

    @property
    def command(self) -> str:
        """What adds it to a model file, `MODEL`, empty where it is not offered."""
        declared = self.step.declaration if self.step and self.offered else None
        if declared is None:
            return ""
        words = dict(declared.effect.chosen) | {one.name: f"{one.value:g}" for one in declared.parameters if one.fixed}
        words |= {"driven_by": declared.driven_by} if declared.driven_by else {}
        given = " ".join(f"{name}={word}" for name, word in words.items())
        return f"lptn add MODEL {LearnedHeat.key} --at {declared.at} --set {given} -o LEARNED"

    def as_json(self) -> dict[str, object]:
        """As other tools read it."""
        return {
            "verdict": UNNAMED + self.inputs[0].column,
            "inputs": [
                {"at": one.node, "input": one.column, "share": one.share, "log_odds": one.log_odds}
                for one in self.inputs
            ],
            "curve": {"input": list(self.values), "watts": list(self.heat), "band": list(self.band)},
            "rmse_holdout_before": self.without,
            "rmse_holdout_after": self.held_out,
            "add": self.command or None,
        }


def learned_curve(first: Diagnosis, last: Diagnosis, data: DataSplit, heat: WanderingHeat) -> LearnedCurve | None:
    """The most probable curve over one input in the model as given, or, if there is none, with all findings added.

    What the catalogue offers where it does not explain may imitate a heat without a name, and hide what that goes with.

    Args:
        first: the diagnosis of the model as given.
        last: of the model that it led to, or the same.
        data: the runs, in the steps of the fits.
        heat: of the last one's fit.

    Returns:
        `None` where all is explained, no heat is sure, or it goes with no input.
    """
    if last.remaining != "unexplained":
        return None
    found: Sequence[Diagnosis | Step] = [last] if last is not first else first.steps[-1:]
    fits = [first.fit, *(one.fit for one in found)]
    models = [heat if fit is heat.fit else WanderingHeat(fit) for fit in fits]
    told = [curve for number, one in enumerate(models) if (curve := _likeliest(one, data, beside=number > 0))]
    without = min((one.holdout.rmse for one in (first, *found) if one.holdout), default=None)
    told = [replace(curve, without=without) for curve in told]
    return next((curve for curve in told if curve.offered), told[0] if told else None)


def _likeliest(
    heat: WanderingHeat, data: DataSplit, *, beside: bool, most: int = 3, least: float = 0.1
) -> LearnedCurve | None:
    """What most surely unexplained heat goes with in one model, with the exact fit where `learned_heat` has the input.

    Args:
        heat: of the fitted model.
        data: as in `learned_curve`.
        beside: whether it has effects that the given model lacks.
        most: nodes that are tested, those with the most significant heat: unnamed heat spreads from its place.
        least: share of the heat that an input must explain to be named.
    """
    nodes = dict.fromkeys(peak.node for peak in stretches(heat.unexplained))
    shares = input_shares(heat, list(nodes)[:most])
    if not shares or shares[0].share < least or shares[0].log_odds < np.log(OCCAM * len(shares)):
        return None
    own = tuple(one for one in shares if one.node == shares[0].node and one.share >= least and one.log_odds > 0)
    if (declaration := own[0].declaration(heat.scale)) is None:
        return LearnedCurve(own, beside=beside)
    done = refit(heat.fit, declaration)
    values, curve, band = curve_of(done, declaration)
    if np.all(np.abs(curve) <= band):
        return None  # what the linear model saw is not there
    step = Step(done, declaration, holdout=holdout_errors(done, data.holdout))
    return LearnedCurve(own, values, curve, band, step, beside=beside)


def curve_of(fit: Fit, declared: EffectDeclaration, points: int = 41) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Values of the input, the heat there and the half-width of its 95 % band [W], shape (n,) each.

    The band is that of the rises, and of what a curve that never falls may do within a piece: a process of gamma
    increments that rises by r over the piece has the variance r² u (1 − u) / 2 at its share u.

    Args:
        fit: a model that has the effect at one place.
        declared: the effect.
        points: of the curve.
    """
    effect = declared.effect
    assert isinstance(effect, LearnedHeat)
    names = [declared.shared_name(f"rise_{number}") for number in range(1, PIECES + 1)]
    index = {parameter.name: number for number, parameter in enumerate(fit.model.parameters)}
    given = {name: fit.point.values[index[declared.shared_name(name)]] for name in ("scale", "start", "span")}
    values = given["start"] + given["span"] * np.linspace(0.0, 1.0, points)
    of_pieces = given["scale"] * np.array(effect.pieces(values, given["start"], given["span"]))
    rises = fit.point.values[[index[name] for name in names]]
    rows = [fit.problem.free.index(index[name]) for name in names]
    slopes = fit.problem.slope(fit.point.values)[rows]
    covariance = fit.uncertainty.covariance[np.ix_(rows, rows)] * np.outer(slopes, slopes)
    variance = np.einsum("kn,kl,ln->n", of_pieces, covariance, of_pieces)
    within = np.abs(of_pieces) / given["scale"]
    variance += 0.5 * ((rises * given["scale"]) ** 2) @ np.clip(within * (1.0 - within), 0.0, None)
    return values, rises @ of_pieces, WIDE * np.sqrt(np.maximum(variance, 0.0))


@one_blas_thread
def input_shares(heat: WanderingHeat, nodes: Sequence[str], *, walks: int = 3) -> list[InputShare]:
    """The inputs with which unexplained heat at some nodes correlates, the most probable first.

    Args:
        heat: of a fitted model.
        nodes: measured ones.
        walks: how fast the heat may wander, the likeliest and slower ones: beside a curve that stands for heat the rest
            wanders less.
    """
    fit, scale, runs = heat.fit, heat.scale, [bound.run for bound in heat.fit.problem.bound_runs]
    inputs = [one for node in nodes for one in _inputs_of(fit, node, runs)]
    if not inputs:
        return []
    columns = [slice(PIECES * number, PIECES * (number + 1)) for number in range(len(inputs))]
    rows = [fit.model.nodes.index(one.node) for one in inputs]
    known = [np.zeros((len(part.time), len(part.rows), PIECES * len(inputs))) for part in heat.runs]
    for run, part, heats in zip(runs, heat.runs, known, strict=True):
        for one, row, own in zip(inputs, rows, columns, strict=True):
            at = np.flatnonzero(part.rows == row)  # a run may not measure all nodes
            effect = LearnedHeat(input=one.key or OWN_TEMPERATURE)
            for_a_watt = np.array(effect.pieces(_values(run, one.column), one.start, one.span))
            heats[:, at, own] = means_in_blocks(for_a_watt, run, part.time, part.seconds).T[:, None]
    best, none = [replace(one, log_odds=-np.inf) for one in inputs], -np.inf
    for walk in reversed(heat.walks[-walks:]):
        done = [
            smoothed(part, heat.prior(part, open_parameters=True), walk, heats)
            for part, heats in zip(heat.runs, known, strict=True)
        ]
        white, density = np.vstack([run.white for run in done]), sum(run.density for run in done)
        none = max(none, density)
        for number, (one, row, own) in enumerate(zip(inputs, rows, columns, strict=True)):
            odds, rises = _posterior(white[:, 0], white[:, 1:][:, own], scale, bool(one.key))
            if odds + density > best[number].log_odds:
                its = [
                    (run.heat[part.rows == row], run.taken[part.rows == row][..., own] @ rises)
                    for run, part in zip(done, heat.runs, strict=True)
                ]
                watts, taken = (np.concatenate(series, axis=None) for series in zip(*its, strict=True))
                left = float(np.sum((watts - taken) ** 2) / max(np.sum(watts**2), np.finfo(float).tiny))
                best[number] = replace(one, log_odds=odds + density, share=max(0.0, 1.0 - left))
    return sorted((replace(one, log_odds=one.log_odds - none) for one in best), key=lambda one: -one.log_odds)


def _posterior(white: FloatArray, pieces: FloatArray, scale: float, monotone: bool) -> tuple[float, FloatArray]:
    """Logarithm of the Bayes factor of a curve to none, by Laplace, and its rises where they are likeliest [W]."""
    gradient, whole = pieces.T @ white, pieces.T @ pieces + np.eye(PIECES) / scale**2
    least = np.zeros(PIECES) if monotone else np.full(PIECES, -np.inf)
    rises = bounded_minimum(gradient, whole, least, np.full(PIECES, np.inf))
    width = 0.5 * np.linalg.slogdet(scale**2 * whole)[1]
    return float(-(gradient @ rises + 0.5 * rises @ whole @ rises) - width), rises


# --- What a node's heat may go with ------------------------------------------------------------------------


def _inputs_of(fit: Fit, node: str, runs: Sequence[Run]) -> list[InputShare]:
    """Its speed, load and power, or those of its winding; temperatures of its own and beside it; the time of day."""
    network = fit.model.network
    windings = network.windings_at(node)
    places = dict.fromkeys([node, *(windings if len(windings) == 1 else [])])
    columns = [
        (input_column(key, place), key, "" if place == node else place)
        for key in LearnedHeat.options["input"]
        if key != OWN_TEMPERATURE
        for place in places
    ]
    columns.append((f"temperature.{node}", OWN_TEMPERATURE, ""))
    beside = {end for link in network.resistors if node in link.ends for end in link.ends} - {node}
    columns += [(f"temperature.{name}", "", "") for name in sorted(beside)]
    if all(run.time[-1] - run.time[0] >= DAY for run in runs):
        columns.append((TIME_OF_DAY, "", ""))
    inputs = []
    for column, key, driven_by in columns:
        if column != TIME_OF_DAY and not all(np.isfinite(run.columns.get(column, np.nan)).any() for run in runs):
            continue
        values = np.concatenate([_values(run, column) for run in runs])
        start = 0.0 if key not in ("", OWN_TEMPERATURE) else float(values.min())
        span = float(np.abs(values).max() if start == 0.0 else np.ptp(values))
        if np.ptp(values) > CHANGE * span:
            inputs.append(InputShare(node, column, key, driven_by, start, span))
    return inputs


def _values(run: Run, column: str) -> FloatArray:
    """A column of a run, gaps bridged; or the hour of its log's clock."""
    if column == TIME_OF_DAY:
        return np.asarray(run.time % DAY)
    values = run.columns[column]
    there = np.isfinite(values)
    return values if there.all() else np.interp(run.time, run.time[there], values[there])
