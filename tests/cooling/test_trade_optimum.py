"""Trade studies against brute force and finite differences: optimum, multipliers, obstacles."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ankle import jump_task, walking_task
from scipy.integrate import solve_ivp

from lptn.basics.arrays import FloatArray
from lptn.planners.trade import Design, DesignProblem, iso_map, limit_curves, parse_study, solve_study
from lptn.robots.presets import presets
from tests.cooling import plain_sink as plain
from tests.cooling.studies import HELD, study

CELLS = 200


def _grid() -> tuple[FloatArray, FloatArray]:
    """Every (C, R) of a 200 × 200 grid over the study's bounds."""
    c, r = np.meshgrid(np.geomspace(20.0, 1500.0, CELLS), np.geomspace(0.05, 10.0, CELLS))
    return c.ravel(), r.ravel()


def _buildable(c: FloatArray, r: FloatArray, mass: float, volume: float) -> np.ndarray:
    fins, package = plain.fins_and_volume(c, r)
    return (fins <= 1) & (plain.mass(c) <= mass) & (package <= volume)


@pytest.fixture(scope="module")
def design() -> Design:
    """The most torque for two minutes, one choice."""
    (optimum,) = solve_study(study("held_torque", "duration = 120", HELD, cooling='"passive"')).designs
    return optimum


@pytest.mark.long
def test_held_torque_agrees_with_brute_force(design: Design) -> None:
    assert design.capacity is not None
    assert design.resistance is not None
    c, r = _grid()
    inside = _buildable(c, r, 0.55, 450e-6)
    c, r = c[inside], r[inside]
    torque = plain.held_torque(c, r, 120.0, 105.0, step=1.0)  # as good as 0.5 s to 1e-6 N·m
    best = int(torque.argmax())
    # One cell of the grid is 2.2 % of C and 2.7 % of R; the optimum is in a corner of what can be built.
    cell = np.log(1500 / 20) / (CELLS - 1), np.log(10 / 0.05) / (CELLS - 1)
    reach = abs(design.sink_sensitivities["capacity"]) * design.capacity * cell[0] * 2
    reach += abs(design.sink_sensitivities["resistance"]) * design.resistance * cell[1] * 2
    assert torque[best] <= design.value + 1e-5
    assert design.value - torque[best] <= reach + 1e-5
    assert abs(np.log(c[best] / design.capacity)) <= 2 * cell[0]
    assert abs(np.log(r[best] / design.resistance)) <= 4 * cell[1]
    there = plain.held_torque(np.array([design.capacity]), np.array([design.resistance]), 120.0, 105.0)
    assert design.value == pytest.approx(there[0], abs=2e-5)


def test_least_mass_agrees_with_brute_force() -> None:
    asked = study("mass", "torque = 1.68\nduration = 120", "volume = 450e-6", cooling='"passive"')
    (design,) = solve_study(asked).designs
    c, r = _grid()
    inside = _buildable(c, r, np.inf, 450e-6)
    c, r = c[inside], r[inside]
    cold = plain.hottest(c, r, np.full(c.size, 1.68), 120.0) <= 105.0
    lightest = float(plain.mass(c[cold]).min())
    cell = np.log(1500 / 20) / (CELLS - 1)
    assert design.value <= lightest + 1e-6
    assert lightest - design.value <= 2 * cell * (design.capacity or 0.0) / plain.HEAT


@pytest.mark.long
@pytest.mark.parametrize(
    ("goal", "task", "limits", "names"),
    [
        (
            "held_torque",
            "duration = 120",
            HELD,
            ("limit.mass", "limit.volume", "limit.winding", "duration", "film", "resistance.stator~winding", "start"),
        ),
        ("mass", "torque = 1.68\nduration = 120", "volume = 450e-6", ("torque", "limit.winding", "limit.volume")),
        ("time_to_limit", "torque = 1.8", "mass = 0.6\nvolume = 600e-6", ("torque", "limit.mass", "limit.volume")),
        ("worst_temperature", walking_task(), "volume = 600e-6", ("limit.volume", "torque", "ambient")),
    ],
)
def test_multipliers_agree_with_finite_differences(goal: str, task: str, limits: str, names: tuple[str, ...]) -> None:
    (option,) = study(goal, task, limits, cooling='"passive"').options()
    problem = DesignProblem(option)
    optimum = problem.solve()
    assert optimum.success
    for name in names:
        value = problem.parameters.defaults[name]
        step = 2e-3 * abs(value)
        ends = [problem.solve({name: value + side * step}, near=optimum) for side in (1, -1)]
        assert all(end.success for end in ends)
        difference = (ends[0].value - ends[1].value) / (2 * step)
        assert optimum.sensitivities[name] == pytest.approx(difference, rel=0.01), name
        assert difference != 0.0


