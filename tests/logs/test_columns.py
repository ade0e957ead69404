"""Where quantities stand: column tables and --map read, converted, refused, and written as lines to paste."""

from __future__ import annotations

import tomllib
from collections.abc import Callable

import numpy as np
import pytest

from lptn.logs.columns import ColumnSource, map_option, parse_columns, parse_map_option, toml_line

Refuse = Callable[..., str]


@pytest.mark.parametrize(
    ("key", "unit", "value", "expected"),
    [
        ("temperature.a", "K", 300.0, 26.85),
        ("temperature.a", "degC", 20.0, 20.0),
        ("temperature.a", "degF", 212.0, 100.0),
        ("torque.a", "N*m", 2.0, 2.0),
        ("torque.a", "N.m", 2.0, 2.0),
        ("torque.a", "Nm", 2.0, 2.0),
        ("current.a", "mA", 1500.0, 1.5),
        ("current.a", "A", 1.5, 1.5),
        ("velocity.a", "rpm", 60.0, 2 * np.pi),
        ("velocity.a", "1/min", 60.0, 2 * np.pi),
        ("velocity.a", "rev/min", 60.0, 2 * np.pi),
        ("velocity.a", "Hz", 1.0, 2 * np.pi),
        ("velocity.a", "deg/s", 180.0, np.pi),
        ("velocity.a", "rad/s", 3.0, 3.0),
        ("speed.base", "km/h", 3.6, 1.0),
        ("power.pc", "W", 5.0, 5.0),
        ("power.pc", "mW", 5.0, 0.005),
        ("duty.fan", "%", 50.0, 0.5),
        ("voltage.bus", "mV", 5.0, 0.005),
        ("time", "ms", 5.0, 0.005),
        ("time", "us", 5.0, 5e-6),
        ("time", "ns", 5.0, 5e-9),
        ("time", "s", 5.0, 5.0),
    ],
)
def test_units_become_si(key: str, unit: str, value: float, expected: float) -> None:
    source = parse_columns({key: {"column": "x", "unit": unit}}, "m.toml", "[columns]")[key]
    assert source.values(key, {"x": np.array([value])})[0] == pytest.approx(expected, rel=1e-12)


def test_scale_and_offset_come_before_the_unit() -> None:
    table = {"temperature.a": {"column": "T", "unit": "K", "scale": 2.0, "offset": 73.15}}
    source = parse_columns(table, "m.toml", "[columns]")["temperature.a"]
    assert source == ColumnSource(("T",), "K", 2.0, 73.15)
    assert source.values("temperature.a", {"T": np.array([100.0])})[0] == pytest.approx(0.0, abs=1e-9)


def test_a_norm_joins_columns() -> None:
    source = parse_columns({"current.a": {"norm": ["d", "q"], "unit": "mA"}}, "m.toml", "[columns]")["current.a"]
    values = source.values("current.a", {"d": np.array([3000.0]), "q": np.array([-4000.0])})
    assert values.tolist() == pytest.approx([5.0])


@pytest.mark.parametrize(
    ("key", "entry", "actual", "expected"),
    [
        (
            "temperature.a",
            {"column": "T", "units": "K"},
            "key 'units'",
            "column, norm, product, mean, ratio, rate, value, unit",
        ),
        ("temperature", "T", "key 'temperature'", "<quantity>.<place>"),
        ("torque.a", {"column": "M", "unit": "W"}, "unit 'W'", "a unit of torque, such as N*m"),
        ("torque.a", {"column": "M", "unit": "%"}, "unit '%'", "a unit of torque"),
        ("power.a", {"column": "P", "unit": "%"}, "unit '%'", "a unit of power, such as W"),
        ("speed.base", {"column": "v", "unit": "rpm"}, "unit 'rpm'", "a unit of speed, such as m/s"),
        ("torque.a", {"column": "M", "unit": "bananas("}, "unit 'bananas('", "a unit of torque"),
        ("torque.a", {"column": "M", "unit": 3}, "3", "the name of a unit"),
        ("torque.a", {"column": "M", "scale": "2"}, "'2'", "a finite number"),
        ("torque.a", {"column": "M", "scale": 0}, "0", "a finite number but 0"),
        ("torque.a", {"column": "M", "offset": float("nan")}, "nan", "a finite number"),
        ("torque.a", {"column": "M", "norm": ["M", "N"]}, "both column and norm", "one of them"),
        ("torque.a", {"unit": "N*m"}, "neither column nor norm", "one of them"),
        ("torque.a", {"norm": ["M"]}, "['M']", "two or more column names"),
        ("torque.a", {"column": 1}, "1", "the name of a column"),
        ("torque.a", 5, "5", "a column's name or a table"),
    ],
)
def test_a_wrong_entry_is_named(refuse: object, key: str, entry: object, actual: str, expected: str) -> None:
    assert callable(refuse)
    line = refuse("m.toml", parse_columns, {key: entry}, "m.toml", "[columns]")
    assert line.startswith(f"m.toml: [columns] {key}")
    assert f"found {actual}" in line
    assert expected in line.partition("expected ")[2]


