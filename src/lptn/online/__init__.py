"""Temperatures and their uncertainty in real time; forecasts of the time to a limit, and faults of sensors.

A large room, since a filter that believes its readings burns motors. Of 3,300 lines 1,200 are
the filter, and whether each sensor is alive (`living_sensors`, which the controller's C repeats). Another 1,250 tell a
wrong sensor from a wrong load, wrong air and a wrong model: rival hypotheses, each with a filter of its own
(`fault_bank`), limits that healthy logs set (`calibration`), and what needs no filter (`monitoring`). The other 850
find the present at a log's end without leaning on dead sensors, the load that goes on (a gait, a mean), and the time to
a limit with its band. Simpler tests than those of rivals blamed healthy sensors in 6 of 16 logs.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
