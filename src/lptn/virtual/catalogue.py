"""Gather the catalogue of hidden effects.

Each function in the files named below sets one effect in a ``Robot``, in place; its name is the effect's key. To add
one: a field in ``Robot`` where it is kept (zero when off), its physics in ``forcing`` (air, heat that does not depend
on temperature), ``Network`` and ``Exponential`` (heat that does), ``surroundings`` (the ambient) or ``shown`` (what
the sensors show), and a function there.
Strengths were chosen by simulating: the effect at one joint moves some temperature by about 1 to 5 K at most.
"""

from __future__ import annotations

from .catalogue_beyond import BEYOND
from .catalogue_heat import HEAT
from .catalogue_paths import PATHS
from .catalogue_readings import READINGS
from .registry import Catalogue

__all__ = ["EFFECTS"]

EFFECTS: Catalogue = {**HEAT, **PATHS, **READINGS, **BEYOND}
