"""What is wrong with a log is said on the line of that channel, and of no other; of a healthy log nothing is."""

from __future__ import annotations

from itertools import product
from pathlib import Path

import pytest

from lptn.identify.data import load_model
from tests.hardening.corruptions import CORRUPTIONS, ROBOTS, STEPS, ask, healthy, issues_in

SEED = 4
NO_READING, LEFT = {"disconnected", "frozen"}, 0.1  # kinds; share of false readings that may be taken
EXAMPLES = Path(__file__).parents[2] / "examples"
UNSEEN = {
    *product(("speed in rpm of the motor",), ROBOTS),
    ("a torque turns into amperes", "leg"),
    ("a torque whose sign is lost in 16 bit", "quadruped"),
    ("a torque with its gear from the middle on", "quadruped"),
    ("the air is a motor's, less 2 K", "quadruped"),
}
"""What slow joints can't show, where fast ones do; a torque of a joint that rests from there on; torques that are never
below 0; of a joint beside eleven that work alike; and of the last one another joint is named as well."""

BELIEVED = {"a bit that is always set", "a voltage of 6 K with the torque", "a column that begins a third later"}
"""What is said in places, of readings of which most are false, and believed."""


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("steps", [*STEPS, 0.0])
def test_of_a_healthy_log_nothing_is_said(robot: str, steps: float) -> None:
    assert issues_in(healthy(robot, SEED, steps)) == []


@pytest.mark.long
@pytest.mark.parametrize(
    ("model", "logs"),
    [
        ("pmsm/four_nodes", ["log.csv"]),
        ("bldc_stators/two_nodes", [f"Run{number}.csv" for number in (1, 3, 4, 5)]),
        ("tclab/two_heaters", ["log.csv"]),
        ("ur3/coupled", ["later.parquet", "warm_up.parquet"]),
    ],
)
def test_of_the_measured_logs_nothing_is_said(model: str, logs: list[str]) -> None:
    file = EXAMPLES / f"{model}.toml"
    runs = load_model(file).runs([file.parent / log for log in logs])
    assert [issue.sentence for run in runs for issue in run.issues] == []


@pytest.mark.parametrize(
    ("kind", "robot"),
    [
        pytest.param(kind, robot, marks=[pytest.mark.slow] if robot == "quadruped" else [])
        for kind, robot in product(CORRUPTIONS, ROBOTS)
        if (kind, robot) not in UNSEEN
    ],
)
def test_what_is_wrong_is_said_of_that_channel_alone(kind: str, robot: str) -> None:
    for steps in STEPS if CORRUPTIONS[kind].coarse else STEPS[:1]:
        answer = ask(kind, robot, SEED, steps)
        assert (answer.found, answer.blamed) == (True, frozenset())
        if NO_READING.intersection(CORRUPTIONS[kind].expected) and kind not in BELIEVED:
            assert answer.believed < LEFT
