from .comparison import Comparison as Comparison
from .comparison import Errors as Errors
from .comparison import Prediction as Prediction
from .comparison import compare as compare
from .comparison import predict as predict
from .data import DataSplit as DataSplit
from .data import Segment as Segment
from .data import load_model as load_model
from .data import split_data as split_data
from .fitting import Fit as Fit
from .fitting import finished as finished
from .fitting import fit as fit
from .problem import Point as Point
from .problem import Problem as Problem
from .solvers import Progress as Progress
from .uncertainty import Uncertainty as Uncertainty

__all__: list[str]
