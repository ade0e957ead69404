"""Torque within temperature limits, in closed loop against peers.

Run it with ``python -m tests.benchmarks.torque_mpc`` and one of

- ``peers``: do-mpc 5 in the same run, interleaved, processor time (do-mpc comes with the extra `benchmarks`),
- ``robots``: ten further robots, 200 steps each from below and from above the limit,
- ``optimality``: cost against the converged nonlinear program,
- ``derating``: linear derating and a hard cut-off over ten tasks,
- ``emitted``: the C step and the limiter as a robot runs them.

Ours comes down from above the limit as fast as can be (`recovery=0`), as its peer does; `derating` has the default law.

The truth is a 13-node quadruped of `lptn.virtual`; every parameter of the model is 10 % off, up or down; readings carry
noise of 0.1 K.
"""

from __future__ import annotations

import argparse
import subprocess
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.model.model import Model
from lptn.planners.limiter import Limiter
from lptn.planners.mpc import TorqueMPC
from lptn.planners.mpc.reference import ReferenceProgram
from tests.planners.truth import World, conditions, model_of, stage_means, true_robot

LIMIT, PERIOD, HORIZON, STAGES, NOISE, ERROR = 60.0, 5, 300, 60, 0.1, 0.1
LIMITS = {"*_*": LIMIT}
MOST = 33.5  # N*m, an A1's joint
LEAST = 0.01  # cost, of all that is asked, in shares of which plans of nearly no cost are told

Controller = Callable[[FloatArray, FloatArray], FloatArray]
"""From readings and the requests of the next 60 periods, shape (60, joints), to torques."""


@dataclass
class Outcome:
    """One closed loop."""

    violation: float = 0.0
    cost: float = 0.0
    failures: int = 0
    times: list[float] = field(default_factory=list)

    def row(self, name: str) -> str:
        """A line of the table."""
        milliseconds = 1e3 * np.array(self.times)
        return (
            f"{name:34} {self.violation:9.4f} {self.cost:12.5f} {self.failures:9d} "
            f"{np.median(milliseconds):10.3f} {milliseconds.max():10.3f}"
        )


HEAD = f"{'':34} {'worst K':>9} {'cost':>12} {'failures':>9} {'median ms':>10} {'worst ms':>10}"


MINUTES, MOMENTS = (15, 60), (1, 5)  # periods: how long each activity lasts at least, and less than


def activity(seed: int, periods: int, lasts: tuple[int, int] = MINUTES) -> FloatArray:
    """Requested RMS torques [N*m], shape (periods, 12): walking, climbing, carrying, standing, each for minutes."""
    random = np.random.default_rng(seed)
    levels = np.array([[5, 9, 12], [7, 12, 18], [6, 14, 15], [2, 5, 9]], dtype=float)
    rows: list[FloatArray] = []
    while len(rows) < periods:
        level = levels[random.integers(len(levels))]
        legs = np.repeat(random.uniform(0.8, 1.2, 4), 3)
        rows += [np.tile(level, 4) * legs] * int(random.integers(*lasts))
    return np.array(rows[:periods])


def run(
    controllers: dict[str, Controller],
    start: float,
    steps: int,
    seed: int,
    failed: dict[str, list[int]] | None = None,
    noise: float = NOISE,
) -> dict[str, Outcome]:
    """Closed loops side by side, each on its own copy of the same true robot with the same noise."""
    robot = true_robot(seed)
    worlds = {name: World(robot, start, noise, seed) for name in controllers}
    idle, request = World(robot, start), activity(seed, steps + STAGES)
    outcomes = {name: Outcome() for name in controllers}
    for k in range(steps):
        # From above the limit the best that can be had is what no torque at all would give.
        unavoidable = np.maximum(idle.step(np.zeros(robot.joints), PERIOD)[:, : robot.joints], LIMIT)
        for name, control in controllers.items():
            world, outcome = worlds[name], outcomes[name]
            before = time.thread_time()
            torque = control(world.read(), request[k : k + STAGES])
            outcome.times.append(time.thread_time() - before)
            path = world.step(torque, PERIOD)[:, : robot.joints]
            outcome.violation = max(outcome.violation, float((path - unavoidable).max()))
            outcome.cost += float(((torque - request[k]) ** 2).sum() / (request[:steps] ** 2).sum())
    for name, count in (failed or {}).items():
        outcomes[name].failures = sum(count)
    return outcomes


