from .basics.errors import InputError as InputError
from .basics.parameters import Parameter as Parameter
from .diagnose.improvement import improve as improve
from .identify.comparison import compare as compare
from .identify.data import load_model as load_model
from .identify.data import split_data as split_data
from .identify.fitting import fit as fit
from .logs.reading import read_log as read_log
from .logs.run import Run as Run
from .model.model import Model as Model
from .model.network import EffectDeclaration as EffectDeclaration
from .model.network import LinkDeclaration as LinkDeclaration
from .model.network import Network as Network
from .model.network import NodeDeclaration as NodeDeclaration
from .online.estimator import Estimator as Estimator
from .online.forecasting import forecast as forecast
from .online.monitoring import monitor as monitor
from .study import Study as Study

__version__: str
__all__: list[str]
