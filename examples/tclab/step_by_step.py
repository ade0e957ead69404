# %% [markdown]
# # What is missing, step by step
#
# The two heaters of `two_heaters.toml`, from the given model to the better one, with every step of `lptn improve` in
# your hands. Each `# %%` begins a cell: open this file as a notebook (VS Code, Jupytext), or run it as it is.

# %%
from pathlib import Path

from lptn.basics.style import show
from lptn.diagnose.advice import advise
from lptn.diagnose.diagnosis import for_search, weighed
from lptn.diagnose.improvement import improve
from lptn.diagnose.refits import continued, refit
from lptn.diagnose.unexplained_heat import largest, unexplained_heat
from lptn.identify.comparison import compare
from lptn.identify.data import load_model, split_data
from lptn.identify.validation import fit_segments, holdout_errors
from lptn.report.comparison_figures import comparison_figure, predictions_figure
from lptn.report.diagnosis_figures import plot_history

here = Path(__file__).parent if "__file__" in globals() else Path.cwd()  # a notebook runs in its folder
loaded = load_model(here / "two_heaters.toml")
data = split_data(loaded.runs([here / "log.csv"]), holdout_after=300.0)  # fit the first 300 s, predict the rest

# %% The model as it was given, fitted: how wrong is it where the fit never looked?
given = fit_segments(loaded.model, data.fit)
print(f"given model: {given.rmse:.2f} K fitted, {holdout_errors(given, data.holdout).rmse:.2f} K held out")
show(comparison_figure(compare(given.model, data.holdout)))

# %% Every effect of the catalogue at every place, weighed to first order beside all that every log has wrong
coarse = for_search(data)
base = fit_segments(loaded.model, coarse.fit)
effects = weighed(base)
print(f"{len(effects)} candidates; the most probable, with the logarithm of their odds to nothing:")
for entry in effects[:5]:
    print(f"  {entry.candidate.key}: {entry.log_odds:.1f}")

# %% One of them tried exactly, by hand
best = effects[0]
tried = refit(base, best.candidate.declaration(best.amplitude, best.shape))
print(f"with {best.candidate.key}: {holdout_errors(tried, coarse.holdout).rmse:.2f} K held out")

# %% Where and when does a model lack heat?
stretch = largest(unexplained_heat(base))
print(stretch.text() if stretch else "nowhere surely")

# %% The whole search, and what to do next
history = improve(loaded.model, data)
for step in history.steps:
    print(step.effect or "as given", step.at or "", f"{step.holdout.rmse:.2f} K held out")
for sentence in advise(history.first, history.last, coarse).sentences:
    print(sentence)
_ = plot_history(history.steps)
show(predictions_figure(*(compare(step.fit.model, data.holdout) for step in (history.steps[0], history.best))))

# %% Second thoughts: the last model without its first step
first = history.steps[1]
without = continued(history.last.fit, history.last.fit.model.network.without_effect(first.effect, first.at))
print(f"without {first.effect}: {holdout_errors(without, coarse.holdout).rmse:.2f} K held out")
