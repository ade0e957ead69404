"""Parameters and systems as files of SSP: written, read back, and by the standard's own schemas."""

from __future__ import annotations

import shutil
from pathlib import Path
from zipfile import ZipFile

import fmpy.ssp
import numpy as np
import pandas as pd
import pytest
from fmpy.ssp.ssd import read_ssd
from lxml import etree
from scipy.integrate import solve_ivp

from lptn.basics.errors import InputError
from lptn.cli.main import main
from lptn.fmu import Connected, Session, cosimulate, export, read_values, write_system, write_values
from lptn.model.model import Model
from lptn.model.network import Network, NodeDeclaration
from lptn.robots.presets import presets
from tests.builders import effect, link, node
from tests.fmu.conftest import Build, network
from tests.fmu.truth import ZERO

SCHEMAS = Path(fmpy.ssp.__file__).parent / "schema"


@pytest.fixture(autouse=True)
def _trusted(built: Build) -> None:
    """The trust store in a folder of its own."""


def _run(*words: object) -> None:
    with pytest.raises(SystemExit) as stop:
        main([str(word) for word in words])
    assert stop.value.code == 0


def _valid(text: bytes, schema: str) -> None:
    etree.XMLSchema(file=str(SCHEMAS / f"SystemStructure{schema}.xsd")).assertValid(etree.fromstring(text))


# --- parameter values -----------------------------------------------------------------------------


@pytest.mark.long
def test_every_parameter_of_a_quadruped_goes_into_one_file_and_comes_back(tmp_path: Path) -> None:
    path = tmp_path / "quadruped.ssv"
    assert write_values(Model(network("quadruped")), path) == 147
    _valid(path.read_bytes(), "ParameterValues")
    exported = export(Model(network("quadruped")), tmp_path / "x.fmu", platforms=())
    starts = {variable.name: variable.start for variable in exported.component.of("parameter")}
    assert {name: value.value for name, value in read_values(path).items()} == starts


@pytest.mark.long
def test_values_of_a_fitted_model_make_its_fmu_of_the_nominal_one(tmp_path: Path) -> None:
    """To the last bit, although the native code is another model's."""
    text = presets()["leg"]
    nominal, fitted, values = (tmp_path / name for name in ("leg.toml", "fitted.toml", "fitted.ssv"))
    nominal.write_text(text)
    fitted.write_text(text.replace("capacity = 300", "capacity = 217.3").replace("0.15", "0.1713"))
    _run("fmu", nominal, "-o", tmp_path / "nominal.fmu")
    _run("fmu", fitted, "-o", tmp_path / "fitted.fmu", "--limit", "75")
    _run("fmu", fitted, "-o", values, "--limit", "75")
    ends = []
    for name, given in (("nominal", values), ("fitted", None), ("nominal", None)):
        with Session(tmp_path / f"{name}.fmu") as session:
            if given is not None:
                session.write({key: parameter.value for key, parameter in read_values(given).items()})
            session.inputs[1:] = 5.0
            for _ in range(100):
                session.step(1.0)
            ends.append(session.outputs.copy())
    assert (ends[0] == ends[1]).all()
    assert np.abs(ends[0] - ends[2]).max() > 0.1


@pytest.fixture
def log(tmp_path: Path) -> Path:
    n = 60
    table = pd.DataFrame(
        {"time": 2.0 * np.arange(n), "temperature.ambient": 22.0, "tau": 4.0, "still": 0.0, "T3": 22.0}
    )
    for joint in ("FR_hip", "FR_thigh", "FR_calf"):
        table[f"torque.{joint}"] = 4.0
        table[f"temperature.{joint}"] = 22.0
    path = tmp_path / "log.csv"
    table.to_csv(path, index=False)
    return path


