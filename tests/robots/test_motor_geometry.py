"""A model file from a drawing: against finite volumes, sound, finer pieces, mistakes with their line, the command."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.cli.main import main
from lptn.model.file import parse_model, read_model_file
from lptn.model.model import Model
from lptn.robots.motor_drawing import parse_geometry, sample
from lptn.robots.motor_model import model_text
from lptn.simulate.simulation import simulate
from tests.builders import bound_runs, make_run
from tests.robots.truth import FLAT, LONG, Drawing, temperatures

FILE = Path("drawing.toml")
CURRENT = 8.0  # A
PARTS = ("shaft", "rotor", "magnets", "yoke", "housing", "tooth", "winding", "end_winding")


def _drawn(kind: str = "inrunner", pieces: Mapping[str, int] = MappingProxyType({})) -> str:
    """The sample, cut otherwise."""
    lines = sample(kind).splitlines()
    start = lines.index(next(line for line in lines if line.startswith("[pieces]")))
    return "\n".join([*lines[:start], "[pieces]", *(f"{part} = {n}" for part, n in pieces.items())]) + "\n"


def _model(text: str, alpha: str = "0.0") -> Model:
    made = model_text(parse_geometry(text, FILE)).replace("value = 0.00393", f"value = {alpha}")
    return Model(parse_model(made, Path("model.toml")).network)


def _capacities(model: Model) -> FloatArray:
    return np.array([model.values[model.network.capacities[name]] for name in model.nodes])


def _heat(model: Model, x: FloatArray, current: float) -> FloatArray:
    """Heat into each node [W], surroundings at 0 degC, at rest."""
    u = [current if column == "current.motor" else 0.0 for column in model.inputs]
    return np.asarray(_capacities(model) * model.rhs(x, u, model.values).full().ravel())


def _conductance(model: Model) -> FloatArray:
    columns = [_heat(model, row, 0.0) for row in np.eye(len(model.nodes))]
    return -np.array(columns).T


def _rises(model: Model) -> dict[str, float]:
    """Steady mean rise of each part [K], surroundings at 0 degC."""
    steady = np.linalg.solve(_conductance(model), _heat(model, np.zeros(len(model.nodes)), CURRENT))
    weights, rises = _capacities(model), {}
    for part in PARTS:
        of = [row for row, name in enumerate(model.nodes) if name.startswith(part)]
        if of:  # an outrunner has no housing
            rises[part] = float(np.average(steady[of], weights=weights[of]))
    return rises


# --- against finite volumes --------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def truth() -> dict[str, float]:
    """Half a slot pitch in finite volumes (radius, angle, axis), 12.8 W in the copper."""
    return temperatures(Drawing(power=0.2 * CURRENT**2), 2)


def test_the_finite_volumes_are_fine_enough(truth: dict[str, float]) -> None:
    coarse = temperatures(Drawing(power=0.2 * CURRENT**2), 1)
    for part in PARTS:
        assert coarse[part] == pytest.approx(truth[part], rel=0.02)


@pytest.mark.long
@pytest.mark.parametrize(
    ("pieces", "winding"),
    [({}, 0.085), ({"winding": 2}, 0.045), ({"winding": 3}, 0.03), ({"axial": 3, "winding": 8, "yoke": 2}, 0.006)],
)
def test_each_part_is_as_warm_as_the_finite_volumes_say(
    truth: dict[str, float], pieces: dict[str, int], winding: float
) -> None:
    """Windings are too warm at first, since their slots lose heat on several sides, and come down with more layers."""
    rises = _rises(_model(_drawn("inrunner", pieces)))
    for part in PARTS:
        tolerance = winding if "winding" in part else 0.02
        assert rises[part] == pytest.approx(truth[part], rel=tolerance), part


@pytest.mark.parametrize("drawing", [LONG, FLAT])
def test_other_motors_are_met_as_well(drawing: Drawing) -> None:
    """Nothing was chosen for the one motor above: a long one of 18 slots and a flat one of 9."""
    reference = temperatures(drawing, 2)
    rises = _rises(_model(_written(drawing, {"winding": 3})))
    for part in PARTS:
        assert rises[part] == pytest.approx(reference[part], rel=0.025), part


def _written(d: Drawing, pieces: Mapping[str, int]) -> str:
    """The geometry file of a test motor."""
    tables: dict[str, dict[str, object]] = {
        "motor": {"kind": '"inrunner"'}
        | {key: getattr(d, key) for key in ("slots", "length", "overhang", "tooth_width")},
        "outer_radius": dict(d.radii),
        "winding": {"resistance": d.power / CURRENT**2, "liner": d.liner, "liner_conductivity": d.liner_conductivity},
        "cooling": {key: getattr(d, key) for key in ("outside", "ends", "fit", "gap_conductivity", "bearing", "mount")},
        "pieces": dict(pieces),
    }
    lines = [[f"[{name}]", *(f"{key} = {value}" for key, value in table.items())] for name, table in tables.items()]
    return "\n".join(line for table in lines for line in table) + "\n"


def test_a_plain_network_of_the_same_pieces_is_far_off(truth: dict[str, float]) -> None:
    """The check can fail: slots as lumps at their middle, L/(4kA) in place of L/(12kA) across, are much too warm."""
    text = _drawn("inrunner", {"axial": 1})
    across = model_text(parse_geometry(text, FILE)).replace(
        "conductivity_x = { value = 0.5267", "conductivity_x = { value = 0.1756"
    )
    lumped = Model(parse_model(across.replace("value = 0.00393", "value = 0.0"), Path("model.toml")).network)
    assert _rises(lumped)["winding"] > 1.15 * truth["winding"]


# --- sound ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["inrunner", "outrunner"])
@pytest.mark.parametrize("pieces", [{}, {"axial": 2, "winding": 3, "yoke": 2, "rotor": 2}])
def test_no_heat_is_lost_and_no_work_taken_in(kind: str, pieces: dict[str, int]) -> None:
    model = _model(_drawn(kind, pieces))
    matrix = _conductance(model)
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-9 * np.abs(matrix).max())
    assert np.linalg.eigvalsh((matrix + matrix.T) / 2)[0] > 0
    assert _heat(model, np.zeros(len(model.nodes)), CURRENT).sum() == pytest.approx(0.2 * CURRENT**2, rel=1e-4)
    assert model.is_linear


@pytest.mark.parametrize("kind", ["inrunner", "outrunner"])
def test_pieces_change_neither_heat_capacity_nor_much_of_the_answer(kind: str) -> None:
    coarse, fine = _model(_drawn(kind)), _model(_drawn(kind, {"axial": 4, "winding": 3, "yoke": 2, "rotor": 2}))
    assert _capacities(coarse).sum() == pytest.approx(_capacities(fine).sum(), rel=1e-3)
    one, other = _rises(coarse), _rises(fine)
    assert one["winding"] == pytest.approx(other["winding"], rel=0.07)
    assert one["tooth"] == pytest.approx(other["tooth"], rel=0.03)


def test_the_iron_weighs_what_the_drawing_says() -> None:
    model = _model(_drawn())
    capacity = dict(zip(model.nodes, _capacities(model), strict=True))
    assert capacity["housing_z1"] == pytest.approx(2700 * 900 * math.pi * (0.036**2 - 0.033**2) * 0.02, rel=1e-4)
    assert capacity["tooth_z1"] == pytest.approx(7650 * 470 * 12 * 0.005 * 0.010 * 0.02, rel=1e-4)


def test_a_hot_winding_makes_more_heat_and_iron_loss_follows_the_speed() -> None:
    text = f"{_drawn('inrunner', {'axial': 2})}\n[losses]\niron_gain = 0.05\n"
    model = _model(text, "0.00393")
    assert set(model.inputs) == {"temperature.ambient", "current.motor", "velocity_rms.motor"}
    columns = {"temperature.ambient": 0.0, "current.motor": CURRENT, "velocity_rms.motor": 16.0}
    u = [columns[column] for column in model.inputs]
    cold, hot = (
        float((_capacities(model) * model.rhs(x, u, model.values).full().ravel()).sum())
        for x in (np.full(len(model.nodes), 25.0), np.full(len(model.nodes), 105.0))
    )
    out = _conductance(_model(_drawn("inrunner", {"axial": 2}))).sum()
    assert cold + 25.0 * out == pytest.approx(0.2 * CURRENT**2 + 0.05 * 64.0, rel=1e-3)
    assert hot + 105.0 * out == pytest.approx(0.2 * CURRENT**2 * (1 + 0.00393 * 80) + 0.05 * 64.0, rel=1e-3)


def test_the_model_runs_on_a_log() -> None:
    model = _model(sample())
    n = 600
    columns = {"temperature.ambient": np.full(n, 22.0), "current.motor": np.full(n, CURRENT)}
    columns["temperature.housing_z1"] = np.full(n, 22.0)
    readings = simulate(model, bound_runs(model, [make_run(columns)])[0]).readings
    rise = dict(zip(model.nodes, readings[:, -1] - 22.0, strict=True))
    assert rise["end_winding_front"] > rise["winding_r2_z1"] > rise["tooth_r2_z1"] > rise["housing_z1"] > 1.0


# --- mistakes ---------------------------------------------------------------------------------------------------

MISTAKES: dict[str, tuple[str, str, str, tuple[str, ...]]] = {
    "kind": ('kind = "inrunner"', 'kind = "axial"', "line 6, motor.kind", ("'axial'",)),
    "no length": ("length = {", "lenght = {", "line 4", ("length",)),
    "unit": (
        'length = { value = 20, unit = "mm" }',
        'length = { value = 20, unit = "K" }',
        "line 7",
        ("a unit like m",),
    ),
    "negative": ("overhang = { value = 5", "overhang = { value = -5", "line 10", ("greater than 0",)),
    "millimetres": ('{ value = 36, unit = "mm" }', "36", "line 19, outer_radius.housing", ("less than or equal to 2",)),
    "order of radii": (
        "gap = { value = 19,",
        "gap = { value = 18,",
        "line 16, outer_radius.gap",
        ("more than 0.0185 m",),
    ),
    "unknown part": ("gap = {", "air = {", "line 16, outer_radius.air", ("one of shaft, rotor",)),
    "missing part": ('gap = { value = 19, unit = "mm" }\n', "", "line 12, outer_radius", ("no gap",)),
    "fat teeth": ("tooth_width = { value = 5", "tooth_width = { value = 12", "line 9", ("12 mm", "less than")),
    "fill": ("fill = 0.45", "fill = 1.2", "line 26, winding.fill", ("less than 0.95",)),
    "half a slot": ("slots = 12", "slots = 12.5", "line 8, motor.slots", ("12.5",)),
    "torque without constant": ('input = "current"', 'input = "torque"', "line 21", ("torque_constant",)),
    "material": ('housing = "aluminium"', 'housing = "wood"', "line 40, materials.housing", ('"wood"', "titanium")),
    "material of nothing": ('housing = "aluminium"', 'lid = "aluminium"', "line 40, materials.lid", ("one of",)),
    "half a material": (
        'housing = "aluminium"',
        "housing = { conductivity_radial = 3, density = 2700, specific_heat = 900 }",
        "line 40, materials.housing",
        ("conductivity_radial and _axial",),
    ),
    "no pieces": ("axial = 1", "axial = 0", "line 43, pieces.axial", ("greater than or equal to 1",)),
    "unknown table": ("[pieces]", "[peices]", "line 42, peices", ('no key "peices"',)),
    "TOML": ("slots = 12", "slots =", "line 8", ("expected TOML",)),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_one_line_with_its_place(mistake: str) -> None:
    old, new, place, words = MISTAKES[mistake]
    text = sample()
    assert old in text
    with pytest.raises(InputError) as caught:
        model_text(parse_geometry(text.replace(old, new, 1), FILE))
    line = str(caught.value)
    assert line.startswith(f"drawing.toml: {place}")
    assert "\n" not in line
    for word in words:
        assert word in line


def test_pieces_too_small_to_weigh_anything_are_refused() -> None:
    text = (
        sample().replace("axial = 1", "axial = 20").replace('length = { value = 20, unit = "mm" }', "length = 0.00002")
    )
    with pytest.raises(InputError, match="pieces"):
        model_text(parse_geometry(text, FILE))


def test_other_materials_and_torque_as_input() -> None:
    text = sample().replace(
        'housing = "aluminium"', "housing = { conductivity = 5, density = 2000, specific_heat = 800 }"
    )
    text = text.replace('input = "current" ', 'input = "torque"\ntorque_constant = 0.09 ')
    made = model_text(parse_geometry(text.replace("mount = 2", "# mount = 2"), FILE))
    model = Model(parse_model(made, FILE).network)
    values = {parameter.name: parameter.value for parameter in model.parameters}
    assert "torque.motor" in model.inputs
    assert values["conductivity_axial.housing_z*"] == 5.0
    assert values["copper_loss.torque_constant.end_winding_*"] == 0.09
    assert not any("mount" in line for line in made.splitlines()[8:])


# --- the command -----------------------------------------------------------------------------------------------


def test_the_command_writes_a_drawing_and_makes_a_model_of_it(tmp_path: Path) -> None:
    for kind in ("inrunner", "outrunner"):
        drawing = tmp_path / f"{kind}.toml"
        with pytest.raises(SystemExit) as ended:
            main(["motor", "--sample", kind, "-o", str(drawing)])
        assert ended.value.code == 0
        with pytest.raises(SystemExit) as ended:
            main(["motor", str(drawing), "-o", str(tmp_path / "m.toml"), "--json", str(tmp_path / "m.json")])
        assert ended.value.code == 0
        made = Model(read_model_file(tmp_path / "m.toml").network)
        written = json.loads((tmp_path / "m.json").read_text())
        assert list(written["nodes"]) == made.nodes
        assert written["parameters"] == len(made.parameters)


def test_a_bad_drawing_is_one_line_and_nothing_is_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    drawing, made = tmp_path / "drawing.toml", tmp_path / "motor.toml"
    drawing.write_text(sample().replace("slots = 12", "slots = 80"))
    with pytest.raises(SystemExit) as ended:
        main(["motor", str(drawing), "-o", str(made)])
    assert ended.value.code == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not made.exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["drawing.toml", "-o", "drawing.toml"], "a file that is read"),
        (["drawing.toml", "--json", "./drawing.toml"], "a file that is read"),
        (["drawing.toml", "--sample", "outrunner"], "--sample"),
        (["--json", "model.json"], "--json"),
    ],
)
def test_options_that_would_destroy_or_do_nothing_are_refused(
    words: list[str], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("drawing.toml").write_text(sample())
    with pytest.raises(SystemExit) as ended:
        main(["motor", *words])
    assert ended.value.code == 2
    seen = capsys.readouterr()
    assert seen.out == ""
    assert seen.err.count("\n") == 1
    assert said in seen.err
    assert Path("drawing.toml").read_text() == sample()
    assert not Path("model.json").exists()
