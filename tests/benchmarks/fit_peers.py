"""One fit beside its peers: the same two hours of logs, model, start and bounds; processor time, one thread.

    python -m tests.benchmarks.fit_peers
    python -m tests.benchmarks.fit_peers --only scipy simultaneous
    python -m tests.benchmarks.fit_peers --old OLD/bin/lptn

Peers at the best settings that were found: SciPy's trust region with finite differences and with our derivatives; IPOPT
on CasADi's single shooting, multiple shooting (ten minutes an interval) and simultaneous transcription, which have the
same least squares to solve; the likelihood of a Kalman filter with process noise, as CTSM-R maximises it, which is
another question with the same unknowns and one more a node; PySINDy's regression on derivatives, which finds
coefficients and fits no run. Building is not counted where it can be kept. Then how far a fit is from its bare
arithmetic, and the same command one release back.

Truth is the plain virtual quadruped (`identification.py`).
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
from scipy.optimize import least_squares

from lptn.basics.arrays import FloatArray
from lptn.basics.parameters import Transform
from lptn.identify.integral_start import integral_start
from lptn.identify.noise import balanced_sigma, estimate_noise
from lptn.identify.problem import Problem
from lptn.identify.solvers import minimise
from lptn.model.model import Model
from lptn.robots.presets import preset_text
from lptn.simulate.bound_run import BoundRun
from lptn.virtual import quadruped_logs, write_logs
from tests.benchmarks.identification import TWO_HOURS, load

SEED = 11
STEP = 10  # s
INTERVAL = 60  # steps of a shooting interval
START_SPREAD = 10.0  # K, of the runs' initial temperatures; as in `lptn.identify.problem`
LIMIT = 300.0  # s that IPOPT may take for each program, unless it is said
IPOPT = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes"}


class Counting(Problem):
    """The least squares; it counts how often it was evaluated."""

    costs = normals = 0

    def cost(self, z: FloatArray) -> float:
        self.costs += 1
        return super().cost(z)

    def normal(self, z: FloatArray) -> tuple[FloatArray, FloatArray]:
        self.normals += 1
        return super().normal(z)


@dataclass(frozen=True)
class Task:
    """What all of them start from.

    Args:
        problem: the least squares.
        start: of the search, from the integrated heat balance, shape (size,).
        limit: s that IPOPT may take for a program.
    """

    problem: Counting
    start: FloatArray
    limit: float

    @property
    def model(self) -> Model:
        """The model."""
        return self.problem.model

    @property
    def runs(self) -> list[BoundRun]:
        """The runs."""
        return self.problem.bound_runs


def task(limit: float = LIMIT) -> Task:
    """The same for each peer."""
    model, runs = load(SEED, TWO_HOURS, step=STEP)
    sigma = balanced_sigma(runs, estimate_noise(runs, model.nodes))
    problem = Counting(model, runs, sigma)
    return Task(problem, problem.guess(integral_start(model, runs, sigma)), limit)


def spent(run: Callable[[], object]) -> float:
    """Processor time of a call [s]."""
    began = time.process_time()
    run()
    return time.process_time() - began


# --- ours ----------------------------------------------------------------------------------------------------------


def ours(given: Task) -> float:
    """Time of one search, everything compiled; prints how far that is from the arithmetic."""
    problem = given.problem

    def search() -> None:
        minima.append(minimise(problem, given.start).cost)

    minima: list[float] = []
    search()
    seconds = min(spent(search) for _ in range(3))
    problem.costs = problem.normals = 0
    search()
    costs, normals = problem.costs, problem.normals
    print(f"ours: {seconds:.3f} s, {costs} costs and {normals} derivatives; cost {minima[-1]:.4f}", flush=True)
    of_cost, of_normal = arithmetic(given)
    rate = rate_of_products()
    bare = (costs * of_cost + normals * of_normal) / rate
    times = [min(spent(partial(call, given.start)) for _ in range(5)) for call in (problem.cost, problem.normal)]
    print(
        f"  a cost takes {1e3 * times[0]:.1f} ms for {of_cost / 1e6:.1f} million additions and multiplications, "
        f"derivatives {1e3 * times[1]:.1f} ms for {of_normal / 1e6:.0f};\n"
        f"  products of matrices make {rate / 1e9:.0f} thousand million a second here: "
        f"the bare arithmetic would take {1e3 * bare:.0f} ms, the search takes {seconds / bare:.0f} times as long",
        flush=True,
    )
    return seconds


def arithmetic(given: Task) -> tuple[float, float]:
    """Additions and multiplications of one cost, and of one gradient with its Gauss-Newton Hessian."""
    model, problem = given.model, given.problem
    rates = model.rhs.n_instructions()
    x, _, _, of_states, _ = model.symbols
    nonzeros = ca.jacobian(of_states, x).nnz()
    states, width = len(model.states), len(problem.free) + len(model.states)
    steps = sum(len(bound) for bound in given.runs)
    one = steps * 4 * (rates + 4 * states)
    along = steps * 4 * (2 * nonzeros * width + 4 * states * width)
    return one, one + along + problem.readings * width * (width + 1)


def rate_of_products() -> float:
    """Operations a second of a product of matrices that fit in the cache, on one thread."""
    a = np.random.default_rng(0).normal(size=(256, 256))
    seconds = min(spent(lambda: [a @ a for _ in range(20)]) for _ in range(5)) / 20
    return float(2 * 256**3 / seconds)


# --- SciPy ---------------------------------------------------------------------------------------------------------


def scipy(given: Task, mine: float) -> None:
    """Trust region, with finite differences and with our derivatives."""
    problem = given.problem
    lower, upper = problem.bounds
    inside = np.clip(given.start, lower + 1e-9, upper - 1e-9)
    ways: dict[str, str | Callable[[FloatArray], FloatArray]] = {
        "finite differences": "2-point",
        "our derivatives": lambda z: problem.jacobian(z)[1],
    }
    for name, jacobian in ways.items():
        costs: list[float] = []

        def run(jacobian: str | Callable[[FloatArray], FloatArray] = jacobian, costs: list[float] = costs) -> None:
            done = least_squares(problem.residuals, inside, jac=jacobian, bounds=(lower, upper), x_scale="jac")  # type: ignore[arg-type]
            costs.append(float(done.cost))

        say(f"scipy trf, {name}", spent(run), mine, f"cost {costs[0]:.4f}")


# --- CasADi's transcriptions with IPOPT -------------------------------------------------------------------------


def _parameters(given: Task) -> tuple[ca.MX, ca.MX]:
    """The free unknowns, and all parameters as an expression of them."""
    problem, model = given.problem, given.model
    z, p = ca.MX.sym("z", len(problem.free)), ca.MX(model.values)
    transform = Transform([model.parameters[index] for index in problem.free])
    for k, index in enumerate(problem.free):
        p[index] = transform.expression(k, z[k])
    return z, p


def _misfit(given: Task, bound: BoundRun, path: ca.MX, first: FloatArray) -> ca.MX:
    """Half the squares of a run's errors of means over its steps, and of its start."""
    nodes = len(given.model.nodes)
    means = 0.5 * (path[:nodes, :-1] + path[:nodes, 1:])
    error = (bound.measured - means) / given.problem.sigma[:, None]
    return 0.5 * ca.sumsqr(error) + 0.5 * ca.sumsqr((path[:, 0] - first) / START_SPREAD)


