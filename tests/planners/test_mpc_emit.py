"""The controller and the limiter as C programs: the same numbers as in Python."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from lptn.basics.arrays import FloatArray
from lptn.basics.c_library import compiler
from lptn.model.model import Model
from lptn.planners import Limiter, TorqueMPC
from tests.builders import effect, leg

needs_a_compiler = pytest.mark.skipif(compiler() is None, reason="no C compiler")
MODEL = Model(leg([effect("copper_loss"), effect("resistance_rise"), effect("torque_constant_drop")]))


def built(folder: Path, source: str, *options: str, main: str = "main.c") -> Path:
    """The program of a folder, every warning about it an error; several sources with spaces between."""
    words = [
        *(compiler() or ()),
        "-std=c99",
        "-Wall",
        "-Wextra",
        "-Wpedantic",
        "-Werror",
        *options,
        main,
        *source.split(),
        "-lm",
        "-o",
        "program",
    ]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return folder / "program"


def answered(program: Path, rows: FloatArray, *words: str) -> FloatArray:
    """What the program prints for lines of numbers."""
    lines = "\n".join(" ".join(repr(value) for value in row) for row in rows.tolist())
    done = subprocess.run([program, *words], input=lines, capture_output=True, text=True, check=True)
    return np.array([[float(word) for word in line.split()] for line in done.stdout.splitlines()])


@pytest.mark.long
@needs_a_compiler
@pytest.mark.parametrize("options", [("-O2", "-ftree-vectorize", "-ffp-contract=off"), ("-O0",), ("-O3",)])
def test_the_emitted_step_is_pythons(tmp_path: Path, options: tuple[str, ...]) -> None:
    limits = {"*": 60.0, "FR_hip": 58.0}
    mpc = TorqueMPC(MODEL, limits, request="torque", current_limits={"*": 40.0, "FR_calf": 15.0}, rates=2.0, stages=12)
    random, steps = np.random.default_rng(0), 40
    measured = random.uniform(45, 62, (steps, 3))
    measured[random.random(measured.shape) < 0.1] = np.nan
    request, ambient = random.uniform(-20, 20, (steps, 3)), random.uniform(20, 30, (steps, 1))
    mpc.emit(tmp_path, np.full(3, 50.0), request, ambient)
    answers = answered(built(tmp_path, "lptn_mpc.c", *options), np.hstack([measured, request, ambient]))
    mpc.reset()
    for row, *given in zip(answers, measured, request, ambient, strict=True):
        plan = mpc.step(*given)
        np.testing.assert_allclose(row[:3], plan.admitted, rtol=0, atol=1e-9)
        assert row[3] == plan.status
        assert row[4] == pytest.approx(plan.cost, abs=1e-9)


@pytest.mark.long
@needs_a_compiler
@pytest.mark.parametrize("power", [np.inf, 60.0])
def test_the_emitted_step_takes_a_preview_of_each_stage(tmp_path: Path, power: float) -> None:
    mpc = TorqueMPC(MODEL, 60.0, request="torque", stages=12, power_limit=power)
    random, steps = np.random.default_rng(1), 15
    measured = random.uniform(45, 62, (steps, 3))
    request, ambient = random.uniform(5, 20, (steps, 12, 3)), random.uniform(20, 30, (steps, 12, 1))
    if np.isfinite(power):  # W; then conditions hold the joints' speeds, too
        assert mpc.conditions[0] == "temperature.ambient"
        ambient = np.concatenate([ambient, random.uniform(-3, 3, (steps, 12, 3))], axis=2)
    mpc.emit(tmp_path, np.full(3, 50.0), request[:, 0], ambient[:, 0])
    lines = np.hstack([measured, request.reshape(steps, -1), ambient.reshape(steps, -1)])
    answers = answered(built(tmp_path, "lptn_mpc.c", "-O2", "-ffp-contract=off"), lines, "preview")
    mpc.reset()
    for row, *given in zip(answers, measured, request, ambient, strict=True):
        plan = mpc.step(*given)
        np.testing.assert_allclose(row[:3], plan.admitted, rtol=0, atol=1e-9)
        assert row[3] == plan.status


@pytest.mark.long
@needs_a_compiler
def test_the_emitted_example_runs(tmp_path: Path) -> None:
    mpc = TorqueMPC(MODEL, 60.0, request="torque")
    paths = mpc.emit(str(tmp_path), np.full(3, 50.0), np.full((5, 3), 9.0), np.full((5, 1), 25.0))
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(path.name for path in paths)
    program = built(tmp_path, "lptn_mpc.c", "-O1", "-fsanitize=undefined", "-fno-sanitize-recover")
    example = np.loadtxt(tmp_path / "example.txt", ndmin=2)
    assert answered(program, example).shape == (5, 5)
    assert (tmp_path / "names.txt").read_text().split("\n")[0] == "temperature.FR_hip [degC]"


WARN = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")
CALLER = """
#include "lptn_loop.h"
#include "settings.h"
#include "admissible.h"
static lptn_loop loop;
static lptn_mpc_state state;
static lptn_mpc_work work;
static lptn_mpc_result result;
static lptn_limiter_memory memory;
int main() {
    const double asked[3] = {9, 9, 9}, hot[3] = {59, 59, 59}, air[1] = {25};
    double scale[3], admissible[3 * LPTN_HORIZONS];
    lptn_loop_begin(&lptn_mpc_default, &loop, 5.0);
    for (int tick = 0; tick < 3; tick++) {
        lptn_loop_update(&loop, asked, asked, hot, air, scale);
        lptn_loop_think(&lptn_mpc_default, &loop, &state, &work, 0, 0, &result);
    }
    lptn_admissible(&memory, hot, asked, air, admissible);
    return scale[0] > 0 && scale[0] < 1 && admissible[0] > 0 ? 0 : 1;
}
"""


@pytest.mark.long
@needs_a_compiler
@pytest.mark.skipif(shutil.which("c++") is None, reason="no C++ compiler")
def test_every_emitted_source_compiles_on_its_own_and_a_program_in_cpp_calls_them(tmp_path: Path) -> None:
    """As a build that takes all `*.c` of a folder does, and the C++ node of a robot."""
    start, around = np.full(3, 50.0), np.full((1, 1), 25.0)
    TorqueMPC(MODEL, 60.0, request="torque").emit(tmp_path / "mpc", start, np.full((1, 3), 9.0), around)
    Limiter(MODEL, 60.0, request="torque").emit(tmp_path / "limiter", start, np.full(3, 9.0), around[0])
    for source in tmp_path.glob("*/*.c"):
        words = [*(compiler() or ()), "-std=c99", *WARN, "-O1", "-c", source.name]
        subprocess.run(words, cwd=source.parent, check=True)
    (tmp_path / "node.cpp").write_text(CALLER)
    objects = ["mpc/lptn_mpc.o", "mpc/lptn_loop.o", "limiter/admissible.o"]
    words = ["c++", "-std=c++11", *WARN, "-Impc", "-Ilimiter", "node.cpp", *objects, "-lm", "-o", "node"]
    subprocess.run(words, cwd=tmp_path, check=True)
    subprocess.run([tmp_path / "node"], check=True)


@pytest.mark.long
@needs_a_compiler
def test_the_emitted_limiter_is_pythons(tmp_path: Path) -> None:
    limiter = Limiter(MODEL, 60.0, request="torque", current_limits=40.0)
    random = np.random.default_rng(0)
    rows = np.hstack([random.uniform(40, 61, (20, 3)), random.uniform(0, 5, (20, 3)), np.full((20, 1), 25.0)])
    limiter.emit(tmp_path, rows[0, :3], rows[0, 3:6], rows[0, 6:])
    answers = answered(built(tmp_path, "admissible.c", "-O2", "-ffp-contract=off"), rows)
    for row, given in zip(answers, rows, strict=True):
        here = limiter.admissible(given[:3], given[3:6], given[6:])
        np.testing.assert_allclose(row, here.ravel(), rtol=0, atol=1e-9)
