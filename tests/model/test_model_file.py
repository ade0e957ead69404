"""Model files in and out: units, sharing, round trips with comments, and every mistake with its line."""

from __future__ import annotations

import tomllib
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lptn.basics.errors import InputError
from lptn.effects import catalogue
from lptn.identify.fitting import Fit, fit
from lptn.logs.columns import ColumnSource
from lptn.model.file import ModelFile, added, parse_model, read_model_file, with_column
from lptn.model.model import Model
from lptn.model.tables import FitTable, FittedTable
from lptn.robots.presets import preset_text, presets, variants
from tests.builders import bound_runs, effect
from tests.identify.truth import TRUTH, truth_run

FILE = Path("robot.toml")
LEG = """\
# Our leg, measured in May.
[model]
name = "leg"                      # shown in reports
joints = ["FL_thigh", "FL_calf", "FR_thigh", "FR_calf"]
ambient = "temperature.ambient"
step = 1.0

[columns]
temperature.FL_calf = "T1"
"temperature.FR_calf" = { column = "T2", unit = "degF" }

[nodes."*_*"]
capacity = { value = 0.3, unit = "kJ/K", bounds = [0.02, 3], share = "sides" }

[[links]]
between = ["{leg}_thigh", "{leg}_calf"]   # through the knee
resistance = { value = 3, unit = "K/W", bounds = [0.05, 200], share = "class" }

[[links]]
between = ["*_*", "ambient"]

[[effects]]
kind = "copper_loss"
at = "*_*"
input = "torque"
resistance = { value = 150, unit = "mohm" }

[[effects]]
kind = "coulomb_friction"
at = "*_calf"
share = "all"
torque = 0.3
"""
SMALL = """\
[model]
ambient = "temperature.ambient"

# what heats
[nodes.a]
capacity = 300

[nodes.b]
capacity = 300 # the housing

[[links]]
between = ["a", "b"]

[[links]]
between = ["b", "ambient"]

[[effects]]
kind = "copper_loss"
at = "a"
resistance = 0.2
torque_constant = 1.0
"""


def _parse(text: str) -> ModelFile:
    return parse_model(text, FILE)


def _values(text: str) -> dict[str, float]:
    return {parameter.name: parameter.value for parameter in _parse(text).network.parameters}


def _refused(text: str) -> str:
    with pytest.raises(InputError) as caught:
        _parse(text)
    line = str(caught.value)
    assert "\n" not in line
    assert line.startswith("robot.toml: ")
    assert "found " in line
    assert "expected " in line
    return line


# --- what a file says -----------------------------------------------------------------------------------


def test_names_units_bounds_and_sharing_are_read() -> None:
    file = _parse(LEG)
    parameters = {parameter.name: parameter for parameter in file.network.parameters}
    capacity = parameters["capacity.FL_calf"]
    assert (file.network.name, file.step) == ("leg", 1.0)
    assert capacity.value == pytest.approx(300.0)
    assert capacity.declared.bounds == pytest.approx((20.0, 3000.0))
    assert capacity.declared.unit == "J/K"
    assert capacity.mirror == "capacity.FR_calf"
    assert parameters["resistance.*_calf~*_thigh"].value == 3.0
    assert parameters["copper_loss.resistance.FR_thigh"].value == pytest.approx(0.15)
    assert not parameters["copper_loss.resistance.FR_thigh"].free
    assert parameters["coulomb_friction.torque.*_calf"].value == 0.3
    assert parameters["resistance.FL_calf~ambient"].free


@pytest.mark.parametrize(
    ("given_as", "value"),
    [("0.3", 0.3), ('{ value = 300, unit = "mN*m" }', 0.3), ('{ value = 2, unit = "ft*lbf" }', 2.7116)],
)
def test_admissible_units_are_converted(given_as: str, value: float) -> None:
    values = _values(LEG.replace("torque = 0.3", f"torque = {given_as}"))
    assert values["coulomb_friction.torque.*_calf"] == pytest.approx(value, rel=1e-4)


def test_bounds_alone_bring_the_start_inside() -> None:
    values = _values(SMALL.replace("capacity = 300\n", "capacity = { bounds = [10, 20] }\n"))
    assert 10 <= values["capacity.a"] <= 20