def shooting(given: Task, interval: int | None) -> tuple[dict[str, ca.MX], FloatArray]:
    """The program of shooting from the start of each interval, of each run for `None`, and where it starts."""
    model, z_p = given.model, _parameters(given)
    z, p = z_p
    unknowns, guess, equal, cost = [z], [given.start[: z.numel()]], [], ca.MX(0)
    for bound, first in zip(given.runs, given.problem.point(given.start).starts, strict=True):
        size, n, h = interval or len(bound), len(bound), bound.run.step
        pieces, before = [], None
        for begin in range(0, n, size):
            count = min(size, n - begin)
            x0 = ca.MX.sym("x0", len(model.states))
            accumulated = model.step("rk4").mapaccum(count)
            u = bound.inputs[:, begin : begin + count]
            path = accumulated(x0, u, ca.repmat(p, 1, count), ca.repmat(ca.DM(h), 1, count))
            if before is not None:
                equal.append(x0 - before)
            pieces += [x0, path] if before is None else [path]
            before = path[:, -1]
            unknowns.append(x0)
            guess.append(first if begin == 0 else _filled(bound.measured[:, begin], first))
        cost += _misfit(given, bound, ca.horzcat(*pieces), first)
    program = {"x": ca.vertcat(*unknowns), "f": cost, "g": ca.vertcat(*equal) if equal else ca.MX(0, 1)}
    return program, np.concatenate(guess)


