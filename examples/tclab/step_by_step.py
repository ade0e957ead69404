# %% [markdown]
# # What is missing, step by step
#
# The two heaters of `two_heaters.toml`, from the given model to the better one, with every step of `lptn improve` in
# your hands. Each `# %%` begins a cell: open this file as a notebook (VS Code, Jupytext), or run it as it is.

# %%
from pathlib import Path

from lptn.advice import advise
from lptn.compare import compare
from lptn.diagnose import candidates, continued, for_search, score
from lptn.diagnose.refit import refit
from lptn.diagnose.unexplained_heat import largest, unexplained_heat
from lptn.evidence import evidence
from lptn.ladder import improve
from lptn.on_evidence import fit_parts, holdout_errors
from lptn.opening import open_model
from lptn.report import comparison_figure, ladder_curve, predictions_figure, show
from lptn.report.words import noise_alone

here = Path(__file__).parent if "__file__" in globals() else Path.cwd()  # a notebook runs in its folder
opened = open_model(here / "two_heaters.toml")
data = evidence(opened.runs([here / "log.csv"]), holdout_after=300.0)  # fit the first 300 s, predict the rest

# %% The model as it was given, fitted: how wrong is it where the fit never looked?
given = fit_parts(opened.model, data.fit)
print(f"given model: {given.rmse:.2f} K fitted, {holdout_errors(given, data.holdout).rmse:.2f} K held out")
show(comparison_figure(compare(given.model, data.holdout)))

# %% Every effect of the catalogue at every place, scored by what it would take off the misfit
coarse = for_search(data)
base = fit_parts(opened.model, coarse.fit)
found = candidates(base.model.network, data.fit[0].run.columns)
scores = score(base, found)
print(f"{len(found)} candidates; chance alone reaches {scores.threshold:.0f} once in twenty logs")
for each in scores.ranked[:5]:
    print(f"  {each.candidate.key}: {each.gain:.0f}, p = {scores.p_value(each.gain):.2f}")

# %% One of them tried exactly, by hand
best = scores.ranked[0]
tried = refit(base, best.candidate.declaration(best.amplitude, best.shape))
print(f"with {best.candidate.key}: {holdout_errors(tried, coarse.holdout).rmse:.2f} K held out")

# %% Where and when does a model lack heat?
stretch = largest(unexplained_heat(base))
print(stretch.text() if stretch else "nowhere surely")

# %% The whole search, and what to do next
ladder = improve(opened.model, data)
for rung in ladder.rungs:
    print(rung.effect or "as given", rung.at or "", f"{rung.holdout.rmse:.2f} K held out")
for sentence in advise(ladder.first, ladder.last.fit, coarse).sentences:
    print(sentence)
show(ladder_curve(ladder, noise_alone(ladder.best.fit)))
show(predictions_figure(*(compare(rung.fit.model, data.holdout) for rung in (ladder.rungs[0], ladder.best))))

# %% Second thoughts: the last model without its first rung
first = ladder.rungs[1]
without = continued(ladder.last.fit, ladder.last.fit.model.network.without_effect(first.effect, first.at))
print(f"without {first.effect}: {holdout_errors(without, coarse.holdout).rmse:.2f} K held out")
