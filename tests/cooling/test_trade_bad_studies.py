"""Bad studies: one line that says file, line, key, found and expected; exit status 2; nothing written."""

from __future__ import annotations

from pathlib import Path

import pytest

from lptn.cli.main import main

GOOD = """\
[study]
name = "U8"
goal = "mass"
cooling = ["none", "passive"]

[task]
torque = 1.68
duration = 120
ambient = 21.5

[limits]
winding = 105
volume = { value = 450, unit = "cm^3" }

[[motors]]
name = "U8"

[sink]
capacity = [20, 1500]
"""

MOTOR, SINK = 'name = "U8"\n\n[sink]', "capacity = [20, 1500]"
BACKWARDS = '[pareto]\nagainst = "volume"\nleast = 9e-4\nmost = 3e-4\n\n[sink]'
TWICE = """[pareto]
against = "volume"
least = 3e-4
most = 9e-4

[pareto.also]
against = 'volume'
least = 2
most = 3

[sink]"""
SOUGHT = '[pareto]\nagainst = "mass"\nleast = 0.3\nmost = 0.9\n\n[sink]'
OWN = "mass = 0.2\nvolume = 1e-4\ntorque_constant = 0.1"
CYCLE = 'kind = "cycle"\nprofile = [1.0, 0.5]'

# what is replaced, by what, and what must be said
BAD: dict[str, tuple[str, str, tuple[str, ...]]] = {
    "no feasible design": ("torque = 1.68", "torque = 3.2", ("no feasible design", "torque 3.2 -> ", "N*m")),
    "negative mass": (MOTOR, 'name = "U8"\nmass = -0.24\n\n[sink]', ("line 17", "motors[0].mass", "-0.24", "than 0")),
    "unknown motor": (MOTOR, 'name = "U9"\n\n[sink]', ("line 16", "U9", "U8, U10")),
    "motor without its mass": (MOTOR, 'name = "mine"\nmodel = "u8"\n\n[sink]', ("mine", "mass", "kg")),
    "the same motor twice": (MOTOR, 'name = "U8"\n[[motors]]\nname = "U8"\n\n[sink]', ("motors[1].name", "second")),
    "no limit of the second motor": (
        'winding = 105\nvolume = { value = 450, unit = "cm^3" }\n\n[[motors]]\nname = "U8"',
        '[[motors]]\nname = "U8"\n[[motors]]\nname = "mine"\nmodel = "u8"\n' + OWN,
        ("no limit of the winding", "mine's"),
    ),
    "air hotter than the motor may be": (
        "ambient = 21.5\n\n[limits]\nwinding = 105",
        "ambient = 130\n\n[limits]",
        ("motors[0]", "105 degC", "130 degC"),
    ),
    "longer than a day": ("duration = 120", "duration = 1e12", ("line 8", "task.duration", "86400")),
    "unknown model": (MOTOR, 'name = "U8"\nmodel = "u9.toml"\n\n[sink]', ("line 17", "u9.toml", "u8-heat-sink")),
    "unknown node": (SINK, 'at = "rotor"', ("line 19", "sink.at", "rotor", "winding, stator, housing")),
    "unknown goal": ('goal = "mass"', 'goal = "weight"', ("line 3", "study.goal", "weight", "held_torque")),
    "unknown key": ("winding = 105", "windings = 105", ("line 12", "windings")),
    "limit below the air": ("winding = 105", "winding = 15", ("line 12", "limits.winding", "15", "21.5")),
    "wrong unit": ('unit = "cm^3"', 'unit = "kg"', ("line 13", "limits.volume", "m^3")),
    "range the wrong way": ("[20, 1500]", "[1500, 20]", ("line 19", "sink.capacity", "1500", "least")),
    "no torque": ("torque = 1.68\n", "", ("line 6", "torque", "goal mass")),
    "sought and given": ('goal = "mass"', 'goal = "time_to_limit"', ("line 8", "task.duration", "seeks")),
    "duty cycle without a period": ("torque = 1.68\nduration = 120", CYCLE, ("period",)),
    "text for a number": ("duration = 120", 'duration = "long"', ("line 8", "task.duration", "long", "number")),
    "not TOML": ("[task]", "[task", ("line 6", "TOML")),
    "sweep of what is sought": ("[sink]", SOUGHT, ("pareto.against", "mass")),
    "the same sweep twice": ("[sink]", TWICE, ("pareto.also.against", "another quantity")),
    "a second sweep backwards": (
        "[sink]",
        TWICE.replace("'volume'", "'torque'").replace("3\n\n", "1\n\n"),
        ("pareto.also.least", "below"),
    ),
    "sweep backwards": ("[sink]", BACKWARDS, ("pareto.least", "below")),
}


@pytest.mark.long
@pytest.mark.parametrize("name", BAD)
def test_one_clear_line(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    old, new, said = BAD[name]
    assert old in GOOD
    path = tmp_path / "study.toml"
    path.write_text(GOOD.replace(old, new, 1))
    with pytest.raises(SystemExit) as stop:
        main(["trade", str(path), "--json", str(tmp_path / "out.json"), "--plot", str(tmp_path / "out.png")])
    seen = capsys.readouterr()
    assert stop.value.code == 2
    assert seen.out == ""
    assert seen.err.count("\n") == 1
    for word in ("study.toml", "found", "expected", *said):
        assert word in seen.err
    assert [entry.name for entry in tmp_path.iterdir()] == ["study.toml"]


@pytest.mark.parametrize("option", ["--json", "--plot"])
def test_the_study_is_not_overwritten(option: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "study.png"
    path.write_text(GOOD)
    with pytest.raises(SystemExit) as stop:
        main(["trade", str(path), option, str(path)])
    assert stop.value.code == 2
    assert "found a file that is read" in capsys.readouterr().err
    assert path.read_text() == GOOD


@pytest.mark.long
def test_the_good_study_is_good(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "study.toml").write_text(GOOD)
    with pytest.raises(SystemExit) as stop:
        main(["trade", str(tmp_path / "study.toml"), "-o", str(tmp_path / "out.json")])
    assert not stop.value.code
    assert "U8, passive" in capsys.readouterr().out
    assert (tmp_path / "out.json").is_file()


def test_a_network_that_a_study_cannot_drive_is_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    motor = 'name = "mine"\nmodel = "motor.toml"\nmass = 0.2\nvolume = 1e-4\ntorque_constant = 0.1\nmagnet = "winding"'
    text = GOOD.replace('name = "U8"\n\n[sink]', f'{motor}\n\n[sink]\nat = "winding"')
    model = '[model]\nambient = "temperature.ambient"\n[nodes.winding]\ncapacity = 50\n[[links]]\n'
    model += 'between = ["winding", "ambient"]\n[[effects]]\nkind = "copper_loss"\nat = "winding"\n'
    for extra, said in (("", "torque"), ('input = "current"\n[[effects]]\nkind = "solar"\nat = "*"\n', "irradiance")):
        (tmp_path / "study.toml").write_text(text)
        (tmp_path / "motor.toml").write_text(model + extra)
        with pytest.raises(SystemExit) as stop:
            main(["trade", str(tmp_path / "study.toml")])
        assert stop.value.code == 2
        line = capsys.readouterr().err
        assert line.count("\n") == 1
        assert "motor.toml" in line
        assert said in line
