"""Diagnosis: which effect is missing, where, how sure, what else would look the same, and the next experiment.

A large room, since it asks six questions of one fit: what may be missing (`candidates`), what is
(`composition`, `evidence`, `refits`), whether it is enough (`diagnosis`, `fit_statistics`), where heat stays
unexplained and what that goes with (`unexplained_heat`, `learned_heat`), how a run differs (`runs_that_differ`), and
what to measure next (`excitation`, `experiment`). The first two take two fifths of it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
