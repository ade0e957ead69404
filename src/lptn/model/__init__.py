"""The thermal model: network, bodies, symbolic heat balance, and the model file.

A fifth of the room are `bodies`, resistances and capacities from dimensions and materials; another third reads model
files and says of each mistake its line and what was expected.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
