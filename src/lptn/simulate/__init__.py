"""A model driven by a run: bound, integrated, linearised, with sensitivities. The only room that integrates."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