def test_sensitivities_to_the_sink_as_it_is(design: Design) -> None:
    at = np.array([design.capacity, design.resistance], dtype=float)
    factors = np.array([[1.05, 0.95, 1.0, 1.0], [1.0, 1.0, 1.05, 0.95]])
    c, r = at[:, None] * factors
    held = plain.held_torque(c, r, 120.0, 105.0)
    differences = (held[::2] - held[1::2]) / (0.1 * at)
    # The bisection is good to 5e-7 N·m, which is 0.4 % of the smaller difference.
    assert design.sink_sensitivities["capacity"] == pytest.approx(differences[0], rel=0.01)
    assert design.sink_sensitivities["resistance"] == pytest.approx(differences[1], rel=0.01)
    assert design.sink_sensitivities["mass"] == pytest.approx(design.sink_sensitivities["capacity"] * 897.0)


def test_a_failed_solve_has_no_multipliers() -> None:
    (option,) = study("mass", "torque = 3.3\nduration = 300", cooling='"passive"').options()
    solution = DesignProblem(option).solve()
    assert not solution.success
    assert solution.sensitivities == {}


@pytest.mark.long
def test_obstacles_are_as_large_as_they_say() -> None:
    asked = study("mass", "torque = 1.7\nduration = 120", "mass = 0.6\nvolume = 450e-6", cooling='"passive"')
    (refusal,) = solve_study(asked).refusals
    needed = {obstacle.name: obstacle for obstacle in refusal.obstacles}
    # More volume alone would not do: at 600 g even a sink that is all fins is too small.
    assert set(needed) == {"torque", "winding", "mass"}
    problem = DesignProblem(refusal.option)
    for name, obstacle in needed.items():
        key = name if name == "torque" else f"limit.{name}"
        sign = -1 if name == "torque" else 1
        assert problem.solve({key: obstacle.needed * (1 + sign * 1e-4)}).success
        assert not problem.solve({key: obstacle.needed * (1 - sign * 1e-3)}).success


def test_where_no_single_limit_helps_several_are_named() -> None:
    # 0.3 kg is less than motor and pipes, and 20 °C above the air is passed within seconds.
    asked = study("held_torque", "duration = 120", "mass = 0.3\nvolume = 1e-4", cooling='"passive"')
    (refusal,) = solve_study(asked).refusals
    assert refusal.obstacles == ()
    assert {obstacle.name for obstacle in refusal.together} == {"mass", "volume"}
    assert "with" in str(refusal)


def test_thermal_runaway_is_refused_not_solved_below_the_air() -> None:
    # Beyond runaway the periodic heat balance has a solution at negative temperatures, which meets every limit.
    asked = study(
        "mass", 'kind = "cycle"\nprofile = [3.0, 3.0, 3.0, 3.0, 3.0]\nperiod = 10.0', "current = 60", cooling='"none"'
    )
    (refusal,) = solve_study(asked).refusals
    torque = next(obstacle.needed for obstacle in refusal.obstacles if obstacle.name == "torque")

    def steady(current: float) -> float:
        total, loss = 1.084 + 1.105 + 0.779, current**2 * 0.186
        return 21.5 + loss * total / (1 - 0.0039 * loss * total)

    currents = np.linspace(5.0, 20.0, 30001)
    current = float(np.interp(105.0, [steady(i) for i in currents], currents))
    housing = 21.5 + current**2 * 0.186 * (1 + 0.0039 * 83.5) * 0.779
    assert torque == pytest.approx(current * plain.K_T * (1 - 0.0012 * (housing - 25.0)), rel=1e-4)


def test_a_cycle_without_end_returns_to_where_it_began() -> None:
    asked = study("worst_temperature", jump_task(20, gear=150.0), "current = 90", cooling='"none"')
    (design,) = solve_study(asked).designs
    task = design.option.study.task

    def rates(_: float, x: FloatArray, torque: float) -> list[float]:
        w, s, h = x
        current = torque / (plain.K_T * (1 - 0.0012 * (h - 25.0)))
        loss = current**2 * plain.RESISTANCE * (1 + plain.ALPHA * (w - 21.5))
        inner, outer = (w - s) / plain.R_WS, (s - h) / plain.R_SH
        return [(loss - inner) / plain.C_W, (inner - outer) / plain.C_S, (outer - (h - 21.5) / plain.R_HA) / plain.C_H]

    x, hottest, part = design.states[:, 0], 0.0, design.duration / len(task.shape)
    for share in task.shape:
        path = solve_ivp(rates, (0.0, part), x, args=(design.torque * share,), rtol=1e-10, atol=1e-10).y
        x, hottest = path[:, -1], max(hottest, float(path[0].max()))
    assert x == pytest.approx(design.states[:, 0], abs=1e-5)
    assert hottest == pytest.approx(design.value, abs=1e-3)


