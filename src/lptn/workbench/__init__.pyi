from .server import serve as serve
from .session import Session as Session

__all__: list[str]