@pytest.mark.long
def test_cosim_takes_values_from_a_file_in_any_unit(log: Path, built: Build, tmp_path: Path) -> None:
    path = tmp_path / "hot.ssv"
    head = '<ParameterSet xmlns="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0" name="hot">'
    entry = '<Parameter name="{}"><Real value="{}" unit="{}"/></Parameter>'
    inside = entry.format("FR_calf.capacity", 0.15, "kJ/K") + entry.format("FR_calf.temperature_limit", 60.0, "degC")
    path.write_text(f"{head}<Parameters>{inside}</Parameters></ParameterSet>")
    plain, hot = (cosimulate(built("leg").path, [log], parameters=file).runs[0] for file in (None, path))
    warming = [run.table["temperature.FR_calf"][-1] - 22.0 for run in (plain, hot)]
    assert warming[1] == pytest.approx(2 * warming[0], rel=0.1)
    scale = hot.table["torque_scale.FR_calf"][-1]
    assert scale == pytest.approx(np.clip((60.0 - (22.0 + warming[1])) / 10.0, 0, 1), abs=1e-9)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("FR_calf.capacity", "FR_tail.capacity"), "no such parameter"),
        (('unit="J/K"', 'unit="V"'), "can't be turned into"),
        (('value="300.0"', 'value="nan"'), "a number"),
        (("<ssv:ParameterSet", "<!DOCTYPE x><ssv:ParameterSet"), "document type"),
        (("</ssv:Parameters>", ""), "XML"),
        (("ParameterSet", "Else"), "ParameterSet"),
    ],
)
def test_values_that_cannot_be_used_give_a_line(
    change: tuple[str, str], said: str, log: Path, built: Build, tmp_path: Path
) -> None:
    path = tmp_path / "x.ssv"
    write_values(Model(network("leg")), path)
    path.write_text(path.read_text().replace(*change))
    with pytest.raises(InputError, match=said):
        cosimulate(built("leg").path, [log], parameters=path)


# --- systems --------------------------------------------------------------------------------------

TO_HOUSING, TO_AIR, WINDING, HOUSING = 2.0, 1.5, 40.0, 160.0  # K/W, J/K


def _pair() -> tuple[Network, Network]:
    """A winding and its housing, each a network of its own that takes the other's temperature as given."""
    air, case, coil = (NodeDeclaration(name, temperature=f"temperature.{name}") for name in ("air", "case", "coil"))
    motor = Network(
        "motor",
        (node("winding", WINDING), case),
        (link("winding", "case", TO_HOUSING),),
        (effect("copper_loss", "winding"),),
    )
    links = (link("housing", "coil", TO_HOUSING), link("housing", "air", TO_AIR))
    return motor, Network("body", (node("housing", HOUSING), coil, air), links)


CONNECTIONS = [
    ("motor.winding.temperature", "body.coil.temperature"),
    ("body.housing.temperature", "motor.case.temperature"),
]


@pytest.fixture(scope="module", params=[(2, 3), (3, 3)], ids=lambda fmi: f"{fmi[0]}and{fmi[1]}")
def fmus(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory, built: Build) -> dict[str, Path]:
    folder = tmp_path_factory.mktemp("pair")
    models = zip(("motor", "body"), _pair(), request.param, strict=True)
    return {name: export(Model(part), folder / f"{name}.fmu", fmi=fmi, step=0.25).path for name, part, fmi in models}


