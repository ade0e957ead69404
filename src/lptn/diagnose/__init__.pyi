from .answers import Step as Step
from .candidates import Candidate as Candidate
from .candidates import candidates as candidates
from .diagnosis import Diagnosis as Diagnosis
from .diagnosis import Verdict as Verdict
from .diagnosis import diagnose as diagnose
from .diagnosis import weighed as weighed
from .evidence import FirstOrder as FirstOrder
from .improvement import History as History
from .improvement import improve as improve

__all__: list[str]
