"""One model fitted to each robot of a fleet on its own, over any executor; resumable.

A third of the room is there for what happens when hundreds of robots are fitted for hours: a worker that dies, logs
that can't be read, two processes in one folder, a call that is repeated.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
