"""What is printed of measured data: each step with its sizes and with what makes it doubtful; the checks of cases."""

from __future__ import annotations

from tests.benchmarks.measured_verdicts import MEASURED, story, summary
from tests.benchmarks.special_cases import SPECIAL, differs, honest, names, runs, short_of
from tests.benchmarks.verdict_answers import Answer

ANSWER = Answer(
    "missing",
    "adequate",
    [("sensor_drift", "winding"), ("radiation", "*")],
    [("sensor_drift", "winding")],
    holdout=[2.0, 2.5, 1.0],
    parameters={
        "capacity.winding": (300.0, 2.0),
        "sensor_drift.rate.winding": (30.0, 2.0),
        "radiation.area.body": (0.01, 0.1),
    },
    at_bound=["sensor_drift.rate.winding"],
    text="""fit, held out: RMSE
Step 1, sensor drift at winding: alone.
  Its size: 30 K/h.
Step 2 can't be told from a fan.
Rest""",
)


def test_doubts_stand_behind_the_size_or_the_step_that_they_concern() -> None:
    lines = story(ANSWER).splitlines()
    drift, radiation = (line for line in lines if line.startswith(("  - 1.", "  - 2.")))
    assert "rate 30 ± 2 K/h **30 times the usual, at a bound**" in drift
    assert "**an error of sensor, clock or ambient, held-out error rises**" in drift
    assert "area 0.01 ± 0.1 m^2 **not told from zero**" in radiation
    assert lines[-2:] == [
        "  - says: Step 1, sensor drift at winding: alone. Its size: 30 K/h.",
        "  - says: Step 2 can't be told from a fan.",
    ]


def test_the_summary_counts_silly_names_and_bounds() -> None:
    row = summary({"motor": ANSWER}).splitlines()[-1]
    assert row.startswith("| motor | sensor_drift@winding, radiation@* | sensor_drift | sensor_drift.rate.winding |")
    assert "2 → 1" in row
    assert "crashed" in summary({"motor": Answer(error="crashed")})
    assert story(Answer(error="crashed")) == "- failed after 0 s: crashed"


def test_all_data_are_in_the_project() -> None:
    from pathlib import Path

    for files in MEASURED.values():
        given = files(Path())
        assert all(file.exists() for file in (given.model, *given.fit, *given.holdout))


def test_a_crash_is_told_from_a_line_of_advice() -> None:
    assert runs(Answer(error="IndexError: list index out of range"))
    assert runs(Answer(error="lptn.simulate.SimulationError: fastest rate 0.2 1/s is too fast for steps of 300 s"))
    assert runs(Answer(error='lptn: leg.toml: effects[3].at: found "a~b"'))
    assert not runs(Answer(error="lptn: slow.csv: time: found 4 readings; expected 10 or more"))


def test_adequate_is_held_against_the_held_out_run() -> None:
    assert honest(Answer("adequate", "adequate", holdout=[10.0]))
    assert not honest(Answer("unexplained", "unexplained", holdout=[10.0]))
    assert not honest(Answer("adequate", "adequate", holdout=[0.1]))
    assert honest(Answer("missing", "adequate", [("fan", "a")], holdout=[12.0, 10.0]))


def test_names_and_runs_that_differ() -> None:
    calf = names(("fan", "FR_calf"), nodes=("FR_hip", "FR_calf"), within=1)
    assert not calf(Answer(steps=[("fan", "*_calf")]))
    assert calf(Answer(steps=[("radiation", "*"), ("fan", "FR_calf")]))
    assert not differs(Answer(differing=[("surface_scale", "*")]))
    assert "nothing is" in differs(Answer())
    assert len(SPECIAL) >= 13
    assert short_of("wall, 5 min a reading", Answer(error="KeyError: 'room'")) == "failed: KeyError: 'room'"
