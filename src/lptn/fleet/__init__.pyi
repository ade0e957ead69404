from .fleet import Fleet as Fleet
from .fleet import Outlier as Outlier
from .fleet import Spread as Spread
from .fleet import fit_each as fit_each
from .robots import RobotLogs as RobotLogs
from .robots import robots_of as robots_of
from .work import Outcome as Outcome

__all__: list[str]
