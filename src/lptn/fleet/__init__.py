"""One model fitted to each robot of a fleet on its own, over any executor; stopped at any moment and gone on with."""

from lptn.fleet.each import Fleet, fit_each
from lptn.fleet.robots import Robot, robots_of
from lptn.fleet.spread import Outlier, Spread
from lptn.fleet.work import Outcome

__all__ = ["Fleet", "Outcome", "Outlier", "Robot", "Spread", "fit_each", "robots_of"]
