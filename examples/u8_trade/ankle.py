"""Torque and speed of an ankle prosthesis over one cycle, level walking or repeated jumps, as a trade study's `[task]`.

[Chen2017, sec. 2.1.1, 2.1.2] describes both in words and by a peak ratio; its figures are not available. What it does
not say is assumed here and named: moments and angles of level walking after the textbook's curves [WinterBiomechanics],
rounded; the shape of a jump as two half sines.

    python ankle.py    # prints the cycles of ankle_walking.toml and ankle_jumps.toml
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.interpolate import PchipInterpolator

from lptn.basics.arrays import FloatArray

WALKING_PERIOD = 1.1  # s; assumed
JUMP_PERIOD = 2.2  # s; assumed
STANCE = 0.62  # of the gait cycle; [Chen2017, sec. 2.1.1] says 60 % for stance and 40 % for swing
FLIGHT = 0.2  # of the jump cycle; [Chen2017, sec. 2.1.2]
JUMP_RATIO = 3.0  # peak of a jump over that of walking; [Chen2017, sec. 2.1.3]: "more than 3x the torque"
BODY_MASS = 75.0  # kg
_WALKING = (  # share of the gait cycle, ankle moment [N·m/kg]; plantar flexion positive; assumed after Winter
    (0.0, 0.0), (0.04, -0.08), (0.10, 0.10), (0.20, 0.45), (0.30, 0.80), (0.40, 1.25), (0.48, 1.60), (0.55, 1.00),
    (0.60, 0.20), (STANCE, 0.0), (1.0, 0.0),
)  # fmt: skip
_ANKLE = (  # share of the gait cycle, ankle angle [deg]; plantar flexion negative; assumed after Winter, rounded
    (0.0, 0.0), (0.06, -4.6), (0.14, -1.0), (0.20, 3.0), (0.30, 6.5), (0.40, 9.0), (0.44, 9.6), (0.50, 7.0),
    (0.54, 0.0), (0.58, -10.0), (STANCE, -17.0), (0.66, -19.8), (0.70, -16.0), (0.76, -9.0), (0.84, -2.0),
    (0.90, 0.0), (1.0, 0.0),
)  # fmt: skip
PEAK = max(moment for _, moment in _WALKING)
"""Largest moment of level walking [N·m/kg]."""


def level_walking(samples: int) -> FloatArray:
    """Magnitude of the ankle moment [N·m/kg] in each of `samples` equal parts of the gait cycle, RMS over the part."""
    share, moment = np.array(_WALKING).T
    return _rms(PchipInterpolator(share, moment), samples)


def walking_speed(samples: int, period: float = WALKING_PERIOD) -> FloatArray:
    """Mean speed of the ankle [rad/s] in each part of the gait cycle, positive into plantar flexion as the moment."""
    share, angle = np.array(_ANKLE).T
    ends = PchipInterpolator(share, np.deg2rad(angle))(np.linspace(0.0, 1.0, samples + 1))
    return np.asarray(-np.diff(ends) * samples / period)


def jump(samples: int) -> FloatArray:
    """Magnitude of the ankle moment [N·m/kg] in each part of a jump cycle: push-off, flight, landing at half of it.

    Push-off takes the first 30 % (assumed), the flight the next 20 %, the landing the next 30 % (assumed).
    """

    def moment(share: FloatArray) -> FloatArray:
        push, landing = share / 0.3, (share - 0.3 - FLIGHT) / 0.3
        return JUMP_RATIO * PEAK * (_half_sine(push) + 0.5 * _half_sine(landing))

    return _rms(moment, samples)


def cycle(period: float, torques: FloatArray, speeds: FloatArray | None = None) -> str:
    """Keys of a trade study's `[task]` for a duty cycle.

    Args:
        period: of the cycle [s].
        torques: of the motor in each part [N·m].
        speeds: of the motor in each part [rad/s]; nobody knows a jump's.
    """
    lines = ['kind = "cycle"', f"period = {period}"]
    for key, values in (("profile", torques), ("speeds", speeds)):
        if values is not None:
            words = [repr(value) for value in (values + 0.0).tolist()]  # 0, not -0
            rows = [", ".join(words[k : k + 5]) for k in range(0, len(words), 5)]
            lines += [f"{key} = [", *(f"    {row}," for row in rows), "]"]
    return "\n".join(lines)


def walking_task(samples: int = 40, gear: float = 50.0) -> str:
    """Level walking, the motor behind an assumed gear: joint torque over motor torque."""
    torques, speeds = level_walking(samples) * (BODY_MASS / gear), walking_speed(samples) * gear
    return cycle(WALKING_PERIOD, torques, speeds)


def jump_task(samples: int = 40, gear: float = 50.0, share: float = 1.0) -> str:
    """Jumps, the motor behind an assumed gear giving a share of the ankle's moment, a parallel spring the rest."""
    return cycle(JUMP_PERIOD, jump(samples) * (BODY_MASS * share / gear))


def _half_sine(phase: FloatArray) -> FloatArray:
    return np.where((phase > 0) & (phase < 1), np.sin(np.pi * np.clip(phase, 0.0, 1.0)), 0.0)


def _rms(moment: Callable[[FloatArray], FloatArray], samples: int) -> FloatArray:
    """Heat grows with the square of the torque, so a part's RMS is its right mean."""
    fine = (np.arange(samples * 20) + 0.5) / (samples * 20)
    values = np.asarray(moment(fine), dtype=np.float64)
    return np.asarray(np.sqrt((values**2).reshape(samples, 20).mean(axis=1)))


if __name__ == "__main__":
    print("# ankle_walking.toml", walking_task(gear=55.0), "# ankle_jumps.toml", jump_task(12, 100.0, 0.9), sep="\n")