def ours(model: Model, stages: int, failed: list[int], **settings: float) -> Controller:
    """`TorqueMPC`, its stages' requests averaged from the periods'."""
    mpc = TorqueMPC(model, LIMITS, request="torque", period=PERIOD, horizon=HORIZON, stages=stages, **settings)
    given = conditions(mpc.conditions)

    def control(read: FloatArray, request: FloatArray) -> FloatArray:
        mean = np.sqrt(stage_means(request**2, PERIOD, mpc.settings.stages))
        plan = mpc.step(read, mean, given)
        failed.append(int(not plan.converged))
        admitted: FloatArray = plan.admitted
        return admitted

    return control


def do_mpc_controller(model: Model, start: float, failed: list[int]) -> Controller:
    """do-mpc 5 as its documentation writes it: default collocation and IPOPT, requests as time-varying parameters, a
    soft limit, state feedback."""
    import do_mpc

    from lptn.planners.heating import heating

    heat = heating(model, "torque")
    rate, joints = heat.rate_function(), len(heat.joints)
    plant = do_mpc.model.Model("continuous")
    x = plant.set_variable("_x", "T", shape=(heat.x.numel(), 1))
    u = plant.set_variable("_u", "torque", shape=(joints, 1))
    wanted = plant.set_variable("_tvp", "request", shape=(joints, 1))
    plant.set_rhs("T", rate(x, u**2, conditions(heat.conditions), model.values))
    plant.setup()
    mpc = do_mpc.controller.MPC(plant)
    mpc.settings.n_horizon, mpc.settings.t_step = STAGES, PERIOD
    mpc.settings.store_full_solution = False
    mpc.settings.supress_ipopt_output()
    scale = float((activity(0, 10) ** 2).sum() / 10) * STAGES
    stage = (u - wanted) ** 2 / scale
    mpc.set_objective(mterm=0 * x[0], lterm=sum(stage[j] for j in range(joints)))
    mpc.set_rterm(torque=0.0)
    mpc.bounds["lower", "_u", "torque"] = 0.0
    mpc.bounds["upper", "_u", "torque"] = MOST
    for j in range(joints):
        mpc.set_nl_cons(f"limit{j}", x[j], ub=LIMIT, soft_constraint=True, penalty_term_cons=10.0)
    template, latest = mpc.get_tvp_template(), {"request": activity(0, STAGES)}

    def parameters(_: float) -> object:
        for k in range(STAGES + 1):
            template["_tvp", k, "request"] = latest["request"][min(k, STAGES - 1)]
        return template

    mpc.set_tvp_fun(parameters)
    mpc.setup()
    mpc.x0 = np.full(heat.x.numel(), start)
    mpc.u0 = activity(0, 1)[0]
    mpc.set_initial_guess()

    def control(read: FloatArray, request: FloatArray) -> FloatArray:
        latest["request"] = request
        torque = np.asarray(mpc.make_step(read.reshape(-1, 1))).ravel()
        failed.append(int(not mpc.solver_stats["success"]))
        return torque

    return control