def _both(torque: float, seconds: float, held: float | None = None) -> np.ndarray:
    """Winding and housing as one model by SciPy [degC]; with the exchange held over `held` seconds, if given."""
    heat, state, time = 0.15 * (torque / 0.84) ** 2, np.full(2, 25.0), 0.0
    while time < seconds - 1e-9:
        step = seconds if held is None else held

        def rates(_: float, x: np.ndarray, other: np.ndarray | None = None if held is None else state) -> list[float]:
            seen = x if other is None else other
            winding = (heat - (x[0] - seen[1]) / TO_HOUSING) / WINDING
            return [winding, ((seen[0] - x[1]) / TO_HOUSING - (x[1] - 25.0) / TO_AIR) / HOUSING]

        state = solve_ivp(rates, (0.0, step), state, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
        time += step
    return state


@pytest.mark.long
@pytest.mark.parametrize("kind", ["ssd", "ssp"])
def test_two_connected_fmus_are_one_model(kind: str, fmus: dict[str, Path], tmp_path: Path) -> None:
    path = tmp_path / f"drive.{kind}"
    write_system(path, fmus, CONNECTIONS)
    for step in (20.0, 2.0):
        temperatures = _connected(path, step)
        assert np.abs(temperatures - _both(6.0, 60.0)).max() < 1e-9


def _connected(path: Path, step: float, held: bool = False) -> np.ndarray:
    """Winding and housing after a minute [degC]."""
    with Connected(path, held=held) as system:
        assert system.input_names == ["motor.winding.torque", "body.air.temperature"]
        system.inputs[:] = [6.0, 25.0 + ZERO]
        for _ in range(round(60.0 / step)):
            system.step(step)
        names = system.output_names
        rows = [names.index("motor.winding.temperature"), names.index("body.housing.temperature")]
        return np.asarray(system.outputs[rows] - ZERO)


@pytest.mark.long
def test_an_exchange_that_holds_costs_in_proportion_to_the_step(fmus: dict[str, Path], tmp_path: Path) -> None:
    path = tmp_path / "drive.ssd"
    write_system(path, fmus, CONNECTIONS)
    errors = []
    for step in (2.0, 1.0, 0.5):
        temperatures = _connected(path, step, held=True)
        assert np.abs(temperatures - _both(6.0, 60.0, held=step)).max() < 1e-9
        errors.append(np.abs(temperatures - _both(6.0, 60.0)).max())
    assert errors[1] / errors[0] == pytest.approx(0.5, abs=0.05)
    assert errors[2] / errors[1] == pytest.approx(0.5, abs=0.05)


def test_a_systems_file_is_what_the_standard_and_fmpy_read(fmus: dict[str, Path], tmp_path: Path) -> None:
    write_system(tmp_path / "drive.ssd", fmus, CONNECTIONS)
    write_system(tmp_path / "drive.ssp", fmus, CONNECTIONS)
    with ZipFile(tmp_path / "drive.ssp") as archive:
        for text in ((tmp_path / "drive.ssd").read_bytes(), archive.read("SystemStructure.ssd")):
            _valid(text, "Description")
        assert archive.read("resources/motor.fmu") == fmus["motor"].read_bytes()
    description = read_ssd(str(tmp_path / "drive.ssp"))
    drawn = description.system.connections
    pairs = {
        (f"{connection.startElement}.{connection.startConnector}", f"{connection.endElement}.{connection.endConnector}")
        for connection in drawn
    }
    assert pairs == set(CONNECTIONS)


@pytest.mark.long
def test_the_command_connects_fmus_and_drives_them_by_a_log(fmus: dict[str, Path], tmp_path: Path) -> None:
    n = 40
    table = pd.DataFrame({"time": np.arange(n), "temperature.air": 25.0, "torque.winding": 6.0})
    table["temperature.winding"] = [_both(6.0, float(k))[0] if k else 25.0 for k in range(n)]
    table.to_csv(tmp_path / "log.csv", index=False)
    path, outputs, target = tmp_path / "drive.ssd", tmp_path / "out.csv", tmp_path / "found.json"
    connect = [word for pair in CONNECTIONS for word in ("--connect", "=".join(pair))]
    _run("fmu", fmus["motor"], fmus["body"], "-o", path, *connect)
    _run("cosim", path, tmp_path / "log.csv", "-o", outputs, "--json", target)
    seen = pd.read_csv(outputs)
    assert seen["temperature.housing"].iloc[-1] == pytest.approx(_both(6.0, float(n))[1], abs=1e-6)
    assert '"motor.winding"' in target.read_text()
    done = cosimulate(path, [tmp_path / "log.csv"])
    assert done.all.rmse == pytest.approx(0.0, abs=1e-6)


def test_parameters_of_a_system_come_from_its_bindings(fmus: dict[str, Path], tmp_path: Path) -> None:
    path, values, names = tmp_path / "drive.ssd", tmp_path / "x.ssv", tmp_path / "x.ssm"
    write_system(path, fmus, CONNECTIONS)
    values.write_text(
        '<ParameterSet xmlns="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0" name="x">'
        '<Parameters><Parameter name="C"><Real value="40000" unit="mJ/K"/></Parameter></Parameters></ParameterSet>'
    )
    names.write_text(
        '<ssm:ParameterMapping xmlns:ssm="http://ssp-standard.org/SSP1/SystemStructureParameterMapping" '
        'xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon" version="1.0">'
        '<ssm:MappingEntry source="C" target="winding.capacity"><ssc:LinearTransformation factor="2"/>'
        "</ssm:MappingEntry></ssm:ParameterMapping>"
    )
    _valid(names.read_bytes(), "ParameterMapping")
    binding = (
        '<ssd:ParameterBindings><ssd:ParameterBinding source="x.ssv"><ssd:ParameterMapping source="x.ssm"/>'
        "</ssd:ParameterBinding></ssd:ParameterBindings></ssd:Component>"
    )
    path.write_text(path.read_text().replace("</ssd:Component>", binding, 1))
    _valid(path.read_bytes(), "Description")
    with Connected(path) as system:
        session = system._sessions["motor"]
        assert session.read(["winding.capacity"])[0] == pytest.approx(80.0)


NESTED = """<?xml version="1.0" encoding="UTF-8"?>
<ssd:SystemStructureDescription xmlns:ssc="http://ssp-standard.org/SSP1/SystemStructureCommon"
 xmlns:ssd="http://ssp-standard.org/SSP1/SystemStructureDescription"
 xmlns:ssv="http://ssp-standard.org/SSP1/SystemStructureParameterValues" version="1.0" name="nested">
<ssd:System name="nested">
 <ssd:Connectors>
  <ssd:Connector name="winding.torque" kind="input"><ssc:Real unit="kN*m"/></ssd:Connector>
  <ssd:Connector name="air.temperature" kind="input"><ssc:Real unit="degC"/></ssd:Connector>
  <ssd:Connector name="winding.temperature" kind="output"><ssc:Real unit="degC"/></ssd:Connector>
  <ssd:Connector name="C" kind="parameter"><ssc:Real unit="kJ/K"/></ssd:Connector>
 </ssd:Connectors>
 <ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>
  <ssv:ParameterSet version="1.0" name="v"><ssv:Parameters>
   <ssv:Parameter name="C"><ssv:Real value="20000" unit="mJ/K"/></ssv:Parameter>
   <ssv:Parameter name="drive.body.housing.capacity"><ssv:Real value="160"/></ssv:Parameter>
  </ssv:Parameters></ssv:ParameterSet>
 </ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>
 <ssd:Elements>
  <ssd:System name="drive">
   <ssd:Connectors>
    <ssd:Connector name="load" kind="input"><ssc:Real unit="N*m"/></ssd:Connector>
    <ssd:Connector name="room" kind="input"><ssc:Real/></ssd:Connector>
    <ssd:Connector name="coil" kind="output"><ssc:Real unit="K"/></ssd:Connector>
    <ssd:Connector name="C" kind="parameter"><ssc:Real unit="J/K"/></ssd:Connector>
   </ssd:Connectors>
   <ssd:Elements>
    <ssd:Component name="motor" source="motor.fmu"/>
    <ssd:Component name="body" source="body.fmu">
     <ssd:ParameterBindings><ssd:ParameterBinding><ssd:ParameterValues>
      <ssv:ParameterSet version="1.0" name="v"><ssv:Parameters>
       <ssv:Parameter name="housing.capacity"><ssv:Real value="1"/></ssv:Parameter>
      </ssv:Parameters></ssv:ParameterSet>
     </ssd:ParameterValues></ssd:ParameterBinding></ssd:ParameterBindings>
    </ssd:Component>
   </ssd:Elements>
   <ssd:Connections>
    <ssd:Connection startElement="motor" startConnector="winding.temperature"
     endElement="body" endConnector="coil.temperature"/>
    <ssd:Connection startElement="body" startConnector="housing.temperature"
     endElement="motor" endConnector="case.temperature"/>
    <ssd:Connection startConnector="load" endElement="motor" endConnector="winding.torque"/>
    <ssd:Connection startConnector="room" endElement="body" endConnector="air.temperature"/>
    <ssd:Connection startElement="motor" startConnector="winding.temperature" endConnector="coil"/>
    <ssd:Connection startConnector="C" endElement="motor" endConnector="winding.capacity">
     <ssc:LinearTransformation factor="2"/></ssd:Connection>
   </ssd:Connections>
  </ssd:System>
 </ssd:Elements>
 <ssd:Connections>
  <ssd:Connection startConnector="winding.torque" endElement="drive" endConnector="load"/>
  <ssd:Connection startConnector="air.temperature" endElement="drive" endConnector="room"/>
  <ssd:Connection startElement="drive" startConnector="coil" endConnector="winding.temperature"/>
  <ssd:Connection startConnector="C" endElement="drive" endConnector="C"/>
 </ssd:Connections>
</ssd:System>
<ssd:Units>
 <ssc:Unit name="degC"><ssc:BaseUnit K="1" offset="273.15"/></ssc:Unit>
 <ssc:Unit name="K"><ssc:BaseUnit K="1"/></ssc:Unit>
 <ssc:Unit name="N*m"><ssc:BaseUnit kg="1" m="2" s="-2"/></ssc:Unit>
 <ssc:Unit name="kN*m"><ssc:BaseUnit kg="1" m="2" s="-2" factor="1000"/></ssc:Unit>
 <ssc:Unit name="J/K"><ssc:BaseUnit kg="1" m="2" s="-2" K="-1"/></ssc:Unit>
 <ssc:Unit name="kJ/K"><ssc:BaseUnit kg="1" m="2" s="-2" K="-1" factor="1000"/></ssc:Unit>
</ssd:Units>
</ssd:SystemStructureDescription>
"""


@pytest.fixture
def nested(fmus: dict[str, Path], tmp_path: Path) -> Path:
    """Winding and housing as a system within a system, whose connectors have units of their own."""
    path = tmp_path / "nested.ssd"
    for name, file in fmus.items():
        shutil.copy(file, tmp_path / f"{name}.fmu")
    path.write_text(NESTED)
    return path


@pytest.mark.long
def test_a_system_within_a_system_is_driven_by_the_outer_ones_connectors(nested: Path, tmp_path: Path) -> None:
    """Units go with connectors: a log's N·m and degC; outer values come first, here C = 2 · 20 J/K, and 160 for 1."""
    _valid(NESTED.encode(), "Description")
    n = 40
    table = pd.DataFrame({"time": np.arange(n), "temperature.air": 25.0, "torque.winding": 6.0})
    truth = np.array([_both(6.0, float(k)) if k else np.full(2, 25.0) for k in range(n + 1)])
    table["temperature.winding"] = truth[:n, 0]
    table.to_csv(tmp_path / "log.csv", index=False)
    outputs, target = tmp_path / "out.csv", tmp_path / "found.json"
    _run("cosim", nested, tmp_path / "log.csv", "-o", outputs, "--json", target)
    (run,) = cosimulate(nested, [tmp_path / "log.csv"]).runs
    assert run.nodes == ("winding",)
    assert run.errors(0).max == pytest.approx(0.0, abs=1e-6)
    seen = pd.read_csv(outputs)
    assert np.abs(seen["temperature.winding"] - truth[1:, 0]).max() < 1e-6
    assert np.abs(seen["temperature.housing"] - truth[1:, 1]).max() < 1e-6
    with Connected(nested) as system:
        assert system.input_names == ["winding.torque", "air.temperature"]
        system.reset({"winding.temperature": 30.0})
        assert system._sessions["drive.motor"].read(["winding.temperature"])[0] == pytest.approx(30.0 + ZERO)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({'endElement="drive" endConnector="load"': 'endElement="motor" endConnector="load"'}, "one of drive"),
        ({'endConnector="room"': 'endConnector="load"'}, "one connection"),
        (
            {'<ssc:Unit name="N*m"><ssc:BaseUnit kg="1" m="2"': '<ssc:Unit name="N*m"><ssc:BaseUnit kg="1" m="1"'},
            "turned",
        ),
        ({'factor="2"/>': 'factor="0"/>'}, "factor of 0"),
        ({'s="-2" factor="1000"/>': 's="-2" factor="0"/>'}, "Units/.*a factor of 0"),
        ({'startConnector="load"': 'startConnector="laod"'}, 'start "drive.laod"'),
        ({'endConnector="load"': 'endConnector="lod"'}, 'end "drive.lod"'),
        ({'startConnector="C" endElement="drive"': 'startConnector="CC" endElement="drive"'}, 'start "CC"'),
        ({'name="load" kind="input"': 'name="load" kind="output"'}, 'end "drive.load"'),
        ({'name="coil" kind="output"': 'name="coil" kind="input"'}, 'start "drive.coil"'),
        ({'name="winding.torque" kind="input"': 'name="winding.torque" kind="output"'}, 'start "winding.torque"'),
        (
            {
                'startElement="motor" startConnector="winding.temperature" endConnector="coil"': 'startElement="body" '
                'startConnector="housing.temperature" endElement="body" endConnector="roof.temperature"'
            },
            "drive.coil, which nothing drives",
        ),
        (
            {
                'startElement="motor" startConnector="winding.temperature"\n': (
                    'startElement="motor" startConnector="case.temperature"\n'
                )
            },
            "an output of drive.motor",
        ),
        ({"drive.body.housing.capacity": "drive.bdy.housing.capacity"}, "drive.bdy.housing.capacity"),
        (
            {
                'startElement="motor" startConnector="winding.temperature" endConnector="coil"': (
                    'startConnector="load" endConnector="coil"'
                ),
                'startConnector="winding.torque"': 'startElement="drive" startConnector="coil"',
            },
            "not a circle",
        ),
    ],
)
def test_connectors_that_lead_nowhere_are_refused(changes: dict[str, str], said: str, nested: Path) -> None:
    text = NESTED
    for old, new in changes.items():
        assert old in text
        text = text.replace(old, new)
    nested.write_text(text)
    with pytest.raises(InputError, match=said):
        Connected(nested)


