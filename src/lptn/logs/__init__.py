"""Logs of robots, read into runs: uniform sampling, SI units, every fault said.

The largest room of the library: seven formats with clocks of their own, and some ninety ways in which a log is wrong,
each told with its place and the line that corrects it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
