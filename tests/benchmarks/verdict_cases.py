"""Cases that a verdict is tried on: what is hidden, the files that a user would have, and which answers are right.

Truths that share no code with the models: virtual robots of `lptn.virtual` made of the catalogue's own formulas
("leg", "quadruped"), and a leg of finite volumes without lumped structure. A case is a few words, so that a result
file can hold it; its logs are made anew from them.
"""

from __future__ import annotations

import random
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from pathlib import Path

from lptn.robots.presets import presets
from lptn.virtual import BEYOND, EFFECTS, LAYOUTS, Hidden, leg_logs, places, quadruped_logs, write_logs
from tests.truth.changes import ALWAYS, CHANGES, finite_volume_leg_logs
from tests.truth.plans import swing, trial
from tests.truth.rough_leg import rough_leg_logs

QUADRUPED_MODEL = Path(__file__).with_name("quadruped_plain.toml")
CATALOGUE = tuple(effect for effect in EFFECTS if effect not in BEYOND)
NOISES = {"0.1K": (0.1, 0.0), "0.3K": (0.3, 0.0), "1K": (0.1, 1.0)}
"""Standard deviation and step of the temperature readings [K]."""
BACKGROUND = (
    ("shared_mass", "*", 0.3),
    ("radiation", "*", 0.15),
    ("natural_convection", "*", 0.15),
    ("coulomb_friction", "*", 0.1),
    ("second_mass", "*", 0.15),
    ("ambient_offset", "ambient", 0.2, "fit1"),
    ("ambient_offset", "ambient", -0.2, "fit2"),
    ("ambient_offset", "ambient", 0.15, "holdout"),
)
"""What the rough quadruped has besides what is hidden, at shares of the typical sizes."""
AMBIENT_ERROR = 0.5
"""K; what the rough tier's user says of the ambient sensor."""
IN_ONE_RUN = ("surface_scale", "loss_scale")
"""Effects that a free parameter imitates unless they act in one run only."""

Key = tuple[str, str]
"""An effect and its place, `"FR_calf"` or `"FR_calf@fit2"`."""


# --- names of the same thing --------------------------------------------------------------------------------------


def key(text: str) -> Key:
    """`effect@place` or `effect@place@run` as effect and place."""
    effect, _, at = text.partition("@")
    return effect, at


def covered(answer: Key, nodes: Sequence[str] = LAYOUTS["quadruped"].nodes) -> tuple[str, frozenset[str], str]:
    """Effect, places and run: two names of the same places are one answer.

    Args:
        answer: effect and place.
        nodes: of the robot that have a sensor; one named `pc` is no joint.
    """
    effect, at = answer
    at, _, run = at.partition("@")
    kind = EFFECTS[effect].kind if effect in EFFECTS else "node"
    if "~" in at:
        ends = at.split("~")
        return effect, frozenset((">".join(ends),) if kind == "linked" else ends), run
    sensed = [node for node in nodes if kind != "joint" or node != "pc"]
    return effect, frozenset(node for node in sensed if fnmatchcase(node, at)) or frozenset((at,)), run


