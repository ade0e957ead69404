"""How `TorqueMPC`'s time grows with nodes and stages, beside acados in C and do-mpc, in one run.

Run it with ``python -m tests.benchmarks.torque_mpc_scaling --acados FOLDER``. acados comes from PyPI:
``pip install --no-deps --target FOLDER comma-deps-acados``. Each line is written when it is ready.

A chain of motors, each with copper loss that grows with temperature and a way to the air, all of whose nodes have a
limit; five seconds a stage. All solve the same sequence of starts from 50 to 58 degC, each near the one before, for
the same torques. Ours solves each problem to its optimum, without an estimate. acados makes one real-time
iteration on the heat scale (the cost's Hessian, which is convex there), with partially condensing HPIPM and RK4, all
of it one call into C. do-mpc is as its documentation writes it (collocation, IPOPT, warm start). Times are the
processor's, the median of some calls.

Each cell has a process of its own, which may use ``--limit`` seconds of processor time, building included, and acados'
``--acados-limit``, for it compiles functions that grow with the square of the nodes. `>` marks a cell that came to no
call's end within them; `-` one that has no fewer nodes and stages than such a cell.
"""

from __future__ import annotations

import argparse
import ctypes
import importlib.util
import multiprocessing
import os
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from functools import partial
from itertools import pairwise
from math import ceil
from pathlib import Path
from types import ModuleType

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.planners.heating import heating
from lptn.planners.mpc import TorqueMPC

NODES, STAGES, PERIOD, LIMIT, AMBIENT = (1, 3, 13, 26, 52, 104), (16, 60, 240), 5.0, 60.0, 25.0
CALLS = 12  # of each cell, once it is warm
PATIENCE, CELL, COMPILING = 20.0, 40.0, 1500.0  # s: of calls, after which a cell makes no more; of a cell; of acados'
_USED_UP = 0.9  # share of the limit; who has used so much was ended by it
SLACK = (1e2, 1e3)  # price of a kelvin, linear and quadratic, for the peers

CHAIN = """
[model]
name = "chain"
joints = {joints}
ambient = "temperature.ambient"
[nodes."*"]
capacity = 300
[[links]]
between = ["*_motor", "ambient"]
resistance = 10
{links}
[[effects]]
kind = "copper_loss"
at = "*_motor"
resistance = 0.15
torque_constant = 0.84357
[[effects]]
kind = "resistance_rise"
at = "*_motor"
"""


def chain(nodes: int) -> Model:
    """Motors in a row."""
    names = [f"J{k}_motor" for k in range(nodes)]
    links = "".join(f'[[links]]\nbetween = ["{a}", "{b}"]\nresistance = 3\n' for a, b in pairwise(names))
    text = CHAIN.format(joints=str(names).replace("'", '"'), links=links)
    return Model(parse_model(text, Path("chain.toml")).network)


def sequence(nodes: int) -> tuple[FloatArray, FloatArray]:
    """Starts, shape (calls, nodes), and the request [N*m]."""
    random = np.random.default_rng(nodes)
    asked = random.uniform(8, 18, nodes)
    starts = [random.uniform(50, 58, nodes)]
    for _ in range(CALLS):
        starts.append(np.clip(starts[-1] + random.uniform(-0.3, 0.3, nodes), 45, 59.8))
    return np.array(starts), asked


Solve = Callable[[FloatArray], float]
"""From a start to seconds."""


def ours(model: Model, stages: int, asked: FloatArray) -> Solve:
    """`TorqueMPC` with equal stages."""
    horizon = PERIOD * stages
    # The starts follow from no plan: an estimate would learn from them that the model lacks a heat.
    mpc = TorqueMPC(model, LIMIT, request="torque", period=PERIOD, horizon=horizon, stages=stages, model_error=0.0)

    def solve(start: FloatArray) -> float:
        before = time.thread_time()
        mpc.step(start, asked, [AMBIENT])
        return time.thread_time() - before

    return solve


