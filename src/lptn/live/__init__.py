"""A running robot: messages of any source go through one sample clock and the filter of `lptn.online` to sinks.

`Watch` is the loop. Each step of the model its estimator takes in what the source said; now and then `assess` gives the
last two hours to `lptn.forecast` and `lptn.monitor`, as it would a finished log.

A large room: of 1,900 lines 750 are sources (DDS with its messages' types among them) and sinks, each of which somebody
else's format fixes; 450 make rows of messages as a log's reader does, which has the whole log before it; 500 are the
loop with its state, 200 ask for forecasts in a process of their own.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
