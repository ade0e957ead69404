"""`lptn export`: the written file stands alone, and mistakes are one line."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from tests.cli.conftest import Lptn

MODEL = Path(__file__).parents[2] / "examples" / "tclab" / "two_heaters.toml"


def test_the_written_module_needs_numpy_alone(lptn: Lptn, tmp_path: Path) -> None:
    target, said = tmp_path / "heat.py", tmp_path / "said.json"
    status, out, _ = lptn("export", MODEL, "--to", "numpy", "--limit", "heater1=60", "-o", target, "--json", said)
    assert (status, out) == (0, f"Written: {target} (2 states, 3 inputs, 4 parameters).\n")
    assert json.loads(said.read_text())["standard_errors"] == 0
    script = """if True:
        import sys; sys.path.insert(0, sys.argv[1])
        import numpy, heat
        params = numpy.asarray(heat.VALUES)
        state = heat.step(heat.initial(params, 20.0), numpy.array([20.0, 1.0, 0.0]), params, 10.0)
        print(round(state.temperature[0], 6), *heat.LIMITED, *({"lptn", "casadi"} & set(sys.modules)))
    """
    done = subprocess.run([sys.executable, "-c", script, tmp_path], capture_output=True, text=True, check=True)
    # RK4 of one node: a tenth of its time constant of 100 s towards 20 K above the air.
    assert done.stdout.split() == [str(round(20 + 20 * (0.1 - 0.1**2 / 2 + 0.1**3 / 6 - 0.1**4 / 24), 6)), "heater1"]


def test_names_and_units_are_in_the_docstring(lptn: Lptn, tmp_path: Path) -> None:
    for to in ("jax", "torch", "numpy", "c"):
        target = tmp_path / f"heat.{to}"
        assert lptn("export", MODEL, "--to", to, "--limit", "60", "-o", target)[0] == 0
        text = target.read_text()
        for line in ("  1  power.heater1  W", "  0  capacity.heater*  5 J/K", "  1  heater2  60", "two_heaters.toml"):
            assert line in text


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            ("--to", "jax", "--limit", "knee=60"),
            'settings: limits."knee": found no such place; expected some of ',
        ),
        (("--to", "jax", "--limit", "warm"), "--limit: found 'warm'; expected degC or NODE=degC"),
        (("--to", "numba"), '"numba"'),
        ((), "--to"),
    ],
)
def test_mistakes_are_one_line_and_nothing_is_written(
    lptn: Lptn, tmp_path: Path, words: tuple[str, ...], said: str
) -> None:
    status, _, complaint = lptn("export", MODEL, *words, "-o", tmp_path / "heat.py")
    assert (status, len(complaint.splitlines())) == (2, 1)
    assert said in complaint
    assert not list(tmp_path.iterdir())
