"""The FMU room: models as components of anybody's simulator, and their co-simulation with logs."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach(
    __name__,
    submod_attrs={
        "exporter": ["Exported", "export"],
        "session": ["FmuError", "Session"],
        "cosim": ["Cosimulation", "cosimulate"],
    },
)
