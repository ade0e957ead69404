"""What is wrong with an input is not put on sensors, and what is wrong with one sensor not on others."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from lptn.model.file import parse_model
from lptn.model.model import Model
from lptn.online.augmented_model import ModelError
from lptn.online.fault_bank import Hypothesis
from tests.builders import make_run
from tests.hardening import monitored_faults
from tests.hardening.monitored_faults import BEGIN, FAULTS, SENSORS, Fault, at, loose, watched
from tests.hardening.plants import ROBOTS


def blamed(
    seed: int, mode: str, faults: list[str], sensors: str = "usual", robot: str = "leg"
) -> tuple[dict[str, tuple[str, ...]], set[str]]:
    """The healthy channels that are blamed, by fault; and the faults that are called."""
    said = watched(robot, seed, SENSORS[sensors], [mode], faults)
    return (
        {fault: answer.blamed for (_, fault), answer in said.items() if answer.blamed},
        {fault for (_, fault), answer in said.items() if answer.called},
    )


@pytest.mark.parametrize(("off", "least", "most"), [(0.0, 1.0, 3.0), (0.4, 5.0, np.inf)])
def test_readings_beside_a_model_that_is_wrong_for_minutes_count_as_fewer(
    off: float, least: float, most: float
) -> None:
    robot, random = ROBOTS["leg"](), np.random.default_rng(4)
    log = monitored_faults.healthy_log(robot, robot.off_by(off, "signs", random), SENSORS["usual"], random)
    model = Model(parse_model(robot.toml(), Path("leg.toml")).network)
    run = make_run({str(name): log[name].to_numpy() for name in log if name != "time"})
    given = Hypothesis.of(model, run, [0.1] * 3, ModelError(heat=0.05))
    assert least <= given.readings_of_one(0) <= most


@pytest.mark.slow
def test_a_wrong_load_is_told_as_one_and_a_wrong_sensor_as_one() -> None:
    """The currents' faults were a drift of one sensor, and offsets of its neighbours."""
    faults = ["healthy", "current half, later", "currents exchanged", "offset of -4 K", "drift of +0.01 K/s"]
    wrongly, called = blamed(2, "fitted", faults)
    assert wrongly == {}
    assert called == {*faults} - {"healthy"}


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize("mode", ["untaught", "fitted"])
def test_of_16_faults_none_is_put_on_a_healthy_channel(seed: int, mode: str) -> None:
    """It was in five or six."""
    wrongly, called = blamed(seed, mode, list(FAULTS))
    assert wrongly == {}
    assert len(called) >= 12
    assert "healthy" not in called


@pytest.mark.slow
@pytest.mark.parametrize(("seed", "sensors"), [(1, "usual"), (1, "fine"), (3, "usual"), (3, "fine")])
def test_a_model_that_is_off_is_not_a_healthy_channels_fault(seed: int, sensors: str) -> None:
    """Every value 10 % off, and healthy logs that teach: it was in three and four logs of 18."""
    wrongly, called = blamed(seed, "taught", list(FAULTS), sensors)
    assert wrongly == {}
    assert len(called) >= 14
    assert "healthy" not in called


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, 4])
def test_a_sensor_that_goes_part_of_the_way_to_the_air_is_no_load(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Its error follows its node's temperature, as smoothly as heat does: in five of six logs a load was blamed."""
    for share, seconds in ((0.3, 50.0), (0.45, 300.0), (0.8, 50.0), (0.8, 300.0)):
        fault = Fault(at(BEGIN, loose(share, seconds)), ("temperature.j",))
        monkeypatch.setitem(monitored_faults.FAULTS, f"loose by {share:.0%} in {seconds:.0f} s", fault)
    faults = [fault for fault in monitored_faults.FAULTS if fault.startswith("loose")]
    wrongly, called = blamed(seed, "taught", faults)
    assert wrongly == {}
    assert len(called) >= 3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "seed", "mode"),
    [("leg", 1011, "fitted"), ("leg", 1012, "taught"), ("leg", 1012, "fitted"), ("motor", 1013, "taught")],
)
def test_the_rounding_of_a_sensor_that_stands_is_no_fault(robot: str, seed: int, mode: str) -> None:
    """Steps of 1 K at 10 Hz: rounding was taken for white noise, of which an hour is none, and a load was blamed."""
    faults = ["healthy", "drift of +0.01 K/s", "current 1.5 times too large"]
    wrongly, called = blamed(seed, mode, faults, "steps", robot)
    assert wrongly == {}
    assert called == {*faults} - {"healthy"}


