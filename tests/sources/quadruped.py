"""S0: the article on a whole-body thermal model of a quadruped [QuadrupedLPTN]; its robot is a virtual one here."""

from __future__ import annotations

import math
import time
import warnings
from collections.abc import Iterable
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import SimpleNamespace

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from scipy.integrate import simpson
from scipy.linalg import expm

from lptn.applications.gym import ID
from lptn.effects.coulomb_friction import CoulombFriction
from lptn.effects.resistance_rise import ResistanceRise
from lptn.effects.viscous_friction import ViscousFriction
from lptn.fmu import Session
from lptn.identify.problem import Problem
from lptn.logs.resampling import reduce_blocks
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.model.network import Network
from lptn.online.monitoring import MonitoredRun, alarms_by_threshold
from lptn.robots.presets import presets
from lptn.simulate.state_space import state_space
from lptn.virtual import QUADRUPED_JOINTS, Bout, Job, motion, plan, quadruped_logs
from tests.builders import AMBIENT, bound_runs, effect, leg, link, node, random_inputs, two_nodes, with_every_effect
from tests.identify import test_fit_problem
from tests.identify.truth import TRUTH, truth_run
from tests.identify.truth import network as two_node_network
from tests.online import test_monitor
from tests.sources.row import Check, Verdict, above, below, differs, equal, printed, row
from tests.sources.trials import LEVELS, SEEDS, SOURCE_RUNS, forecasts, largest, neighbours, whole_body, windings

REFERENCE = Path(__file__).parents[2] / "fmu" / "reference"
PHYSICS = "tests/effects/test_physics.py"
STATES = "tests/simulate/test_state_space.py"


def _p(**values: float) -> SimpleNamespace:
    return SimpleNamespace(**values)


def _one(capacity: float = 300.0, resistance: float = 8.0, *effects: str, **values: float) -> Model:
    """One node that is cooled by the air."""
    declared = tuple(effect(key, "a", **values) for key in effects)
    return Model(Network("one", (node("a", capacity), AMBIENT), (link("a", "ambient", resistance),), declared))


# --- equations ------------------------------------------------------------------------------------------


@row("S0-E1", "heat into a motor", "Q_in = I² R_d + Q_other", more=PHYSICS)
def heat_in() -> Iterable[Check]:
    copper = replace(effect("copper_loss", "a", resistance=0.15, torque_constant=0.84), at="a")
    heat = effect("constant_heat", "a", power=4.0)
    model = Model(Network("one", (node("a", 300.0), AMBIENT), (link("a", "ambient", 8.0),), (copper, heat)))
    rate = float(model.rhs([20.0], [_inputs(model, torque=5.0)[k] for k in range(len(model.inputs))], model.values)[0])
    yield equal("C dT/dt at the ambient's temperature", 300.0 * rate, 0.15 * (5.0 / 0.84) ** 2 + 4.0, "W", 1e-12)


def _inputs(model: Model, torque: float = 0.0, ambient: float = 20.0) -> list[float]:
    return [{"torque": torque, "temperature": ambient}.get(name.split(".")[0], 0.0) for name in model.inputs]


@row("S0-E2", "one node", "dT/dt = (Q_in - (T - T_E)/R)/C", more=PHYSICS)
def one_node() -> Iterable[Check]:
    model = _one(100.0, 3.0, "constant_heat", power=5.0)
    after = [float(model.step("zoh")([20.0], [20.0], model.values, t)) for t in (300.0, 3e5)]
    yield equal("T in the end", after[1], 20.0 + 15.0, "degC", 1e-9)
    yield equal("share of the rise after RC", (after[0] - 20.0) / 15.0, 1 - np.exp(-1), "", 1e-9)


