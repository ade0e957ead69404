"""The planners' room: torque planning and cooling trade studies on the same model; installed as `lptn.planners`.

A large room, since four tools answer four questions: how much torque now (`limiter`), over the next seconds (`mpc`),
whether a day's work can be done (`mission`), and what to build (`trade`, a third of the room). Each has a file of its
own that is checked to the last key, and its own answer. What two of them need stands beside their folders; none
imports another.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
