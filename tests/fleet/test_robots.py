"""Which files and folders are which robots."""

from __future__ import annotations

from pathlib import Path

import pytest

from lptn.basics.errors import InputError
from lptn.fleet.robots import robots_of
from lptn.logs.reading import ENDINGS


def _touch(*paths: Path) -> None:
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("time\n")


def test_a_file_is_a_robot_and_a_folder_of_logs_is_one(tmp_path: Path) -> None:
    alone, first, second = tmp_path / "spot.csv.gz", tmp_path / "anymal" / "a.csv", tmp_path / "anymal" / "b.parquet"
    _touch(alone, first, second, tmp_path / "anymal" / "notes.txt", tmp_path / "anymal" / ".hidden.csv")
    robots = robots_of([alone, tmp_path / "anymal"])
    assert [(robot.name, robot.logs) for robot in robots] == [("spot", (alone,)), ("anymal", (first, second))]


@pytest.mark.parametrize("ending", ENDINGS)
def test_a_log_of_any_format_is_a_robots_but_for_plain_text(tmp_path: Path, ending: str) -> None:
    first, log = tmp_path / "spot" / "a.csv", tmp_path / "spot" / f"b{ending}"
    _touch(first, log)
    (robot,) = robots_of([tmp_path / "spot"])
    assert robot.logs == ((first,) if ending.startswith(".txt") else (first, log))
    assert robots_of([log])[0].name == "b"


def test_a_folder_of_folders_is_a_shelf_of_robots(tmp_path: Path) -> None:
    logs = [tmp_path / "fleet" / name / "log.csv" for name in ("two", "one")]
    _touch(*logs)
    (tmp_path / "fleet" / "empty").mkdir()
    assert [robot.name for robot in robots_of([tmp_path / "fleet"])] == ["one", "two"]


def test_a_bag_is_one_log(tmp_path: Path) -> None:
    bags = [tmp_path / "spot" / name for name in ("monday", "friday")]
    _touch(*(bag / file for bag in bags for file in ("metadata.yaml", "0.db3")))
    assert [(robot.name, len(robot.logs)) for robot in robots_of([tmp_path / "spot"])] == [("spot", 2)]
    assert [(robot.name, robot.logs) for robot in robots_of(bags[:1])] == [("monday", (bags[0],))]


def test_robots_of_one_name_are_told_apart_by_the_folders_above(tmp_path: Path) -> None:
    logs = [tmp_path / "a" / "logs" / "x.csv", tmp_path / "B" / "logs" / "x.csv", tmp_path / "b" / "other" / "x.csv"]
    _touch(*logs)
    names = [robot.name for robot in robots_of([*logs, tmp_path / "a" / "logs" / ".."][:3])]
    assert names == ["a_logs_x", "B_logs_x", "other_x"]
    folders = [robot.name for robot in robots_of([log.parent for log in logs])]
    assert folders == ["a_logs", "B_logs", "other"]


def test_names_that_differ_in_their_endings_only_are_numbered(tmp_path: Path) -> None:
    _touch(tmp_path / "x.csv", tmp_path / "x.parquet")
    names = [robot.name for robot in robots_of([tmp_path / "x.csv", tmp_path / "x.parquet"])]
    assert len(set(names)) == 2
    assert names[1] == f"{names[0]}_2"


def test_what_is_no_log_or_given_twice_is_refused(tmp_path: Path) -> None:
    _touch(tmp_path / "x.csv")
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="no such file or folder"):
        robots_of([tmp_path / "missing"])
    with pytest.raises(InputError, match="no log in it"):
        robots_of([tmp_path / "empty"])
    with pytest.raises(InputError, match="given twice"):
        robots_of([tmp_path / "x.csv", tmp_path])