@row("S0-E3", "resistance to the air", "R = R_c exp(-β (T - T_E))/(1 + γ |V|)", more=PHYSICS)
def resistance_to_air() -> Iterable[Check]:
    r, beta, gamma = 11.0, 0.006, 0.55
    convection = [effect("natural_convection", "a", beta=beta), effect("forced_convection", "a", gamma=gamma)]
    model = Model(two_nodes(convection).with_values({"resistance.a~ambient": r, "capacity.a": 1.0}))
    seen = []
    for difference, speed in ((1e-9, 0.0), (20.0, 0.0), (40.0, 0.0), (40.0, 0.5), (40.0, -1.2)):
        inputs = {"temperature.ambient": 20.0, "speed.base": speed}
        x = [20.0 + difference, 20.0]
        rate = float(model.rhs(x, [inputs[c] for c in model.inputs], model.values)[0])
        seen.append(difference / -rate)
        wanted = r * np.exp(-beta * difference) / (1 + gamma * abs(speed))
        yield equal(
            f"R at {difference:.0f} K, {speed:g} m/s", seen[-1], wanted, "K/W", 1e-6 if difference < 1 else 1e-12
        )
    yield below("largest step of R along these, all falling", float(np.diff(seen).max()), 0.0, "K/W")


@row("S0-E4", "stored heat", "dT_i/dt = q_i/C_i", more="tests/model/test_network.py")
def stored_heat() -> Iterable[Check]:
    model = Model(leg([effect("constant_heat", power=7.0)]))
    n, step = 1200, 0.5
    inputs = np.full((len(model.inputs), n), 20.0)
    start = np.array([50.0, 25.0, 20.0])
    path = np.column_stack([start, model.run(n)(start, inputs, model.values, step).full()])
    stored = 300.0 * float((path[:, -1] - start).sum())
    lost = float(simpson((path - 20.0).sum(axis=0) / 10.0, dx=step))
    yield equal("Σ C ΔT over 600 s", stored, 3 * 7.0 * n * step - lost, "J", 1e-8)


@row(
    "S0-E5",
    "heat flow between nodes",
    "q_i = Σ (T_i - T_j)/R + …",
    Verdict.CORRECTED,
    more="tests/model/test_network.py",
)
def heat_flow() -> Iterable[Check]:
    links = (link("a", "b", 5.0), link("b", "c", 2.5), link("a", "c", 12.0), *(link(x, "ambient", 4.5) for x in "abc"))
    model = Model(Network("leg", (*(node(x) for x in "abc"), AMBIENT), links))
    start, air = np.array([50.0, 25.0, 25.0]), [25.0]
    end = model.step("zoh")(start, air, model.values, 300.0).full().ravel()
    a = state_space(model, start, np.array(air)).A
    wrong = 25.0 + expm(-300.0 * a) @ (start - 25.0)
    for name, ours, theirs, right, misprint in zip(
        "abc", end, wrong, ("40.4", "27.9", "26.7"), ("67.4", "15.7", "23.0"), strict=True
    ):
        yield printed(f"joint {name} after 300 s", float(ours), right, "degC")
        yield printed(f"the same with the printed sign, joint {name}", float(theirs), misprint, "degC")
    for value, text in zip(np.sort(-np.linalg.eigvals(a).real), ("0.0007", "0.0021", "0.0039"), strict=True):
        yield printed("growth with the printed sign", float(value), text, "1/s")
    yield below("fastest growth with the right one", float(np.linalg.eigvals(a).real.max()), 0.0, "1/s")
    closed = Model(leg(ambient=None))
    modes = np.sort(np.linalg.eigvals(state_space(closed, start, np.array([])).A).real)
    yield equal("without ambient: the one mode that stays", float(modes[-1]), 0.0, "1/s", 1e-15)
    yield below("and the next", float(modes[-2]), -1e-4, "1/s")


@row("S0-E6", "winding resistance", "R_d = (1 + α (T - T_ref)) R_ref", more=PHYSICS)
def winding_resistance() -> Iterable[Check]:
    factor = float(ResistanceRise().factor(105.0, _p(alpha=0.0039, reference=25.0)))
    yield equal("at 105 over 25 degC", factor, 1.312, "", 1e-12)


@row("S0-E7", "friction torque", "F = -F_k sgn(q̇) - D q̇", more=PHYSICS)
def friction_torque() -> Iterable[Check]:
    for speed in (-5.0, -0.1, 0.0, 0.1, 5.0):
        work = (-0.25 * np.sign(speed) - 0.04 * speed) * speed
        yield equal(
            f"heat and work of friction, {speed:g} rad/s", _friction(abs(speed), abs(speed)) + work, 0.0, "W", 1e-12
        )


