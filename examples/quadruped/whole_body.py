# %% [markdown]
# # The whole-body model against single nodes, as the source compares them
#
# A virtual quadruped with more physics than either model (windings apart from housings, a trunk, radiation, sensors in
# steps of 1 K) runs the source's identification protocol: 25 runs of half an hour. Both presets are fitted to it, then
# predict seven runs that neither saw. The source's printed tables stand beside ours.
#
# `python examples/quadruped/whole_body.py --seeds 0 1 2 -o tables`

# %%
from __future__ import annotations

import argparse
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Literal

import numpy as np

from lptn import EffectDeclaration, load_model, split_data
from lptn.basics.files import write_whole
from lptn.effects import Effect
from lptn.effects.ambient_offset import AmbientOffset
from lptn.effects.surface_scale import SurfaceScale
from lptn.identify.comparison import Pair, Versus, versus
from lptn.identify.data import DataSplit
from lptn.identify.fitting import Fit, fit
from lptn.identify.validation import fit_segments
from lptn.logs.run import Run
from lptn.model.model import Model
from lptn.report.pages import versus_html
from lptn.robots.presets import preset_text
from lptn.virtual import quadruped_logs, write_logs

Level = Literal["none", "default", "strong"]
_FAST_STEP, _SLOW_STEP = 10.0, 30.0  # s
_ITERATIONS = 9  # of a fit in averages of 30 s: the searches of ten robots are to end in an hour
AMBIENT_ERROR, SURFACE_ERROR = 1.0, 0.15  # K, share; one standard deviation: air near a robot, and how it moves
_FARTHEST = 2.5  # standard deviations
FEW = (
    "unpowered", "cooling", "trot_low", "trot_medium", "trot_high",
    *(f"{joint}_{legs}_6Nm" for joint in ("abd", "hip", "knee") for legs in ("RF_LR", "LF_RR")),
)  # fmt: skip
"""Eleven of the protocol's 25 runs in which every joint is moved: enough for a fit of two masses a joint."""

# [QuadrupedLPTN, table 2]: mean error of the single node and of the whole body [°C].
SOURCE_CLASSES = {"*_hip": (1.57, 0.67), "*_thigh": (2.07, 0.66), "*_calf": (2.44, 0.88), "all": (2.02, 0.74)}
# [QuadrupedLPTN, table 3]: largest error [°C], mean square error [°C²], error reduction [%].
SOURCE_RUNS = {
    "identification": (4.77, 0.91, 66.67),
    "stand": (2.56, 0.50, 51.41),
    "trot_0kg_low": (3.20, 1.07, 69.31),
    "trot_0kg_high": (2.38, 0.61, 66.67),
    "trot_4kg_low": (4.52, 1.91, 40.26),
    "walk_4kg": (3.47, 1.14, 29.44),
    "cooling": (3.14, 2.14, 37.88),
}


# %% [markdown]
# ## One virtual robot: logs, two fits, errors


# %%
@dataclass(frozen=True)
class Trial:
    """One robot: both fits, their errors on the protocol and on held-out runs, the whole body's fitting time [s]."""

    seed: int
    fits: tuple[Fit, Fit]
    protocol: Versus
    tests: Versus
    seconds: float


def trial(
    seed: int,
    level: Level,
    folder: Path,
    only: Sequence[str] | None = None,
    model: str | None = None,
    spread: float = 1.0,
) -> Trial:
    """Make the logs of one robot, fit both models, compare.

    Args:
        seed: of the robot.
        level: hidden errors of each run that no model can know: none, default or strong.
        folder: where logs go.
        only: names of the protocol's runs to fit, all in averages of 10 s; all runs as they are by default.
        model: of the quadruped's ready models the one for the whole body, such as "windings", which is fitted in
            averages of 30 s; its one mass a joint by default.
        spread: factor on how far each fitted run's own air and cooling may lie from what is logged.
    """
    fitted, seconds, data = [], 0.0, []
    for name, chosen in (("whole-body", model), ("single-node", "single-node")):
        path = folder / f"{name}.toml"
        write_whole(path, preset_text("quadruped", chosen))
        loaded = load_model(path)
        runs, held = (loaded.runs(_logs(kind, seed, level, folder, only)) for kind in ("protocol", "tests"))
        whole = split_data(runs, held)
        averaged = whole if only is None else whole.coarsened(_FAST_STEP)
        data.append(averaged if model is None else whole)
        began = time.perf_counter()
        if chosen == "windings":
            fitted.append(_quickly(loaded.model, runs, spread))
        else:
            fitted.append(fit_segments(loaded.model, averaged.fit))
        seconds = seconds or time.perf_counter() - began
    return Trial(seed, (fitted[0], fitted[1]), *(_errors(fitted, data, held) for held in (False, True)), seconds)


