"""How much happens in a run: counted by hand in runs made for it."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from lptn.diagnose.excitation import excitation
from tests.diagnose.pair_runs import run, table

NODES = ("a", "b")


def test_levels_rest_and_cool_downs_are_counted() -> None:
    alone = table().drop(columns="torque.b")
    seen = excitation([run(alone)], NODES)
    assert seen.minutes == 40
    assert seen.levels == 3  # none, 36 and 100 % of the largest heat
    assert seen.still == pytest.approx(0.4, abs=0.03)
    assert seen.cool_downs == 1
    assert seen.steps == 3
    assert seen.rise == pytest.approx(40.0, abs=1.0)
    assert seen.spread == pytest.approx(10.0, abs=0.5)
    assert seen.ambient == 0.0
    assert seen.ranges["speed.base"] == pytest.approx((0.0, 0.8))


def test_a_run_without_rest() -> None:
    data = table(cool=False).drop(columns="torque.b")
    seen = excitation([run(data[data["torque.a"] > 9])], NODES)
    assert (seen.levels, seen.still, seen.cool_downs, seen.steps) == (1, 0.0, 0, 0)


def test_speed_and_load_that_go_together() -> None:
    data = table()
    seen = excitation([run(data.assign(**{"velocity.a": data["torque.a"] ** 2 / 50}))], NODES)
    assert seen.together["a"] == pytest.approx(1.0)
    assert abs(seen.together["b"]) < 0.7


def test_runs_without_load_temperatures_or_length() -> None:
    bare = table(1)[["time", "temperature.a"]].assign(**{"temperature.a": np.nan})
    seen = excitation([run(bare)], NODES)
    assert (seen.levels, seen.rise, seen.spread, seen.cool_downs) == (0, 0.0, 0.0, 0)
    few = pd.DataFrame({"time": np.arange(3.0), "temperature.a": 20.0, "torque.a": 1.0})
    assert excitation([run(few)], NODES).minutes == 0.05
    holes = table().assign(**{"temperature.a": np.nan})
    assert excitation([run(holes)], NODES).spread == 0.0


def test_several_runs_add_up() -> None:
    both = excitation([run(table(), "one"), run(table(), "two")], NODES)
    one = excitation([run(table())], NODES)
    assert (both.runs, both.minutes, both.cool_downs) == (2, 80, 2 * one.cool_downs)


def test_the_load_is_that_of_the_joints_and_not_of_one_computer() -> None:
    data = table().assign(**{"power.b": 20.0})
    seen = excitation([run(data.drop(columns="torque.b").assign(**{"torque.c": 1.0}))], ("a", "b", "c"))
    assert seen.levels == 3


def test_a_given_temperature_is_surroundings_whatever_it_is_called() -> None:
    ambient = table()
    ambient["temperature.ambient"] = 22.0 + 4.0 * ambient["time"] / ambient["time"].iloc[-1]
    room = ambient.rename(columns={"temperature.ambient": "temperature.room"})
    one, other = (excitation([run(data)], NODES) for data in (ambient, room))
    assert (other.rise, other.ambient) == (one.rise, one.ambient)
    assert one.ambient == pytest.approx(4.0, abs=0.2)
    shed = excitation([run(room.assign(**{"temperature.shed": 10.0}))], NODES)
    assert shed.rise > one.rise


def test_joints_that_work_in_turns_have_levels_and_cool_downs_of_their_own() -> None:
    """The heat of both together is the same all the time."""
    data = table().drop(columns="torque.b")
    idle = np.abs(data["torque.a"]) < 0.5 * np.abs(data["torque.a"]).max()
    top = float(np.abs(data["torque.a"]).max())
    turns = data.assign(**{"torque.a": np.where(idle, 0.0, top), "torque.b": np.where(idle, top, 0.0)})
    alone, both = (excitation([run(own)], NODES) for own in (turns.drop(columns="torque.b"), turns))
    assert (both.levels, both.cool_downs, both.steps) == (alone.levels, alone.cool_downs, alone.steps)
    assert both.levels == 2
    assert both.cool_downs
    assert both.still == 0.0
