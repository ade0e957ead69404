"""FMUs and systems of others: what they hold is counted before it is unpacked, and nothing leads out of an archive."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

import pytest

from lptn.basics.bounds import Bound
from lptn.basics.errors import InputError
from lptn.fmu import export
from lptn.fmu.archive import Unpacked
from lptn.fmu.connected import Connected
from lptn.fmu.ssp import opened_system
from lptn.model.file import parse_model
from lptn.robots.presets import presets

QUICKLY = 5.0  # s on a busy machine
_SSP = "http://ssp-standard.org/SSP1/SystemStructure"


def zipped(path: Path, entries: Mapping[str, str | bytes]) -> Path:
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        for name, content in entries.items():
            archive.writestr(name, content)
    return path


def described(*dimensions: int, variables: int = 1) -> str:
    """An FMU's description with arrays of so many dimensions."""
    sizes = "".join(f'<Dimension start="{size}"/>' for size in dimensions)
    each = '<Float64 name="v{0}" valueReference="{0}" causality="input" start="0">{1}</Float64>'
    arrays = "".join(each.format(number, sizes) for number in range(variables))
    return (
        '<fmiModelDescription fmiVersion="3.0" modelName="m" instantiationToken="t"><CoSimulation modelIdentifier="m"/>'
        f"<ModelVariables>{arrays}</ModelVariables><ModelStructure/></fmiModelDescription>"
    )


@pytest.mark.parametrize(
    ("dimensions", "variables", "said"),
    [
        ((20_000_000,), 1, "20,000,000 variables"),
        ((10**12,), 1, "1,000,000,000,000 variables"),
        ((10_000, 10_000), 1, "100,000,000 variables"),
        ((50_000,), 3, "150,000 variables"),
        ((-3,), 1, "a dimension of -3"),
    ],
)
def test_arrays_are_counted_before_they_are_taken_apart(
    dimensions: tuple[int, ...], variables: int, said: str, tmp_path: Path
) -> None:
    path = zipped(tmp_path / "x.fmu", {"modelDescription.xml": described(*dimensions, variables=variables)})
    begun = time.monotonic()
    with pytest.raises(InputError, match=said):
        Unpacked(path, trust=True)
    assert time.monotonic() - begun < QUICKLY
    unpacked = Unpacked(zipped(path, {"modelDescription.xml": described(20, 30)}), trust=True)
    assert len(unpacked.variables) == 600
    unpacked.close()


@pytest.mark.parametrize(
    ("model", "said"),
    [
        (b"# x\n" * 1_000_000, "4,000,000 bytes; expected at most 500,000"),
        (b"\xff\xfe[model]", "bytes that are not UTF-8 text"),
        (b"\0" * 2_000_000, "2,000,000 bytes"),
        (b" " * 200_000_000, "200,000,000 bytes"),
    ],
)
def test_a_model_inside_is_a_text_that_a_person_can_edit(model: bytes, said: str, tmp_path: Path) -> None:
    entries: dict[str, str | bytes] = {"modelDescription.xml": described(2), "resources/model.toml": model}
    unpacked = Unpacked(zipped(tmp_path / "x.fmu", entries), trust=True)
    begun = time.monotonic()
    with pytest.raises(InputError, match=said):
        assert unpacked.model_text
    assert time.monotonic() - begun < QUICKLY
    unpacked.close()


