"""The model as pure functions of arrays, for thousands of robots at once: a module without lptn and CasADi in it.

A hundred lines above its budget are `motors.py`: MuJoCo's one node a joint, and the error that this costs.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
