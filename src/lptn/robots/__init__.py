"""Ready model files: motors, a leg, a quadruped; and model files made from a motor's drawing or a robot's URDF."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