def test_time_to_limit_and_maps_and_curves_agree_with_plain_code() -> None:
    asked = study("time_to_limit", "torque = 1.8", "mass = 0.6\nvolume = 600e-6", cooling='"passive"')
    (design,) = solve_study(asked).designs
    sink = np.array([design.capacity]), np.array([design.resistance])
    at_end = plain.hottest(*sink, np.array([1.8]), design.value, step=design.value / 200)
    assert at_end == pytest.approx(105.0, abs=1e-3)
    assert design.checked == pytest.approx(105.0, abs=1e-3)
    surface = iso_map(design, points=8)
    c, r = (grid.ravel() for grid in np.meshgrid(surface.capacity, surface.resistance))
    truth = plain.hottest(c, r, np.full(c.size, 1.8), design.value, step=design.value / 400)
    assert surface.winding.ravel() == pytest.approx(truth, abs=1e-3)
    curve = limit_curves(design, np.array([5.0, 20.0, 35.0]))
    assert np.isinf(curve.time[0])
    assert curve.time[1] > curve.time[2] > 15.0


@pytest.mark.long
def test_discrete_choices_are_each_solved_and_the_best_comes_first() -> None:
    motors = '[[motors]]\nname = "U8"\n[[motors]]\nname = "U10"'
    sweep = '[pareto]\nagainst = "mass"\nleast = 0.25\nmost = 0.8\npoints = 5'
    result = solve_study(
        study("held_torque", "duration = 120", "mass = 0.7", motors, "[pipes]\ncount = [2, 4]\n" + sweep)
    )
    assert len(result.designs) + len(result.refusals) == 2 * (1 + 2 + 2)
    values = [design.value for design in result.designs]
    assert values == sorted(values, reverse=True)
    assert result.best.option.motor.name == "U10"
    assert "4 pipes" in result.best.option.name
    assert repr(result).startswith("<StudyResult: ")
    assert f" best {result.best.option.name}, " in repr(result)
    assert repr(result.best).startswith(f"<Design {result.best.option.name}: ")
    assert [point.value for point in result.front] == sorted(point.value for point in result.front)
    assert [point.amount for point in result.front] == sorted(point.amount for point in result.front)
    for points in result.by_option.values():
        for point in points:  # nothing is beaten by the front in both ways
            assert any(
                front.amount <= point.amount + 1e-9 and front.value >= point.value * 0.999 for front in result.front
            )


@pytest.mark.long
def test_a_front_over_mass_and_volume_agrees_with_brute_force() -> None:
    """Beside every design of a grid in plain NumPy: at each point of the front the best that its two budgets allow."""
    second = "[pareto.also]\nagainst = 'volume'\nleast = 3.2e-4\nmost = 5e-4\npoints = 3"
    sweep = f"[pareto]\nagainst = 'mass'\nleast = 0.45\nmost = 0.6\npoints = 4\n{second}"
    result = solve_study(study("held_torque", "duration = 120", HELD, more=sweep, cooling='"none", "passive"'))
    c, r = _grid()
    fins, package = plain.fins_and_volume(c, r)
    inside = (fins <= 1) & (plain.mass(c) <= 0.6) & (package <= 5e-4)
    c, r, package = c[inside], r[inside], package[inside]
    torque = plain.held_torque(c, r, 120.0, 105.0, step=1.0)
    assert {point.option for point in result.front} == {"U8, no sink", "U8, passive"}
    assert len({point.also for point in result.front}) == 3
    for point in result.front:
        if point.option == "U8, passive":
            allowed = (plain.mass(c) <= point.mass + 1e-9) & (package <= (point.also or 0.0) + 1e-12)
            assert torque[allowed].max() <= point.value + 1e-5
            assert torque[allowed].max() == pytest.approx(point.value, rel=3e-3)  # two cells of the grid
    for one in result.front:  # and none is beaten by another
        for other in result.front:
            no_dearer = other.amount <= one.amount and (other.also or 0.0) <= (one.also or 0.0)
            assert one is other or not no_dearer or other.value <= one.value


