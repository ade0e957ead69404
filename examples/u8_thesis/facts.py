"""What the thesis states of its measurements, and networks fitted to it; facts that contradict each other show as χ².

Source: [Chen2017, sec. 3.1.2; sec. 4.3]. Standard deviations are ours: the thesis gives none (its thermocouples are
good to 5 K).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np
from circuits import AMBIENT, Array, Circuit, chain, two_nodes, with_sink
from scipy.optimize import brentq, least_squares, minimize_scalar

HEATING, TEST_CURRENT, HIGH_CURRENT, LEVEL = 120.0, 11.0, 15.0, 55.0  # s, A, A, degC
_CONDITION = "unaltered", "passive", "fan"


@dataclass(frozen=True)
class Fact:
    """A statement as a number with its standard deviation; `most` marks one that only says "below"."""

    name: str
    stated: float
    sigma: float
    most: bool = False

    def misfit(self, found: float) -> float:
        """Deviation in standard deviations."""
        off = min((found - self.stated) / self.sigma, 1e3)
        return max(off, 0.0) if self.most else off


# Measured on the motor as it came: these four alone fix its network.
UNALTERED = (
    Fact("winding after 120 s at 11 A [degC]", 55.0, 0.5),
    Fact("housing's maximum [degC]", 26.5, 0.5),
    Fact("housing's maximum after the winding's [s]", 100.0, 10.0),
    Fact("cooling: winding's excess down to 1/e [s]", 160.0, 8.0),
)
AT_15_A = Fact("passive, 15 A to 55 degC [s]", 50.0, 2.0), Fact("fan, 15 A to 55 degC [s]", 56.0, 2.0)
LITERAL = (
    Fact("steady state lower by, passive, 11 A [K]", 25.0, 3.0),
    Fact("steady state with fan, 11 A [degC]", 60.0, 2.0, most=True),
    *AT_15_A,
)
PROJECTED = (
    Fact("asymptote of the recorded heating lower by, passive [K]", 25.0, 3.0),
    Fact("asymptote of the recorded heating, fan [degC]", 60.0, 2.0, most=True),
    *AT_15_A,
    Fact("time constant of the recorded heating longer by, passive [s]", 20.0, 4.0),
)
"""What is said of the motor with the exchanger. The times at 15 A were measured; steady states and time constants were
projected from recorded heating [Chen2017, sec. 4.3]: here read literally, and as one exponential up to 55 degC."""


def of_unaltered(motor: Circuit) -> list[float]:
    """The four unaltered facts as a network gives them."""
    hot = motor.rise(TEST_CURRENT, np.array([HEATING]))[:, 0]
    times = np.linspace(0.0, 600.0, 601)
    housing = motor.rise(0.0, times, hot)[motor.housing]
    peak = int(housing.argmax())

    def fall(t: float) -> float:
        return float(motor.rise(0.0, np.array([t]), hot)[0, 0] - hot[0] / np.e)

    top, when = _parabola(times, housing, peak)
    return [AMBIENT + hot[0], AMBIENT + top, when, float(brentq(fall, 0.0, 5e4)) if fall(5e4) < 0 else 5e4]


def of_literal(motor: Circuit, passive: Circuit, fan: Circuit) -> list[float]:
    """The literal facts as three networks give them."""
    drop = min(motor.steady(TEST_CURRENT), 1e3) - min(passive.steady(TEST_CURRENT), 1e3)
    return [drop, min(fan.steady(TEST_CURRENT), 1e3), *_at_15_a(passive, fan)]


def of_projected(motor: Circuit, passive: Circuit, fan: Circuit) -> list[float]:
    """The same facts, steady states and time constants read off one exponential through the recorded heating."""
    (high, slow), (lower, slower), (least, _) = (_single_exponential(circuit) for circuit in (motor, passive, fan))
    return [high - lower, AMBIENT + least, *_at_15_a(passive, fan), slower - slow]


def _at_15_a(passive: Circuit, fan: Circuit) -> list[float]:
    return [min(circuit.time_to(LEVEL, HIGH_CURRENT), 1e3) for circuit in (passive, fan)]


def _parabola(times: Array, values: Array, peak: int) -> tuple[float, float]:
    """Height and time of a sampled maximum, refined by the parabola through three samples."""
    if not 0 < peak < len(values) - 1:
        return float(values[peak]), float(times[peak])
    left, middle, right = values[peak - 1 : peak + 2]
    shift = 0.5 * (left - right) / (left - 2 * middle + right)
    return float(middle - 0.25 * (left - right) * shift), float(times[peak] + shift * (times[1] - times[0]))


def _single_exponential(circuit: Circuit) -> tuple[float, float]:
    """Asymptote [K above ambient] and time constant [s] of the one exponential nearest to the heating up to 55 degC."""
    times = np.linspace(0.0, min(circuit.time_to(LEVEL, TEST_CURRENT), 1e3), 60)
    rise = circuit.rise(TEST_CURRENT, times)[0]

    def amplitude(log_tau: float) -> tuple[float, float]:
        shape = -np.expm1(-times / np.exp(log_tau))
        best = float(shape @ rise / (shape @ shape))
        return best, float(((best * shape - rise) ** 2).sum())

    minimum = minimize_scalar(lambda z: amplitude(z)[1], bounds=(1.0, 9.0), method="bounded", options={"xatol": 1e-7})
    return amplitude(minimum.x)[0], float(np.exp(minimum.x))


# --- networks -----------------------------------------------------------------------------------


Build = Callable[[Array], tuple[Circuit, Circuit, Circuit]]


@dataclass(frozen=True)
class Family:
    """A kind of network: parameter names, rough guesses from masses and materials, and how to build the three."""

    name: str
    parameters: tuple[str, ...]
    guess: tuple[float, ...]
    build: Build
    extra: Callable[[Array], list[float]] = field(default=lambda values: [])


def _same_resistance(v: Array) -> tuple[Circuit, Circuit, Circuit]:
    c_w, r_wh, c_h, r_ha, c_sink, r_passive, r_fan = v
    return two_nodes(c_w, r_wh, c_h, r_ha), two_nodes(c_w, r_wh, c_sink, r_passive), two_nodes(c_w, r_wh, c_sink, r_fan)


def _free_resistance(v: Array) -> tuple[Circuit, Circuit, Circuit]:
    c_w, r_wh, c_h, r_ha, c_sink, r_passive, r_fan, r_inner = v
    sinks = (two_nodes(c_w, r_inner, c_sink, r) for r in (r_passive, r_fan))
    return (two_nodes(c_w, r_wh, c_h, r_ha), *sinks)  # type: ignore[return-value]


def _no_lighter_housing(v: Array) -> list[float]:
    """A heat exchanger that is added can't take thermal mass away."""
    return [max(0.0, float(np.log(v[2] / v[4]))) * 100.0]


