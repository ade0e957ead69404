from .bodies import Annulus as Annulus
from .bodies import Cuboid as Cuboid
from .bodies import Cylinder as Cylinder
from .bodies import Element as Element
from .file import ModelFile as ModelFile
from .file import parse_model as parse_model
from .file import read_model_file as read_model_file
from .model import Model as Model
from .network import EffectDeclaration as EffectDeclaration
from .network import LinkDeclaration as LinkDeclaration
from .network import Network as Network
from .network import NodeDeclaration as NodeDeclaration

__all__: list[str]