def test_effects_of_the_motors_own_model_count(tmp_path: Path) -> None:
    """A film that depends on the temperature, radiation, a drive's drop and a gear's loss; the hold again by SciPy."""
    beta, area, drop, share, speed = 0.008, 0.02, 0.5, 0.05, 50.0  # 1/K, m², V, of the mechanical power, rad/s
    effects = "".join(
        f'\n[[effects]]\nkind = "{kind}"\nat = "{place}"\n{size}\n'
        for kind, place, size in (
            ("natural_convection", "sink", f"beta = {beta}"),
            ("radiation", "sink", f"area = {area}"),
            ("driver_loss", "winding", f'input = "current_abs"\nvoltage = {drop}'),
            ("gear_loss", "housing", f"fraction = {share}"),
        )
    )
    (tmp_path / "motor.toml").write_text(presets()["u8-heat-sink"] + effects)
    text = f"""
[study]
goal = "held_torque"
cooling = ["passive"]
[task]
duration = 3600
speed = {speed}
ambient = 21.5
[limits]
winding = 105
mass = 0.7
volume = 9e-4
[[motors]]
name = "mine"
model = "motor.toml"
mass = 0.24
volume = 1.59e-4
torque_constant = 0.0955
"""
    (design,) = solve_study(parse_study(text, tmp_path / "study.toml")).designs
    capacity, resistance = design.capacity or 0.0, design.resistance or 0.0

    def rates(_: float, x: FloatArray) -> list[float]:
        w, s, h, k = x
        current = design.value / (0.0955 * (1 - 0.0012 * (h - 25)))
        loss, rise = current**2 * plain.RESISTANCE * (1 + plain.ALPHA * (w - 21.5)) + drop * current, k - 21.5
        lost = rise / resistance * np.exp(beta * rise) + 5.670374419e-8 * area * ((k + 273.15) ** 4 - 294.65**4)
        to_stator, to_housing, to_sink = (w - s) / plain.R_WS, (s - h) / plain.R_SH, (s - k) / plain.R_SK
        return [
            (loss - to_stator) / plain.C_W,
            (to_stator - to_housing - to_sink) / plain.C_S,
            (to_housing - (h - 21.5) / plain.R_HA + share * design.value * speed) / plain.C_H,
            (to_sink - lost) / capacity,
        ]

    end = solve_ivp(rates, (0, 3600), [21.5] * 4, method="LSODA", rtol=1e-9, atol=1e-9).y[:, -1]
    assert end[0] == pytest.approx(105.0, abs=1e-3)


def test_heat_pipes_are_limited() -> None:
    # At 35 A the thesis's pipes have more to carry than they can, once the winding is hot.
    hold = study(
        "held_torque",
        "duration = 600",
        "winding = 400\ncurrent = 100",
        cooling='"passive"',
        more="[pipes]\npower = 15\n",
    )
    (design,) = solve_study(hold).designs
    assert "pipe_power" in design.binding
    sink, stator = (design.option.network().dynamic.index(name) for name in ("sink", "stator"))
    flow = (design.states[stator] - design.states[sink]).max() / (0.708 / 4)
    assert flow == pytest.approx(60.0, rel=1e-6)


@pytest.mark.parametrize(("limit", "value"), [("magnet", 24.5), ("current", 12.0)])
def test_magnets_and_current_are_limited(limit: str, value: float) -> None:
    asked = study("held_torque", "duration = 120", f"mass = 0.55\n{limit} = {value}", cooling='"passive"')
    (design,) = solve_study(asked).designs
    assert limit in design.binding
    assert "winding" not in design.binding
    reached = design.current if limit == "current" else design.states[2].max()
    assert reached == pytest.approx(value, rel=1e-6)


@pytest.mark.parametrize(
    ("goal", "task", "against", "ends"),
    [
        ("mass", "torque = 1.6\nduration = 120", "torque", (1.65, 1.69)),
        ("held_torque", "duration = 120", "duration", (30.0, 600.0)),
        ("held_torque", "duration = 120", "volume", (2.4e-4, 6e-4)),
    ],
)
def test_fronts_over_what_is_asked(goal: str, task: str, against: str, ends: tuple[float, float]) -> None:
    sweep = f'[pareto]\nagainst = "{against}"\nleast = {ends[0]}\nmost = {ends[1]}\npoints = 4'
    result = solve_study(study(goal, task, "mass = 0.7\nvolume = 6e-4", more=sweep, cooling='"passive"'))
    values = [point.value for point in result.front]
    assert len(values) == 4
    falls = goal == "held_torque" and against == "duration"
    assert values == sorted(values, reverse=falls)
    # More of what costs allows more, or less of what is asked for costs less; nothing jumps.
    assert values[0] != pytest.approx(values[-1], rel=1e-3)


def test_a_corner_with_too_many_limits_is_said() -> None:
    # The volume limit runs through the very corner of mass and fins.
    asked = study("held_torque", "duration = 120", "mass = 0.6", cooling='"passive"')
    (free,) = solve_study(asked).designs
    assert not free.degenerate
    assert set(free.binding) == {"winding", "mass", "fins"}
    corner = study("held_torque", "duration = 120", f"mass = 0.6\nvolume = {free.volume!r}", cooling='"passive"')
    (design,) = solve_study(corner).designs
    assert set(design.binding) == {"winding", "mass", "fins", "volume"}
    assert design.degenerate
