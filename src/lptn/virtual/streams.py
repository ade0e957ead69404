"""Give every random thing its own generator, so that changing one leaves the others as they were."""

from __future__ import annotations

from zlib import crc32

import numpy as np


def stream(seed: int, *names: str) -> np.random.Generator:
    """Return the generator of one named thing under one seed.

    A log with a hidden effect and the log without it then share parameters, movements and sensor noise:
    their difference is the effect and nothing else.

    Args:
        seed: integer, 0 or above.
        names: what is drawn, such as ``"protocol", "fit1"``.

    Raises:
        ValueError: the seed is negative.
    """
    if seed < 0:
        raise ValueError(f"seed: found {seed}; expected an integer, 0 or above")
    return np.random.default_rng([seed, *(crc32(name.encode()) for name in names)])