def _filled(measured: FloatArray, otherwise: FloatArray) -> FloatArray:
    start = otherwise.copy()
    start[: len(measured)] = np.where(np.isfinite(measured), measured, otherwise[: len(measured)])
    return start


def simultaneous(given: Task) -> tuple[dict[str, ca.MX], FloatArray]:
    """The program over all states of all steps, as textbooks transcribe it, and where it starts."""
    z, p = _parameters(given)
    unknowns, guess, equal, cost = [z], [given.start[: z.numel()]], [], ca.MX(0)
    for bound, first in zip(given.runs, given.problem.point(given.start).starts, strict=True):
        n = len(bound)
        path = ca.MX.sym("x", len(given.model.states), n + 1)
        step = given.model.step("rk4").map(n)
        following = step(path[:, :-1], bound.inputs, ca.repmat(p, 1, n), ca.repmat(ca.DM(bound.run.step), 1, n))
        equal.append(ca.vec(path[:, 1:] - following))
        cost += _misfit(given, bound, path, first)
        unknowns.append(ca.vec(path))
        guess.append(np.hstack([bound.measured[:, :1], bound.measured]).T.ravel())
    return {"x": ca.vertcat(*unknowns), "f": cost, "g": ca.vertcat(*equal)}, np.concatenate(guess)


def kalman(given: Task) -> tuple[dict[str, ca.MX], FloatArray]:
    """The program of the likelihood of a filter with process noise of its own at each node, and where it starts."""
    model, runs = given.model, given.runs
    z, p = _parameters(given)
    noise = ca.MX.sym("noise", len(model.states))  # logarithm of the intensity [K/√s]
    one = _filter_step(given)
    cost, unknowns, guess = ca.MX(0), [z, noise], [given.start[: z.numel()], np.full(len(model.states), np.log(1e-3))]
    for bound, first in zip(runs, given.problem.point(given.start).starts, strict=True):
        n, states = len(bound), len(model.states)
        covariance = np.eye(states) * START_SPREAD**2 / 100
        begin = np.concatenate([first, covariance.T.ravel(), [0.0]])
        path = one.mapaccum(n)(begin, bound.inputs, bound.measured, ca.repmat(p, 1, n), ca.repmat(noise, 1, n))
        cost += path[-1, -1]
    return {"x": ca.vertcat(*unknowns), "f": cost, "g": ca.MX(0, 1)}, np.concatenate(guess)


def _filter_step(given: Task) -> ca.Function:
    """(state, covariance and negative log-likelihood so far; u; reading; p; noise) -> the same a step later."""
    model, h, sigma = given.model, given.runs[0].run.step, given.problem.sigma
    n, nodes = len(model.states), len(model.nodes)
    all_before = ca.SX.sym("all", n + n * n + 1)
    x, covariance, total = all_before[:n], ca.reshape(all_before[n:-1], n, n), all_before[-1]
    u, y = ca.SX.sym("u", len(model.inputs)), ca.SX.sym("y", nodes)
    p, noise = ca.SX.sym("p", len(model.parameters)), ca.SX.sym("noise", n)
    following = model.step("rk4")(x, u, p, h)
    slope = ca.jacobian(following, x)
    covariance = slope @ covariance @ slope.T + ca.diag(h * ca.exp(2 * noise))
    innovation = y - following[:nodes]
    spread = covariance[:nodes, :nodes] + ca.diag(sigma**2)
    gain = ca.solve(spread, covariance[:nodes, :]).T
    total = total + 0.5 * (innovation.T @ ca.solve(spread, innovation) + ca.log(ca.det(spread)))
    after = ca.vertcat(following + gain @ innovation, ca.vec(covariance - gain @ covariance[:nodes, :]), total)
    return ca.Function("filter", [all_before, u, y, p, noise], [after])