def test_a_prior_frees_a_parameter_and_starts_it_at_its_mean() -> None:
    given = '{ prior = [200, 10], unit = "mohm" }'
    text = SMALL.replace("resistance = 0.2", f"resistance = {given}")
    text = text.replace('"temperature.ambient"', '{ prior = [68, 1.8], unit = "degF" }')
    parameters = {parameter.name: parameter for parameter in _parse(text).network.parameters}
    winding, air = parameters["copper_loss.resistance.a"], parameters["temperature.ambient"]
    assert winding.free
    assert winding.value == pytest.approx(0.2)
    assert winding.declared.prior == pytest.approx((0.2, 0.01))
    assert air.declared.prior == pytest.approx((20.0, 1.0))  # a deviation has no zero
    held = _parse(text.replace(given, given.replace(" }", ", fixed = true }"))).network.parameters
    assert not next(parameter for parameter in held if parameter.name == "copper_loss.resistance.a").free


def test_a_fitted_value_stands_before_the_prior_that_it_began_at() -> None:
    text = SMALL.replace("resistance = 0.2", "resistance = { prior = [0.2, 0.01] }  # from the data sheet")
    fitted = FitTable(parameters={"copper_loss.resistance.a": FittedTable(value=0.21, error=0.005)})
    written = _parse(text).with_fit(fitted).text
    assert "resistance = {value = 0.21, prior = [0.2, 0.01]}  # from the data sheet\n" in written


def test_an_added_effect_keeps_its_prior() -> None:
    declared = effect("constant_heat", "a")
    declared = replace(declared, parameters=tuple(replace(p, prior=(4.0, 1.0)) for p in declared.parameters))
    again = _parse(_parse(SMALL).with_effects([declared]).text).network.effects[-1]
    assert [parameter.prior for parameter in again.parameters] == [(4.0, 1.0)]


def test_a_parameter_can_be_fixed_and_freed() -> None:
    text = SMALL.replace("capacity = 300\n", "capacity = { value = 300, fixed = true }\n")
    text = text.replace("resistance = 0.2", "resistance = { value = 0.2, fixed = false }")
    free = {parameter.name for parameter in _parse(text).network.parameters if parameter.free}
    assert "capacity.a" not in free
    assert "copper_loss.resistance.a" in free


@pytest.mark.parametrize("word", ["torque", "current"])
def test_an_option_word_chooses_the_input(word: str) -> None:
    model = Model(_parse(SMALL + f'input = "{word}"\n').network)
    assert f"{word}.a" in model.inputs


def test_ambient_is_a_column_the_start_a_number_or_a_free_parameter() -> None:
    def with_ambient(text: str) -> Model:
        return Model(_parse(SMALL.replace('"temperature.ambient"', text)).network)

    assert with_ambient('"temperature.room"').inputs[0] == "temperature.room"
    assert with_ambient('"start"').started == ["temperature.ambient"]
    assert "temperature.ambient" not in with_ambient("21.5").inputs
    number = {u.name: u for u in with_ambient("21.5").parameters}["temperature.ambient"]
    assert number.value == 21.5
    free = {u.name: u for u in with_ambient('{ value = 68, unit = "degF", bounds = [50, 86] }').parameters}
    assert free["temperature.ambient"].value == pytest.approx(20.0)
    assert free["temperature.ambient"].declared.bounds == pytest.approx((10.0, 30.0))


def test_a_prescribed_node_can_stand_among_the_nodes() -> None:
    text = SMALL.replace('ambient = "temperature.ambient"', "").replace(
        "[nodes.b]", '[nodes.ambient]\ntemperature = "temperature.lab"\n\n[nodes.b]'
    )
    assert Model(_parse(text).network).inputs[0] == "temperature.lab"


def test_dotted_columns_need_no_quotes() -> None:
    columns = _parse(LEG).columns
    assert columns["temperature.FL_calf"].columns == ("T1",)
    assert columns["temperature.FR_calf"].unit == "degF"
    assert _parse(LEG + '\n[columns.torque]\nFL_calf = "tau"\n').columns["torque.FL_calf"].columns == ("tau",)


@pytest.mark.parametrize(("name", "other"), [(name, other) for name in presets() for other in (None, *variants(name))])
def test_every_preset_is_a_model(name: str, other: str | None) -> None:
    model = Model(parse_model(preset_text(name, other), Path(f"{name}.toml")).network)
    assert model.free
    assert any(not parameter.free for parameter in model.parameters)