def acados_at(folder: Path) -> ModuleType:
    """acados' interface from a folder that can't be on Python's path, for the CasADi in it would come before ours."""
    spec = importlib.util.spec_from_file_location("acados", folder.resolve() / "acados" / "__init__.py")
    if spec is None or spec.loader is None:
        raise ImportError(f"no acados in {folder}")
    package = sys.modules["acados"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(package)
    os.environ |= {
        "ACADOS_SOURCE_DIR": package.DIR,
        "ACADOS_PYTHON_INTERFACE_PATH": package.TEMPLATE_DIR,
        "TERA_PATH": package.TERA_PATH,
    }
    for library in ("blasfeo", "hpipm", "qpOASES_e", "acados"):  # what acados' own code asks for by name
        ctypes.CDLL(str(Path(package.LIB_DIR) / f"lib{library}.so"), ctypes.RTLD_GLOBAL)
    return importlib.import_module("acados.acados_template")


def acados(interface: ModuleType, folder: Path, model: Model, stages: int, asked: FloatArray) -> Solve:
    """acados' real-time iteration on the heat scale; its code goes to a folder."""
    heat, nodes = heating(model, "torque"), len(model.nodes)
    scale, moved = ca.SX.sym("scale", nodes), ca.SX.sym("moved", nodes)
    rates = heat.rates_at(scale * ca.DM(asked**2))
    rates = ca.cse(ca.substitute(ca.substitute(rates, heat.d, ca.DM([AMBIENT])), heat.p, ca.DM(model.values)))
    ocp = interface.AcadosOcp()
    ocp.model.name, ocp.model.x, ocp.model.u, ocp.model.xdot = f"chain_{nodes}", heat.x, scale, moved
    ocp.model.f_expl_expr, ocp.model.f_impl_expr = rates, moved - rates
    ocp.dims.N, ocp.solver_options.tf = stages, PERIOD * stages
    ocp.cost.cost_type, ocp.cost.cost_type_e = "EXTERNAL", "EXTERNAL"
    share = ca.DM(asked**2 / float(asked @ asked))
    ocp.model.cost_expr_ext_cost = ca.dot(share, (1 - ca.sqrt(scale + 1e-4)) ** 2) / stages
    ocp.model.cost_expr_ext_cost_e = ca.SX(0)
    every, bounds = np.arange(nodes), ocp.constraints
    bounds.lbu, bounds.ubu, bounds.idxbu = np.zeros(nodes), np.ones(nodes), every
    for end in ("", "_e"):
        for name, value in (("lbx", np.full(nodes, -100.0)), ("ubx", np.full(nodes, LIMIT)), ("idxbx", every),
                            ("idxsbx", every)):  # fmt: skip
            setattr(bounds, name + end, value)
        for name, price in (("zl", SLACK[0]), ("zu", SLACK[0]), ("Zl", SLACK[1]), ("Zu", SLACK[1])):
            setattr(ocp.cost, name + end, np.full(nodes, price))
    bounds.x0 = np.full(nodes, 50.0)
    options = ocp.solver_options
    options.qp_solver, options.integrator_type = "PARTIAL_CONDENSING_HPIPM", "ERK"
    options.nlp_solver_type, options.qp_solver_iter_max = "SQP_RTI", 100
    # An external cost's own Hessian is exact all the same; the dynamics' are left out, so that there is nothing to
    # regularise, and not compiled, which takes as long as all else.
    options.hessian_approx = "GAUSS_NEWTON"
    ocp.code_export_directory = str(folder / f"code_{nodes}_{stages}")
    solver = interface.AcadosOcpSolver(ocp, json_file=str(folder / f"ocp_{nodes}_{stages}.json"), verbose=False)
    for k in range(stages + 1):
        solver.set(k, "x", np.full(nodes, 55.0))
        if k < stages:
            solver.set(k, "u", np.full(nodes, 0.5))

    def solve(start: FloatArray) -> float:
        solver.set(0, "lbx", start)
        solver.set(0, "ubx", start)
        before = time.thread_time()
        solver.solve()
        return time.thread_time() - before

    return solve


def do_mpc_controller(model: Model, stages: int, asked: FloatArray) -> Solve:
    """do-mpc, default collocation and IPOPT."""
    import do_mpc

    heat, nodes = heating(model, "torque"), len(model.nodes)
    plant = do_mpc.model.Model("continuous", symvar_type="SX")
    x, u = plant.set_variable("_x", "T", (nodes, 1)), plant.set_variable("_u", "torque", (nodes, 1))
    plant.set_rhs("T", heat.rate_function()(x, u**2, np.array([AMBIENT]), model.values))
    plant.setup()
    mpc = do_mpc.controller.MPC(plant)
    mpc.settings.n_horizon, mpc.settings.t_step, mpc.settings.store_full_solution = stages, PERIOD, False
    mpc.settings.supress_ipopt_output()
    mpc.set_objective(mterm=0 * x[0], lterm=ca.sumsqr(u - asked) / float(asked @ asked))
    mpc.set_rterm(torque=0.0)
    mpc.bounds["lower", "_u", "torque"], mpc.bounds["upper", "_u", "torque"] = np.zeros(nodes), asked
    for k in range(nodes):
        mpc.set_nl_cons(f"limit{k}", x[k], ub=LIMIT, soft_constraint=True, penalty_term_cons=10.0)
    mpc.setup()
    mpc.x0 = np.full(nodes, 55.0)
    mpc.set_initial_guess()

    def solve(start: FloatArray) -> float:
        before = time.thread_time()
        mpc.make_step(start[:, None])
        return time.thread_time() - before

    return solve


def measured(solve: Solve, starts: FloatArray) -> float:
    """Milliseconds of a call once it is warm; few calls where they are long."""
    times = [solve(starts[0])]
    for start in starts[1:]:
        times.append(solve(start))
        if sum(times) > PATIENCE:
            break
    kept = times[1:] or times
    return 1e3 * float(np.median(kept))


def timed(
    make: Callable[[Model, int, FloatArray], Solve], model: Model, stages: int, asked: FloatArray, starts: FloatArray
) -> float:
    """Build a solver and measure it [ms]."""
    return measured(make(model, stages, asked), starts)


def within(limit: float, work: Callable[[], float]) -> float | None:
    """What `work` returns in a process of its own, `None` where that uses more processor time than the limit [s]."""
    ours_end, its_end = multiprocessing.Pipe(duplex=False)

    def run() -> None:
        resource.setrlimit(resource.RLIMIT_CPU, (ceil(limit), ceil(limit)))
        try:
            its_end.send(work())
        except OSError:  # of a compiler that was ended by the same limit there is no library
            used = resource.getrusage(resource.RUSAGE_CHILDREN)
            if used.ru_utime + used.ru_stime < _USED_UP * limit:
                raise
            os.kill(os.getpid(), signal.SIGKILL)

    process = multiprocessing.get_context("fork").Process(target=run)
    process.start()
    its_end.close()
    try:
        return float(ours_end.recv())
    except EOFError:
        process.join()
        if process.exitcode not in (-signal.SIGXCPU, -signal.SIGKILL):
            raise RuntimeError(f"a cell ended with {process.exitcode}") from None
        return None
    finally:
        process.join()


def main() -> None:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--acados", type=Path, help="folder with the package acados")
    parser.add_argument("--nodes", type=int, nargs="*", default=NODES)
    parser.add_argument("--stages", type=int, nargs="*", default=STAGES)
    parser.add_argument("--no-do-mpc", action="store_true")
    parser.add_argument("--limit", type=float, default=CELL, help="processor time of a cell [s]")
    parser.add_argument("--acados-limit", type=float, default=COMPILING, help="of one of acados'")
    arguments = parser.parse_args()
    solvers: dict[str, Callable[[Model, int, FloatArray], Solve]] = {"ours": ours}
    with tempfile.TemporaryDirectory() as name:
        if arguments.acados:
            solvers["acados"] = partial(acados, acados_at(arguments.acados), Path(name))
        if not arguments.no_do_mpc:
            solvers["do-mpc"] = do_mpc_controller
        print(f"{'nodes':>5} {'stages':>6} " + " ".join(f"{solver + ' ms':>10}" for solver in solvers), flush=True)
        too_long: dict[str, list[tuple[int, int]]] = {solver: [] for solver in solvers}
        for nodes in arguments.nodes:
            model, (starts, asked) = chain(nodes), sequence(nodes)
            for stages in arguments.stages:
                row = []
                for solver, make in solvers.items():
                    if any(nodes >= n and stages >= k for n, k in too_long[solver]):
                        row.append(f"{'-':>10}")
                        continue
                    limit = arguments.acados_limit if solver == "acados" else arguments.limit
                    milliseconds = within(limit, partial(timed, make, model, stages, asked, starts))
                    if milliseconds is None:
                        too_long[solver].append((nodes, stages))
                    row.append(f"{'>':>10}" if milliseconds is None else f"{milliseconds:10.3f}")
                print(f"{nodes:5d} {stages:6d} " + " ".join(row), flush=True)


if __name__ == "__main__":
    main()
