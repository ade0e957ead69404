r"""Conduction along one axis of a body that generates heat: conductances between its mean and its two faces.

Along one axis the steady temperature is that of pure conduction plus that of a uniform source. With
:math:`w` the weight of each face in the mean of pure conduction, :math:`\rho` the rise of the mean for each watt
between faces held at zero, and :math:`G` the conductance from face to face, the same numbers follow from three
conductances:

.. math:: G_{mean,low} = w_{low} / \rho, \quad G_{mean,high} = w_{high} / \rho, \quad
          G_{low,high} = G - w_{low} w_{high} / \rho

This is the T-network with a negative resistance in its foot, its massless star point eliminated. The conductance from
face to face is negative, and yet the whole takes in no work: its power is
:math:`(\bar T - \sum w T)^2 / \rho + G (T_{low} - T_{high})^2`.

Derived here; [BlockLPTN, eq. 9] gives the slab (R = -L/(6kA)). [GerlingDajaku2005], named there for the ring,
was not available.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

_SERIES = 0.05  # below it coth x - 1/x loses digits; the series is exact to 1e-15 there


@dataclass(frozen=True)
class Axis:
    """Conductances for each W/(m K) of conductivity [m].

    Args:
        faces: names of the low and the high face; the high one alone where the body reaches to its centre line.
        mean: from the mean temperature to each face.
        across: from face to face; negative for a slab or a ring.
    """

    faces: tuple[str, ...]
    mean: tuple[float, ...]
    across: float = 0.0


def slab_axis(faces: tuple[str, str], length: float, area: float) -> Axis:
    """Along `length` [m] through a constant `area` [m²] ([BlockLPTN, eq. 8, 9])."""
    one = area / length
    return Axis(faces, (6.0 * one, 6.0 * one), -2.0 * one)


def ring_axis(faces: tuple[str, str], inner: float, outer: float, angle: float, length: float) -> Axis:
    """From the inner to the outer radius [m] of a ring, or of an arc of it, of an `angle` [rad] and a `length` [m].

    The weights are (1 ∓ 𝓛)/2 and ρ is 𝓛/(4 angle length), with 𝓛(x) = coth x - 1/x and x = ln(outer/inner).
    """
    x = math.log(outer / inner)
    curved = langevin(x)
    size = angle * length
    mean = 2.0 * size * (1.0 - curved) / curved, 2.0 * size * (1.0 + curved) / curved
    return Axis(faces, mean, size * (1.0 / x - 1.0 / curved + curved))


def rod_axis(face: str, angle: float, length: float) -> Axis:
    """From a solid cylinder, or a wedge of an `angle` [rad], to its surface: R = 1/(4 angle length k)."""
    return Axis((face,), (4.0 * angle * length,))


def langevin(x: float) -> float:
    """Langevin's function coth x - 1/x for x > 0."""
    if x < _SERIES:
        square = x * x
        return x / 3.0 * (1.0 - square / 15.0 * (1.0 - square * 2.0 / 21.0 * (1.0 - square / 10.0)))
    return 1.0 / math.tanh(x) - 1.0 / x


def slab_peak(power: float, length: float, conductivity: float, area: float, cooled: int = 2) -> float:
    """How far the hottest place of a slab lies above its mean in the steady state [K]: constrain mean plus this.

    Args:
        power: heat generated [W].
        length: [m].
        conductivity: [W/(m K)].
        area: section [m²].
        cooled: faces that are cooled alike: 2 (the middle is hottest) or 1 (the other face is).

    Raises:
        ValueError: neither one face nor two are cooled.

    Derived from the profile [BlockLPTN, eq. 4]: Q L/(24kA) and Q L/(6kA).
    """
    if cooled not in (1, 2):
        raise ValueError(f"{cooled} cooled faces; a slab has one or two")
    return power * length / ((24.0 if cooled == 2 else 6.0) * conductivity * area)
