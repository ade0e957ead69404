"""The plain detector: measured against expected of the free-running model, and a threshold.

Source: [QuadrupedLPTN, application 2].
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from lptn.monitor.alarms import Alarm, earliest
from lptn.monitor.naming import dropouts, shaped, stuck
from lptn.monitor.scene import Scene


def direct_alarms(scene: Scene, threshold: float) -> list[Alarm]:
    """The first time at each sensor that measured and expected lie apart, or that readings are missing.

    Args:
        threshold: K.
    """
    alarms = dropouts(scene)
    for row, residual in enumerate(scene.residual):
        apart = np.flatnonzero(np.abs(np.nan_to_num(residual)) > threshold)
        if apart.size:
            alarms.append(_named(scene, row, int(apart[0])))
    return earliest(alarms)


def _named(scene: Scene, row: int, at: int) -> Alarm:
    alarm = shaped(scene, row, at)
    stands = stuck(scene, row, at)
    return alarm if stands is None else replace(alarm, kind="stuck", onset=stands, size=None)
