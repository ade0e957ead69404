"""The trial counts right: names of the same places, groups and probabilities, alarms, bounds, bins, the result file."""

from __future__ import annotations

import json
import stat
import sys
from dataclasses import replace
from functools import partial
from pathlib import Path

import pytest

from tests.benchmarks.verdict_answers import Answer, out_of_bounds, read_answer, read_results, run_missing
from tests.benchmarks.verdict_cases import TRUTHS, Case, Files, draw_cases
from tests.benchmarks.verdict_trial import (
    NOTHING,
    calibration,
    credible_set,
    draw_reliability,
    judged,
    misses,
    reliability,
    table,
)

LEG = Case("leg", "clean", ("forced_convection@FR_calf",), 1)
TWO = Case("leg", "clean", ("second_mass@FR_hip", "sensor_drift@FR_calf"), 1)
NONE = Case("leg", "clean", (), 1)
OUTSIDE = Case("leg", "clean", ("splash@FR_calf",), 1)
QUADRUPED = Case("quadruped", "clean", ("coulomb_friction@*",), 1)
PASTE = Case("finite volumes", "0.1K", ("paste_missing@FR_thigh",), 1)
AS_BUILT = Case("finite volumes", "0.1K", (), 1)


def said(*steps: tuple[str, str], verdict: str = "missing", **more: object) -> Answer:
    """An answer with these steps, the first of them its own group."""
    return Answer(verdict, "adequate", list(steps), list(steps[:1]), **more)  # type: ignore[arg-type]


def test_kinds_of_cases() -> None:
    kinds = {case: case.kind for case in (LEG, TWO, NONE, OUTSIDE)}
    assert kinds == {LEG: "one", TWO: "two", NONE: "nothing", OUTSIDE: "outside"}
    assert Case("finite volumes", "1K", ("wax@FR_calf",), 1).kind == "outside"


def test_two_names_of_the_same_places_are_one_answer() -> None:
    assert judged(QUADRUPED, said(("coulomb_friction", "*_*"))).first  # the computer has no friction
    assert not judged(QUADRUPED, said(("coulomb_friction", "*_calf"))).first
    assert judged(LEG, said(("forced_convection", "*_calf"))).first  # a leg has one calf
    assert not judged(LEG, said(("forced_convection", "FR_calf@fit1"))).first
    assert not judged(LEG, said(("fan", "FR_calf"))).first


def test_a_right_answer_in_the_group_or_behind_is_not_first() -> None:
    late = judged(LEG, said(("fan", "FR_calf"), ("radiation", "*"), ("forced_convection", "FR_calf")))
    assert (late.first, late.in_set, late.in_three) == (False, False, True)
    group = Answer("missing", "", [("fan", "FR_calf")], [("fan", "FR_calf"), ("forced_convection", "FR_calf")])
    assert (judged(LEG, group).first, judged(LEG, group).in_set, judged(LEG, group).in_three) == (False, True, False)
    assert not judged(LEG, group).left_open
    assert judged(LEG, replace(group, names=group.group)).left_open
    fourth = said(*[("fan", "FR_hip")] * 3, ("forced_convection", "FR_calf"))
    assert not judged(LEG, fourth).in_three


def test_a_place_is_right_whatever_effect_is_told_there() -> None:
    at = partial(said, ("radiation", "*"))  # in common, so no finding
    assert judged(LEG, at(("fan", "FR_calf"))).placed
    assert judged(LEG, at(("sensor_position", "FR_calf~FR_thigh@fit1"))).placed  # of the calf's sensor
    assert not judged(LEG, at(("sensor_position", "FR_thigh~FR_calf"))).placed
    assert not judged(LEG, at(*[("fan", "FR_hip")] * 3, ("fan", "FR_calf"))).placed
    assert not judged(LEG, said(("fan", "*"))).placed


def test_either_of_two_effects_may_be_named_first() -> None:
    assert judged(TWO, said(("sensor_drift", "FR_calf"))).first
    assert not judged(TWO, said(("sensor_drift", "FR_calf"))).silly  # it is there
    assert judged(TWO, said(("sensor_drift", "FR_hip"))).silly


def test_the_credible_set_ends_when_it_holds_ninety_percent() -> None:
    stated = [("fan", "FR_calf", 0.7), ("forced_convection", "FR_calf", 0.25), ("radiation", "*", 0.04)]
    answer = said(("fan", "FR_calf"), probabilities=stated)
    assert credible_set(answer) == [("fan", "FR_calf"), ("forced_convection", "FR_calf")]
    mark = judged(LEG, answer)
    assert (mark.in_set, mark.stated, mark.true) == (True, 0.7, False)
    assert credible_set(said(verdict="adequate", probabilities=[("", "", 0.6)])) == [NOTHING]


