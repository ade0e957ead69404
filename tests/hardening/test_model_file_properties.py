"""A model file that is written again keeps every line of its author; a spoilt one is read, or refused in one line."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from lptn.basics.errors import InputError
from lptn.model.file import ModelFile, added, parse_model
from lptn.model.tables import FitTable, FittedTable
from tests.hardening.fuzz import run
from tests.hardening.model_target import ALL, models
from tests.hardening.targets import TARGETS

PATH = Path("model.toml")
COMMENTS = st.text(st.characters(exclude_categories=("Cc", "Cs", "Zl", "Zp")), max_size=20)
SEEDS: Mapping[str, bytes] = models()


@st.composite
def laid_out(draw: st.DrawFn) -> str:
    """A good model file with comments, blank lines and blanks where a person might put them."""
    lines = []
    for line in SEEDS[draw(st.sampled_from(sorted(SEEDS)))].decode().splitlines():
        if draw(st.integers(0, 5)) == 0 and line and not line.lstrip().startswith(("]", '"""')):
            line += draw(st.sampled_from(["  ", "\t"])) + "# " + draw(COMMENTS)
        lines += [line] * (line != "" or draw(st.booleans()))
        lines += [f"# {draw(COMMENTS)}", "", "   "][: draw(st.integers(0, 3))] if draw(st.integers(0, 9)) == 0 else []
    return "\n".join(lines) + "\n"


def _fitted(file: ModelFile) -> ModelFile:
    chosen = {
        parameter.name: FittedTable(value=parameter.value, error=0.1) for parameter in file.network.parameters[:3]
    }
    return file.with_fit(FitTable(rmse=0.5, status="converged", warnings=["one", "two"], parameters=chosen))


def _in_order(lines: list[str], text: str) -> bool:
    """Whether all lines stand in the text, in their order."""
    rest = iter(text.split("\n"))
    return all(line in rest for line in lines)


def _without_fit(text: str) -> list[str]:
    """The author's lines: all but those of `[fit]` and of the parameters to which a fit gives values."""
    lines = text.partition("\n[fit]")[0].rstrip("\n").split("\n")
    return [line for line in lines if not line.startswith(("capacity", "resistance", "conductivity", "temperature ="))]


def _comments(text: str) -> list[str]:
    """The author's comments at the ends of lines, which a fit keeps."""
    lines = text.partition("\n[fit]")[0].split("\n")
    return [line.partition("# ")[2] for line in lines if line.startswith("capacity") and line.count("#") == 1]


@settings(max_examples=12)
@given(laid_out(), st.booleans())
def test_writing_a_fit_or_an_effect_keeps_every_line(text: str, twice: bool) -> None:
    file = parse_model(text, PATH)
    fitted = _fitted(file)
    assert _in_order(_without_fit(text), fitted.text)
    assert all(comment in fitted.text for comment in _comments(text))
    values = {parameter.name: parameter.value for parameter in fitted.network.parameters}
    for parameter in file.network.parameters:
        assert values[parameter.name] == pytest.approx(parameter.value, rel=1e-5)
    more = added(fitted, "sensor_offset", fitted.network.dynamic[-1])
    assert _in_order(_without_fit(text), more.text)
    assert more.network.dynamic == file.network.dynamic
    again = _fitted(_fitted(more)) if twice else _fitted(more)
    assert again.text.count("[fit]") == 1
    assert again.text == _fitted(again).text


def test_every_table_that_a_file_may_have_survives() -> None:
    file = parse_model(ALL, PATH)
    again = parse_model(added(_fitted(file), "radiation", "*_calf").text, PATH)
    assert again.columns == file.columns
    assert again.step == file.step
    assert [instance.name for instance in again.network.effect_instances][: len(file.network.effect_instances)] == [
        instance.name for instance in file.network.effect_instances
    ]


def _parse(text: str) -> None:
    said = ""
    try:
        parse_model(text, PATH)
    except InputError as error:
        said = str(error)
    assert said.isprintable()


@pytest.mark.long
@settings(max_examples=80)
@given(st.text(max_size=60) | st.binary(max_size=60).map(lambda content: content.decode("latin-1")))
def test_any_text_is_a_model_or_refused_in_one_line(text: str) -> None:
    _parse(text)


VALUES = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=8),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=8), inner, max_size=3),
    max_leaves=6,
)


@settings(max_examples=60)
@given(st.data())
def test_any_value_in_any_place_is_read_or_refused_in_one_line(data: st.DataObject) -> None:
    import tomlkit

    content = tomlkit.parse(ALL).unwrap()
    place = content
    while True:
        key = data.draw(st.sampled_from(sorted(place) if isinstance(place, dict) else range(len(place))))
        if not isinstance(place[key], dict | list) or not place[key] or data.draw(st.booleans()):
            break
        place = place[key]
    value = data.draw(VALUES.filter(lambda drawn: drawn is not None))
    place[key] = value
    try:
        text = tomlkit.dumps(content)
    except (TypeError, ValueError, AttributeError):
        return  # a value that TOML has no way to say
    _parse(text)


CASES = {
    "model": 80,
    "study": 120,
    "task": 15,
    "drawing": 40,
    "calibration": 60,
    "log": 120,
    "fmu": 40,
    "command": 10,
}


@pytest.mark.long
@pytest.mark.parametrize("what", TARGETS)
def test_a_short_run_of_the_fuzzer_finds_nothing(what: str) -> None:
    tally = run(what, seed=0, cases=CASES[what])
    assert not tally.exceptions, "\n".join([*tally.exceptions, *tally.details.values()])
    assert tally.refused
    assert tally.read