# --- there and back -----------------------------------------------------------------------------------------


def test_a_written_file_is_the_same_text(tmp_path: Path) -> None:
    path = tmp_path / "leg.toml"
    _parse(LEG).write(path)
    assert path.read_text() == LEG
    assert read_model_file(path).network.parameters == _parse(LEG).network.parameters


def test_more_effects_keep_the_text_before_them() -> None:
    extended = _parse(LEG).with_effects([effect("forced_convection", "*_thigh", gamma=0.7)])
    assert extended.text.startswith(LEG.rstrip("\n"))
    assert "forced_convection" in extended.text


@pytest.mark.parametrize("key", [key for key in catalogue() if key != "copper_loss"])
def test_a_file_with_one_more_effect_says_the_same_as_the_network_with_it(key: str) -> None:
    file = _parse(SMALL)
    kind = catalogue()[key]
    at = {"edge": "a~b", "contact": "a~b", "pair": "b~a", "link": "b", "group": "*", "boundary": "ambient"}.get(
        kind.site, "a"
    )
    if kind.site == "edge":
        file = _parse(SMALL.replace('between = ["a", "b"]', 'between = ["a", "ambient"]'))
    if kind.scales_heat and not file.network.nodes_with(kind.heat_of):
        file = file.with_effects([effect(kind.heat_of, at)])
    declared = effect(key, at)
    network = file.network.with_effects([declared])
    again = file.with_effects([declared]).network
    assert [(u.name, u.value, u.declared) for u in again.parameters] == [
        (u.name, u.value, u.declared) for u in network.parameters
    ]
    assert Model(again).inputs == Model(network).inputs


def test_an_effect_added_at_a_pattern_has_one_parameter_for_all_of_it() -> None:
    network = added(_parse(LEG), "constant_heat", "*_calf").network
    assert [u.name for u in network.parameters if u.name.startswith("constant_heat")] == ["constant_heat.power.*_calf"]


def test_an_effect_that_does_not_exist_is_not_added() -> None:
    with pytest.raises(InputError, match="radiation"):
        added(_parse(LEG), "radiaton", "*")


@pytest.fixture(scope="module")
def fitted() -> Fit:
    model = Model(_parse(SMALL).network)
    return fit(model, bound_runs(model, [truth_run(900.0, step=5.0)]))


def test_a_fit_is_kept_in_the_file_and_read_again(fitted: Fit) -> None:
    file = _parse(SMALL).with_fit(fitted.table())
    written = "".join(line + "\n" for line in file.text.partition("\n[fit]")[0].splitlines())
    for author, line in zip(
        SMALL.splitlines(), [line for line in written.splitlines() if "K/W" not in line], strict=True
    ):
        assert line == author or line.startswith("capacity = ")
    assert "# the housing" in file.text
    assert "fit.parameters" not in file.text
    again = {parameter.name: parameter.value for parameter in _parse(file.text).network.parameters}
    for parameter in fitted.model.parameters:
        assert again[parameter.name] == pytest.approx(parameter.value, rel=1e-5)
    assert {name: again[name] for name in TRUTH} == pytest.approx(TRUTH, rel=0.05)
    assert 'file = "run0.csv"' in file.text
    assert "status" in file.text


def test_a_second_fit_replaces_the_first(fitted: Fit) -> None:
    once = _parse(SMALL).with_fit(fitted.table())
    assert once.with_fit(fitted.table()).text == once.text
    assert once.text.count("[fit]") == 1


def test_fitted_values_stand_where_their_parameters_are_declared() -> None:
    file = _parse(LEG)
    values = {p.name: 0.9 * p.value + 0.001 * row for row, p in enumerate(file.network.parameters) if p.free}
    table = FitTable(rmse=0.5, parameters={name: FittedTable(value=v, error=v / 10) for name, v in values.items()})
    fitted = file.with_fit(table)
    assert "resistance = { value = 2.70" in fitted.text.replace("{value", "{ value")  # a class: one value
    assert "# through the knee" in fitted.text
    content = tomllib.loads(fitted.text)
    capacity = content["nodes"]["*_*"]["capacity"]
    assert capacity["value"] == {
        name: pytest.approx(values[f"capacity.{name}"] / 1000, rel=1e-5) for name in file.network.dynamic
    }
    assert (capacity["unit"], capacity["bounds"]) == ("kJ/K", [0.02, 3])
    assert content["effects"][1]["torque"] == pytest.approx(values["coulomb_friction.torque.*_calf"], rel=1e-5)
    assert set(content["fit"]["standard_errors"]) == set(values)
    assert "parameters" not in content["fit"]
    assert {name: entry.error for name, entry in fitted.fit.parameters.items()} == {
        name: pytest.approx(value / 10, rel=1e-5) for name, value in values.items()
    }


