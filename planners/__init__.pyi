from .limiter.limiter import Limiter as Limiter
from .mpc.controller import TorqueMPC as TorqueMPC
from .mpc.plan import Plan as Plan

__all__: list[str]
