from .augmented_model import ModelError as ModelError
from .calibration import Calibration as Calibration
from .calibration import calibrate as calibrate
from .estimator import Estimate as Estimate
from .estimator import Estimator as Estimator
from .fault_bank import Alarm as Alarm
from .forecasting import Forecast as Forecast
from .forecasting import NodeForecast as NodeForecast
from .forecasting import forecast as forecast
from .monitoring import MonitoredRun as MonitoredRun
from .monitoring import Monitoring as Monitoring
from .monitoring import monitor as monitor
from .operating_point import GaitPeriod as GaitPeriod
from .operating_point import OperatingPoint as OperatingPoint
from .operating_point import find_gait as find_gait
from .present import ModelUncertainty as ModelUncertainty

__all__: list[str]
