"""`lptn check`: an answer of fifteen lines, details, the lines that mend, JSON, status 2 where others would refuse."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from textwrap import wrap

import pytest

from tests.cli.conftest import Lptn
from tests.diagnose.pair_runs import table


def test_a_good_log_has_an_answer_and_details(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    log = tmp_path / "monday.csv"
    table().assign(gain=1.0).to_csv(log, index=False)
    status, answer, err = lptn("check", model, log)
    assert (status, err) == (0, "")
    assert "monday.csv (CSV): 2400 samples of 1 s, 40 min" in answer
    labels = ["Verdict", "Model", "Losses", "monday.csv (CSV)", "Sensors", "Excitation", "Effects", "Next"]
    assert [line.partition(":")[0] for line in answer.splitlines() if "WRONG?" not in line] == labels
    assert len(answer.splitlines()) <= 8
    _, out, _ = lptn("check", model, log, "--details")
    assert out.startswith(answer)
    assert "not used: gain" in out
    assert "Could show, if present: " in out
    assert "drive_heat (powered.<node>)" in out
    assert len(out.splitlines()) < 45


def test_the_answer_ends_with_the_next_command(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    days = ("monday", "tuesday", "friday")
    for number, day in enumerate(days):
        table().iloc[: 1100 + number].to_csv(tmp_path / f"{day}.csv", index=False)
    logs = [tmp_path / f"{day}.csv" for day in days]
    for some, behind in ((logs[:1], ["--holdout-after", "+770"]), (logs, [str(logs[1]), "--holdout", str(logs[2])])):
        _, answer, _ = lptn("check", model, *some)
        assert "nothing looks wrong" in answer.splitlines()[0]
        assert sum(len(wrap(line.replace(str(tmp_path), ""), 80)) for line in answer.splitlines()) <= 15
        command = shlex.split(answer.splitlines()[-1].partition(": ")[2])
        assert command == ["lptn", "improve", str(model), str(logs[0]), *behind, "-o", "better.toml"]


def test_a_log_with_gaps_is_in_pieces(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    table().query("time < 600 or time >= 1200").to_csv(tmp_path / "monday.csv", index=False)
    out = lptn("check", model, tmp_path / "monday.csv")[1]
    assert "monday.csv (CSV): 1800 samples of 1 s, 30 min in 2 pieces between gaps" in out


def test_what_a_slow_sensor_misses_is_counted_by_its_own_interval(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    data = table()
    data.loc[data.index % 2 == 1, "temperature.a"] = None
    data.loc[600:1199, "temperature.a"] = None
    data.to_csv(tmp_path / "monday.csv", index=False)
    out = lptn("check", model, tmp_path / "monday.csv", "--details")[1]
    assert "temperature.a: logged every 2 s; 1 gap up to 602 s." in out
    assert [line.split()[-3] for line in out.splitlines() if line.startswith(("a  ", "b  "))] == ["25%", "0%"]


def test_a_log_that_is_refused_shows_its_columns_as_columns(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    log = tmp_path / "monday.csv"
    table().rename(columns=lambda name: name.replace("torque.", "x")).to_csv(log, index=False)
    _, out, _ = lptn("check", model, log)
    assert "it can't be used yet" in out
    assert "  columns: time, " in out
    assert "not used" not in out


def test_json(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    log, target = tmp_path / "monday.parquet", tmp_path / "found.json"
    data = table()
    data.loc[100:103, "temperature.a"] = 850.0
    data.to_parquet(log)
    status, out, _ = lptn("check", model, log, "--json", target)
    assert status == 0
    assert "WRONG? temperature.a: 4 readings of exactly 850 degC" in out
    content = json.loads(target.read_text())
    assert content["nodes"] == ["a", "b"]
    (written,) = content["logs"]
    assert written["format"] == "Parquet"
    assert written["used"]["torque.a"] == ["torque.a"]
    assert written["runs"][0]["steps"] == 2400
    assert "invalid = [850]" in written["wrong"][0]["mend"]
    assert written["wrong"][0]["sure"] is False
    effects = {row["effect"]: row for row in content["effects"]}
    assert effects["forced_convection"]["identifiable"] is True
    assert effects["fan"]["why"] == "not logged: fan.<node> or speed.fan"
    assert content["excitation"]["runs"] == 1


def test_what_can_not_be_right_is_shown_and_refused(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    data = table()
    kelvin = {name: data[name] + 273.15 for name in ("temperature.a", "temperature.b")}
    log, target = tmp_path / "monday.csv", tmp_path / "found.json"
    data.assign(**kelvin).to_csv(log, index=False)
    status, out, err = lptn("check", model, log, "--json", target)
    assert status == 2
    assert out.count("which look like kelvin") == 2  # all of them, where other commands say the first
    assert out.startswith("Verdict: The log can't be used yet.\n")
    assert err.count("\n") == 1
    assert '--map "temperature.a=temperature.a[K]"' in err
    assert not target.exists()


def test_what_is_wrong_alike_in_three_logs_is_said_once(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    logs = [tmp_path / f"{day}.csv" for day in ("monday", "tuesday", "friday")]
    for number, log in enumerate(logs):
        data = table()
        kelvin = {str(name): data[name] + 273.15 + number for name in data if str(name).startswith("temperature.")}
        data.assign(**kelvin).to_csv(log, index=False)
    status, answer, _ = lptn("check", model, *logs)
    assert status == 2
    assert answer.count("which look like kelvin") == 1
    assert (
        "WRONG? 8 more of this kind in 3 logs (temperature.a, temperature.b and temperature.ambient): --details"
        in answer
    )
    assert sum(len(wrap(line.replace(str(tmp_path), ""), 80)) for line in answer.splitlines()) <= 15
    assert lptn("check", model, *logs, "--details")[1].count("which look like kelvin") == 9


def test_columns_are_proposed_and_taken_on_request(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    names = {"time": "t_s", "temperature.ambient": "T_amb", "speed.base": "v"}
    for joint in "ab":
        names |= {
            f"temperature.{joint}": f"T_{joint}",
            f"torque.{joint}": f"tau_{joint}",
            f"velocity.{joint}": f"dq{joint}",
        }
    log = tmp_path / "monday.csv"
    table().rename(columns=names).to_csv(log, index=False)
    status, answer, err = lptn("check", model, log)
    assert answer.startswith("Verdict: The log can't be used yet.\n")
    assert len(answer.splitlines()) <= 15
    assert "    and 3 more: --details\n" in answer
    assert "or write --map guess" in answer
    status, out, err = lptn("check", model, log, "--details")
    assert status == 2
    assert 'time = { column = "t_s", unit = "s" }' in out
    assert '"torque.a" = "tau_a"' in out
    assert '--map "temperature.b=T_b"' in out
    assert err.count("\n") == 1
    status, out, err = lptn("check", model, log, "--guess")
    assert status == 0
    assert 'guessed: "torque.a" = "tau_a"' in err
    assert "2400 samples of 1 s" in out


def test_a_good_and_a_bad_log(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    table().to_csv(tmp_path / "good.csv", index=False)
    table().drop(columns="torque.b").to_csv(tmp_path / "bad.csv", index=False)
    status, out, err = lptn("check", model, tmp_path / "bad.csv", tmp_path / "good.csv")
    assert status == 2
    assert "good.csv (CSV): 2400 samples" in out
    assert "bad.csv (CSV): it can't be used yet" in out
    assert "bad.csv: column torque.b: found no such column" in err
    status, out, err = lptn("check", model, tmp_path / "none.csv")
    assert (status, out) == (2, "")


def test_every_command_says_what_may_be_meant_otherwise(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    data = table()
    data.iloc[[1, 0, *range(2, len(data))]].to_csv(tmp_path / "sorted.csv", index=False)
    said = "time: 1 row out of order, by a few steps; sorted."
    status, out, _ = lptn("check", model, tmp_path / "sorted.csv")
    assert status == 0
    assert f"  {said}" in out.splitlines()
    _, _, err = lptn("fit", model, tmp_path / "sorted.csv", "-o", tmp_path / "fitted.toml")
    assert said in err
    data.to_csv(tmp_path / "other.csv", index=False)  # the clock of the second is nobody's word
    _, out, _ = lptn("check", model, f"{tmp_path / 'sorted.csv'}+other.csv")
    assert "its clock is taken for that of sorted.csv" in out


def test_two_logs_joined(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    data = table()
    warm = [name for name in data if name == "time" or str(name).startswith("temperature.")]
    data[warm].to_csv(tmp_path / "warm.csv", index=False)
    rest = data.drop(columns=warm[1:])
    rest.assign(time=rest["time"] - 5.0).to_csv(tmp_path / "moved.csv", index=False)
    status, out, _ = lptn("check", model, f"{tmp_path / 'warm.csv'}+moved.csv@5")
    assert status == 0
    assert "warm.csv+moved.csv@5 (CSV joined with CSV)" in out
    _, out, _ = lptn("check", model, f"{tmp_path / 'warm.csv'}+moved.csv@5", "--details")
    assert "its clock set forward by 5 s, as given" in out


def test_a_model_without_a_log(lptn: Lptn, model: Path) -> None:
    status, out, _ = lptn("check", model)
    assert status == 0
    assert "Model: pair, 2 nodes (a and b), " in out


def test_check_draws_the_network(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    drawn = tmp_path / "network.svg"
    assert lptn("check", model, "--drawing", drawn)[0] == 0
    text = drawn.read_text()
    assert text.startswith("<svg")
    assert all(f'data-node="{node}"' in text for node in ("a", "b"))
    status, _, err = lptn("check", model, "--drawing", tmp_path / "network.png")
    assert status == 2
    assert "one ending in .svg" in err


def test_a_log_of_currents_says_how_the_model_takes_them(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    log = tmp_path / "monday.csv"
    table().rename(columns={"torque.a": "current.a"}).to_csv(log, index=False)
    status, out, _ = lptn("check", model, log)
    assert status == 2
    assert "It seems to hold currents instead of torques (current.a)." in out
    assert 'input = "current"' in out


def test_a_log_of_torque_and_current_is_held_against_the_torque_constant(
    lptn: Lptn, model: Path, tmp_path: Path
) -> None:
    log, says = (
        tmp_path / "monday.csv",
        "the logged torque is 0.594 N·m for each logged ampere, torque_constant says 0.84",
    )
    both = table()
    for amperes, seen in ((0.84 / 2**0.5, True), (0.84, False)):
        both.assign(**{"current.a": both["torque.a"] / amperes}).to_csv(log, index=False)
        status, out, _ = lptn("check", model, log)
        assert status == 0
        assert "Losses: R I², 0.15 ohm of one phase, torque / 0.84 N·m per power-invariant A." in out
        assert (says in out) == seen
        assert ("nothing looks wrong" in out) != seen


def test_what_is_the_same_of_all_logs_is_said_once(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    logs = [tmp_path / f"{day}.csv" for day in ("monday", "tuesday", "friday")]
    for number, log in enumerate(logs):
        renamed = table().rename(columns=lambda name: name.replace("torque.", "trq_")).assign(gain=1.0)
        renamed.assign(**{"temperature.a": 20.0 + number}).to_csv(log, index=False)
    _, out, _ = lptn("check", model, *logs)
    assert all(out.count(f"{log.name} (CSV)") == 1 for log in logs)
    assert out.count("  Some columns may be what is missing.") == out.count("write behind the command") == 1
    assert out.index("All logs:\n") > out.index("friday.csv")
    _, one, _ = lptn("check", model, logs[0])
    assert "All logs:" not in one


@pytest.mark.parametrize("key", ["temperature.aa", "torqe.a", "time.3", "temperature.*"])
def test_a_mapping_of_nothing_is_one_line(lptn: Lptn, model: Path, tmp_path: Path, key: str) -> None:
    table().to_csv(tmp_path / "monday.csv", index=False)
    status, _, err = lptn("check", model, tmp_path / "monday.csv", "--map", f"{key}=gain")
    assert (status, len(err.splitlines())) == (2, 1)
    assert key in err


def test_a_mapping_to_nothing_is_said(lptn: Lptn, model: Path, tmp_path: Path) -> None:
    table().to_csv(tmp_path / "monday.csv", index=False)
    status, out, _ = lptn("check", model, tmp_path / "monday.csv", "--map", "power.a=gain")
    assert (status, "power.a: mapped to a column that is not in the log; left out." in out) == (0, True)
