from .linear import StateSpace as StateSpace
from .linear import state_space as state_space
from .sensitivities import Sensitivities as Sensitivities
from .sensitivities import sensitivities as sensitivities
from .simulation import BoundRun as BoundRun
from .simulation import SimulationError as SimulationError
from .simulation import Trajectory as Trajectory
from .simulation import bind as bind
from .simulation import simulate as simulate

__all__: list[str]