# --- cases --------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """One question to a program.

    Args:
        truth: a key of `TRUTHS`.
        tier: one of the truth's tiers.
        hidden: `effect@place` or `effect@place@run` each, of finite volumes `change@place`; nothing for an empty tuple.
        seed: draws parameters, movements and noise.
    """

    truth: str
    tier: str
    hidden: tuple[str, ...]
    seed: int

    @property
    def kind(self) -> str:
        """What is asked: "nothing", "one", "two" or "outside"."""
        return TRUTHS[self.truth].kind(self.hidden)

    def right(self, answer: Key) -> bool:
        """Whether this effect at this place is something that is hidden."""
        return TRUTHS[self.truth].right(self, answer)

    def natural(self, answer: Key) -> bool:
        """Whether this effect at this place is true of the robot, whatever is hidden."""
        always, (effect, places, run) = TRUTHS[self.truth].always.get(self.tier, ()), covered(answer)
        if effect in always and not run:
            return True
        listed = [covered(key(text)) for text in always if "@" in text]
        several = "*" in answer[1] or "~" in answer[1]
        return any(
            (effect, run) == (one, when) and (places == at or (several and places <= at)) for one, at, when in listed
        )


@dataclass(frozen=True)
class Files:
    """What the user has.

    Args:
        model: as given.
        fit, holdout: logs.
        options: further words of the command.
        share: who has a second mass in common where one is put at every node by hand.
    """

    model: Path
    fit: tuple[Path, ...]
    holdout: tuple[Path, ...]
    options: tuple[str, ...] = ()
    share: str = "each"


@dataclass(frozen=True)
class Truth:
    """A source of cases.

    Args:
        tiers: its kinds of logs.
        drawn: from effect, seed and tier a case's `hidden`.
        names: what can be hidden and named, and what can be hidden and has no name.
        files: makes a case's files in a folder.
        right: whether an answer to a case is right.
        always: by tier, what is true of the robot whatever is hidden, `effect@place`, or `effect` for any place:
            such an answer is neither right nor silly.
        pairs: whether two things can be hidden in it.
    """

    tiers: tuple[str, ...]
    names: tuple[str, ...]
    outside: tuple[str, ...]
    drawn: Callable[[str, int, str], tuple[str, ...]]
    files: Callable[[Case, Path], Files]
    right: Callable[[Case, Key], bool]
    always: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    pairs: bool = True

    def kind(self, hidden: tuple[str, ...]) -> str:
        """What a case with this hidden asks."""
        if not hidden:
            return "nothing"
        return "outside" if key(hidden[0])[0] in self.outside else ("one", "two")[len(hidden) - 1]


def draw_cases(
    truth: str, tiers: Iterable[str], seeds: Iterable[int], *, most: int, pairs: int, nothing: int, outside: int
) -> list[Case]:
    """Cases of a truth: so many for each tier and seed.

    Args:
        truth: a key of `TRUTHS`.
        tiers: of them those that the truth has.
        seeds: each draws anew.
        most: cases with one thing hidden, drawn without repetition; all that there are if it is as many or more.
        pairs: cases with two things hidden.
        nothing: cases with nothing hidden.
        outside: cases with something that no catalogue has, drawn without repetition.
    """
    source, cases = TRUTHS[truth], []
    for tier in (tier for tier in tiers if tier in source.tiers):
        for seed in seeds:

            def shuffled(names: Sequence[str], what: str, tier: str = tier, seed: int = seed) -> list[str]:
                # All of them, so that more cases are those of before and others.
                return random.Random(f"{truth} {what} {tier} {seed}").sample(names, len(names))

            hidden = [source.drawn(name, seed, tier) for name in shuffled(source.names, "one")[:most]]
            for number in range(pairs if source.pairs else 0):
                two = [name for name in shuffled(source.names, f"pair {number}") if name not in IN_ONE_RUN][:2]
                hidden.append(tuple(text for name in two for text in source.drawn(name, seed, tier)))
            hidden += [source.drawn(name, seed, tier) for name in shuffled(source.outside, "outside")[:outside]]
            cases += [Case(truth, tier, effects, seed) for effects in hidden]
            # Another robot each time: the same one with nothing hidden would be asked the same thing twice.
            cases += [Case(truth, tier, (), seed + 10_000 * number) for number in range(nothing)]
    return list(dict.fromkeys(cases))


# --- robots of the catalogue's own formulas -------------------------------------------------------------------------


def drawn_place(effect: str, robot: str, seed: int, tier: str) -> tuple[str, ...]:
    """The effect at a place drawn by seed and tier, in one run where it needs that; "none": nothing."""
    if effect == "none":
        return ()
    rng = random.Random(f"{effect} {seed} {tier}")
    place = rng.choice(list(places(effect, robot)))
    return (f"{effect}@{place}@{rng.choice(['fit1', 'fit2'])}" if effect in IN_ONE_RUN else f"{effect}@{place}",)


def hidden_effects(texts: Iterable[str], robot: str) -> list[Hidden]:
    """The effects of a case, as a virtual robot takes them."""
    effects = []
    for effect, at in map(key, texts):
        place, _, run = at.partition("@")
        effects.append(Hidden(effect, place, robot=robot, run=run))
    return effects


def write_quadruped(folder: Path, hidden: Sequence[str], seed: int, noise: str, *, rough: bool) -> None:
    """The logs `fit1`, `fit2` and `holdout` of a plain quadruped with something hidden, to a folder."""
    effects = hidden_effects(hidden, "quadruped")
    if rough:
        first = (effects[0].effect, effects[0].at) if effects else None
        for effect, at, size, *run in BACKGROUND:
            if (effect, at) != first:
                effects.append(Hidden(effect, at, size, robot="quadruped", run="".join(run)))
    spread, step = NOISES[noise]
    runs = swing(seed) if any("ambient_lag" in text for text in hidden) else trial(seed)
    logs = quadruped_logs(
        effects, seed=seed, runs=runs, physics="plain", noise=spread, quantisation=step, columns="all"
    )
    write_logs(folder, logs)


def three_runs(folder: Path, model: Path, *options: str) -> Files:
    """Files of a virtual robot whose logs are in a folder."""
    return Files(
        model, (folder / "fit1.parquet", folder / "fit2.parquet"), (folder / "holdout.parquet",), tuple(options)
    )


def _sensors(tier: str) -> str:
    """What the thermometers are like: a rough robot's have 0.3 K of noise."""
    return {"clean": "0.1K", "1K": "1K", "rough": "0.3K"}[tier]


def _options(tier: str) -> tuple[str, ...]:
    return ("--ambient-error", str(AMBIENT_ERROR)) if tier == "rough" else ()


def _quadruped_files(case: Case, folder: Path) -> Files:
    write_quadruped(folder, case.hidden, case.seed, _sensors(case.tier), rough=case.tier == "rough")
    # Thirteen of them for themselves are a fit of minutes; a person would take like joints together.
    return replace(three_runs(folder, QUADRUPED_MODEL, *_options(case.tier)), share="class")


