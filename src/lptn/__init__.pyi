from .basics.errors import InputError as InputError
from .diagnose.improvement import improve as improve
from .identify.comparison import predict as predict
from .identify.data import load_model as load_model
from .identify.data import split_data as split_data
from .identify.fitting import fit as fit
from .logs.reading import read_log as read_log
from .logs.run import Run as Run
from .model.file import read_model_file as read_model_file
from .model.model import Model as Model
from .model.network import Network as Network
from .online.estimator import Estimator as Estimator
from .online.forecasting import Forecast as Forecast

__version__: str
__all__: list[str]