def peers(steps: int, seed: int) -> None:
    """Ours at 16 and at 60 stages and do-mpc, interleaved; then the cost against the converged program."""
    model = model_of(true_robot(seed), ERROR, seed)
    for start, count in ((45.0, steps), (63.0, max(steps // 4, 1)), (61.0, max(steps // 4, 1))):
        names = ("ours, 16 growing stages", "ours, 60 stages", "ours, 16, no bias, no margin", "do-mpc 5")
        failed: dict[str, list[int]] = {name: [] for name in names}
        controllers = {
            names[0]: ours(model, 16, failed[names[0]], recovery=0.0),
            names[1]: ours(model, STAGES, failed[names[1]], recovery=0.0),
            names[2]: ours(model, 16, failed[names[2]], margin=0.0, model_error=0.0, recovery=0.0),
            names[3]: do_mpc_controller(model, start, failed[names[3]]),
        }
        print(f"start {start:g} degC, {count} steps of {PERIOD} s, horizon {HORIZON} s\n{HEAD}")
        outcomes = run(controllers, start, count, seed, failed)
        for name, outcome in outcomes.items():
            print(outcome.row(name))
        slow, fast = (1e3 * np.array(outcomes[name].times) for name in (names[3], names[0]))
        median, most = np.median(slow) / np.median(fast), slow.max() / fast.max()
        print(f"16 growing stages: {median:.0f} times faster than do-mpc in the median, {most:.0f} in the worst case\n")


def robots(steps: int) -> None:
    """The worst temperature above the limit and the failures of ten robots, with noise as told and three times that."""
    for noise, settings in ((NOISE, {}), (0.3, {"noise": 0.3})):
        for start in (45.0, 62.0):
            worst, failed = [], list[int]()
            for seed in range(11, 21):
                controller = ours(model_of(true_robot(seed), ERROR, seed), 16, failed, recovery=0.0, **settings)
                worst.append(run({"ours": controller}, start, steps, seed, noise=noise)["ours"].violation)
            above = ", ".join(f"{violation:.3f}" for violation in worst)
            print(f"noise {noise} K, start {start:g} degC: above {above} K; {sum(failed)} failures", flush=True)


def optimality(seed: int, points: int, lasts: tuple[int, int]) -> None:
    """Cost of the plan against the converged program with 60 stages (IPOPT, RK4), from the same temperatures, both to
    the same margin of 0.15 K: at a level of a half nothing is kept for what is not known."""
    model = model_of(true_robot(seed), ERROR, seed)
    known = partial(TorqueMPC, level=0.5, margin=0.15, model_error=0.0)
    full, few = (
        known(model, LIMITS, request="torque", period=PERIOD, horizon=HORIZON, stages=stages) for stages in (STAGES, 16)
    )
    reference = ReferenceProgram(full.heating, full.settings)
    given, random = conditions(full.conditions), np.random.default_rng(seed)
    print(f"{'from degC':>10} {'IPOPT cost':>12} {'60 stages':>10} {'16 stages':>10} {'over K':>10}")
    worst: dict[int, list[float]] = {60: [], 16: []}
    hottest: list[float] = []
    for point in range(points):
        start = random.uniform(35, 62, len(model.nodes))
        request = activity(100 + point, STAGES, lasts)
        solved = reference.solve(start, request, np.tile(given, (STAGES, 1)))
        gaps, over = [], []
        for mpc in (full, few):
            mpc.reset()
            stages = mpc.settings.stages
            plan = mpc.step(start, np.sqrt(stage_means(request**2, PERIOD, stages)), given)
            # What is applied open loop: each stage's heat scale on the request of every period in it.
            scale = plan.currents**2 / stage_means(request**2, PERIOD, stages)
            torque = np.sqrt(_per_period(scale, stages)) * request
            over.append(_excess(full, start, torque, given) - solved.slack.max())
            cost = float(((torque - request) ** 2).sum() / (request**2).sum())
            gaps.append((cost - solved.cost) / max(solved.cost, LEAST))
        worst = {count: [*kept, gap] for (count, kept), gap in zip(worst.items(), gaps, strict=True)}
        hottest.append(over[1])
        said = "" if solved.converged else "IPOPT failed"
        print(f"{start.mean():10.1f} {solved.cost:12.6f} {gaps[0]:+10.3%} {gaps[1]:+10.3%} {over[1]:10.3f} {said}")
    for count, kept in worst.items():
        print(f"{count} stages: {min(kept):+.3%} to {max(kept):+.3%}, median {np.median(kept):+.3%}")
    print(f"above the margin by at most {max(hottest):.2f} K, median {np.median(hottest):.2f} K")


def _excess(mpc: TorqueMPC, start: FloatArray, torque: FloatArray, given: FloatArray) -> float:
    """Most that a joint is above its limit less the margin at the end of a period, or from above it over the course on
    which it is to come down [K], by the model itself, second-order steps of 1 s."""
    heat, x = mpc.heating, start
    nodes = [heat.model.places.index(node) for node in mpc.settings.limits]
    course = mpc.settings.limits_from(start[nodes]).T
    worst = -np.inf
    rate = heat.rate_function()
    for square, limits in zip(torque**2, course, strict=True):
        for _ in range(PERIOD):
            k1 = rate(x, square, given, mpc.model.values).full().ravel()
            k2 = rate(x + k1 / 2, square, given, mpc.model.values).full().ravel()
            x = x + k2
        worst = max(worst, float((x[nodes] - limits).max()))
    return worst


def _per_period(scale: FloatArray, stages: FloatArray) -> FloatArray:
    """Scales of growing stages, averaged over the periods."""
    ends = np.concatenate([[0.0], np.cumsum(stages)])
    sums = np.vstack([np.zeros((1, scale.shape[1])), np.cumsum(scale * stages[:, None], axis=0)])
    edges = PERIOD * np.arange(STAGES + 1)
    return np.asarray(np.diff(np.column_stack([np.interp(edges, ends, column) for column in sums.T]), axis=0) / PERIOD)


# --- derating and cut-off ------------------------------------------------------------------------------

BEGINS, RESUMES, STOPPED = 50.0, 55.0, 0.1  # degC; degC; share of the request at which a joint has stopped


class Derating:
    """The industry's habit: each joint's torque falls linearly between 50 and 60 degC of its own reading."""

    def __call__(self, read: FloatArray, request: FloatArray) -> FloatArray:
        return np.asarray(request[0] * np.clip((LIMIT - read[:12]) / (LIMIT - BEGINS), 0, 1))


class CutOff:
    """A joint is switched off at 60 degC and on again at 55 degC."""

    def __init__(self) -> None:
        self.off = np.zeros(12, dtype=bool)

    def __call__(self, read: FloatArray, request: FloatArray) -> FloatArray:
        self.off = np.where(self.off, read[:12] > RESUMES, read[:12] >= LIMIT)
        return np.asarray(np.where(self.off, 0.0, request[0]))


def derating(tasks: int, steps: int) -> None:
    """Work |torque| * speed of half an hour at constant joint speed, as a share of what was asked."""
    names = ("TorqueMPC", "linear derating", "cut-off")
    print(f"{'task':>5} " + "".join(f"{name + ': work, until a joint stops, cost, worst K':>62}" for name in names))
    all_rows = []
    for seed in range(1, tasks + 1):
        robot, request = true_robot(seed), activity(seed, steps + STAGES)
        model = model_of(robot, ERROR, seed)
        row = []
        for control in (ours(model, 16, []), Derating(), CutOff()):
            world, done, before, stopped, cost, worst = World(robot, 35.0, NOISE, seed), 0.0, 0.0, False, 0.0, 0.0
            for k in range(steps):
                torque = control(world.read(), request[k : k + STAGES])
                stopped = stopped or bool((torque < STOPPED * request[k]).any())
                done += float(torque.sum())
                before += 0.0 if stopped else float(torque.sum())
                cost += float(((torque - request[k]) ** 2).sum())
                worst = max(worst, float(world.step(torque, PERIOD)[:, :12].max() - LIMIT))
            asked = request[:steps]
            row.append((done / asked.sum(), before / asked.sum(), cost / (asked**2).sum(), worst))
        all_rows.append(row)
        print(f"{seed:5d} " + "".join(f"{a:32.1%} {b:9.1%} {c:9.4f} {d:9.3f}" for a, b, c, d in row))
    mean = np.array(all_rows).mean(axis=0)
    print(" mean " + "".join(f"{a:32.1%} {b:9.1%} {c:9.4f} {d:9.3f}" for a, b, c, d in mean))


# --- as a robot runs it -------------------------------------------------------------------------------------


def emitted(seed: int, steps: int) -> None:
    """Time per call of the emitted C programs, and how far their numbers are from Python's."""
    model, random = model_of(true_robot(seed), ERROR, seed), np.random.default_rng(seed)
    request = activity(seed, steps)
    for stages in (16, STAGES):
        mpc = TorqueMPC(model, LIMITS, request="torque", period=PERIOD, horizon=HORIZON, stages=stages)
        given = conditions(mpc.conditions)
        starts = random.uniform(50, 61, (steps, len(model.nodes)))
        here = [mpc.step(start, asked, given).admitted for start, asked in zip(starts, request, strict=True)]
        rows = [(*start, *asked, *given) for start, asked in zip(starts, request, strict=True)]
        lines = [" ".join(f"{value:.17g}" for value in row) for row in rows]
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            mpc.emit(folder, starts[0], request, np.tile(given, (steps, 1)))
            output, said = _built_and_run(folder, "lptn_mpc.c", "\n".join(lines))
        apart = float(np.abs(output[:, : len(mpc.joints)] - np.array(here)).max())
        print(f"controller, {stages} stages: {said}; largest difference from Python {apart:.1e} N*m")
    limiter = Limiter(model, LIMITS, request="torque", current_limits=40.0)
    given, load = conditions(limiter.conditions), np.tile([2.0, 3.0, 4.0], 4)
    starts = random.uniform(40, 59, (steps, len(model.nodes)))
    here = [limiter.admissible(start, load, given).ravel() for start in starts]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        limiter.emit(folder, starts[0], load, given)
        lines = [" ".join(f"{value:.17g}" for value in (*row, *load, *given)) for row in starts]
        output, said = _built_and_run(folder, "admissible.c", "\n".join(lines))
    apart = float(np.abs(output - np.array(here)).max())
    print(f"limiter, {output.shape[1]} numbers: {said}; largest difference from Python {apart:.1e} N*m")


def _built_and_run(folder: Path, source: str, lines: str) -> tuple[FloatArray, str]:
    words = [
        "cc",
        "-std=c99",
        "-O2",
        "-ftree-vectorize",
        "-ffp-contract=off",
        "-DLPTN_WIDE",
        "main.c",
        source,
        "-lm",
        "-o",
        "program",
    ]
    subprocess.run(words, cwd=folder, check=True, capture_output=True)
    done = subprocess.run([folder / "program"], input=lines, capture_output=True, text=True, check=True)
    return np.array([[float(word) for word in line.split()] for line in done.stdout.splitlines()]), done.stderr.strip()


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["peers", "robots", "optimality", "derating", "emitted"])
    parser.add_argument("--steps", type=int, default=200)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    if arguments.what == "peers":
        peers(arguments.steps, arguments.seed)
    elif arguments.what == "robots":
        robots(arguments.steps)
    elif arguments.what == "optimality":
        for lasts in (MINUTES, MOMENTS):
            print(f"activities of {PERIOD * lasts[0]} to {PERIOD * (lasts[1] - 1)} s:")
            optimality(arguments.seed, 12, lasts)
    elif arguments.what == "derating":
        derating(10, 360)
    else:
        emitted(arguments.seed, arguments.steps)


if __name__ == "__main__":
    main()