def ipopt(
    given: Task, mine: float, name: str, made: tuple[dict[str, ca.MX], FloatArray], options: dict[str, str | int]
) -> None:
    """Solve a program and print how long that took."""
    program, guess = made
    chosen: dict[str, Any] = {**IPOPT, "ipopt.max_cpu_time": given.limit, **options}
    solver = ca.nlpsol("peer", "ipopt", program, chosen)
    lower, upper = given.problem.bounds
    free, size, equalities = len(given.problem.free), len(guess), program["g"].numel()
    bounds = [np.full(size, -np.inf), np.full(size, np.inf)]
    bounds[0][:free], bounds[1][:free] = lower[:free], upper[:free]
    minima: list[float] = []

    def run() -> None:
        done = solver(x0=guess, lbx=bounds[0], ubx=bounds[1], lbg=np.zeros(equalities), ubg=np.zeros(equalities))
        minima.append(float(done["f"]))

    seconds = spent(run)
    statistics = solver.stats()
    say(
        name,
        seconds,
        mine,
        f"{statistics['return_status']}, {statistics['iter_count']} iterations, cost {minima[0]:.4f}",
    )


# --- others ------------------------------------------------------------------------------------------------------


def sindy(given: Task, mine: float) -> None:
    """PySINDy's regression of derivatives on temperatures and heat."""
    if find_spec("pysindy") is None:
        print("pysindy: not installed")
        return
    import pysindy

    def run() -> None:
        model = pysindy.SINDy(optimizer=pysindy.STLSQ(threshold=1e-6), feature_library=pysindy.PolynomialLibrary(1))
        x = [bound.measured.T for bound in given.runs]
        u = [bound.inputs.T**2 for bound in given.runs]
        model.fit(x, t=float(STEP), u=u)

    say("pysindy, linear library", spent(run), mine, "coefficients of derivatives, no run fitted")


def one_release_back(commands: Sequence[str]) -> None:
    """`lptn fit` on the same files by each command: processor time of the whole process, least of three."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        model = folder / "quadruped.toml"
        model.write_text(preset_text("quadruped", "coupled"))
        logs = quadruped_logs(seed=SEED, runs="protocol", physics="plain", quantisation=1.0)
        files = write_logs(folder, {key: logs[key] for key in TWO_HOURS})
        for command in commands:
            words = [command, "fit", str(model), *map(str, files), "-o", str(folder / "better.toml")]
            times = []
            for _ in range(3):
                before = resource.getrusage(resource.RUSAGE_CHILDREN)
                subprocess.run(words, capture_output=True, check=True, env=os.environ | {"OMP_NUM_THREADS": "1"})
                after = resource.getrusage(resource.RUSAGE_CHILDREN)
                times.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
            print(f"{command} fit, whole command: {min(times):.2f} s", flush=True)


def say(name: str, seconds: float, mine: float, rest: str) -> None:
    """A line of the table."""
    print(f"{name}: {seconds:.2f} s, {seconds / mine:.0f} times ours ({mine:.3f} s); {rest}", flush=True)


PEERS: dict[str, Callable[[Task, float], None]] = {
    "scipy": scipy,
    "simultaneous": lambda given, mine: ipopt(
        given, mine, "IPOPT, simultaneous, exact Hessian", simultaneous(given), {}
    ),
    "multiple": lambda given, mine: ipopt(
        given, mine, "IPOPT, multiple shooting, exact Hessian", shooting(given, INTERVAL), {}
    ),
    "single": lambda given, mine: ipopt(
        given,
        mine,
        "IPOPT, single shooting, limited memory",
        shooting(given, None),
        {"ipopt.hessian_approximation": "limited-memory"},
    ),
    "kalman": lambda given, mine: ipopt(
        given,
        mine,
        "likelihood of a Kalman filter, as CTSM-R",
        kalman(given),
        {"ipopt.hessian_approximation": "limited-memory", "ipopt.max_iter": 300},
    ),
    "sindy": sindy,
}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="*", choices=list(PEERS), default=list(PEERS))
    parser.add_argument("--old", nargs="*", default=[], help="commands of other releases, beside this one's")
    parser.add_argument("--limit", type=float, default=LIMIT, help="s that IPOPT may take for a program")
    chosen = parser.parse_args()
    given = task(chosen.limit)
    free = len(given.problem.free)
    print(f"{free} parameters, {given.problem.size} unknowns, {given.problem.readings} readings", flush=True)
    mine = ours(given)
    for name in chosen.only:
        PEERS[name](given, mine)
    if chosen.old:
        one_release_back([*chosen.old, str(Path(sys.executable).with_name("lptn"))])


if __name__ == "__main__":
    main()
