"""Which files are which robot's logs, and of which day."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import date
from pathlib import Path

from lptn.basics.errors import InputError
from lptn.logs.reading import ENDINGS, run_name

# No .txt: beside logs that is what somebody wrote about them.
_ENDINGS = tuple(ending for ending in ENDINGS if not ending.startswith(".txt"))
_BAG = "metadata.yaml"  # what makes a folder a log: a ROS 2 bag


_DAY = re.compile(r"(?<!\d)((?:19|20)\d\d)([-_]?)(\d\d)\2(\d\d)(?!\d)")


@dataclass(frozen=True)
class RobotLogs:
    """A robot and its logs, all of them or those of a day.

    Args:
        name: what its results are called; different for each robot of a fleet, and for each of its days.
        logs: its logs, in order: files, or folders that are bags; each may hold several runs.
        robot: the robot, where several days of it are told apart; by default its name.
        day: the day of all of its logs, where it is known.
    """

    name: str
    logs: tuple[Path, ...]
    robot: str = ""
    day: date | None = None

    @property
    def of(self) -> str:
        """The robot whose logs these are."""
        return self.robot or self.name


def by_day(robots: Sequence[RobotLogs]) -> list[RobotLogs]:
    """Each robot's logs of a day apart, where a date such as 2026-03-14 stands in all of their names."""
    apart = []
    for robot in robots:
        days: dict[date | None, list[Path]] = {}
        for log in robot.logs:
            days.setdefault(_day_of(log.name), []).append(log)
        if None in days:
            apart.append(robot)
            continue
        for day, logs in sorted(days.items(), key=lambda item: str(item[0])):
            name = robot.name if str(day) in robot.name else f"{robot.name}_{day}"
            apart.append(RobotLogs(name, tuple(logs), robot.name, day))
    return apart


def _day_of(name: str) -> date | None:
    for year, _, month, day in _DAY.findall(name):
        try:
            return date(int(year), int(month), int(day))
        except ValueError:
            continue
    return None


def robots_of(places: Sequence[Path]) -> list[RobotLogs]:
    """The robots that files and folders stand for.

    A log is one robot, named as the file, or as the folder of a ROS 2 bag. Any other folder with logs in it
    is one robot, named as the folder; its logs are that robot's runs. In a folder without logs each folder
    that holds logs is one robot. Robots of the same name get the name of the folder above in front. Hidden files,
    and files that are no logs, are passed over.

    Args:
        places: log files and folders.

    Raises:
        InputError: a place does not exist, holds no log, or is given twice.
    """
    robots = [robot for place in places for robot in _robots_at(place)]
    seen = Counter(log.resolve() for robot in robots for log in robot.logs)
    for log, times in seen.most_common(1):
        if times > 1:
            raise InputError(log, "robots", "a log that is given twice", "each log once")
    paths = []  # of each the robot's name and the folders above it, nearest first
    for robot in robots:
        place = robot.logs[0].resolve().parent
        above = [place, *place.parents] if robot.name != place.name else place.parents
        paths.append([robot.name, *(folder.name for folder in above if folder.name)])
    names = _different_names(paths)
    return [RobotLogs(name, robot.logs) for name, robot in zip(names, robots, strict=True)]


def _robots_at(place: Path) -> list[RobotLogs]:
    if not place.exists():
        raise InputError(place, "robots", "no such file or folder", "a robot's log, or a folder of its logs")
    if place.is_file() or _is_bag(place):
        name = run_name(place if place.is_file() else place.resolve())
        return [RobotLogs(name.lstrip(".") or "robot", (place,))]
    logs = _logs_in(place)
    if logs:
        return [RobotLogs(place.resolve().name, logs)]
    folders = sorted(path for path in place.iterdir() if path.is_dir() and not path.name.startswith("."))
    robots = [RobotLogs(folder.name, logs) for folder in folders if (logs := _logs_in(folder))]
    if not robots:
        raise InputError(place, "robots", "no log in it", f"bags, or files that end in {', '.join(_ENDINGS)}")
    return robots


def _logs_in(folder: Path) -> tuple[Path, ...]:
    seen = sorted(path for path in folder.iterdir() if not path.name.startswith("."))
    return tuple(path for path in seen if _is_bag(path) or (path.is_file() and path.name.endswith(_ENDINGS)))


def _is_bag(place: Path) -> bool:
    return (place / _BAG).is_file()


def _different_names(paths: list[list[str]]) -> list[str]:
    """The shortest ends of paths that tell all of them apart, whatever a file system thinks of capital letters."""
    lengths = [1] * len(paths)
    while True:
        names = ["_".join(reversed(path[:length])) for path, length in zip(paths, lengths, strict=True)]
        often = Counter(name.casefold() for name in names)
        longer = [
            length + 1 if often[name.casefold()] > 1 and length < len(path) else length
            for name, path, length in zip(names, paths, lengths, strict=True)
        ]
        if longer == lengths:
            break
        lengths = longer
    for number, name in enumerate(names):  # a.csv beside a.parquet
        if name.casefold() in {other.casefold() for other in names[:number]}:
            names[number] = f"{name}_{number + 1}"
    return names
