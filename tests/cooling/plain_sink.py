"""The U8 with a heat sink in plain NumPy, many designs side by side: truth that shares nothing with `lptn.model`."""

from __future__ import annotations

import numpy as np

from lptn.basics.arrays import FloatArray

AMBIENT = 21.5  # degC
K_T, MAGNET = 60 / (2 * np.pi * 100), -0.0012  # N·m/A at 25 degC, 1/K
C_W, C_S, C_H = 46.5, 44.3, 176.0  # J/K
R_WS, R_SH, R_HA, R_SK = 1.084, 1.105, 0.779, 0.708 / 4  # K/W
RESISTANCE, ALPHA, REFERENCE = 0.186, 0.0039, 21.5  # ohm, 1/K, degC
DENSITY, HEAT, THICKNESS = 2700.0, 897.0, 1e-3  # kg/m³, J/(kg K), m
MOTOR_MASS, PIPES_MASS = 0.240, 0.06 + 4 * 0.03  # kg
MOTOR_VOLUME = np.pi * 0.0871**2 / 4 * 0.02665  # m³


def still_air() -> tuple[float, float]:
    """Film coefficient times fin efficiency [W/(m² K)] and fin spacing [m] at 30 K and 80 mm."""
    nu, a, k = 1.67e-5, 2.36e-5, 0.0267
    spacing = 2.714 * (0.08 * nu * a / (9.81 * 30.0 / 310.0)) ** 0.25
    film = 1.307 * k / spacing
    ml = np.sqrt(2 * film / (200.0 * THICKNESS)) * 0.03
    return film * np.tanh(ml) / ml, spacing


def mass(c: FloatArray) -> FloatArray:
    """Motor, pipes and sink [kg]."""
    return MOTOR_MASS + PIPES_MASS + c / HEAT


def fins_and_volume(c: FloatArray, r: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mass of the fins over the sink's, and the package's volume [m³]."""
    film, spacing = still_air()
    area = 1 / (film * r)
    metal = DENSITY * area / 2 * THICKNESS
    volume = MOTOR_VOLUME + area / 2 * (THICKNESS + spacing) + (c / HEAT - metal) / DENSITY
    return metal / (c / HEAT), volume


def hottest(
    c: FloatArray, r: FloatArray, torque: FloatArray, duration: float, step: float = 0.5, r_ws: float = R_WS
) -> FloatArray:
    """Winding temperature [degC] after a hold, by RK4; `r_ws` is between winding and stator [K/W]."""
    x = np.zeros((4, c.size)) + AMBIENT

    def rates(x: FloatArray) -> FloatArray:
        w, s, h, k = x
        current = torque / (K_T * (1 + MAGNET * (h - 25.0)))
        loss = current**2 * RESISTANCE * (1 + ALPHA * (w - REFERENCE))
        return np.stack(
            [
                (loss - (w - s) / r_ws) / C_W,
                ((w - s) / r_ws - (s - h) / R_SH - (s - k) / R_SK) / C_S,
                ((s - h) / R_SH - (h - AMBIENT) / R_HA) / C_H,
                ((s - k) / R_SK - (k - AMBIENT) / r) / c,
            ]
        )

    for _ in range(round(duration / step)):
        k1 = rates(x)
        k2 = rates(x + step / 2 * k1)
        k3 = rates(x + step / 2 * k2)
        k4 = rates(x + step * k3)
        x = x + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return np.asarray(x[0])


def held_torque(
    c: FloatArray, r: FloatArray, duration: float, limit: float, step: float = 0.5, r_ws: float = R_WS
) -> FloatArray:
    """Torque [N·m] that brings the winding just to its limit [degC], between 1.5 and 2, by bisection."""
    low, high = np.full(c.size, 1.5), np.full(c.size, 2.0)
    for _ in range(20):
        middle = (low + high) / 2
        fits = hottest(c, r, middle, duration, step, r_ws) <= limit
        low, high = np.where(fits, middle, low), np.where(fits, high, middle)
    return low
