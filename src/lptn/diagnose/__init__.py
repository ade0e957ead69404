"""Diagnosis: which catalogue effect is missing, where, how sure, and what else would look the same."""

from lptn.diagnose.candidates import Candidate, candidates
from lptn.diagnose.diagnosis import Diagnosis, Finding, Verdict, diagnose, examine, fit_parts, holdout_errors
from lptn.diagnose.refit import Refit, continued, criterion, price
from lptn.diagnose.score import Score, Scores, score

__all__ = [
    "Candidate",
    "Diagnosis",
    "Finding",
    "Refit",
    "Score",
    "Scores",
    "Verdict",
    "candidates",
    "continued",
    "criterion",
    "diagnose",
    "examine",
    "fit_parts",
    "holdout_errors",
    "price",
    "score",
]
