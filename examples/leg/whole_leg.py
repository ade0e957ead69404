# %% [markdown]
# # A whole leg, from its logs to a forecast
#
# Three joints of a virtual leg. While the robot travels, its thigh loses more heat than the model knows. Each `# %%`
# begins a cell: open this file as a notebook, or run it as it is; `--fast` looks at it in steps of 5 s.

# %%
import sys
import tempfile
from pathlib import Path

from lptn.diagnose.advice import advise
from lptn.diagnose.diagnosis import diagnose, for_search
from lptn.diagnose.improvement import improve
from lptn.identify.comparison import compare
from lptn.identify.data import load_model, split_data
from lptn.identify.validation import fit_segments, holdout_errors
from lptn.online.forecasting import forecast
from lptn.report.diagnosis_figures import ladder_curve
from lptn.report.figures import comparison_figure, predictions_figure
from lptn.report.online_figures import forecast_figure
from lptn.basics.style import show
from lptn.report.words import noise_alone
from lptn.robots.presets import preset_text
from lptn.virtual import Hidden, leg_logs, write_logs

FAST = "--fast" in sys.argv
folder = Path(tempfile.mkdtemp(prefix="whole-leg-"))


# %% A virtual robot's logs: two to fit, one to hold out. Its truth shares no code with the model
write_logs(folder, leg_logs([Hidden("forced_convection", "FR_thigh")], seed=3, rate=1.0))
(folder / "leg.toml").write_text(preset_text("leg"))
loaded = load_model(folder / "leg.toml")
fitted, held = ([*sorted(folder.glob(f"{kind}*.parquet"))] for kind in ("fit", "holdout"))
data = split_data(loaded.runs(fitted), loaded.runs(held))
if FAST:
    data = data.coarsened(5.0)
for part in (*data.fit, *data.holdout):
    print(
        f"{part.run.name}: {len(part.run) * part.run.step / 60:.0f} min, {', '.join(part.run.notes) or 'nothing found'}"
    )

# %% The model as it is given, fitted: right where it was fitted, wrong where it wasn't?
given = fit_segments(loaded.model, data.fit)
print(f"as given: {given.rmse:.2f} K fitted, {holdout_errors(given, data.holdout).rmse:.2f} K held out")
show(comparison_figure(compare(given.model, data.holdout)))

# %% What is missing, and where? Each name with the error that it leaves on the held-out run
found = diagnose(loaded.model, data)
print(f"verdict: {found.verdict}")
for each in found.helpful[:3]:
    print(f"  {each.key[0]} at {each.key[1]}: {each.holdout.rmse:.2f} K held out, p = {each.p_value:.2g}")

# %% The ladder: add it, refit, ask again, until nothing is missing
history = improve(loaded.model, data)
for step in history.steps:
    print(f"{step.effect or 'as given'} {step.at or ''}: {step.holdout.rmse:.2f} K held out")
show(ladder_curve(history, noise_alone(history.best.fit)))

# %% Proof: the held-out run, predicted by both
both = (compare(step.fit.model, data.holdout) for step in (history.steps[0], history.best))
show(predictions_figure(*both))

# %% What to do next
print("nothing is missing any more" if history.remaining == "adequate" else "something is left")
for sentence in advise(history.first, history.last.fit, for_search(data)).sentences:
    print(sentence)

# %% Ten minutes into the held-out run: if the robot went on as it does, when would a joint reach 60 degC?
ahead = forecast(history.best.fit.model, data.holdout[0].run.slice(0.0, 600.0), 60.0, fit=history.best.fit)
for node in ahead.nodes.values():
    when = f"in {node.time_to_limit / 60:.0f} min" if node.reaches else f"never; it settles at {node.steady:.0f} degC"
    print(f"{node.node}: {when}")
show(forecast_figure(ahead))
