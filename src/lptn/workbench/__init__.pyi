from .server import serve as serve
from .session import WorkbenchSession as WorkbenchSession

__all__: list[str]
