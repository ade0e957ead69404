from .calibration import Calibration as Calibration
from .calibration import calibrate as calibrate
from .dynamics import ModelError as ModelError
from .estimator import Estimate as Estimate
from .estimator import Estimator as Estimator
from .forecasting import Forecast as Forecast
from .forecasting import NodeForecast as NodeForecast
from .forecasting import Window as Window
from .forecasting import forecast as forecast
from .monitoring import Monitoring as Monitoring
from .monitoring import Watched as Watched
from .monitoring import monitor as monitor
from .operating_point import Gait as Gait
from .operating_point import find_gait as find_gait
from .present import Knowledge as Knowledge
from .sensor_faults import Alarm as Alarm

__all__: list[str]
