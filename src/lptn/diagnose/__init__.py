"""Diagnosis: which catalogue effect is missing, where, how sure, and what else would look the same."""

from lptn.diagnose.candidates import Candidate, candidates
from lptn.diagnose.diagnosis import (
    MUCH_WORSE,
    Diagnosis,
    Finding,
    Verdict,
    diagnose,
    examine,
    explained_elsewhere,
    for_search,
)
from lptn.diagnose.lack import explained
from lptn.diagnose.nuisance import with_ambient_errors
from lptn.diagnose.refit import SIGNIFICANT, TIE, Refit, continued, tied, unless_interrupted, worse_by
from lptn.diagnose.score import Score, Scores, score

__all__ = [
    "MUCH_WORSE",
    "SIGNIFICANT",
    "TIE",
    "Candidate",
    "Diagnosis",
    "Finding",
    "Refit",
    "Score",
    "Scores",
    "Verdict",
    "candidates",
    "continued",
    "diagnose",
    "examine",
    "explained",
    "explained_elsewhere",
    "for_search",
    "score",
    "tied",
    "unless_interrupted",
    "with_ambient_errors",
    "worse_by",
]
