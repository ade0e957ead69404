"""Model files for the fuzzer."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from random import Random

import numpy as np
import pandas as pd

from lptn.model.model import Model
from lptn.robots.presets import presets
from tests.hardening.target import EXAMPLES, command

ALL = """\
[model]
name = "all"   # every table there is
joints = ["FR_calf", "FL_calf"]
ambient = { value = 22, unit = "degC" }
step = 1

[columns]
"temperature.FR_calf" = { column = "T3", unit = "degF" }
"current.FR_calf" = { norm = ["i_d", "i_q"], unit = "mA", scale = 2 }
torque.FL_calf = "tau"

[nodes."*_calf"]
capacity = { value = 0.3, unit = "kJ/K", bounds = [0.02, 3], share = "class" }

[nodes.wall]
temperature = "temperature.wall"

[nodes.stator.element]
kind = "annulus"
inner_radius = { value = 25, unit = "mm" }
outer_radius = { value = 40, unit = "mm" }
length = { value = 20, unit = "mm" }
conductivity_radial = 28
conductivity_axial = { value = 3, fixed = false }
density = 7650
specific_heat = 470

[[links]]
between = ["stator.outer", "wall"]
resistance = 0.1

[[links]]
between = ["stator.inner", "FR_calf"]
perfect = true

[[links]]
between = ["{leg}_calf", "ambient"]
resistance = { value = 3, unit = "K/W", share = "sides" }

[[effects]]
kind = "copper_loss"
at = "*_calf"
resistance = 0.15
share = "class"

[[effects]]
kind = "sensor_offset"
at = "FR_calf"
run = "mon*"

[[effects]]
kind = "conduction"
at = "FL_calf~FR_calf"
driven_by = "FR_calf"

[fit]
rmse = 0.5
warnings = ["one"]
data = [{ file = "log.csv", sha256 = "00" }]

[fit.parameters]
"resistance.FR_calf~ambient" = { value = 3.5, error = 0.1, unit = "K/W" }
"""


@cache
def models() -> Mapping[str, bytes]:
    """Presets and examples, and one with all that a model file may say."""
    small = [name for name in presets() if name not in ("quadruped", "heated-block")]
    files = {f"{name}.toml": presets()[name].encode() for name in small}
    for path in sorted(EXAMPLES.glob("*/*.toml")):
        if path.parent.name in ("tclab", "ur3", "pmsm", "bldc_stators", "u8_thesis"):
            files[path.name] = path.read_bytes()
    files["all.toml"] = ALL.encode()
    return files


def read_model(path: Path, random: Random) -> None:
    """The file, the network, the model, additions to it; now and then a command with a log."""
    from lptn.model.file import read_model_file

    file = read_model_file(path)
    model = Model(file.network)
    again = file.with_effects(file.network.effects[:0])
    if again.network.dynamic != file.network.dynamic:
        raise AssertionError("written again it says something else")
    if random.random() < 0.3:
        _simulated(path, model, random)
    if random.random() < 0.1:
        from lptn.model.file import added

        added(file, random.choice(("conduction", "forced_convection", "sensor_lag")), random.choice(("*", "FR_calf")))


def _simulated(path: Path, model: Model, random: Random) -> None:
    """`lptn simulate` and `lptn check` with a log that holds whatever the model reads."""
    time = np.arange(0.0, 60.0)
    columns = [*model.inputs, *(f"temperature.{node}" for node in model.nodes)]
    table = {"time": time} | {
        name: 25.0 + 0.1 * time if name.startswith("temperature") else np.full(60, random.uniform(0, 5))
        for name in columns
    }
    log = path.with_name("driven.csv")
    pd.DataFrame(table).to_csv(log, index=False)
    command(["simulate", str(path), str(log), "-o", str(path.with_name("out.csv"))])
    command(["check", str(path), str(log)])
