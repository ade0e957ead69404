"""The numbers of the thesis [Chen2017], one test a row: printed formula, consistent network, verdict."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import pytest
from table import main, table

OK, NO, MISSING, HOLDS = "reproduces", "does not reproduce", "an input is missing", "definition holds"

# id: (by the printed formula, by the consistent network, verdict), computed apart from the code under test.
EXPECTED: dict[str, tuple[float | None, float | None, str]] = {
    "eq. 2.1": (0.0955, None, OK),
    "eq. 2.2": (None, 13.93, MISSING),
    "eq. 2.2 b": (None, 8.36, MISSING),
    "eq. 2.3": (None, 0.5347, MISSING),
    "eq. 2.4": (22.506, None, OK),
    "eq. 2.5": (0.003901, 0.0039, NO),
    "eq. 2.5 b": (1.312, None, HOLDS),
    "eq. 2.6": (0.904, None, HOLDS),
    "eq. 2.7": (5.211, None, HOLDS),
    "eq. 2.8": (None, None, MISSING),
    "eq. 2.8 b": (2549.7, None, HOLDS),
    "eq. 2.9": (0.0013074, None, HOLDS),
    "eq. 3.1": (8.3333, None, HOLDS),
    "eq. 3.2": (0.0878, None, OK),
    "eq. 3.2 b": (22.506, None, OK),
    "eq. 3.3 c": (-4146.0, None, NO),
    "eq. 3.3 d": (-1732.0, None, HOLDS),
    "eq. 3.4": (33.5, 55.0, NO),
    "eq. 3.4 b": (0.0, 21.5, NO),
    "eq. 4.1": (11.959, None, OK),
    "eq. 4.1 b": (1.05, None, HOLDS),
    "table 3.1": (159.96, None, OK),
    "table 3.1 b": (-0.066, None, HOLDS),
    "table 3.1 c": (23.6, 35.3, NO),
    "table 4.1": (288.0, None, OK),
    "table 4.1 b": (-0.050, None, HOLDS),
    "table 4.2": (300.0, None, OK),
    "table A.1": (3.342, None, NO),
    "table A.1 b": (2220.0, None, OK),
    "table A.1 p": (33.0, None, OK),
    "table A.1 q": (0.0, None, OK),
    "table A.1 r": (0.005, None, OK),
    "table A.1 s": (0.0, None, OK),
    "appendix A.2": (0.5108, None, HOLDS),
    "appendix A.3": (226.0, None, NO),
    "appendix A.3 b": (71.1, None, NO),
    "appendix A.4": (260.0, None, HOLDS),
    "sec. 3.1.2": (121.7, 120.0, OK),
    "sec. 3.1.2 b": (None, 26.5, MISSING),
    "sec. 3.1.2 c": (None, 100.0, MISSING),
    "sec. 3.1.2 d": (159.96, 160.0, OK),
    "sec. 3.1.2 e": (61.5, None, NO),
    "sec. 4.3": (104.0, None, OK),
    "sec. 4.3 b": (141.8, None, OK),
    "sec. 4.3 c": (330.8, None, OK),
    "sec. 4.3 d": (38.3, 52.56, "only with R_0 = 1452.1"),
    "sec. 4.3 e": (42.2, 52.62, "only with R_0 = 1452.3"),
    "sec. 4.3 f": (1.5, 25.26, NO),
    "sec. 4.3 g": (57.4, 57.87, OK),
    "sec. 4.3 h": (31.3, None, NO),
    "chapter 5": (50.8, None, NO),
    "chapter 5 b": (57.0, None, NO),
    "sec. 4.3 i": (49.9, 26.45, "only with R_0 = 1449.6"),
    "sec. 4.3 j": (47.7, 26.45, "only with R_0 = 1449.1"),
    "sec. 4.3 k": (3.20, 16.95, "only with R_0 = 1451.9"),
    "sec. 4.3 l": (3.49, 16.95, "only with R_0 = 1450.0"),
    "sec. 4.3 m": (0.1395, 0.0100, OK),
    "sec. 3.2.1": (8.6955, None, OK),
    "sec. 3.2.1 b": (273.18, None, OK),
    "chapter 5 c": (261.25, None, NO),
    "chapter 5 d": (1003.7, None, HOLDS),
    "chapter 5 e": (396.5, None, NO),
    "chapter 5 f": (166.7, None, OK),
    "chapter 5 g": (132.3, None, OK),
    "sec. 2.5": (5.25, None, OK),
    "sec. 3.1.1": (1.0, None, HOLDS),
    "sec. 2.1.3": (None, None, MISSING),
    "fig. 4-10, C = 300 J/K": (39.8, 26.4, HOLDS),
    "fig. 4-10, C = 400 J/K": (31.9, 26.4, HOLDS),
    "chapter 5 h": (1.399, None, HOLDS),
    "chapter 5 i": (0.8395, None, HOLDS),
    "sec. 4.3, every 20 s": (None, 61.0, MISSING),
    "sec. 4.3, every 10 s": (None, 114.0, MISSING),
    "sec. 4.3, every 5 s": (None, 309.0, MISSING),
}


def _close(value: float | None, expected: float | None) -> bool:
    if value is None or expected is None:
        return value is expected
    return math.isclose(value, expected, rel_tol=0.01, abs_tol=1e-4)


@pytest.mark.parametrize("name", EXPECTED)
def test_row(name: str) -> None:
    rows = {row.id: row for row in table()}
    formula, network, verdict = EXPECTED[name]
    assert _close(rows[name].formula, formula), rows[name].formula
    assert _close(rows[name].network, network), rows[name].network
    assert rows[name].verdict == verdict


def test_every_row_has_its_test() -> None:
    names = [row.id for row in table()]
    assert sorted(names) == sorted(EXPECTED)
    assert len(names) == len(set(names))


def test_one_command_writes_the_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    main()
    assert "sec. 4.3 j" in capsys.readouterr().out
    main(tmp_path / "table.csv")
    with (tmp_path / "table.csv").open(encoding="utf-8") as stream:
        lines = list(csv.reader(stream))
    assert lines[0][0] == "row"
    assert len(lines) == len(EXPECTED) + 1
