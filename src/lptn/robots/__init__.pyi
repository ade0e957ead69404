from .motor_drawing import Geometry as Geometry
from .motor_drawing import load_geometry as load_geometry
from .motor_drawing import parse_geometry as parse_geometry
from .motor_drawing import sample as sample
from .motor_model import model_text as model_text
from .presets import preset_text as preset_text
from .presets import presets as presets
from .presets import variants as variants
from .urdf import urdf_model_text as urdf_model_text

__all__: list[str]
