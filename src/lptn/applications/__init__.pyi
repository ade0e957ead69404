from .load_sharing.sharing import LoadSharing as LoadSharing
from .replanning import MissionControl as MissionControl

__all__: list[str]
