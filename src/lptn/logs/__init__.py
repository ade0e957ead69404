"""Logs of robots, read into runs: uniform sampling, SI units, every fault said.

A large room, for two reasons. Seven formats, each with clocks, names and units of its own, take more than half of it.
The rest finds what is wrong with a log: a fit believes every reading, and some ninety ways of being wrong look like
physics to it. They are told by four comparisons, with one table of what each quantity can be (`plausible`): of a
channel with itself (`silence`, `units`), with what a passive part can do (`passive`), with the law of its own heat
(`law`), and with other channels (`alike`, `streams`). Each finding needs its place in the file and the line that
corrects it. Of ten checks that were switched off one by one nearly each lost findings.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