def test_nothing_hidden_and_something_said_is_an_alarm() -> None:
    silent = judged(NONE, Answer("adequate", "adequate", probabilities=[("", "", 0.97)]))
    assert (silent.first, silent.alarm, silent.true) == (True, False, True)
    loud = judged(NONE, said(("sensor_drift", "FR_calf"), probabilities=[("sensor_drift", "FR_calf", 0.5)]))
    assert (loud.first, loud.alarm, loud.silly, loud.true) == (False, True, True, False)
    assert judged(NONE, Answer("unexplained", "unexplained")).alarm
    assert not judged(LEG, said(("fan", "FR_hip"))).alarm


def test_outside_the_catalogue_unexplained_is_right() -> None:
    assert judged(OUTSIDE, said(("fan", "FR_hip"), verdict="unexplained")).first
    assert not judged(OUTSIDE, said(("fan", "FR_hip"))).first


def test_a_failed_command_is_wrong_but_neither_silly_nor_an_alarm() -> None:
    for case in (LEG, NONE, OUTSIDE):
        mark = judged(case, Answer(error="not done within 900 s"))
        assert not any((mark.first, mark.in_set, mark.in_three, mark.silly, mark.alarm))


def test_what_every_leg_of_finite_volumes_has_is_neither_right_nor_an_alarm() -> None:
    assert not judged(AS_BUILT, said(("second_mass", "*"), ("natural_convection", "*"))).alarm
    assert not judged(AS_BUILT, said(("sensor_position", "FR_thigh~FR_calf"))).alarm
    assert judged(AS_BUILT, said(("sensor_position", "FR_hip~FR_thigh"))).alarm
    assert judged(AS_BUILT, said(("second_mass", "*"), ("sensor_offset", "FR_calf"))).alarm
    assert judged(AS_BUILT, said(("loss_scale", "*@fit1"))).alarm  # what is built in is so in every run
    mass = judged(PASTE, said(("second_mass", "FR_hip"), probabilities=[("second_mass", "FR_hip", 0.9)]))
    assert (mass.first, mass.true) == (False, True)
    assert judged(PASTE, said(("hot_spot", "FR_thigh"))).first
    assert judged(PASTE, said(("sensor_position", "FR_thigh~FR_thigh_case"))).first
    assert not judged(PASTE, said(("sensor_position", "FR_thigh~FR_calf"))).first


def test_everywhere_does_not_match_a_single_joint() -> None:
    wind = Case("finite volumes", "computer", ("wind@*",), 1)
    assert judged(wind, said(("forced_convection", "*"))).first
    assert judged(wind, said(("forced_convection", "*_*"))).first
    assert not judged(wind, said(("forced_convection", "FR_calf"))).first


def test_bounds_count_where_something_was_added() -> None:
    answer = said(
        ("second_mass", "FR_hip"),
        parameters={"capacity.FR_hip": (20.0, 1.0), "second_mass.time_constant.FR_hip": (1e8, 1.0)},
        at_bound=["capacity.FR_hip"],
    )
    assert out_of_bounds(answer) == ["capacity.FR_hip", "second_mass.time_constant.FR_hip"]
    assert out_of_bounds(said(("fan", "FR_hip"), at_bound=["fan.gamma.FR_hip"])) == ["fan.gamma.FR_hip"]
    assert not out_of_bounds(said(at_bound=["capacity.FR_hip"]))


def test_both_versions_json_is_read() -> None:
    steps = [
        {"effect": None, "at": None, "rmse_holdout": 1.0, "indistinguishable_from": []},
        {"effect": "fan", "at": "FR_hip", "rmse_holdout": 0.5, "indistinguishable_from": [["radiation", "*"]]},
    ]
    text = "Warning: fan.gamma.FR_hip: ends at its bound (0 to 100 1).\nWarning: resistance.a~b: not determined.\n"
    text += "Warning: capacity.a: would go to its bound beside the added effects, 20 J/K, and is kept at 50 J/K."
    old = read_answer({"verdict": "missing", "remaining": "adequate", "ladder": steps}, text, 1.0)
    assert (old.group, old.holdout, old.at_bound) == (
        [("fan", "FR_hip"), ("radiation", "*")],
        [1.0, 0.5],
        ["fan.gamma.FR_hip", "capacity.a"],
    )
    assert old.probabilities is None
    stated = [{"effect": "fan", "at": "FR_hip", "probability": 0.8}, {"effect": None, "at": None, "probability": 0.1}]
    written = {"verdict": "missing", "remaining": "adequate", "history": steps, "probabilities": stated}
    assert read_answer(written, "", 1.0).probabilities == [("fan", "FR_hip", 0.8), (*NOTHING, 0.1)]
    offset = {"effect": "sensor_offset", "at": "FR_hip", "indistinguishable_from": [["constant_heat", "FR_hip"]]}
    told = written | {"findings": [offset], "structure": [{"effect": "fan", "at": "*"}]}
    new = read_answer(told, "", 1.0)
    assert new.steps == [("sensor_offset", "FR_hip"), ("fan", "*")]
    assert new.group == [("sensor_offset", "FR_hip"), ("constant_heat", "FR_hip")]
    assert new.holdout == old.holdout


