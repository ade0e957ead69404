from .limiter.limiter import Limiter as Limiter
from .mpc.controller import Plan as Plan
from .mpc.controller import TorqueMPC as TorqueMPC
from .mpc.loop import ControlLoop as ControlLoop

__all__: list[str]
