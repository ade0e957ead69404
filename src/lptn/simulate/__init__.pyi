from .bound_run import BoundRun as BoundRun
from .bound_run import bind as bind
from .bound_run import needed_columns as needed_columns
from .simulation import Sensitivities as Sensitivities
from .simulation import SimulationError as SimulationError
from .simulation import Trajectory as Trajectory
from .simulation import sensitivities as sensitivities
from .simulation import simulate as simulate
from .state_space import StateSpace as StateSpace
from .state_space import state_space as state_space

__all__: list[str]
