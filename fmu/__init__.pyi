from .connected import Connected as Connected
from .cosim import Cosimulation as Cosimulation
from .cosim import cosimulate as cosimulate
from .exporter import Exported as Exported
from .exporter import export as export
from .session import FmuError as FmuError
from .session import Session as Session
from .ssp import read_values as read_values
from .ssp import write_system as write_system
from .ssp import write_values as write_values

__all__: list[str]