def _quickly(model: Model, runs: Sequence[Run], spread: float) -> Fit:
    """A fit in averages of 30 s from the declared values, which are near: two masses a joint are slow to fit.

    Each run may have its own air, a little warmer or colder than logged and cooling a little better or worse, or that
    would be fitted as the robot's own. Nothing of the kind is fitted to a run that is predicted.
    """
    averages = [run.coarsen(round(_SLOW_STEP / run.step)) for run in runs]
    errors = [
        error
        for run in runs
        for error in (
            _error(AmbientOffset(), "ambient", spread * AMBIENT_ERROR, run),
            _error(SurfaceScale(), "*_case", spread * SURFACE_ERROR, run),
        )
    ]
    own = Model(model.network.with_effects(errors))
    result = fit(own, averages, symmetry_penalty=1.0, guess=own.values, iterations=_ITERATIONS, precision=1e-4)
    fitted = {parameter.name: parameter.value for parameter in result.model.parameters}
    values = np.array([fitted[parameter.name] for parameter in model.parameters])
    return replace(result, model=model.with_values(values))


def _error(effect: Effect, place: str, deviation: float, run: Run) -> EffectDeclaration:
    """An effect of one run, held near none by a prior of that standard deviation."""
    (size,) = effect.parameters
    bounds = (-_FARTHEST * deviation, _FARTHEST * deviation)
    size = replace(size, value=0.0, prior=(0.0, deviation), bounds=bounds, share="all")
    return EffectDeclaration(effect, place, (size,), f"{effect.key}_error", run=run.name)


def _logs(
    kind: Literal["protocol", "tests"], seed: int, level: Level, folder: Path, only: Sequence[str] | None
) -> list[Path]:
    place = folder / kind
    if not place.exists():
        write_logs(place, quadruped_logs(seed=seed, runs=kind, level=level, quantisation=1.0))
    chosen = only if kind == "protocol" and only is not None else sorted(path.stem for path in place.iterdir())
    return [place / f"{name}.parquet" for name in chosen]


def _errors(fitted: Sequence[Fit], data: Sequence[DataSplit], held: bool) -> Versus:
    parts = [split.holdout if held else split.fit for split in data]
    return versus(fitted[0].model, fitted[1].model, *parts)


# %% [markdown]
# ## The source's tables beside ours


# %%
def tables(trials: Sequence[Trial]) -> str:
    """[QuadrupedLPTN, table 2, 3], ours for each robot behind them."""
    robots = "".join(f"{f'robot {outcome.seed}':>22s}" for outcome in trials)
    lines = [f"Mean error [K], single node -> whole body\n{'joints':16s}{'source':>16s}{robots}"]
    for what, printed in SOURCE_CLASSES.items():
        ours = "".join(f"{_arrow(_named(outcome.protocol.classes, what).mean):>22s}" for outcome in trials)
        lines.append(f"{what:16s}{f'{printed[0]:.2f} -> {printed[1]:.2f}':>16s}{ours}")
    lines.append(f"\nLargest error [K], mean square [K²], reduction of the largest\n{'run':16s}{'source':>16s}{robots}")
    runs = {"identification": [_named(outcome.protocol.classes, "all") for outcome in trials]}
    names = {pair.what for pair in trials[0].tests.runs}
    ordered = [*(name for name in SOURCE_RUNS if name in names), *sorted(names - SOURCE_RUNS.keys())]
    runs |= {name: [_named(outcome.tests.runs, name) for outcome in trials] for name in ordered}
    for what, pairs in runs.items():
        source = SOURCE_RUNS.get(what)
        shown = f"{source[0]:.2f}  {source[1]:.2f}  {source[2]:.0f}%" if source else "-"
        ours = "".join(f"{f'{p.max[0]:.2f}  {p.square[0]:.2f}  {p.reduction:.0%}':>22s}" for p in pairs)
        lines.append(f"{what:16s}{shown:>16s}{ours}")
    return "\n".join(lines)