def test_a_file_with_fitted_values_of_an_older_version_is_read_and_brought_up_to_date() -> None:
    old = SMALL + '\n[fit]\nrmse = 0.3\n[fit.parameters]\n"capacity.a" = { value = 222, error = 3, unit = "J/K" }\n'
    file = _parse(old)
    assert {p.name: p.value for p in file.network.parameters}["capacity.a"] == 222
    new = file.with_fit(FitTable(rmse=0.2, parameters={"capacity.b": FittedTable(value=99.0, error=1.0)}))
    assert {p.name: p.value for p in new.network.parameters}["capacity.a"] == 222
    assert "capacity = 222.0" in new.text
    assert "capacity = 99.0 # the housing" in new.text
    assert "fit.parameters" not in new.text


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ("{ value = { FL_thigh = 1, FL_calf = 1, FR_thigh = 1 } }", "no value for FR_calf"),
        ("{ value = { FL_thigh = 1, FL_calf = 1, FR_thigh = 1, FR_calf = 1, hip = 1 } }", "a value for hip"),
        ("{ value = { FL_thigh = 1, FL_calf = 1, FR_thigh = 1, FR_calf = -1 } }", "-1 J/K for FR_calf"),
        ("{ value = { FL_thigh = 1, FL_calf = 'x', FR_thigh = 1, FR_calf = 1 } }", "'x'; expected a number"),
        ("{ value = {} }", "no value for FL_thigh"),
    ],
)
def test_a_value_for_each_place_has_to_be_one_for_each(given: str, said: str) -> None:
    capacity = next(line for line in LEG.splitlines() if line.startswith("capacity"))
    with pytest.raises(InputError, match="line 13") as refused:
        _parse(LEG.replace(capacity, f"capacity = {given}"))
    assert said in str(refused.value)


def test_bounds_that_leave_one_value_hold_it() -> None:
    for bounds in ("{ bounds = [310, 310] }", "{ value = 310, bounds = [310, 310] }"):
        network = _parse(SMALL.replace("capacity = 300\n", f"capacity = {bounds}\n")).network
        held = {p.name: p for p in network.parameters}["capacity.a"]
        assert (held.value, held.free) == (310.0, False)


@pytest.mark.parametrize(
    ("at", "run", "place", "kept"),
    [
        ("b", "", "b", ""),
        ("b@monday", "", "b", "monday"),
        ("b@mon,day", "", "b", "mon?day"),
        ("b", "mon day", "b", "mon day"),
        ("b@mon,day", "mon day", "b", "mon day"),
        ("*@monday", "", "*", "monday"),
    ],
)
def test_an_effect_is_added_for_one_run_as_diagnose_prints_it(at: str, run: str, place: str, kept: str) -> None:
    declared = added(_parse(SMALL), "sensor_offset", at, run).network.effects[-1]
    assert (declared.at, declared.run) == (place, kept)


def test_two_runs_for_one_effect_are_refused() -> None:
    with pytest.raises(InputError, match="another run"):
        added(_parse(SMALL), "sensor_offset", "b@monday", "tuesday")


def test_an_effect_can_be_added_to_a_fitted_file(fitted: Fit) -> None:
    file = added(_parse(SMALL).with_fit(fitted.table()), "constant_heat", "b")
    values = {parameter.name: parameter.value for parameter in file.network.parameters}
    assert values["capacity.a"] == pytest.approx(TRUTH["capacity.a"], rel=0.05)
    assert values["constant_heat.power.b"] == 3.0


def test_an_effect_is_added_to_effects_written_in_one_line() -> None:
    text = 'effects = [{ kind = "copper_loss", at = "a" }]\n' + SMALL[: SMALL.index("[[effects]]")]
    kept = [declared.effect.key for declared in added(_parse(text), "constant_heat", "b").network.effects]
    assert kept == ["copper_loss", "constant_heat"]