def _friction(mean: float, rms: float) -> float:
    coulomb = CoulombFriction().heat(25.0, _p(velocity=mean), _p(torque=0.25))
    return float(coulomb + ViscousFriction().heat(25.0, _p(velocity_rms=rms), _p(damping=0.04)))


@row("S0-E8", "friction heat", "Q = -F(q̇) ∫ |q̇| dt", Verdict.CORRECTED, more=PHYSICS)
def friction_heat() -> Iterable[Check]:
    at = np.arange(0.0, 1.0, 1e-4)
    speed = 5.0 * np.sin(2 * np.pi * 2.0 * at)
    ours = _friction(float(np.abs(speed).mean()), float(np.sqrt((speed**2).mean())))
    yield printed("symmetric gait, 1 s", ours, "1.296", "J")
    f = -0.25 * np.sign(speed) - 0.04 * speed
    yield equal("as printed", float((-f * np.abs(speed)).mean()), 0.0, "J", 1e-3)
    yield printed("backwards at 3 rad/s, 1 s", _friction(3.0, 3.0), "1.11", "J")
    yield equal("as printed", (-0.25 - 0.04 * 3.0) * 3.0, -1.11, "J")


@row("S0-E9/10", "state space", "ẋ = A x + B u, constant A, B; y = C x", Verdict.CORRECTED, more=STATES)
def linear_form() -> Iterable[Check]:
    model, rng = Model(with_every_effect()), np.random.default_rng(3)
    x = rng.uniform(15.0, 60.0, len(model.states))
    u = np.array(list(random_inputs(model, rng).values()))
    form = state_space(model, x, u)
    e = 1e-4 * np.eye(len(x))
    difference = np.column_stack(
        [(model.rhs(x + d, u, model.values) - model.rhs(x - d, u, model.values)).full().ravel() / 2e-4 for d in e]
    )
    off = np.abs(form.A - difference) / (np.abs(difference) + 1e-3 * np.abs(difference).max())
    yield below("A against finite differences, relative", float(off.max()), 1e-5)
    warmer = state_space(model, x + 20.0, u)
    yield above("change of A by 20 K", float(np.abs(warmer.A - form.A).max()), 1e-5, "1/s", "A is not constant")
    yield equal("the ambient is among the inputs", float("temperature.ambient" in form.inputs), 1.0)


@row("S0-E11", "zero-order hold", "x(k+1) = G(h) x(k) + H(h) u(k)", more=STATES)
def held_inputs() -> Iterable[Check]:
    model = Model(leg([effect("constant_heat", power=7.0)]))
    x, u = np.array([50.0, 25.0, 20.0]), np.array([20.0])
    form = state_space(model, x, u)
    g, h = form.exact(45.0)
    wanted = expm(45.0 * form.A) @ (x - (s := -np.linalg.solve(form.A, form.B @ form.u))) + s
    for name, ours, theirs in zip(model.nodes, g @ x + h @ form.u, wanted, strict=True):
        yield equal(f"{name} after 45 s", float(ours), float(theirs), "degC", 1e-10)


@row("S0-E12", "Euler", "G ≈ I + hA, H ≈ hB for small h", more=STATES)
def euler() -> Iterable[Check]:
    model = _one(300.0, 1.69, "constant_heat", power=25.0)
    form = state_space(model, np.array([20.0]), np.array([20.0]))
    yield equal("stable below", form.euler_stable, 2 * 300.0 * 1.69, "s")
    for step, share in ((1.0, 0.5 * 1.0 / (math.e * 507.0)),):
        # The largest error of Euler's step response, rise·h/(2 e τ) to first order.
        error = form.euler_error(step, 3000.0)
        yield equal(f"largest error, h = {step:g} s", error, share * 25.0 * 1.69, "K", 1e-3)
    fast = state_space(_one(0.4, 1.0, "constant_heat", power=1.0), np.array([20.0]), np.array([20.0]))
    yield below("0.4 J/K behind 1 K/W: stable below", fast.euler_stable, 1.0, "s", "refused at h = 1 s")


