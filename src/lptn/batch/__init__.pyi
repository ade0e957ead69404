from .module import export as export
from .module import functions as functions

__all__: list[str]
