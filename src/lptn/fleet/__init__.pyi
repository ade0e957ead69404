from .fleet import Deviation as Deviation
from .fleet import Fleet as Fleet
from .fleet import fit_each as fit_each
from .pooling import FleetParameter as FleetParameter
from .pooling import RobotValue as RobotValue
from .robots import RobotLogs as RobotLogs
from .robots import robots_of as robots_of
from .work import Outcome as Outcome

__all__: list[str]