@row("S0-E13", "sum of squares", "L(θ) = Σ (x - x̂)ᵀ (x - x̂)", more="tests/identify/test_fit_problem.py")
def sum_of_squares() -> Iterable[Check]:
    model = Model(two_node_network())
    problem = Problem(model, bound_runs(model, [truth_run(900.0, step=5.0)]), np.ones(2))
    z = problem.guess(model.values) + 0.1
    residuals, jacobian = problem.jacobian(z)
    gradient = jacobian.T @ residuals
    steps = 1e-5 * np.eye(len(z))
    differences = np.array([(problem.cost(z + d) - problem.cost(z - d)) / 2e-5 for d in steps])
    off = float(np.abs(gradient - differences).max() / np.abs(differences).max())
    yield below("gradient against finite differences, relative", off, 1e-5)


@row(
    "S0-E14",
    "pull between left and right",
    "J = L + λ Σ (R_d/C - R_d'/C')²",
    Verdict.CORRECTED,
    more="tests/identify/test_fit_problem.py",
)
def left_and_right() -> Iterable[Check]:
    yield _runs("λ = 0 leaves both sides free", test_fit_problem.test_no_symmetry_penalty_leaves_left_and_right_free)
    yield _runs("a large λ makes them equal", test_fit_problem.test_a_large_symmetry_penalty_makes_left_and_right_equal)
    yield _runs("a larger one brings them nearer", test_fit_problem.test_a_larger_symmetry_penalty_brings_them_closer)
    model = Model(parse_model(presets()["quadruped"], Path("quadruped.toml")).network)
    paired = [p.name for p in model.parameters if p.mirror is not None and not p.declared.fixed]
    yield above("couplings among what is pulled, as printed there is none", sum("~" in name for name in paired), 0)


def _runs(what: str, test: object) -> Check:
    """Whether a test passes."""
    try:
        test()  # type: ignore[operator]
    except AssertionError:
        return Check(what, 0.0, "its test passes", False)
    return Check(what, 1.0, "its test passes", True)


@row("S0-E15", "100 Hz to 1 Hz", "mean temperature, RMS torque", more="tests/logs/test_resampling.py")
def resampling() -> Iterable[Check]:
    torque = np.random.default_rng(0).normal(2.0, 5.0, 60_000)
    reduced = reduce_blocks("torque.a", torque, 100)
    yield equal("∫ τ² over 600 s", float((reduced**2).sum()), float((torque**2).sum() / 100), "(N·m)² s", 1e-9)
    readings = np.random.default_rng(1).normal(40.0, 1.0, 60_000)
    mean = float(reduce_blocks("temperature.a", readings, 100).mean())
    yield equal("mean temperature", mean, float(readings.mean()), "degC")


# --- figure and tables -------------------------------------------------------------------------------------


@row("S0-F1", "network diagram", "figure, absent", Verdict.MISSING)
def network_diagram() -> Iterable[Check]:
    network = Model(parse_model(presets()["quadruped"], Path("quadruped.toml")).network).network
    yield equal("nodes with a mass", len(network.dynamic), 13)
    inner = [resistor for resistor in network.resistors if "ambient" not in resistor.place.split("~")]
    yield equal("links between them: 3 a leg, 2 between hips, 4 to the computer", len(inner), 18)
    yield equal("links to the air", len(network.resistors) - len(inner), 13)


@row(
    "S0-T1",
    "identification runs",
    "20 of torque, unpowered, cooling, 3 trots; no durations",
    Verdict.MISSING,
    more="tests/virtual/test_quadruped.py",
)
def identification_runs() -> Iterable[Check]:
    runs = plan("protocol", 0)
    yield equal("runs", len(runs), 25)
    for word, torques in (("abd", (2, 4, 6)), ("hip", (2, 4, 6)), ("knee", (2, 4, 6, 10))):
        there = sum(f"{word}_{diagonal}_{torque}Nm" in runs for diagonal in ("RF_LR", "LF_RR") for torque in torques)
        yield equal(f"of torque, {word}", there, 2 * len(torques))
    for name, speed in (("trot_low", "0.2"), ("trot_medium", "0.5"), ("trot_high", "1.0")):
        yield printed(f"speed of {name}", max(segment.speed for segment in runs[name].segments), speed, "m/s")