def test_a_fit_that_ends_at_a_long_bound_can_be_read_again() -> None:
    text = SMALL.replace("capacity = 300\n", "capacity = { value = 150, bounds = [140.123456, 160] }\n")
    model = Model(_parse(text).network)
    result = fit(model, bound_runs(model, [truth_run(300.0, step=5.0)]))
    _parse(text).with_fit(result.table())


def test_bounds_of_an_added_effect_are_kept() -> None:
    declared = effect("constant_heat", "b")
    declared = replace(declared, parameters=tuple(replace(p, bounds=(0.0, 7.0)) for p in declared.parameters))
    (again,) = (
        u for u in _parse(SMALL).with_effects([declared]).network.parameters if u.name == "constant_heat.power.b"
    )
    assert again.declared.bounds == (0.0, 7.0)


# --- mistakes ------------------------------------------------------------------------------------------------

# old text, new text (in SMALL), line, words of the message
MISTAKES: dict[str, tuple[str, str, str, tuple[str, ...]]] = {
    "unknown effect": ('"copper_loss"', '"coper_loss"', "line 18, effects[0].kind", ('"coper_loss"', "copper_loss (")),
    "unknown effect unlike any": ('"copper_loss"', '"zzzz"', "line 18", ("one of battery_heat, computer_heat",)),
    "unknown key of an effect": ("torque_constant", "torque_const", "line 21", ("torque_const", "torque_constant")),
    "unknown key of a node": ("capacity = 300\n", "capacity = 300\nmass = 2\n", "line 7, nodes.a.mass", ("found 2",)),
    "unknown table": ("# what", "[extra]\n# what", "line 4, extra", ('no key "extra"',)),
    "bounds upside down": ("= 300\n", "= { bounds = [9, 2] }\n", "line 6", ("lower bound 9 above the upper 2",)),
    "prior outside its bounds": (
        "= 300\n",
        "= { prior = [300, 30], bounds = [2, 9] }\n",
        "line 6",
        ("a mean of 300 J/K", "[mean, standard deviation]", "from 2 to 9 J/K"),
    ),
    "prior without spread": ("= 300\n", "= { prior = [300, 0] }\n", "line 6", ("standard deviation of 0 J/K",)),
    "value outside its bounds": (
        "= 300\n",
        "= { value = 300, bounds = [2, 9] }\n",
        "line 6",
        ("300 J/K", "from 2 to 9 J/K"),
    ),
    "negative capacity": ("= 300\n", "= -300\n", "line 6", ("-300 J/K",)),
    "wrong unit": ("= 300\n", '= { value = 3, unit = "K/W" }\n', "line 6", ('"K/W"', "a unit like J/K")),
    "no unit at all": ("= 300\n", '= { value = 3, unit = "((" }\n', "line 6", ("a unit like J/K",)),
    "text for a number": ("= 300\n", '= "300"\n', "line 6, nodes.a.capacity", ("'300'", "number")),
    "text for a number of an effect": ("= 0.2", '= "0.2"', "line 20, effects[0].resistance", ("'0.2'",)),
    "true for a number": ("= 300\n", "= true\n", "line 6", ("true",)),
    "infinite": ("= 300\n", "= inf\n", "line 6", ("inf", "finite")),
    "both": ("= 300\n", "= 300\ntemperature = 20\n", "line 5", ("both capacity and temperature", "one of the two")),
    "neither": ("capacity = 300\n", "", "line 5", ("neither capacity",)),
    "bad TOML": ("capacity = 300\n", "capacity = \n", "line 6", ("expected TOML",)),
    "missing at": ('at = "a"\n', "", "line 17", ('a key "at"',)),
    "missing kind": ('kind = "copper_loss"\n', "", "line 17", ('a key "kind"',)),
    "isolated node": ("# what", "[nodes.c]\ncapacity = 1\n# what", "line 4", ("isolated", '["c", "ambient"]')),
    "one end only": ('["a", "b"]', '["a"]', "line 12, links[0].between", ("['a']",)),
    "link to nowhere": ('["a", "b"]', '["a", "x"]', "line 12, links[0].between", ("a and x",)),
    "two links": ('["b", "ambient"]', '["b", "a"]', "line 15", ("second link a~b",)),
    "option word": ("[nodes.b]", "[nodes.b]", "line 22, effects[0].input", ("'power'", '"torque" or "current"')),
    "glob matching no place": ('at = "a"', 'at = "*_calf"', "line 19, effects[0].at", ("*_calf", "one of a, b")),
    "glob matching no joint": ("[nodes.a]", '[nodes."*_calf"]', "line 5", ("matches no joint", "[model] joints")),
    "effect twice": (
        "# what",
        '[[effects]]\nkind = "copper_loss"\nat = "a"\n# what',
        "line 22, effects[1].at",
        ("a second copper_loss at a",),
    ),
    "ambient word": ('"temperature.ambient"', '"air"', "line 2, model.ambient", ('"air"', '"start"')),
    "step of nothing": ("[model]\n", "[model]\nstep = 0\n", "line 2, model.step", ("greater than 0",)),
    "model as a number": ("[model]\nambient", "model = 3\nambient", "line 1, model", ("found 3",)),
    "column key": ("# what", "[columns]\nT1 = 'x'\n# what", "line 5", ("T1", "<quantity>.<place>")),
    "column unit": (
        "# what",
        "[columns]\ntemperature.a = { column = 'x', unit = 'kg' }\n# what",
        "line 5",
        ("kg",),
    ),
    "stale fit": (
        "# what",
        '[fit.parameters]\n"capacity.z" = { value = 3 }\n# what',
        "line 5",
        ("no part of the model uses",),
    ),
    "fitted value outside": (
        "# what",
        '[fit.parameters]\n"capacity.a" = { value = -3 }\n# what',
        "",
        ("capacity.a", "found -3.0"),
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line_with_file_line_place_found_and_expected(mistake: str) -> None:
    old, new, place, words = MISTAKES[mistake]
    assert old in SMALL
    text = SMALL.replace(old, new, 1) + ('input = "power"\n' if mistake == "option word" else "")
    line = _refused(text)
    assert line.startswith(f"robot.toml: {place}")
    for word in words:
        assert word in line


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("{ bounds = [1, 2, 3] }", ("capacity.bounds", "[1, 2, 3]")),
        ('{ share = "some" }', ("capacity.share", "'some'", "'each'")),
        ("{ bonds = [1, 2] }", ("capacity.bonds", "no key")),
        ('{ value = "300" }', ("capacity.value", "'300'")),
    ],
)
def test_a_mistake_inside_a_parameter_table_is_named(table: str, words: tuple[str, ...]) -> None:
    line = _refused(SMALL.replace("capacity = 300\n", f"capacity = {table}\n"))
    assert "line 6" in line
    for word in words:
        assert word in line