def _stator(v: Array) -> tuple[Circuit, Circuit, Circuit]:
    c_w, r_ws, c_s, r_sh, c_h, r_ha, r_sk, c_k, r_passive, r_fan = v
    motor = chain([c_w, c_s, c_h], [r_ws, r_sh], r_ha)
    return motor, with_sink(motor, 1, r_sk, c_k, r_passive), with_sink(motor, 1, r_sk, c_k, r_fan)


_TWO = ("C_w", "R_wh", "C_h", "R_ha", "C_h with sink", "R_ha passive", "R_ha fan")
SAME = Family(
    "2 nodes, R_wh unchanged by the sink (the thesis)", _TWO, (50, 2, 200, 0.9, 300, 0.6, 0.2), _same_resistance
)
FREE = Family(
    "2 nodes, R_wh free with the sink",
    (*_TWO, "R_wh with sink"),
    (50, 2, 200, 0.9, 300, 0.6, 0.2, 1.5),
    _free_resistance,
)
HEAVIER = Family(
    "2 nodes, R_wh free, sink no lighter", FREE.parameters, FREE.guess, _free_resistance, _no_lighter_housing
)
STATOR = Family(
    "3 nodes, heat pipes on the stator",
    ("C_w", "R_ws", "C_s", "R_sh", "C_h", "R_ha", "R_sk", "C_k", "R_k passive", "R_k fan"),
    # Copper of three phases 35 J/K, about 80 g of laminations, the aluminium rest of 240 g; 627 g of copper and
    # aluminium in the heat exchanger.
    (40, 1.0, 37, 1.0, 120, 0.8, 0.4, 350, 1.2, 0.25),
    _stator,
)
FAMILIES = (SAME, FREE, HEAVIER, STATOR)
RECOMMENDED = np.array([46.5, 1.084, 44.3, 1.105, 176.0, 0.779, 0.177, 353.0, 3.30, 0.225])
"""Values of `STATOR` that the ready models `u8` and `u8-heat-sink` hold: `fit_motor_then_exchanger`, rounded."""
_PRIOR = 1.5  # standard deviation of a parameter's logarithm: weak, a factor of 4.5


