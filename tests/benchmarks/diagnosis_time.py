"""Time of one diagnosis against refitting every candidate, and whether the two agree.

Run it with ``python tests/benchmarks/diagnosis_time.py``: the virtual quadruped, 13 nodes, an hour at 1 s, the full
catalogue. Brute force fits the model once with each candidate in it, by the same fit from the same start, to the end.
CPU time of one process; the two are measured in one run.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from pathlib import Path

from lptn.diagnose.candidates import candidates
from lptn.diagnose.diagnosis import examine, for_search
from lptn.diagnose.fit_statistics import criterion_difference
from lptn.diagnose.refits import refit
from lptn.identify.data import DataSplit, load_model, split_data
from lptn.identify.fitting import Fit
from lptn.identify.validation import fit_segments
from lptn.model.model import Model
from lptn.virtual import quadruped_logs, write_logs
from tests.truth.plans import trial

MODEL = Path(__file__).with_name("quadruped_plain.toml")


def hour(effect: str, at: str, seed: int) -> tuple[Model, DataSplit]:
    """An hour of logs with one hidden effect, to fit."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        runs = trial(seed, fitted=1800)
        logs = quadruped_logs([(effect, at)], seed=seed, runs=runs, physics="plain", noise=0.1, quantisation=0.0)
        write_logs(folder, logs)
        loaded = load_model(MODEL)
        return loaded.model, split_data(loaded.runs([folder / "fit1.parquet", folder / "fit2.parquet"]))


def brute_force(base: Fit, data: DataSplit, most: int | None) -> tuple[list[tuple[float, tuple[str, str]]], int, float]:
    """Each candidate's gain, best first; how many there are; and the CPU time for all, from those that were run."""
    columns = set.intersection(*(set(segment.run.columns) for segment in data.fit))
    proposed = candidates(base.model.network, columns, [segment.run.name for segment in data.fit])
    picked = proposed if most is None else proposed[:: max(1, len(proposed) // most)]
    start = time.process_time()
    gains = []
    for candidate in picked:
        shape = candidate.effect.shape()
        declaration = candidate.declaration(None, shape.grid[0] if shape else None)
        gains.append((criterion_difference(base, refit(base, declaration)), candidate.key))
    spent = (time.process_time() - start) * len(proposed) / len(picked)
    return sorted(gains, reverse=True), len(proposed), spent


def main() -> None:
    """Print both times, their ratio and both answers."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--effect", default="forced_convection")
    parser.add_argument("--at", default="RL_calf")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--most", type=int, help="candidates to refit by brute force, spread evenly; all by default")
    chosen = parser.parse_args()
    model, data = hour(chosen.effect, chosen.at, chosen.seed)
    coarse = for_search(data)
    start = time.process_time()
    base = fit_segments(model, coarse.fit)
    fitted = time.process_time()
    diagnosis = examine(base, coarse)
    ours = time.process_time() - fitted
    said = [step.key for step in diagnosis.steps]
    print(f"baseline fit {fitted - start:.1f} s; diagnosis {ours:.1f} s: {diagnosis.verdict}, {said[:1]}")
    gains, count, spent = brute_force(base, coarse, chosen.most)
    print(f"brute force, {count} candidates: {spent:.0f} s, {spent / ours:.0f} times as long; best {gains[0][1]}")
    print("first five: ours", said[:5], "brute force", [key for _, key in gains[:5]])


if __name__ == "__main__":
    main()
