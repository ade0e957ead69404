from .cosim import Cosimulation as Cosimulation
from .cosim import cosimulate as cosimulate
from .exporter import Exported as Exported
from .exporter import export as export
from .session import FmuError as FmuError
from .session import Session as Session

__all__: list[str]
