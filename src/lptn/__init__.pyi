from .compare import predict as predict
from .errors import InputError as InputError
from .evidence import evidence as evidence
from .forecast import Forecast as Forecast
from .identify import fit as fit
from .ladder import improve as improve
from .logs import Run as Run
from .logs import read_log as read_log
from .model import Model as Model
from .model_file import load_model as load_model
from .network import Network as Network
from .online import Estimator as Estimator
from .opening import open_model as open_model

__version__: str
__all__: list[str]
