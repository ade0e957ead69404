"""Logs of robots, read into runs: uniform sampling, SI units, every fault said."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