@pytest.mark.parametrize(
    ("text", "key", "source"),
    [
        ("temperature.a=T1", "temperature.a", ColumnSource(("T1",))),
        ("temperature.a=T1[degF]", "temperature.a", ColumnSource(("T1",), "degF")),
        ("temperature.a = Motor temp [degF]", "temperature.a", ColumnSource(("Motor temp",), "degF")),
        ("torque.a=M[Nm][]", "torque.a", ColumnSource(("M[Nm]",))),
        ("time=a=b[ms]", "time", ColumnSource(("a=b",), "ms")),
    ],
)
def test_map_options_are_read(text: str, key: str, source: ColumnSource) -> None:
    assert parse_map_option(text) == (key, source)


PATTERNS = [f"{key}=T1" for key in ("temperature.*", "temperature.?_hip", "torque.{leg}_hip", "temperature.a[1]")]


@pytest.mark.parametrize("text", ["temperature.a", "=T1", "temperature.a=", "a=T1", "torque.a=M[degC]", *PATTERNS])
def test_a_wrong_map_option_is_named(refuse: object, text: str) -> None:
    assert callable(refuse)
    refuse("--map", parse_map_option, text)


# --- Lines to paste ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "source",
    [
        ColumnSource(("T1",)),
        ColumnSource(("T[3]",)),
        ColumnSource(("Motor temp [degC]",), "degC"),
        ColumnSource(("T",), "K", 2.0, -1.5, "norm", 65536.0, (850.0, -127.0), (-40.0, 2000.0)),
        ColumnSource(('a "quoted" name',), "K"),
    ],
)
def test_lines_to_paste_are_read_as_they_are_meant(source: ColumnSource) -> None:
    line = toml_line("temperature.a", source)
    assert parse_columns(tomllib.loads(line), "m.toml", "[columns]") == {"temperature.a": source}
    option = map_option("temperature.a", source).removeprefix('--map "').removesuffix('"')
    assert parse_map_option(option) == ("temperature.a", source)


@pytest.mark.parametrize(
    "source",
    [
        ColumnSource(("i_d", "i_q"), "mA", how="norm"),
        ColumnSource(("u_dc", "i_dc"), "mA", how="product"),
        ColumnSource(("A 1", "A 2"), "mA", how="mean", invalid=(850.0,)),
        ColumnSource(("u", "r"), "mA", how="ratio"),
    ],
)
def test_lines_of_several_columns(source: ColumnSource) -> None:
    assert parse_columns(tomllib.loads(toml_line("current.a", source)), "m", "[columns]") == {"current.a": source}
    option = map_option("current.a", source).removeprefix('--map "').removesuffix('"')
    assert parse_map_option(option) == ("current.a", source)


def test_a_name_with_a_comma_has_no_option() -> None:
    assert map_option("current.a", ColumnSource(("i, d", "i, q"), how="mean")) == ""


def test_a_mean_is_missing_where_one_of_its_columns_is() -> None:
    source = parse_map_option("temperature.a=[degF; mean=T1,T2]")[1]
    values = source.values("temperature.a", {"T1": np.array([32.0, 50.0]), "T2": np.array([68.0, np.nan])})
    np.testing.assert_allclose(values, [10.0, np.nan])


