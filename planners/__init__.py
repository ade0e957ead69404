"""The planners' room: torque planning and cooling trade studies on the same model; installed as `lptn.planners`."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
