"""A learned heat: a curve that never falls, none at zero, a loss over its own temperature; never a name."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from lptn.basics.errors import InputError
from lptn.diagnose.candidates import candidates
from lptn.effects.learned_heat import PIECES, LearnedHeat
from lptn.model.file import added, read_model_file
from tests.builders import leg

DRIVEN = [word for word in LearnedHeat.options["input"] if word != "own_temperature"]
MODEL = """
[model]
name = "motor"
ambient = "temperature.ambient"
[nodes.motor]
capacity = 300
[[links]]
between = ["motor", "ambient"]
resistance = 2
"""


def _heat(word: str, values: FloatArray, rises: FloatArray, *, start: float = 0.0, span: float = 6.0) -> FloatArray:
    p = SimpleNamespace(scale=2.0, start=start, span=span, **{f"rise_{k + 1}": rise for k, rise in enumerate(rises)})
    return np.asarray(LearnedHeat(input=word).heat(values, SimpleNamespace(**{word: values}), p))


@pytest.mark.parametrize("word", DRIVEN)
def test_over_a_speed_or_a_load_it_is_zero_at_zero_and_never_falls(word: str) -> None:
    rises = np.random.default_rng(1).exponential(size=PIECES)
    values = np.linspace(0.0, 12.0, 400)
    heat = _heat(word, values, rises)
    assert heat[0] == pytest.approx(0.0, abs=1e-12)
    assert (np.diff(heat) > 0).all()  # beyond the log too, along its last piece
    np.testing.assert_allclose(_heat(word, -values, rises), heat)
    assert heat[values.searchsorted(6.0)] == pytest.approx(2.0 * rises.sum(), rel=0.05)


def test_over_its_own_temperature_it_is_a_loss_that_stays_beyond_the_log() -> None:
    heat = _heat("own_temperature", np.linspace(-20.0, 150.0, 400), np.ones(PIECES), start=20.0, span=40.0)
    assert (np.diff(heat) <= 1e-12).all()
    cold, start, hot, hottest = _heat(
        "own_temperature", np.array([10.0, 20.0, 60.0, 150.0]), np.ones(PIECES), start=20.0, span=40.0
    )
    assert abs(start) < 1e-9
    assert abs(cold) < 0.2
    assert hottest == pytest.approx(hot, abs=0.2) == pytest.approx(-2.0 * PIECES, abs=0.4)


def test_even_rises_over_temperature_are_a_line() -> None:
    values = np.linspace(25.0, 55.0, 50)
    heat = _heat("own_temperature", values, np.full(PIECES, 0.5), start=20.0, span=40.0)
    np.testing.assert_allclose(heat, -PIECES * (values - 20.0) / 40.0, atol=0.06)


def test_it_is_never_looked_for_as_a_name() -> None:
    columns = [f"{word}.FR_{joint}" for word in ("velocity", "torque") for joint in ("hip", "thigh", "calf")]
    assert LearnedHeat.key not in {one.effect.key for one in candidates(leg(), columns)}


def test_it_is_added_as_it_is_set_and_read_again(tmp_path: Path) -> None:
    (path := tmp_path / "model.toml").write_text(MODEL)
    settings: dict[str, str | float] = {"input": "power", "span": "6.5", "scale": 4.0}
    added(read_model_file(path), LearnedHeat.key, "motor", settings=settings).write(path)
    network = read_model_file(path).network
    assert network.effects[0].effect.chosen == {"input": "power"}
    values = {parameter.name: parameter for parameter in network.parameters}
    assert values["learned_heat.span.motor"].value == 6.5
    assert values["learned_heat.scale.motor"].value == 4.0
    assert values["learned_heat.rise_1.motor"].declared.prior == (0.0, 1.0)
    assert [one.name.split(".")[1] for one in network.parameters if one.free and "learned" in one.name] == [
        f"rise_{number}" for number in range(1, PIECES + 1)
    ]


@pytest.mark.parametrize(
    ("setting", "expected"),
    [
        ({"input": "sound"}, "own_temperature"),
        ({"spam": "1"}, "driven_by"),
        ({"span": "long"}, "a number"),
        ({"span": "-1"}, "lower bound"),
        ({"scale": "nan"}, "lower bound"),
    ],
)
def test_what_it_does_not_have_is_refused_in_a_line(
    tmp_path: Path, setting: dict[str, str | float], expected: str
) -> None:
    (path := tmp_path / "model.toml").write_text(MODEL)
    with pytest.raises(InputError, match=expected) as refused:
        added(read_model_file(path), LearnedHeat.key, "motor", settings=setting)
    assert "\n" not in str(refused.value)
