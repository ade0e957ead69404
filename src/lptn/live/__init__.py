"""A running robot: messages of any source go through one sample clock and the filter of `lptn.online` to sinks.

`Watch` is the loop. Each step of the model its estimator takes in what the source said; now and then `assess` gives the
last two hours to `lptn.forecast` and `lptn.monitor`, as it would a finished log.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