@row(
    "S0-T2",
    "mean errors",
    "single 1.57/2.07/2.44/2.02, whole body 0.67/0.66/0.88/0.74 °C",
    slow=True,
    more="examples/quadruped/whole_body.py",
)
def mean_errors() -> Iterable[Check]:
    yield printed(
        "its own mean over the joint types, single",
        (1.57 + 2.07 + 2.44) / 3,
        "2.02",
        "K",
        within=0.01,
        why="rounded joint types: 2.022 to 2.032",
    )
    yield printed("the same, whole body", (0.67 + 0.66 + 0.88) / 3, "0.74", "K")
    sources = list(zip((1.57, 2.07, 2.44, 2.02), (0.67, 0.66, 0.88, 0.74), strict=True))
    fits = {f"robot {SEEDS[0]}, one mass a joint": whole_body(SEEDS[0])}
    fits |= {f"robot {seed}, level {level}": windings(seed, level) for seed in SEEDS for level in LEVELS}
    for name, fitted in fits.items():
        for pair, (single, whole) in zip(fitted.protocol.classes, sources, strict=True):
            good = "as good as the source's"
            yield below(f"{name}, {pair.what}: whole body", pair.mean[0], whole + 0.005, "K", good)
            share = pair.mean[0] / pair.mean[1]
            yield below(f"{name}, {pair.what}: whole over single", share, whole / single, why="the source's")


@row(
    "S0-T3",
    "largest and mean square errors",
    "2.38 to 4.77 °C, 0.50 to 2.14 °C², reduction 29 to 69 %",
    slow=True,
    more="examples/quadruped/whole_body.py",
)
def largest_errors() -> Iterable[Check]:
    """Winding and housing apart and a trunk; one mass a joint is up to 7.7 K off, see examples/quadruped/README.md.

    Without errors that differ from run to run each printed number is met. With them the largest errors stay below the
    source's largest; its smaller ones can't all be met, for the oracle, which has the robot's own physics, misses some.
    """
    for seed in SEEDS:
        for name, (errors, _) in largest(seed, "none").items():
            if name not in SOURCE_RUNS:
                continue
            most, square, reduction = SOURCE_RUNS[name]
            yield below(f"robot {seed}, {name}: largest error", errors.max[0], most + 0.005, "K", "printed")
            yield below(f"robot {seed}, {name}: mean square error", errors.square[0], square + 0.005, "K²", "printed")
            reduced = 100 * errors.reduction
            yield above(
                f"robot {seed}, {name}: reduction against single nodes", reduced, reduction - 0.005, "%", "printed"
            )
        for name, (errors, floor) in largest(seed, "default").items():
            beside = f"oracle {floor[0]:.2f} K, {floor[1]:.2f} K²"
            yield below(f"robot {seed}, {name}, errors of runs: largest error", errors.max[0], 4.77, "K", beside)


# --- numbers --------------------------------------------------------------------------------------------------


@row("S0-N1", "the robot", "12 motors, Unitree A1, 100 Hz")
def robot() -> Iterable[Check]:
    network = parse_model(presets()["quadruped"], Path("quadruped.toml")).network
    motors = [place for place in Model(network).nodes if f"copper_loss.resistance.{place}" in _names(network)]
    yield printed("motors of the ready model", len(motors), "12")
    one = quadruped_logs(seed=0, runs={"stand": Job((Bout("stand", 5),))}, rate=100)["stand"]
    yield printed("samples a second of its logs", len(one) / 5, "100", "Hz")
    yield equal("named as in the A1's description", len(set(QUADRUPED_JOINTS) & set(motors)), 12)


def _names(network: Network) -> set[str]:
    return {parameter.name for parameter in network.parameters}


@row("S0-N2", "unpowered neighbours", "the single node underestimates coupled regions", slow=True)
def unpowered_neighbours() -> Iterable[Check]:
    for joint, (truth, whole, single) in neighbours(SEEDS[0]).items():
        yield below(f"{joint} beside a powered knee, rise: single node less truth", single - truth, -1.0, "K")
        share = abs(whole - truth) / abs(single - truth)
        yield below(f"{joint}: error of the whole body over the single node's", share, 0.74 / 2.02, why="table 2's")