def test_a_file_without_nodes_is_refused() -> None:
    assert "no node with a capacity" in _refused("")


def test_a_missing_file_and_one_that_is_no_text_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="No such file"):
        read_model_file(tmp_path / "none.toml")
    (tmp_path / "binary.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match="not UTF-8"):
        read_model_file(tmp_path / "binary.toml")


@pytest.mark.parametrize("zero", ["{ value = 0.0, bounds = [0, 10] }", "{ value = -1.0, bounds = [-5, 10] }"])
def test_a_capacity_is_positive_whatever_the_bounds_say(zero: str) -> None:
    _refused(SMALL.replace("capacity = 300\n", f"capacity = {zero}\n"))


def test_a_key_given_twice_is_refused() -> None:
    _refused(SMALL + "resistance = 0.3\n")


def test_a_tilde_in_a_name_is_refused() -> None:
    _refused(SMALL.replace("[nodes.a]", '[nodes."a~c"]').replace('["a", "b"]', '["a~c", "b"]').replace('"a"', '"*"'))


def test_a_byte_order_mark_does_no_harm(tmp_path: Path) -> None:
    (tmp_path / "leg.toml").write_text(LEG, encoding="utf-8-sig")
    read_model_file(tmp_path / "leg.toml")


# --- any text at all -------------------------------------------------------------------------------------------

LINES = LEG.splitlines()
_EDIT = st.tuples(
    st.sampled_from(["delete", "copy", "insert", "character"]), st.integers(0, 10_000), st.integers(0, 10_000)
)
_LETTERS = "\"'[]{}=.,~*?#-_0159ae \n\\+\t"


def _edited(text: str, edits: list[tuple[str, int, int]]) -> str:
    for kind, one, other in edits:
        lines = text.splitlines() or [""]
        row = one % len(lines)
        if kind == "delete":
            del lines[row]
        elif kind == "copy":
            lines.insert(other % len(lines), lines[row])
        elif kind == "insert":
            lines.insert(row, LINES[other % len(LINES)])
        else:
            column = other % (len(lines[row]) + 1)
            letter = _LETTERS[(one + other) % len(_LETTERS)]
            lines[row] = lines[row][:column] + letter + lines[row][column + one % 2 :]
        text = "\n".join(lines) + "\n"
    return text


@settings(max_examples=200)
@given(st.lists(_EDIT, min_size=1, max_size=4))
def test_edits_never_raise_anything_but_an_input_error(edits: list[tuple[str, int, int]]) -> None:
    with suppress(InputError):
        file = _parse(_edited(LEG, edits))
        assert np.isfinite([parameter.value for parameter in file.network.parameters]).all()


# --- heat of housings, driven by the columns of the windings beside them ------------------------------------

WHEELS = """\
[model]
name = "wheels"
joints = ["FL", "FL_hub", "FR", "FR_hub"]
ambient = "temperature.ambient"

[nodes."*"]
capacity = 200

[[links]]
between = ["FL", "FL_hub"]
[[links]]
between = ["FR", "FR_hub"]
[[links]]
between = ["*_hub", "ambient"]

[[effects]]
kind = "copper_loss"
at = "F?"

[[effects]]
kind = "coulomb_friction"
at = "*_hub"
driven_by = "*"
share = "all"
"""


def test_each_housing_is_driven_by_the_winding_that_it_is_linked_to() -> None:
    file = _parse(WHEELS)
    driven = [
        instance.driven_by for instance in file.network.effect_instances if instance.effect.key == "coulomb_friction"
    ]
    assert driven == ["FL", "FR"]
    assert {"velocity.FL", "velocity.FR"} <= set(Model(file.network).inputs)
    without = _parse(WHEELS[: WHEELS.rindex("[[effects]]")])
    assert without.with_effects([file.network.effects[-1]]).network.effects[-1].driven_by == "*"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ('at = "F?"', 'at = "FL"', "FR_hub is linked to no winding"),
        ('["FR", "FR_hub"]', '["FR", "FL_hub"]', "FL_hub is linked to FL and FR"),
    ],
)
def test_a_housing_beside_no_winding_or_two_is_refused(old: str, new: str, message: str) -> None:
    with pytest.raises(InputError, match=message):
        _parse(WHEELS.replace(old, new))


