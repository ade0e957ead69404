from .answers import Step as Step
from .candidates import Candidate as Candidate
from .candidates import candidates as candidates
from .diagnosis import Diagnosis as Diagnosis
from .diagnosis import Verdict as Verdict
from .diagnosis import diagnose as diagnose
from .improvement import History as History
from .improvement import improve as improve
from .scores import Score as Score
from .scores import Scores as Scores
from .scores import score as score

__all__: list[str]