def _leg_files(case: Case, folder: Path) -> Files:
    spread, step = NOISES[_sensors(case.tier)]
    effects = hidden_effects(case.hidden, "leg")
    make = rough_leg_logs if case.tier == "rough" else leg_logs
    logs = make(effects, seed=case.seed, noise=spread, quantisation=step, columns="all")
    write_logs(folder, logs)
    model = folder / "leg.toml"
    model.write_text(presets()["leg"], encoding="utf-8")
    return three_runs(folder, model, *_options(case.tier))


def _catalogue_truth(robot: str, files: Callable[[Case, Path], Files], beside: tuple[str, ...]) -> Truth:
    nodes = LAYOUTS[robot].nodes

    def right(case: Case, answer: Key) -> bool:
        return covered(answer, nodes) in [covered(key(text), nodes) for text in case.hidden]

    def drawn(effect: str, seed: int, tier: str) -> tuple[str, ...]:
        return drawn_place(effect, robot, seed, tier)

    return Truth(("clean", "1K", "rough"), CATALOGUE, BEYOND, drawn, files, right, {"rough": beside})


# --- the leg without lumped structure -------------------------------------------------------------------------------

COMPUTER = """
[nodes.pc]
capacity = { value = 400, unit = "J/K", bounds = [50, 5000] }

[[links]]
between = ["pc", "ambient"]
resistance = { value = 3, unit = "K/W", bounds = [0.2, 100] }

[[links]]
between = ["*_hip", "pc"]
resistance = { value = 8, unit = "K/W", bounds = [0.2, 500] }

[[effects]]
kind = "heat_input"
at = "pc"
gain = { value = 1, fixed = true }
"""
"""What the leg's model needs for a computer that it hangs on; its measured watts are heat."""


def second_masses(share: str) -> str:
    """What makes a model with one mass a node one with two, as a person would write it by hand.

    The bounds are a person's, too: what is slower than an hour or faster than some seconds is not a second mass of a
    joint that logs of half an hour show.
    """
    return f"""
[[effects]]
kind = "second_mass"
at = "*"
share = "{share}"
capacity = {{ value = 100, unit = "J/K", bounds = [1, 2000] }}
time_constant = {{ value = 120, unit = "s", bounds = [5, 3600] }}
"""


def with_bounds(files: Files) -> Files:
    """The same with bounds of three standard deviations in place of priors, which older versions don't read."""

    def bounded(prior: re.Match[str]) -> str:
        mean, deviation = map(float, prior.groups())
        return f"value = {mean:g}, bounds = [{mean - 3 * deviation:g}, {mean + 3 * deviation:g}], fixed = false"

    text = files.model.read_text(encoding="utf-8")
    files.model.write_text(re.sub(r"prior = \[([\d.]+), ([\d.]+)\]", bounded, text), encoding="utf-8")
    return files


def _finite_volume_files(case: Case, folder: Path) -> Files:
    change, at = key(case.hidden[0]) if case.hidden else (None, "")
    computer = case.tier == "computer"
    steps = 1.0 if case.tier == "1K" else 0.1
    write_logs(folder, finite_volume_leg_logs(change, at, seed=case.seed, computer=computer, steps=steps))
    model = folder / "leg.toml"
    text = presets()["leg"] + COMPUTER * computer
    model.write_text(text + second_masses("each") * ("two masses" in case.truth), encoding="utf-8")
    return three_runs(folder, model)


def _drawn_change(change: str, seed: int, tier: str) -> tuple[str, ...]:
    return (f"{change}@{random.Random(f'{change} {seed} {tier}').choice(list(CHANGES[change].places))}",)


def _right_of_finite_volumes(case: Case, answer: Key) -> bool:
    joints, (effect, at) = LAYOUTS["leg"].nodes, answer
    for change, place in map(key, case.hidden):
        for wanted, pattern in CHANGES[change].answers(place):
            inside = "~" in pattern and fnmatchcase(at, pattern)
            # On all joints is everywhere, whether the computer's box is with them or not.
            if wanted == effect and (inside or covered(answer, joints) == covered((wanted, pattern), joints)):
                return True
    return False


def _finite_volumes() -> Truth:
    names = tuple(name for name, change in CHANGES.items() if not change.outside)
    outside = tuple(name for name in CHANGES if name not in names)
    tiers = ("0.1K", "1K", "computer")
    return Truth(
        tiers, names, outside, _drawn_change, _finite_volume_files, _right_of_finite_volumes,
        dict.fromkeys(tiers, ALWAYS), pairs=False,
    )  # fmt: skip


TRUTHS = {
    "quadruped": _catalogue_truth(
        "quadruped", _quadruped_files, tuple("@".join([effect, at, *run]) for effect, at, _, *run in BACKGROUND)
    ),
    "leg": _catalogue_truth("leg", _leg_files, ("radiation@*",)),
    "finite volumes": _finite_volumes(),
    "finite volumes, two masses": _finite_volumes(),
}
"""Where cases come from; of finite volumes by the model that is given: one mass a joint, or two."""
