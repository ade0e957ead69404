"""The thesis's own formulas, exactly as printed, beside what its own circuit gives.

An exhibit, not a model: [Chen2017, eq. 3.2, 3.3, 3.4, 4.1; table 3.1, 4.1, 4.2].
Temperatures are in degC, times in s.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

AMBIENT = 21.5  # degC, section 3.1.2
RESISTANCE = 0.186  # ohm, table A.1
ALPHA = 0.0878 / 22.506  # 1/K, a/b of table 3.1; the text says 0.004
R_0 = 1447.0  # K A²/W, equation 4.1


@dataclass(frozen=True)
class Circuit:
    """One row of tables 3.1, 4.1, 4.2: R_w [K/W], C [J/K], R_h [K/W] at 11 A."""

    name: str
    r_w: float
    c: float
    r_h: float


UNALTERED = Circuit("unaltered", 1.2, 133.3, 12.14)
PASSIVE = Circuit("passive", 1.2, 240.0, 11.96)
FAN = Circuit("fan", 1.2, 250.0, 11.96)


def slope_and_offset(current: float, resistance: float = RESISTANCE, alpha: float = ALPHA) -> tuple[float, float]:
    """a [W/K] and b [W] of the heat Q = a x + b; printed with a in W (equation 3.2)."""
    return alpha * current**2 * resistance, current**2 * resistance


def housing_resistance(current: float, r_0: float = R_0) -> float:
    """R_h = R_0/I² [K/W], equation 4.1."""
    return r_0 / current**2


def time_constant(circuit: Circuit, current: float, r_h: float | None = None) -> float:
    """Heating time constant [s], equation 3.3; this part follows from the circuit."""
    a, _ = slope_and_offset(current)
    r_h = circuit.r_h if r_h is None else r_h
    return circuit.r_w * circuit.c * (1 - a * r_h) / (1 - a * (circuit.r_w + r_h))


def printed_amplitude(circuit: Circuit, current: float, r_h: float | None = None) -> float:
    """The factor b/(C (1 - a R_h)²) of equation 3.3: its unit is K/s, the thesis reads it as K."""
    a, b = slope_and_offset(current)
    r_h = circuit.r_h if r_h is None else r_h
    return b / (circuit.c * (1 - a * r_h) ** 2)


def heating(circuit: Circuit, current: float, time: float, r_h: float | None = None) -> float:
    """Equation 3.3 as printed: T_w(t) from the ambient."""
    growth = -math.expm1(-time / time_constant(circuit, current, r_h))
    return AMBIENT + printed_amplitude(circuit, current, r_h) * growth


def heating_time(circuit: Circuit, current: float, level: float, r_h: float | None = None) -> float:
    """When equation 3.3 as printed reaches a temperature; infinite where it never does."""
    share = (level - AMBIENT) / printed_amplitude(circuit, current, r_h)
    return math.inf if share >= 1 else -time_constant(circuit, current, r_h) * math.log1p(-share)


def initial_jump(circuit: Circuit, current: float, r_h: float | None = None) -> float:
    """The jump R_h b/(1 - a R_h) [K] that the circuit of figure 3-3 makes and equation 3.3 leaves out."""
    a, b = slope_and_offset(current)
    r_h = circuit.r_h if r_h is None else r_h
    return r_h * b / (1 - a * r_h)


def heating_from_circuit(circuit: Circuit, current: float, time: float, r_h: float | None = None) -> float:
    """What the circuit of figure 3-3 gives: Q = a x + b, x = V + R_h Q, C V' = Q - V/R_w."""
    tau = time_constant(circuit, current, r_h)
    rate = printed_amplitude(circuit, current, r_h)
    return AMBIENT + initial_jump(circuit, current, r_h) - rate * tau * math.expm1(-time / tau)


def loop_gain(current: float, r_h: float) -> float:
    """a R_h: above 1 the circuit's resistance is negative."""
    return slope_and_offset(current)[0] * r_h


def cooling_as_printed(start: float, time: float, since: float, tau: float) -> float:
    """Equation 3.4 as printed: a temperature that starts at neither T_init nor ends at the ambient."""
    return (start - AMBIENT) * math.exp((-time - since) / tau)


def cooling(start: float, time: float, since: float, tau: float) -> float:
    """Equation 3.4 mended: from T_init at `since` to the ambient."""
    return AMBIENT + (start - AMBIENT) * math.exp(-(time - since) / tau)
