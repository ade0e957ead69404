"""Trade studies of motor, gear and cooling: small optimisation problems on the model (`lptn trade STUDY.toml`)."""

from .answer import FrontPoint, StudyResult, solve_study
from .designs import Design, IsoMap, LimitCurve, TorqueSpeed, iso_map, limit_curves, torque_speed
from .problem import DesignProblem, Obstacle, Refusal
from .study import Gear, Option, TradeStudy
from .study_file import load_study, parse_study
from .uncertainty import Interval

__all__ = [
    "Design", "DesignProblem", "FrontPoint", "Gear", "Interval", "IsoMap", "LimitCurve", "Obstacle", "Option",
    "Refusal", "StudyResult", "TorqueSpeed", "TradeStudy", "iso_map", "limit_curves", "load_study", "parse_study",
    "solve_study", "torque_speed",
]  # fmt: skip
