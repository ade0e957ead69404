"""A running robot: messages of any source go through one sample clock and the filter of `lptn.online` to sinks.

`Watch` is the loop. Each step of the model its estimator takes in what the source said; now and then `assess` gives the
last two hours to `lptn.forecast` and `lptn.monitor`, as it would a finished log.

A large room: of 2,600 lines 1,300 are sources and sinks, each of which somebody else's format fixes (ROS 2's messages
by DDS, by Zenoh and in bags, Prometheus, Foxglove, Rerun); 400 make rows of messages as a log's reader does, which has
the whole log before it; 600 are the loop with its state, 300 ask for forecasts and diagnoses in a process of their own.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
