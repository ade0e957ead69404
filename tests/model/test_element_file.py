"""Elements in a model file: units, round trip, and every mistake with its line."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lptn.basics.errors import InputError
from lptn.identify.fitting import fit
from lptn.model.file import ModelFile, parse_model, read_model_file
from lptn.model.model import Model
from lptn.simulate.simulation import simulate
from tests.builders import bound_runs, effect, make_run

FILE = Path("motor.toml")
MOTOR = """\
[model]
ambient = "temperature.ambient"

[nodes.stator.element]                    # laminated iron
kind = "annulus"
inner_radius = { value = 25, unit = "mm" }
outer_radius = { value = 4, unit = "cm" }
length = 0.02
conductivity_radial = { value = 28, bounds = [5, 50], fixed = false }
conductivity_axial = 3
density = { value = 7.65, unit = "g/cm^3" }
specific_heat = 490

[nodes.housing]
capacity = 100

[[links]]
between = ["stator.outer", "housing"]     # shrink fit
resistance = 0.1

[[links]]
between = ["stator.front", "housing"]
perfect = true

[[links]]
between = ["housing", "ambient"]

[[effects]]
kind = "copper_loss"
at = "stator"
"""


def _parse(text: str) -> ModelFile:
    return parse_model(text, FILE)


def _values(text: str) -> dict[str, float]:
    return {parameter.name: parameter.value for parameter in _parse(text).network.parameters}


def test_dimensions_and_material_are_read_in_any_unit() -> None:
    values = _values(MOTOR)
    assert values["capacity.stator"] == pytest.approx(7650 * 490 * np.pi * (0.04**2 - 0.025**2) * 0.02)
    parameters = {parameter.name: parameter for parameter in _parse(MOTOR).network.parameters}
    assert not parameters["capacity.stator"].free
    assert parameters["conductivity_radial.stator"].free
    assert parameters["conductivity_radial.stator"].declared.bounds == (5.0, 50.0)
    assert not parameters["conductivity_axial.stator"].free


def test_an_inline_table_says_the_same() -> None:
    start, end = MOTOR.index("[nodes.stator"), MOTOR.index("[nodes.housing]")
    lines = MOTOR[start:end].splitlines()[1:]
    inline = "[nodes.stator]\nelement = { " + ", ".join(line for line in lines if line) + " }\n\n"
    assert _values(MOTOR[:start] + inline + MOTOR[end:]) == _values(MOTOR)


def test_one_conductivity_serves_for_all_directions() -> None:
    text = MOTOR.replace("conductivity_axial = 3\n", "").replace("conductivity_radial", "conductivity")
    assert [name for name in _values(text) if "conductivity" in name] == ["conductivity.stator"]


def test_a_capacity_may_be_given_in_place_of_the_material() -> None:
    text = MOTOR.replace('density = { value = 7.65, unit = "g/cm^3" }\nspecific_heat = 490\n', "")
    text = text.replace("[nodes.stator.element]", "[nodes.stator]\ncapacity = 200\n[nodes.stator.element]")
    assert _values(text)["capacity.stator"] == 200.0


def test_an_arc_and_a_count() -> None:
    whole = _values(MOTOR)["capacity.stator"]
    arc = MOTOR.replace("length = 0.02", 'length = 0.02\nangle = { value = 30, unit = "deg" }\ncount = 6')
    assert _values(arc)["capacity.stator"] == pytest.approx(whole / 2)


def test_an_element_may_stand_for_many_joints() -> None:
    text = MOTOR.replace("[nodes.stator.element]", '[nodes."*_stator".element]').replace(
        'at = "stator"', 'at = "*_stator"'
    )
    text = text.replace('"stator.', '"*_stator.').replace("[model]", '[model]\njoints = ["FL_stator", "FR_stator"]')
    names = Model(_parse(text.replace("perfect = true", "resistance = 2")).network).nodes
    assert names == ["FL_stator", "FR_stator", "housing"]


def test_a_written_file_is_the_same_text_and_takes_an_effect(tmp_path: Path) -> None:
    path = tmp_path / "motor.toml"
    _parse(MOTOR).write(path)
    assert path.read_text() == MOTOR
    more = read_model_file(path).with_effects([effect("radiation", "housing")])
    assert more.text.startswith(MOTOR.rstrip("\n"))
    assert len(Model(more.network).parameters) == len(_values(MOTOR)) + 1


def test_a_conductivity_is_found_from_a_log_and_kept_in_the_file() -> None:
    """A step of current on a stator of 12 W/(m K), modelled as 28."""
    time = np.arange(600.0)
    current = np.where(time < 300.0, 20.0, 5.0)
    columns = {"temperature.ambient": np.full(600, 20.0), "torque.stator": current}
    columns |= {f"temperature.{name}": np.full(600, 20.0) for name in ("stator", "housing")}
    text = MOTOR.replace("resistance = 0.1", "resistance = { value = 0.1, fixed = true }")
    text = text.replace(
        'between = ["stator.front", "housing"]\nperfect = true', 'between = ["stator.inner", "ambient"]'
    )
    truth = Model(_parse(text.replace("value = 28", "value = 12")).network)
    readings = simulate(truth, bound_runs(truth, [make_run(columns)])[0]).readings
    for row, name in enumerate(truth.nodes):
        columns[f"temperature.{name}"] = readings[row]
    model = Model(_parse(text).network)
    result = fit(model, bound_runs(model, [make_run(columns)]))
    kept = _parse(_parse(text).with_fit(result.table()).text).network
    values = {parameter.name: parameter.value for parameter in kept.parameters}
    assert values["conductivity_radial.stator"] == pytest.approx(12.0, rel=1e-3)


def test_one_motor_s_current_drives_every_piece_of_its_winding() -> None:
    text = MOTOR.replace('at = "stator"', 'at = "*"\ndriven_by = "motor"\ninput = "current"\nshare = "all"')
    file = _parse(text)
    assert Model(file.network).inputs == ["temperature.ambient", "current.motor"]
    declared = file.network.effects[0]
    bare = _parse(text[: text.index("[[effects]]")])
    assert bare.with_effects([declared]).network.effects[0].driven_by == "motor"


# old text, new text, line, words
MISTAKES: dict[str, tuple[str, str, str, tuple[str, ...]]] = {
    "kind": ('"annulus"', '"ring"', "line 5, nodes.", ('unknown element "ring"', "one of cuboid, annulus, cylinder")),
    "no kind": ('kind = "annulus"\n', "", "line 4", ('a key "kind"',)),
    "key": ("length =", "lenght =", "line 8", ('unknown key "lenght"', "length")),
    "missing": ("length = 0.02\n", "", "line 4", ("annulus without length", 'a key "length"')),
    "missing conductivity": ("conductivity_axial = 3\n", "", "line 4", ("without conductivity_axial",)),
    "both conductivities": (
        "conductivity_axial",
        "conductivity",
        "line 9",
        ("conductivity_radial beside conductivity",),
    ),
    "radii": ("value = 25", "value = 45", "line 7", ("0.04 m", "more than inner_radius = 0.045 m")),
    "unit": ('unit = "mm"', 'unit = "K"', "line 6", ('"K"', "a unit like m")),
    "negative": ("length = 0.02", "length = -0.02", "line 8", ("-0.02 m",)),
    "millimetres": ("length = 0.02", "length = 20", "line 8", ("20 m", "to 2 m")),
    "text": ("length = 0.02", 'length = "short"', "line 8", ("'short'",)),
    "wrong density": ("value = 7.65", "value = 0.00000000001", "line 11", ("kg/m^3",)),
    "tiny": ("length = 0.02", "length = 0.000001\ncount = 1\nangle = 0.001", "line 4", ("a body of", "their unit")),
    "fitted length": (
        "length = 0.02",
        "length = { value = 0.02, fixed = false }",
        "line 8",
        ("length can't be fitted",),
    ),
    "no value": ("length = 0.02", 'length = { unit = "m" }', "line 8", ('a key "value"',)),
    "conductivity without value": ("conductivity_axial = 3", "conductivity_axial = {}", "line 10", ('a key "value"',)),
    "conductivity's key": ("= 28,", "= 28, bonds = 3,", "line 9", ("no key",)),
    "angle": ("length = 0.02", "length = 0.02\nangle = 7", "line 9", ("7 rad",)),
    "arcs": ("length = 0.02", "length = 0.02\nangle = 3\ncount = 3", "line 9", ("a full circle",)),
    "count": ("length = 0.02", "length = 0.02\ncount = 1.5", "line 9", ("a whole number",)),
    "half a material": ("specific_heat = 490\n", "", "line 4", ("without specific_heat",)),
    "two capacities": (
        "[nodes.stator.element]",
        "[nodes.stator]\ncapacity = 3\n[nodes.stator.element]",
        "line 6",
        ("both capacity and density",),
    ),
    "no capacity": (
        'density = { value = 7.65, unit = "g/cm^3" }\nspecific_heat = 490\n',
        "",
        "line 4",
        ("neither capacity nor density",),
    ),
    "temperature": (
        "[nodes.stator.element]",
        "[nodes.stator]\ntemperature = 3\n[nodes.stator.element]",
        "line 4",
        ("both element and temperature",),
    ),
    "middle": ('"stator.outer"', '"stator"', "line 18", ("middle of element stator", "stator.inner, stator.outer")),
    "face": ('"stator.outer"', '"stator.top"', "line 18", ("stator.top and housing", "stator.back")),
    "perfect twice": ("perfect = true", "perfect = true\nresistance = 2", "line 21", ("both perfect and resistance",)),
    "masses touch": (
        'between = ["housing", "ambient"]',
        'between = ["housing", "ambient"]\nperfect = true',
        "line 26",
        ("perfect contact of housing and ambient", "a face"),
    ),
    "driven by a pattern": ('at = "stator"', 'at = "stator"\ndriven_by = "mot*"', "line 31", ("'mot*'",)),
    "a name with a dot": ("[nodes.housing]", '[nodes."housing.x0"]', "line 14", ("without blanks, dots",)),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line_with_its_place(mistake: str) -> None:
    old, new, place, words = MISTAKES[mistake]
    assert old in MOTOR
    with pytest.raises(InputError) as caught:
        _parse(MOTOR.replace(old, new, 1))
    line = str(caught.value)
    assert line.startswith(f"motor.toml: {place}")
    assert "\n" not in line
    for word in words:
        assert word in line


@pytest.mark.parametrize(
    ("effect", "quantity", "owner"),
    [
        ("", "resistance", "housing~stator.outer"),
        ("", "resistance", "ambient~housing"),
        ("", "conductivity_radial", "stator"),
        ("copper_loss", "resistance", "stator"),
        ("surface_scale", "change", "housing@log,2"),
    ],
)
def test_a_parameter_says_whose_it_is(effect: str, quantity: str, owner: str) -> None:
    """A face's name has a dot, and so may a run's: the parts of a parameter's name can't be found in it."""
    scale = '\n[[effects]]\nkind = "surface_scale"\nat = "housing"\nrun = "log.2"\n'
    parameters = _parse(MOTOR + scale).network.parameters
    (found,) = (one for one in parameters if (one.effect, one.declared.name, one.owner) == (effect, quantity, owner))
    assert found.name == ".".join(part for part in (effect, quantity, owner) if part)
