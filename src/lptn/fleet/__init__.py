"""One model fitted to each robot of a fleet on its own, over any executor; resumable."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