def test_bins_and_their_intervals(tmp_path: Path) -> None:
    low, high = reliability([(0.4, True), (0.4, False), (1.0, True), (0.995, True)])
    assert (low.count, low.right, high.count, high.right) == (2, 1, 2, 2)
    assert high.stated == pytest.approx(0.9975)
    assert high.lower == pytest.approx(0.025**0.5)  # Clopper and Pearson: both of two
    assert high.upper == 1
    draw_reliability({"the catalogue's formulas": [low, high]}, tmp_path / "reliability.svg")
    assert (tmp_path / "reliability.svg").stat().st_size > 1000


def test_tables_compare_only_what_all_versions_were_asked() -> None:
    right, wrong = said(("forced_convection", "FR_calf"), holdout=[1.0, 0.1]), Answer(error="crashed", seconds=2.0)
    results = {(LEG, "old"): wrong, (LEG, "new"): right, (TWO, "old"): wrong, (LEG, "two masses"): said(holdout=[0.7])}
    lines = table(results, [LEG, TWO], ["old", "new"]).splitlines()
    assert len(lines) == 5
    cells = [cell.strip() for cell in lines[-1].split("|")[1:-1]]
    assert cells[:5] == ["leg", "clean", "one", "1", "0.00 · 1.00"]
    assert cells[14:17] == ["1.00 · 0.00", "– → – · 1 → 0.1", "0.7"]
    assert "crashed" in misses(results, [LEG, TWO], ["old", "new"])
    assert calibration(results, [LEG, TWO], "new") == {}


def test_more_cases_are_those_of_before_and_others() -> None:
    numbers = {"pairs": 1, "nothing": 1, "outside": 1}
    few = draw_cases("leg", ["clean"], [7], most=2, **numbers)
    many = draw_cases("leg", ["clean"], [7], most=5, **numbers)
    assert len(few) == 5
    assert set(few) < set(many)
    assert len(draw_cases("finite volumes", ["0.1K"], [7], most=2, **numbers)) == 4  # one change at a time


@pytest.mark.long
def test_cases_are_asked_once_and_a_program_that_fails_or_hangs_is_an_answer(tmp_path: Path) -> None:
    out, calls = tmp_path / "out.jsonl", tmp_path / "calls"
    result = {"verdict": "adequate", "remaining": "adequate", "history": [{"effect": None, "rmse_holdout": 0.1}]}
    bodies = {
        "good": f"open(sys.argv[sys.argv.index('--json') + 1], 'w').write({json.dumps(result)!r})",
        "bad": "sys.exit('no such model')",
        "slow": "\nwhile True: pass",
    }
    versions = {}
    for name, body in bodies.items():
        versions[name] = tmp_path / name
        versions[name].write_text(f"#!{sys.executable}\nimport sys; open({str(calls)!r}, 'a').write('x'); {body}\n")
        versions[name].chmod(versions[name].stat().st_mode | stat.S_IEXEC)
    for _ in range(2):
        run_missing({NONE: lambda folder: Files(folder, (folder,), ())}, versions, None, out, limit=2.0)
    assert calls.read_text() == "xxx"
    results = read_results(out)
    assert replace(results[NONE, "good"], seconds=0.0) == Answer("adequate", "adequate", holdout=[0.1])
    assert results[NONE, "bad"].error == "no such model"
    assert results[NONE, "slow"].error == "not done within 2 s"


def test_every_truth_has_cases_of_each_kind() -> None:
    for truth, source in TRUTHS.items():
        cases = draw_cases(truth, source.tiers[:1], [3], most=1, pairs=1, nothing=1, outside=1)
        assert {case.kind for case in cases} >= {"one", "nothing", "outside"}