@pytest.mark.slow
def test_what_a_failed_sensor_reads_is_named() -> None:
    """A share of the air, and a constant, were drifts."""
    said = watched("leg", 3, SENSORS["usual"], ["taught"], list(FAULTS))
    assert said["taught", "come loose by 60 %"].called == ("disconnected",)
    assert said["taught", "stuck with dither"].called == ("stuck",)


def _scaled(share: float, values: FloatArray, _since: FloatArray, _random: np.random.Generator) -> FloatArray:
    return share * values


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "mode"), [("leg", "taught"), ("leg", "untaught"), ("knee", "taught"), ("quadruped", "untaught")]
)
def test_a_load_of_another_size_from_some_time_on_is_called(
    robot: str, mode: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Every value of the model is 10 % off; without healthy logs no sensor stood out, and no load was looked at."""
    for share in (0.5, 0.6, 1.6):
        fault = Fault(at(BEGIN, partial(_scaled, share), "current"), ("current.j",))
        monkeypatch.setitem(monitored_faults.FAULTS, f"current times {share}", fault)
    faults = ["healthy", *(fault for fault in monitored_faults.FAULTS if fault.startswith("current times"))]
    wrongly, called = blamed(5, mode, faults, robot=robot)
    assert wrongly == {}
    assert called == {*faults} - {"healthy"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "mode", "offset"),
    [
        ("leg", "taught", 10.0),
        ("leg", "taught", -10.0),
        ("motor", "taught", 8.0),
        ("knee", "taught", 10.0),
        ("leg", "untaught", 8.0),
        ("leg", "untaught", -9.0),
        ("motor", "untaught", 10.0),
        ("knee", "untaught", 8.0),
    ],
)
def test_air_that_is_off_all_the_while_is_called(
    robot: str, mode: str, offset: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """All joints lose more heat, or less, than the model says; each by itself could be a model that is off."""
    fault = Fault(at(0, lambda x, t, r: x + offset, "ambient"), ("temperature.ambient",))
    monkeypatch.setitem(monitored_faults.FAULTS, "air off", fault)
    wrongly, called = blamed(6, mode, ["healthy", "air off"], robot=robot)
    assert "air off" not in wrongly
    assert called == {"air off"}


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "share"), [("leg", 1.5), ("leg", 0.6), ("leg", 2.0), ("knee", 1.5), ("knee", 0.6)])
def test_a_load_of_another_size_from_the_beginning_is_called_without_healthy_logs(
    robot: str, share: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The guess how wrong a model is was too cautious: readings say that it is less so."""
    fault = Fault(at(0, partial(_scaled, share), "current"), ("current.j",))
    monkeypatch.setitem(monitored_faults.FAULTS, "current off", fault)
    wrongly, called = blamed(7, "untaught", ["healthy", "current off"], robot=robot)
    assert wrongly == {}
    assert called == {"current off"}


@pytest.mark.slow
@pytest.mark.parametrize(("robot", "seed", "sensors"), [("leg", 1, "steps"), ("leg", 6, "steps"), ("leg", 7, "usual")])
def test_a_load_that_is_logged_as_none_is_not_put_on_the_air(robot: str, seed: int, sensors: str) -> None:
    """The air was weighed beside loads near one node alone, and blamed; where a load explained more, nobody was."""
    wrongly, called = blamed(seed, "untaught", ["healthy", "current 0", "air 8 K too warm"], sensors, robot)
    assert wrongly == {}
    assert called == {"current 0", "air 8 K too warm"}