@pytest.mark.parametrize(
    ("entries", "said"),
    [
        ({"modelDescription.xml": described(2) + " " * 60_000_000}, "60,000,[0-9]+ bytes"),
        ({"modelDescription.xml": described(2), "resources/zeros": bytes(3 << 20)}, "unpacked: found 3,[0-9,]+ bytes"),
        ({"modelDescription.xml": described(2), **{f"a{k}": bytes(1 << 20) for k in range(3)}}, "unpacked: found 3,"),
    ],
)
def test_what_unpacks_to_more_than_any_fmu_is_refused(
    entries: dict[str, str | bytes], said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    if len(entries) > 1:
        monkeypatch.setattr("lptn.fmu.archive.ARCHIVE", Bound(1 << 21, "bytes"))
    with pytest.raises(InputError, match=said):
        Unpacked(zipped(tmp_path / "x.fmu", entries), trust=True)


# --- systems ------------------------------------------------------------------------------------------------


def system(*sources: str, names: list[str] | None = None, inside: str = "") -> str:
    """A system of the FMUs at some addresses."""
    named = names or [f"c{number}" for number in range(len(sources))]
    parts = "".join(
        f'<ssd:Component name="{name}" source="{source}">{inside}</ssd:Component>'
        for name, source in zip(named, sources, strict=True)
    )
    return (
        f'<ssd:SystemStructureDescription xmlns:ssd="{_SSP}Description" version="1.0" name="s">'
        f'<ssd:System name="s"><ssd:Elements>{parts}</ssd:Elements></ssd:System></ssd:SystemStructureDescription>'
    )


def packed(folder: Path, text: str) -> Path:
    fmu = zipped(folder / "one.fmu", {"modelDescription.xml": described(2)})
    return zipped(folder / "x.ssp", {"SystemStructure.ssd": text, "resources/one.fmu": fmu.read_bytes()})


OUTSIDE = [
    "../../outside.fmu",
    "%2e%2e/%2E%2e/outside.fmu",
    "resources/../../outside.fmu",
    "..%2foutside.fmu",
    "..",
    "x/%2e%2e/%2e%2e/outside.fmu",
]


@pytest.mark.parametrize("source", OUTSIDE)
def test_no_source_of_an_archive_leads_out_of_it(source: str, tmp_path: Path) -> None:
    binding = f'<ssd:ParameterBindings><ssd:ParameterBinding source="{source}"/></ssd:ParameterBindings>'
    for text in (system(source), system("resources/one.fmu", inside=binding)):
        with (
            pytest.raises(InputError, match="leads out of the archive"),
            opened_system(packed(tmp_path, text)),
        ):
            pass
    with opened_system(packed(tmp_path, system("resources/../resources/one.fmu"))) as structure:
        assert [file.is_file() for file in structure.components.values()] == [True]


@pytest.mark.parametrize(
    ("text", "place"),
    [
        (system("resources"), "resources"),
        (system("SystemStructure.ssd"), "SystemStructure.ssd"),
        (system("resources/two.fmu"), "resources/two.fmu"),
        (system("resources/one.fmu", inside='<ssd:ParameterBindings><ssd:ParameterBinding source="x.ssv"/>'
                '</ssd:ParameterBindings>'), "x.ssv"),
        ("<a", "SystemStructure.ssd"),
    ],
)  # fmt: skip
def test_what_is_wrong_within_an_archive_is_said_of_it_and_not_of_where_it_was_unpacked(
    text: str, place: str, tmp_path: Path
) -> None:
    path = packed(tmp_path, text)
    with pytest.raises(InputError) as said:
        Connected(path, trust=True)
    assert str(said.value).startswith(f"{path}: {place}, ")


@pytest.mark.parametrize("source", ["", "x.fmu%00", "/etc/passwd", "file:///etc/passwd", "http://host/x.fmu"])
def test_a_source_that_is_no_path_beside_the_file_is_refused(source: str, tmp_path: Path) -> None:
    (tmp_path / "x.ssd").write_text(system(source))
    for path in (packed(tmp_path, system(source)), tmp_path / "x.ssd"):
        with pytest.raises(InputError, match="a path relative to the file"), opened_system(path):
            pass


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (system(), "no component"),
        (system("one.fmu", "one.fmu", names=["a", "a"]), "a name twice"),
        (system(*["one.fmu"] * 101), "101 FMUs; expected at most 100"),
        (system(*["one.fmu"] * 5000), "5,000 FMUs"),
        (system(*["one.fmu"] * 40), "Elements, unpacked: found 1[0-9],[0-9]+ bytes"),
    ],
)
def test_a_system_holds_some_fmus_and_not_too_many(
    text: str, said: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("lptn.fmu.ssp.ARCHIVE", Bound(10_000, "bytes"))
    zipped(tmp_path / "one.fmu", {"modelDescription.xml": described(2)})
    (tmp_path / "x.ssd").write_text(text)
    with pytest.raises(InputError, match=said), opened_system(tmp_path / "x.ssd"):
        pass


# --- names -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "identifier"),
    [
        ("x" * 240, "x" * 240),
        ("a/b", "a_b"),
        ("../../up", "up"),
        ("", "model"),
        ("\N{FIRE}" * 70, "model"),
        ("7 of 9", "model_7_of_9"),
        ("*/ #error", "error"),
        ("'\\\"", "model"),
        ("x" * 241, None),
        ("leg" * 85, None),
        ("7" * 240, None),
    ],
)
def test_a_models_name_becomes_that_of_a_library_or_is_too_long(
    name: str, identifier: str | None, tmp_path: Path
) -> None:
    written = name.replace("\\", "\\\\").replace('"', '\\"')
    file = parse_model(presets()["single-motor"].replace('"single motor"', f'"{written}"'), Path("model.toml"))
    if identifier is None:
        with pytest.raises(InputError, match=r"model.name: found [0-9]+ characters; expected at most 240"):
            export(file, tmp_path / "x.fmu", platforms=())
        return
    path = export(file, tmp_path / "x.fmu", platforms=()).path
    unpacked = Unpacked(path, trust=True)
    assert unpacked.description.coSimulation.modelIdentifier == identifier
    unpacked.close()
