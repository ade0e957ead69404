from .assessment import Assessment as Assessment
from .sinks import Foxglove as Foxglove
from .sinks import JsonLines as JsonLines
from .sinks import Prometheus as Prometheus
from .sources import GrowingFile as GrowingFile
from .sources import Lines as Lines
from .sources import Push as Push
from .sources import Replay as Replay
from .sources import Source as Source
from .sources import Udp as Udp
from .status import NodeStatus as NodeStatus
from .status import Status as Status
from .watch import Sink as Sink
from .watch import Watch as Watch

__all__: list[str]
