"""The FMU room: models as components of anybody's simulator, and their co-simulation with logs."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
