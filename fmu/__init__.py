"""The FMU room: models as components of anybody's simulator, and their co-simulation with logs.

A large room, since the standard has two versions in use, which say the same variables in two kinds of XML and ask for
them by two sets of calls; since an FMU has to build for machines that are not this one; and since systems of several
models (SSP) are read and written here, too. The numbers themselves come from the one C function that CasADi generates.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
