"""Hidden-effect trial: a virtual leg with one effect that the model lacks; is it named, and does the error fall?

Run it with ``python tests/benchmarks/hidden_effects.py --seeds 101 102``. The truth comes from `lptn.virtual`,
which shares no code with the model; logs go through files, as a user's would.
"""

from __future__ import annotations

import argparse
import random
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from lptn.diagnose.improvement import History, improve
from lptn.identify.data import load_model, split_data
from lptn.robots.presets import presets
from lptn.virtual import BEYOND, EFFECTS, Hidden, leg_logs, places, write_logs

CATALOGUE = tuple(effect for effect in EFFECTS if effect not in BEYOND)


@dataclass(frozen=True)
class Trial:
    """One virtual leg: what was hidden (nothing: `None`), the history, and how long it took."""

    hidden: Hidden | None
    seed: int
    history: History
    seconds: float

    @property
    def named(self) -> tuple[str, str] | None:
        """Effect and place of the first step."""
        first = self.history.steps[1] if len(self.history.steps) > 1 else None
        return None if first is None or first.effect is None or first.at is None else (first.effect, first.at)

    @property
    def right(self) -> str:
        """Whether the first step is the hidden effect at its place."""
        if self.hidden is None or self.hidden.effect in BEYOND:
            wanted = "adequate" if self.hidden is None else "unexplained"
            return "yes" if self.history.verdict == wanted else "no"
        truth = (self.hidden.effect, self.hidden.at)
        if self.named == truth:
            return "yes"
        indistinguishable = self.history.steps[1].indistinguishable if self.named else ()
        return "in group" if truth in indistinguishable else "no"


def trial(hidden: Hidden | None, seed: int, noise: float, quantisation: float, rough: bool) -> Trial:
    """Make the logs, read them back, select effects step by step."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        wanted = [] if hidden is None else [hidden]
        write_logs(folder, leg_logs(wanted, seed=seed, noise=noise, quantisation=quantisation, rough=rough))
        (folder / "leg.toml").write_text(presets()["leg"])
        loaded = load_model(folder / "leg.toml")
        fitted = loaded.runs([folder / "fit1.parquet", folder / "fit2.parquet"])
        data = split_data(fitted, loaded.runs([folder / "holdout.parquet"]))
        start = time.perf_counter()
        return Trial(hidden, seed, improve(loaded.model, data), time.perf_counter() - start)


def cases(effects: list[str], seeds: list[int]) -> Iterator[tuple[Hidden | None, int]]:
    """Each effect at a place drawn by the seed; `none` hides nothing."""
    for effect in effects:
        for seed in seeds:
            place = None if effect == "none" else random.Random(f"{effect} {seed}").choice(list(places(effect)))
            yield (None if place is None else Hidden(effect, place)), seed


def row(done: Trial) -> str:
    """A line of the table."""
    before, after = done.history.steps[0].holdout, done.history.best.holdout
    hidden = "nothing" if done.hidden is None else f"{done.hidden.effect} at {done.hidden.at}"
    history = ", ".join(f"{step.effect} at {step.at}" for step in done.history.steps[1:]) or "–"
    errors = f"{before.rmse:.3f} | {after.rmse:.3f}" if before and after else "– | –"
    answer = f"{done.history.verdict} | {history} | {done.right}"
    return f"| {hidden} | {done.seed} | {answer} | {errors} | {done.seconds:.0f} |"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--effects", nargs="+", default=[*CATALOGUE, "none", *BEYOND])
    parser.add_argument("--seeds", nargs="+", type=int, default=[101, 102])
    parser.add_argument("--noise", type=float, default=0.15)
    parser.add_argument("--quantisation", type=float, default=0.0)
    parser.add_argument("--rough", action="store_true")
    chosen = parser.parse_args()
    print("| hidden | seed | verdict | history | right first | held out before, K | after, K | s |")
    print("| --- | --- | --- | --- | --- | --- | --- | --- |")
    counted: dict[str, int] = {}
    for hidden, seed in cases(chosen.effects, chosen.seeds):
        done = trial(hidden, seed, chosen.noise, chosen.quantisation, chosen.rough)
        counted[done.right] = counted.get(done.right, 0) + 1
        print(row(done), flush=True)
    print(", ".join(f"{answer}: {count}" for answer, count in sorted(counted.items(), reverse=True)))


if __name__ == "__main__":
    main()
