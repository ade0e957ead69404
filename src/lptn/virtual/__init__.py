"""Virtual robots, a leg and a quadruped, to try things on; nothing here uses the rest of the library.

From a robot to its log, a file each: ``robot`` (the truth), ``effects`` (what may be hidden in it), ``heat`` (its
balance), ``sensors``, ``surroundings``, ``motion`` and ``runs`` (what it does), ``leg`` and ``quadruped`` (the logs),
``writers`` (the files). Those robots are lumped, as the models are; ``tests/truth`` has a leg that isn't, and the plans
of runs that only trials need.

A large room for two robots, since each effect of the catalogue is here once more, from its equation, and can stand at
each place of both.
"""

from __future__ import annotations

from .effects import BEYOND, EFFECTS, SINGLE, Columns, Hidden, places
from .heat import Balance, Forcing
from .leg import leg_logs
from .motion import Bout
from .quadruped import Logs, Record, quadruped, quadruped_logs, rows, simulate_runs
from .robot import LAYOUTS, LEG_JOINTS, QUADRUPED_JOINTS, QUADRUPED_NODES, Mass, Robot, draw_leg, draw_quadruped
from .runs import PLANS, Job, Plan, plan
from .sensors import Probe
from .writers import Format, write_logs

__all__ = [
    "BEYOND", "EFFECTS", "LAYOUTS", "LEG_JOINTS", "PLANS", "QUADRUPED_JOINTS", "QUADRUPED_NODES", "SINGLE",
    "Balance", "Bout", "Columns", "Forcing", "Format", "Hidden", "Job", "Logs", "Mass", "Plan", "Probe",
    "Record", "Robot", "draw_leg", "draw_quadruped", "leg_logs", "places", "plan", "quadruped",
    "quadruped_logs", "rows", "simulate_runs", "write_logs",
]  # fmt: skip