@dataclass(frozen=True)
class Fitted:
    """A family at its best values: χ² of the facts alone, and each fact's misfit in standard deviations."""

    family: Family
    values: Array
    misfits: dict[str, float]

    @property
    def chi_squared(self) -> float:
        return float(sum(misfit**2 for misfit in self.misfits.values()))


def misfits(family: Family, values: Array, facts: Sequence[Fact]) -> dict[str, float]:
    """Every fact's misfit in standard deviations, the unaltered motor's first."""
    motor, passive, fan = family.build(values)
    predicted = of_literal(motor, passive, fan) if len(facts) == len(LITERAL) else of_projected(motor, passive, fan)
    pairs = zip((*UNALTERED, *facts), (*of_unaltered(motor), *predicted), strict=True)
    return {fact.name: fact.misfit(value) for fact, value in pairs}


def fit(family: Family, facts: Sequence[Fact], starts: int = 6, seed: int = 0) -> Fitted:
    """The best of several searches: the sum of squares has local minima."""
    guess = np.log(np.array(family.guess, dtype=float))
    rng = np.random.default_rng(seed)

    def residuals(z: Array) -> Array:
        values = np.exp(z)
        try:
            off = list(misfits(family, values, facts).values())
        except (ValueError, np.linalg.LinAlgError):
            off = [1e2] * (len(UNALTERED) + len(facts))
        return np.array([*off, *family.extra(values), *((z - guess) / _PRIOR)])

    least, best = np.inf, guess
    for number in range(starts):
        scatter = 0.4 * rng.standard_normal(guess.size) if number else 0.0
        result = least_squares(residuals, guess + scatter, bounds=(guess - 4, guess + 4), max_nfev=200)
        if result.cost < least:
            least, best = result.cost, result.x
    values = np.exp(best)
    return Fitted(family, values, misfits(family, values, facts))


def fit_motor_then_exchanger() -> Array:
    """Values of `STATOR`: the motor from what was measured on it unaltered, then, that held, the exchanger.

    The motor is no better known for what was projected of another machine. The exchanger's four values come from the
    literal facts; its "+20 s" is left out, for no network meets it together with the others.
    """
    guess = np.log(np.array(STATOR.guess))
    motor_guess, exchanger_guess = guess[:6], guess[6:]

    def of_motor(z: Array) -> Array:
        predicted = of_unaltered(STATOR.build(np.exp([*z, *exchanger_guess]))[0])
        off = [fact.misfit(value) for fact, value in zip(UNALTERED, predicted, strict=True)]
        return np.array([*off, *((z - motor_guess) / _PRIOR)])

    motor = least_squares(of_motor, motor_guess).x

    def of_exchanger(z: Array) -> Array:
        predicted = of_literal(*STATOR.build(np.exp([*motor, *z])))
        off = [fact.misfit(value) for fact, value in zip(LITERAL, predicted, strict=True)]
        return np.array([*off, *((z - exchanger_guess) / _PRIOR)])

    return np.asarray(np.exp([*motor, *least_squares(of_exchanger, exchanger_guess).x]))


def holding_current(motor: Circuit, level: float = 105.0) -> float:
    """The current [A] under which the winding ends at a level [degC]; the data sheet's rating was not fitted."""
    # The rise goes to infinity at the current of the runaway; a per cent below it any level has been passed.
    return float(brentq(lambda current: motor.steady(current) - level, 1.0, 0.99 * motor.runaway_current()))


def fit_two_nodes() -> Array:
    """C_w, R_wh, C_h, R_ha from the four unaltered facts: as many facts as parameters, so no check in itself."""
    stated = np.array([fact.stated for fact in UNALTERED])
    sigma = np.array([fact.sigma for fact in UNALTERED])

    def residuals(z: Array) -> Array:
        return np.asarray((np.array(of_unaltered(two_nodes(*np.exp(z)))) - stated) / sigma)

    return np.asarray(np.exp(least_squares(residuals, np.log([50.0, 2.0, 250.0, 0.9])).x))
