"""What stands on the planners: a mission in closed loop, legs that share a load, environments of Gymnasium.

None of the three imports another, and no planner imports any of them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
