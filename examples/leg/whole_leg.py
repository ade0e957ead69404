# %% [markdown]
# # A whole leg, from its logs to a forecast
#
# Three joints of a virtual leg. While the robot travels, its thigh loses more heat than the model knows. Each `# %%`
# begins a cell: open this file as a notebook, or run it as it is; `--fast` looks at it in steps of 5 s.

# %%
import sys
import tempfile
from pathlib import Path

import pandas as pd

import lptn
from lptn.robots.presets import preset_text
from lptn.virtual import Hidden, leg_logs, write_logs

folder = Path(tempfile.mkdtemp(prefix="whole-leg-"))

# %% A virtual robot's logs: two to fit, one to hold out. Its truth shares no code with the model
write_logs(folder, leg_logs([Hidden("forced_convection", "FR_thigh")], seed=3, rate=1.0))
coarse = "[model]\nstep = 5" if "--fast" in sys.argv else "[model]"
(folder / "leg.toml").write_text(preset_text("leg").replace("[model]", coarse, 1))

# %% A model and its data: paths or data frames, some to fit, some that no fit sees
study = lptn.Study(
    folder / "leg.toml",
    fit=[folder / "fit1.parquet", pd.read_parquet(folder / "fit2.parquet")],
    holdout=folder / "holdout.parquet",
)
for run in study.runs:
    print(f"{run.name}: {len(run) * run.step / 60:.0f} min, {', '.join(run.notes) or 'nothing wrong with it'}")

# %% The model as it is given, fitted: right where it was fitted, wrong where it wasn't?
study.fit()
compared = study.compare()
print(compared)
compared.plot()

# %% What is missing, and where? What sets one part apart comes first, then what all have in common
diagnosis = study.diagnose()
print(f"verdict: {diagnosis.verdict}")
for answer in diagnosis.steps:
    print(f"  {answer.effect} at {answer.at}: {100 * answer.probability:.0f} % probable")

# %% Add the first answer and refit: the error falls on the run that the fit never saw
study.add(diagnosis.best)
print(study.history)
study.compare().plot("FR_thigh")

# %% Anything else? `improve` finds and adds effects automatically
study.undo().improve()
print("nothing is missing any more" if study.selection().remaining == "adequate" else "something is left")
for sentence in study.advise().sentences:
    print(sentence)

# %% What to take away: the model, the story, an FMU for a simulator
study.save(folder / "better.toml")
study.report(folder / "story.html")
study.export_fmu(folder / "leg.fmu", platforms=[])
print(*sorted(path.name for path in folder.iterdir()))

# %% Ten minutes into the held-out run: if the robot went on as it does, when would a joint reach 60 degC?
walk = study.data.holdout[0].run.slice(0.0, 600.0)
ahead = lptn.forecast(study.model, walk, 60.0, fit=study.steps[-1].fit)
for node in ahead.nodes.values():
    when = f"in {node.time_to_limit / 60:.0f} min" if node.reaches else f"never; it settles at {node.steady:.0f} degC"
    print(f"{node.node}: {when}")