@pytest.mark.parametrize(
    ("connection", "said"),
    [
        (("motor.winding.temperature", "body.roof.temperature"), "an input of body"),
        (("motor.winding.torque", "body.coil.temperature"), "an output of motor"),
        (("motor.winding.torque_scale", "body.coil.temperature"), "the same unit"),
        (("arm.winding.temperature", "body.coil.temperature"), "component.variable"),
    ],
)
def test_what_cannot_be_connected_is_said(connection: tuple[str, str], said: str, tmp_path: Path) -> None:
    models = zip(("motor", "body"), _pair(), strict=True)
    fmus = {name: export(Model(part), tmp_path / f"{name}.fmu", platforms=()).path for name, part in models}
    with pytest.raises(InputError, match=said):
        write_system(tmp_path / "x.ssd", fmus, [connection])
    with pytest.raises(InputError, match="one connection"):
        write_system(tmp_path / "x.ssd", fmus, [CONNECTIONS[0], CONNECTIONS[0]])
    assert not (tmp_path / "x.ssd").exists()


def test_a_forecast_cannot_be_connected(tmp_path: Path, built: Build) -> None:
    path = tmp_path / "x.ssd"
    fmu = built("leg", forecast=True).path
    write_system(path, {"leg": fmu}, [])
    start = '<ssd:Connection startElement="leg" startConnector="FR_calf.time_to_limit" endConnector="when"/>'
    shown = '<ssd:Connectors><ssd:Connector name="when" kind="output"/></ssd:Connectors><ssd:Elements>'
    text = path.read_text().replace("<ssd:Elements>", shown, 1)
    path.write_text(text.replace("</ssd:System>", f"<ssd:Connections>{start}</ssd:Connections></ssd:System>"))
    with pytest.raises(InputError, match="no forecast"):
        Connected(path)


