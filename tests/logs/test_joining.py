"""Two logs of one run with clocks of their own: joined on the onset of heating, or refused where there is none."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy.integrate import solve_ivp

from lptn.logs.columns import ColumnSource, parse_columns
from lptn.logs.reading import read_log

Refuse = Callable[..., str]
EXAMPLES = Path(__file__).parents[2] / "examples" / "bldc_stators"


def warmed(time: np.ndarray, heat: Callable[[float], float], winding: float = 60.0) -> np.ndarray:
    """Winding and housing of a motor under a heat [W], by scipy: temperatures of the winding, degC."""

    def rates(t: float, x: np.ndarray) -> list[float]:
        across = (x[0] - x[1]) / 1.5
        return [(heat(t) - across) / winding, (across - (x[1] - 22.0) / 8.0) / 300.0]

    solution = solve_ivp(rates, (float(time[0]), float(time[-1])), [22.0, 22.0], t_eval=time, max_step=0.5, rtol=1e-7)
    return np.asarray(solution.y[0])


def files(folder: Path, shift: float, *, rest: float = 40.0, noise: float = 0.05, seed: int = 0) -> tuple[Path, Path]:
    """Temperatures at 2 Hz by one clock; a swinging torque at 50 Hz by another that is `shift` s behind it."""
    rng = np.random.default_rng(seed)
    time = np.arange(0.0, 400.0, 0.5)

    def torque(t: float) -> float:
        return float((t > rest) * 10 * np.abs(np.sin(9 * t)) * (1 if t < 250 else 0.3))

    temperature = warmed(time, lambda t: 0.6 * torque(t) ** 2) + rng.normal(0, noise, time.size)
    pd.DataFrame({"clock": time, "T": temperature}).to_csv(folder / "warm.csv", index=False)
    fast = np.arange(max(0.0, shift), 380.0, 0.02)
    table = {"t_ms": (fast - shift) * 1000, "tau": [torque(t) for t in fast]}
    pd.DataFrame(table).to_csv(folder / "moved.csv", index=False)
    return folder / "warm.csv", folder / "moved.csv"


COLUMNS = {
    "time": ColumnSource(("clock",)),
    "time.2": ColumnSource(("t_ms",), "ms"),
    "temperature.motor": ColumnSource(("T",)),
    "torque.motor": ColumnSource(("tau",)),
}


def said_shift(notes: tuple[str, ...]) -> tuple[float, float]:
    """Shift and its error as a note says them, s."""
    (note,) = (note for note in notes if "set forward by" in note)
    shift, _, error = note.partition("set forward by ")[2].partition(" s")[0].partition(" ± ")
    return float(shift), float(error)


@pytest.mark.parametrize(("shift", "seed"), [(12.4, 1), (-33.3, 2), (0.0, 3)])
def test_the_shift_is_found_within_its_error(tmp_path: Path, shift: float, seed: int) -> None:
    warm, moved = files(tmp_path, shift, seed=seed)
    (run,) = read_log(f"{warm}+{moved}", COLUMNS, step=1.0)
    estimate, error = said_shift(run.notes)
    assert 0.1 < error < 2.0
    assert abs(estimate - shift) < 3 * error
    assert run.name == "warm"
    # Mixed rates: RMS of the fast torque, mean of the slow temperature, on one clock.
    hot = run.columns["torque.motor"][(run.time > 60) & (run.time < 240)]
    assert hot.mean() == pytest.approx(10 / np.sqrt(2), rel=0.02)
    assert run.temperature("motor")[-1] > 30


def test_the_other_way_round_the_shift_turns_its_sign(tmp_path: Path) -> None:
    warm, moved = files(tmp_path, 12.4)
    swapped = COLUMNS | {"time": COLUMNS["time.2"], "time.2": COLUMNS["time"]}
    (run,) = read_log(f"{moved}+{warm}", swapped, step=1.0)
    estimate, error = said_shift(run.notes)
    assert abs(estimate + 12.4) < 3 * error


def test_real_logs_cut_in_two(tmp_path: Path) -> None:
    """The stator of the example; its NOTICE says that its own alignment is off by about a second."""
    for number in (1, 3, 5):
        table = pd.read_csv(EXAMPLES / f"Run{number}.csv")
        table[["time_s", "T_winding", "T_body", "T_ambient"]].to_csv(tmp_path / "warm.csv", index=False)
        power = table[["time_s", "power_W"]].assign(time_s=table["time_s"] - 17.0)
        power.to_csv(tmp_path / "power.csv", index=False)
        columns = {"time": "time_s", "temperature.winding": "T_winding", "power.winding": "power_W"}
        (run,) = read_log(tmp_path / "warm.csv+power.csv", parse_columns(columns, "m.toml", "[columns]"))
        estimate, error = said_shift(run.notes)
        assert error < 1.5
        assert abs(estimate - 17.0) < 1.5


def test_a_shift_that_the_user_knows(tmp_path: Path) -> None:
    warm, moved = files(tmp_path, 12.4)
    (run,) = read_log(f"{warm}+{moved}@12.4", COLUMNS, step=1.0)
    assert "moved.csv: its clock set forward by 12.4 s, as given." in run.notes
    on = run.time[int((run.columns["torque.motor"] > 1).argmax())]
    assert on == pytest.approx(40.0, abs=1.0)


@pytest.mark.parametrize(
    ("rest", "shift", "why"), [(-1.0, 0.0, "the heat is on from the first row"), (500.0, 0.0, "no heat")]
)
def test_without_an_onset_nothing_is_guessed(
    tmp_path: Path, refuse: Refuse, rest: float, shift: float, why: str
) -> None:
    path = "+".join(map(str, files(tmp_path, shift, rest=rest)))
    said = refuse(path, read_log, path, COLUMNS)
    assert f"join: found no onset of heating to align on ({why})" in said
    assert f"{path}@SECONDS" in said


def test_a_temperature_that_does_not_follow(tmp_path: Path, refuse: Refuse) -> None:
    warm, moved = files(tmp_path, 5.0)
    table = pd.read_csv(warm)
    table.assign(T=22 + 0.01 * table["clock"]).to_csv(warm, index=False)
    refuse(f"{warm}+{moved}", read_log, f"{warm}+{moved}", COLUMNS)
    table.assign(T=22.0).to_csv(warm, index=False)
    assert "no temperature rises" in refuse(f"{warm}+{moved}", read_log, f"{warm}+{moved}", COLUMNS)


def test_a_missing_time_is_named_by_its_file(tmp_path: Path, refuse: Refuse) -> None:
    warm, moved = files(tmp_path, 5.0)
    path = f"{warm}+{moved}"
    columns = {key: source for key, source in COLUMNS.items() if key != "time.2"}
    assert "column time.2: found no such column" in refuse(moved, read_log, path, columns)
    columns["time.2"] = ColumnSource(("t_ms",))
    said = refuse(moved, read_log, path, columns)
    assert '"time.2" = { column = "t_ms", unit = "ms" }' in said
    assert '--map "time.2=t_ms[ms]"' in said


def test_paths_that_can_not_be_joined(tmp_path: Path, refuse: Refuse) -> None:
    warm, moved = files(tmp_path, 5.0)
    path = f"{warm}+{moved}+{moved}"
    assert "more than two logs" in refuse(path, read_log, path, COLUMNS)
    missing = tmp_path / "none.csv"
    assert "no such file" in refuse(missing, read_log, f"{warm}+{missing}", COLUMNS)
    missing = tmp_path / "run+1" / "log.csv"
    assert "no such file" in refuse(missing, read_log, missing, COLUMNS)


def test_a_file_with_a_plus_in_its_name_is_one_log(tmp_path: Path) -> None:
    path = tmp_path / "a+b.csv"
    pd.DataFrame({"time": np.arange(20.0), "temperature.a": 20 + np.arange(20.0)}).to_csv(path, index=False)
    assert read_log(path)[0].name == "a+b"


def test_columns_of_one_name_are_told_apart(tmp_path: Path) -> None:
    time = np.arange(60.0)
    one = pd.DataFrame({"time": time, "temperature.a": 20 + time, "x": 1.0})
    other = pd.DataFrame({"time": time, "torque.a": 1.0, "x": 2.0})
    one.to_csv(tmp_path / "one.csv", index=False)
    other.to_csv(tmp_path / "other.csv", index=False)
    columns = {"power.one": ColumnSource(("x",)), "power.other": ColumnSource(("x:2",))}
    (run,) = read_log(tmp_path / "one.csv+other.csv@0", columns)
    assert run.name == "one"
    assert (run.columns["power.one"][0], run.columns["power.other"][0]) == (1.0, 2.0)
    assert any(note.startswith("x: in both files") for note in run.notes)
