"""Cooling trade studies: small optimisation problems on the symbolic model (`lptn trade STUDY.toml`)."""

from .answer import FrontPoint, StudyResult, solve_study
from .designs import Design, IsoMap, LimitCurve, Obstacle, Refusal, iso_map, limit_curves
from .problem import Problem
from .study import Option, Study
from .study_file import load_study, parse_study

__all__ = [
    "Design",
    "FrontPoint",
    "IsoMap",
    "LimitCurve",
    "Obstacle",
    "Option",
    "Problem",
    "Refusal",
    "Study",
    "StudyResult",
    "iso_map",
    "limit_curves",
    "load_study",
    "parse_study",
    "solve_study",
]