@row(
    "S0-N3",
    "largest error",
    "below 5 °C in all tests",
    slow=True,
    more="examples/quadruped/whole_body.py",
)
def below_five() -> Iterable[Check]:
    for seed in SEEDS:
        for name, (errors, floor) in largest(seed, "default").items():
            yield below(f"robot {seed}, {name}: largest error", errors.max[0], 5.0, "K", f"oracle {floor[0]:.2f} K")


@row("S0-N4", "high-speed trot", "2.38 for 7.11 °C; reduction 66.67 % in table 3", Verdict.CONTRADICTED)
def high_speed_trot() -> Iterable[Check]:
    reduction = 100 * (1 - 2.38 / 7.11)
    yield equal("reduction by the two", reduction, 66.526, "%", 1e-5)
    yield differs("the same against the table", reduction, "66.67", "%")
    yield equal("the table's is that of its largest errors: single node", 2.38 / (1 - 0.6667), 7.14, "K", 1e-3)


@row("S0-N5", "several gaits in one run", "largest error 3.34 °C; no row in table 3", Verdict.MISSING, slow=True)
def several_gaits() -> Iterable[Check]:
    run = plan("tests", 0)["multi_gait"]
    yield equal("parts: stand 0/4 kg, trot 2/4 kg, walk 4 kg", len(run.segments), 5)
    for seed in SEEDS:
        yield below(
            f"robot {seed}: largest error", largest(seed, "none")["multi_gait"][0].max[0], 3.345, "K", "printed"
        )


@row("S0-N6", "forced convection", "slows the rise", more=PHYSICS)
def slower_rise() -> Iterable[Check]:
    model = Model(parse_model(presets()["quadruped"], Path("quadruped.toml")).network)
    x, rates = np.full(len(model.states), 50.0), []
    for speed in (0.0, 0.5, 1.0):
        inputs = [
            {"torque": 5.0, "powered": 1.0, "speed": speed, "temperature": 25.0}.get(c.split(".")[0], 0.0)
            for c in model.inputs
        ]
        rates.append(model.rhs(x, inputs, model.values).full().ravel()[:12])
    yield below("largest change of dT/dt, 0 to 0.5 m/s", float((rates[1] - rates[0]).max()), 0.0, "K/s")
    yield below("largest change of dT/dt, 0.5 to 1 m/s", float((rates[2] - rates[1]).max()), 0.0, "K/s")


# --- applications -----------------------------------------------------------------------------------------------


@row(
    "S0-A1",
    "in a simulator",
    "real-time temperatures from torques, velocities, body speed",
    more="tests/fmu, examples/mujoco_a1",
)
def in_a_simulator() -> Iterable[Check]:
    folder = REFERENCE / "quadruped"
    model = Model(parse_model(presets()["quadruped"], Path("quadruped.toml")).network)
    rng, n, step = np.random.default_rng(1), 600, 1.0
    rows = rng.uniform(0.0, 6.0, (n, len(model.inputs)))
    for column, name in enumerate(model.inputs):
        if name.startswith("temperature."):
            rows[:, column] = 22.0
        if name.startswith(("powered.", "speed.")):
            rows[:, column] = rng.uniform(0.0, 1.0, n)
    path = model.run(10 * n)(
        np.full(len(model.states), 25.0), rows.repeat(10, axis=0).T, model.values, step / 10
    ).full()
    kelvin = np.array([273.15 if name.startswith("temperature.") else 0.0 for name in model.inputs])
    names = [f"{node}.temperature" for node in model.nodes]
    with Session(folder / "quadruped.fmu", outputs=names, trust=True) as session:
        order = [session.input_names.index(_fmu_name(name)) for name in model.inputs]
        began, worst = time.process_time(), 0.0
        for k in range(n):
            session.inputs[order] = rows[k] + kelvin
            off = session.step(step) - 273.15 - path[: len(names), 10 * k + 9]
            worst = max(worst, float(np.abs(off).max()))
        took = time.process_time() - began
    yield below("FMU against CasADi over 600 s", worst, 1e-3, "K")
    yield above("simulated over computing time", n * step / took, 1.0, why="real time")