def test_a_winding_is_its_own_thermometer() -> None:
    """Voltage over current of a copper winding of 0.186 ohm at 25 degC, whose temperature is known here."""
    temperature = np.array([25.0, 60.0, 105.0, 105.0])
    current = np.array([10.0, -20.0, 5.0, 1.0])  # the last is less than a tenth of the largest: it says nothing
    entry = {"ratio": ["u", "i"], "thermometer": {"resistance": 0.186, "at": 25, "alpha": 0.0039}}
    source = parse_columns({"temperature.a": entry}, "m.toml", "[columns]")["temperature.a"]
    voltage = 0.186 * (1 + 0.0039 * (temperature - 25.0)) * current
    temperatures = source.values("temperature.a", {"u": voltage, "i": current})
    np.testing.assert_allclose(temperatures, [25.0, 60.0, 105.0, np.nan])
    # In ohm, as a quantity of its own; copper at 25 degC is what is taken where nothing else is said.
    own = parse_columns({"resistance.a": {"ratio": ["u", "i"], "unit": "mohm"}}, "m", "[columns]")["resistance.a"]
    np.testing.assert_allclose(own.values("resistance.a", {"u": 1e3 * voltage, "i": current})[1], 0.186 * 1.1365)
    short = parse_columns({"temperature.a": {"column": "R", "thermometer": {"resistance": 0.186}}}, "m", "[columns]")
    np.testing.assert_allclose(short["temperature.a"].values("temperature.a", {"R": np.array([0.186 * 1.312])}), 105.0)


def test_a_thermometer_is_for_temperatures(refuse: Refuse) -> None:
    entry = {"column": "R", "thermometer": {"resistance": 0.186}}
    assert "thermometer of a temperature alone" in refuse("m", parse_columns, {"torque.a": entry}, "m", "[columns]")


def test_a_rate_is_of_time_alone() -> None:
    source = ColumnSource((), rate=50.0)
    assert parse_columns({"time": {"rate": 50}}, "m", "[columns]") == {"time": source}
    assert parse_map_option("time=[rate=50]") == ("time", source)
    assert parse_columns(tomllib.loads(toml_line("time", source)), "m", "[columns]") == {"time": source}
    assert map_option("time", source) == '--map "time=[rate=50]"'


@pytest.mark.parametrize(
    ("entry", "actual"),
    [
        ({"column": "T", "wrap": -1}, "-1"),
        ({"column": "T", "wrap": 0}, "0"),
        ({"column": "T", "invalid": "850"}, "'850'"),
        ({"column": "T", "invalid": []}, "[]"),
        ({"column": "T", "invalid": [True]}, "[true]"),
        ({"column": "T", "valid": [3, 1]}, "[3, 1]"),
        ({"column": "T", "valid": 3}, "3"),
        ({"column": "T", "product": ["a", "b"]}, "both column and product"),
        ({"product": ["a"]}, "['a']"),
        ({"mean": ["a"]}, "['a']"),
        ({"mean": "a"}, "'a'"),
        ({"rate": 50}, "50"),
        ({"ratio": ["u", "i", "j"]}, "['u', 'i', 'j']"),
        ({"column": "T", "rows": "means before"}, "'means before'"),
        ({"column": "R", "thermometer": {"at": 25}}, "{ at = 25 }"),
        ({"column": "R", "thermometer": {"resistance": -0.1}}, "{ resistance = -0.1 }"),
        ({"column": "R", "thermometer": {"resistance": 0.1}, "scale": 2}, "scale beside thermometer"),
    ],
)
def test_a_wrong_setting_is_named(refuse: Refuse, entry: dict[str, object], actual: str) -> None:
    assert f"found {actual};" in refuse("m.toml", parse_columns, {"temperature.a": entry}, "m.toml", "[columns]")


@pytest.mark.parametrize(
    "text",
    ["temperature.a=T[degC; invalid=x]", "temperature.a=T[wrap=]", "temperature.a=T[a=1]", "current.a=I[scale=1,5]"],
)
def test_a_wrong_word_in_an_option_is_named(refuse: Refuse, text: str) -> None:
    refuse("--map", parse_map_option, text)