def test_a_unit_of_nothing_is_refused(fmus: dict[str, Path], tmp_path: Path) -> None:
    """Which would have counted as the base unit."""
    with ZipFile(fmus["motor"]) as archive, ZipFile(tmp_path / "motor.fmu", "w") as target:
        for name in archive.namelist():
            content = archive.read(name)
            if name == "modelDescription.xml":
                assert b'<BaseUnit kg="1" m="2" s="-2"' in content
                content = content.replace(b'<BaseUnit kg="1" m="2" s="-2"', b'<BaseUnit factor="0" kg="1" m="2" s="-2"')
            target.writestr(name, content)
    with pytest.raises(InputError, match="a factor of 0"):
        write_system(tmp_path / "x.ssd", fmus | {"motor": tmp_path / "motor.fmu"}, CONNECTIONS)


def test_a_system_of_foreign_fmus_is_not_run_without_trust(fmus: dict[str, Path], tmp_path: Path) -> None:
    foreign = tmp_path / "foreign.fmu"
    shutil.copy(fmus["body"], foreign)
    with ZipFile(foreign, "a") as archive:
        archive.writestr("extra/note.txt", "changed")
    write_system(tmp_path / "x.ssp", fmus | {"body": foreign}, CONNECTIONS)
    with pytest.raises(InputError, match="--trust"):
        Connected(tmp_path / "x.ssp")
    Connected(tmp_path / "x.ssp", trust=True).close()


# --- any FMU, by the names of its own variables ---------------------------------------------------


def test_columns_are_mapped_to_the_variables_of_any_fmu(log: Path, built: Build, tmp_path: Path) -> None:
    """The names of columns that the FMU knows nothing of; a measured column that its output is compared with."""
    fmu, target = tmp_path / "any.fmu", tmp_path / "out.csv"
    shutil.copy(built("leg").path, fmu)
    joints = ("FR_hip", "FR_thigh", "FR_calf")
    words = [f"{joint}.torque=torque.{'motor' if joint == 'FR_calf' else 'rest'}" for joint in joints]
    words += [
        "torque.motor=tau",
        "torque.rest=still",
        "FR_calf.temperature=temperature.case",
        "temperature.case=T3[degC]",
    ]
    _run("cosim", fmu, log, "--trust", "-o", target, *(word for pair in words for word in ("--map", pair)))
    table = pd.read_csv(target)
    assert table["temperature.case"].iloc[-1] > 23.0  # alone it gives torque
    assert table["temperature.FR_hip"].iloc[-1] < 22.1
