"""What logs hold, what is wrong with them, and which effects of the catalogue they could reveal; no fit is made."""

from lptn.check.excitation import Excitation, excitation
from lptn.check.holding import Held, held
from lptn.check.revealing import Revealed, revealed

__all__ = ["Excitation", "Held", "Revealed", "excitation", "held", "revealed"]
