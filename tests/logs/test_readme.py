"""The page on logs: what it tells people to write is read as it is meant."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path

import lptn.logs
from lptn.logs.columns import ColumnSource, parse_columns, parse_map_option
from lptn.logs.reading import ENDINGS

PAGE = (Path(lptn.logs.__file__).parent / "README.md").read_text()


def test_its_tables_are_read() -> None:
    blocks = re.findall(r"```toml\n(.*?)```", PAGE, flags=re.DOTALL)
    assert len(blocks) == 4
    tables = [parse_columns(tomllib.loads(block)["columns"], "README.md", "[columns]") for block in blocks]
    sources: dict[str, ColumnSource] = {}
    for table in tables:
        sources |= table
    assert sources["temperature.FR_calf"].invalid == (850.0, -127.0)
    assert sources["current.FR_hip"].wrap == 65536.0
    assert sources["power.battery"].how == "product"
    assert sources["temperature.FR_thigh"].how == "mean"
    assert tables[2]["time"].rows == "means before"
    assert sources["time"].rate == 50.0


def test_its_options_are_read() -> None:
    options = re.findall(r'--map "([^"]+)"', PAGE)
    assert len(options) >= 4
    for option in options:
        parse_map_option(option)


def test_it_names_every_ending() -> None:
    for ending in ENDINGS:
        assert f"`{ending.removesuffix('.gz')}`" in PAGE, ending