# --- an entry of [columns], written and taken away --------------------------------------------------


def test_rows_at_a_rate_are_the_time_of_the_file() -> None:
    text = LEG.replace("[columns]\n", '[columns]\ntime = { rate = 50 }\n"time@friday" = { rate = 20 }\n')
    columns = parse_model(text, FILE).columns
    assert (columns["time"].rate, columns["time@friday"].rate) == (50, 20)


def test_an_entry_of_columns_is_written_where_it_stands() -> None:
    path = FILE
    text = '[columns]\ntime = "t" # as logged\ntemperature.a = "T1" # guessed\n\n# nodes\n[nodes.a]\ncapacity = 3\n'
    text = with_column(text, path, "temperature.a", ColumnSource(("T2",), unit="degF"))
    assert 'temperature.a = { column = "T2", unit = "degF" }\n' in text  # without the old reason
    text = with_column(text, path, "current.a@mon[1]*", ColumnSource(value=2.0), "held\nthere")
    assert text.splitlines()[3] == '"current.a@mon[1]*" = { value = 2 }   # held there'
    for key in ("temperature.a", "current.a@mon[1]*", "not.there"):
        text = with_column(text, path, key, None)
    assert text == '[columns]\ntime = "t" # as logged\n\n# nodes\n[nodes.a]\ncapacity = 3\n'
    assert with_column("", path, "time", ColumnSource(("t",))) == '[columns]\ntime = "t"\n'
    with pytest.raises(InputError, match="a table"):
        with_column("columns = 3\n", path, "time", ColumnSource(("t",)))
    with pytest.raises(InputError, match="TOML"):
        with_column("[columns\n", path, "time", ColumnSource(("t",)))