def _fmu_name(column: str) -> str:
    quantity, _, place = column.partition(".")
    return f"{place}.{quantity}"


@row("S0-A2", "faults of sensors", "alarm at 10 °C; linear drift", more="tests/online/test_monitor.py")
def sensor_faults() -> Iterable[Check]:
    right = Model(two_node_network().with_values(TRUTH))
    wrong = Model(two_node_network().with_values(TRUTH | test_monitor.WRONG))
    for rate in test_monitor.RATES:
        late = _time_to_alarm(right, rate)
        why = "a fifth; noise and steps of 1 K take part"
        yield printed(f"time to the alarm over 10 K/rate, {rate:g} K/s", late, "1", within=0.2, why=why)
    off = [abs(_time_to_alarm(wrong, rate) - 1) for rate in test_monitor.RATES]
    own = max(MonitoredRun.of(wrong, test_monitor.log(4)).largest_error.values()) / 10
    yield below(
        "by a model that is wrong: off by at most", max(off), own + 0.05, why="its own error over 10 K, and a step"
    )
    healthy = alarms_by_threshold(MonitoredRun.of(wrong, test_monitor.log(5)), 10.0)
    yield equal("alarms of a healthy log", len(healthy), 0)


def _time_to_alarm(model: Model, rate: float) -> float:
    """When a drift is called, over 10 K/rate."""
    watched = MonitoredRun.of(model, test_monitor.log(4, test_monitor.drift(rate)))
    (alarm,) = alarms_by_threshold(watched, 10.0)
    return (alarm.time - test_monitor.BEGIN) * abs(rate) / 10.0


@row(
    "S0-A3",
    "time to 60 °C",
    "4 kg trot: about 553 s, from 10 gait cycles held",
    slow=True,
    more="tests/benchmarks/forecast.py",
)
def time_to_limit() -> Iterable[Check]:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(motion, "SHARE", 0.0)
        patch.setattr(motion, "MODULATION", 0.0)
        run = Job((Bout("trot", 700, 0.2, 4.0),), 27.0, cutout=None)
        logs = quadruped_logs(seed=0, runs={"trot": run}, level="none", scatter=0, noise=0, quantisation=0)
    reached = int((logs.truth["trot"]["temperature.FR_calf"] > 60).argmax())
    yield printed(
        "nominal virtual robot, knee at 60 degC after",
        reached,
        "553",
        "s",
        within=2.0,
        why="its torque was chosen for it",
    )
    done = forecasts()
    errors = np.array([trial.error for trial in done])
    yield below("shipped model: median error of the time still to go", float(np.median(errors)), 0.10)
    yield below("its worst error", float(errors.max()), 0.25)
    yield above("share of times inside the 90 % interval", float(np.mean([trial.inside for trial in done])), 0.8)


@row(
    "S0-A4",
    "reinforcement learning",
    "future work: temperatures as limits of a policy",
    slow=True,
    more="tests/applications/test_gym.py; examples/reinforcement",
)
def environment() -> Iterable[Check]:
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        model = Model(parse_model(presets()["quadruped"], Path("quadruped.toml")).network)
        check_env(gymnasium.make(ID, model=model, limits={"*_*": 60.0}).unwrapped)
    yield equal("complaints of gymnasium's checker", len(said), 0)
    train = import_module("train")
    weights, steps = train.learn(rounds=3, drawn=24, episodes=8, chosen=16)
    derating, learnt = list(train.compare(weights, 64).values())[2:]
    before = f"over 64 fresh episodes, after {steps[-1].episodes} to learn on"
    gained = {what: 100 * float((of(learnt) - of(derating)).mean()) for what, of in
              (("work", lambda outcome: outcome.work), ("worth", train.worth))}  # fmt: skip
    yield above("work of a learnt policy less the best derating's", gained["work"], 2.0, "% of what is asked", before)
    yield above("the same, 10 % off for each kelvin above the limit", gained["worth"], 2.0, "%")