def over_robots(trials: Sequence[Trial]) -> str:
    """Of the same tables the median of all robots, and the worst in parentheses."""
    lines = [f"\nMedian and worst of {len(trials)} robots\nMean error [K], single node -> whole body"]
    for what in SOURCE_CLASSES:
        means = np.array([_named(outcome.protocol.classes, what).mean for outcome in trials])
        single, whole = np.median(means[:, 1]), f"{np.median(means[:, 0]):.2f} ({means[:, 0].max():.2f})"
        lines.append(f"{what:16s}{single:.2f} -> {whole}")
    lines.append("Largest error [K], mean square [K²], reduction of the largest")
    for what in ("identification", *(pair.what for pair in trials[0].tests.runs)):
        pairs = [
            _named(outcome.protocol.classes, "all") if what == "identification" else _named(outcome.tests.runs, what)
            for outcome in trials
        ]
        largest, square, reduction = (
            np.array(values) for values in zip(*((p.max[0], p.square[0], p.reduction) for p in pairs), strict=True)
        )
        lines.append(
            f"{what:16s}{np.median(largest):.2f} ({largest.max():.2f})  {np.median(square):.2f} ({square.max():.2f})  "
            f"{np.median(reduction):.0%} ({reduction.min():.0%})"
        )
    return "\n".join(lines)


def _named(pairs: Sequence[Pair], what: str) -> Pair:
    return next(pair for pair in pairs if pair.what == what)


def _arrow(errors: tuple[float, float]) -> str:
    return f"{errors[1]:.2f} -> {errors[0]:.2f}"


# %% [markdown]
# ## Run it


# %%
def main(arguments: Sequence[str] | None = None) -> Mapping[int, Trial]:
    """Run the trials that the command line asks for, print the tables, write a page for each robot."""
    parser = argparse.ArgumentParser(description="Whole-body model against single nodes on a virtual quadruped.")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--level", choices=("none", "default", "strong"), default="none")
    parser.add_argument(
        "--fast", action="store_true", help="fit four runs in steps of 10 s instead of 25 in steps of 1 s"
    )
    parser.add_argument("--windings", action="store_true", help="two masses a joint and a trunk, fitted to eleven runs")
    parser.add_argument(
        "--spread",
        type=float,
        default=1.0,
        help="with --windings: factor on what each fitted run's own air may be off by",
    )
    parser.add_argument("-o", "--output", type=Path, help="folder for an HTML page of each robot")
    given = parser.parse_args(arguments)
    only = ("unpowered", "hip_RF_LR_4Nm", "knee_LF_RR_6Nm", "trot_medium") if given.fast else None
    only, model = (FEW, "windings") if given.windings else (only, None)
    trials = {}
    for seed in given.seeds:
        with TemporaryDirectory() as folder:
            trials[seed] = trial(seed, given.level, Path(folder), only, model, given.spread)
        print(
            f"robot {seed}: {len(trials[seed].fits[0].problem.free)} parameters fitted in {trials[seed].seconds:.0f} s"
        )
        if given.output is not None:
            given.output.mkdir(parents=True, exist_ok=True)
            title = f"Whole body against single nodes, robot {seed}"
            write_whole(given.output / f"robot{seed}.html", versus_html(trials[seed].tests, title))
    print(tables(list(trials.values())))
    if len(trials) > 1:
        print(over_robots(list(trials.values())))
    return trials


if __name__ == "__main__":
    main()
