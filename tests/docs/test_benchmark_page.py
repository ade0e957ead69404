"""The benchmark page: what the benchmarks print becomes rows, and what they don't print is not made up."""

from __future__ import annotations

import pytest

from tests.benchmarks.page import BENCHMARKS, PAGE, Benchmark, Row, controller, diagnosis, fits, fmus, measure, page
from tests.benchmarks.page import sharing as shared
from tests.benchmarks.page import trade as traded

FITS = """56 parameters, 108 unknowns, 9308 readings
ours: 0.700 s, 16 costs and 9 derivatives; cost 12.1
scipy trf, finite differences: 21.00 s, 30 times ours (0.700 s); cost 12.1000
scipy trf, our derivatives: 1.40 s, 2 times ours (0.700 s); cost 12.1000
IPOPT, simultaneous, exact Hessian: 7.00 s, 10 times ours (0.700 s); Solve_Succeeded, 12 iterations, cost 12.1
"""
DIAGNOSIS = """baseline fit 2.0 s; diagnosis 4.0 s: missing, ('forced_convection', 'RL_calf')
brute force, 600 candidates: 160 s, 40 times as long; best ('forced_convection', 'RL_calf')
"""
FMUS = """ours in C [us]                                                 2
ours through fmpy, FMI 2, arrays made once [us]                20
PythonFMU through fmpy [us]                                    {peer}
"""
TRADE = """one program: built 300 ms, solved 200 ms, again nearby 10 ms
200 × 200 grid, the model: 50.0 s for the 1200 that can be built, 100 times the program with its building
200 × 200 grid, plain NumPy: 5.0 s for the 1200 that can be built, 10 times the program with its building
"""
MPC = """start 45 degC, 24 steps of 5 s, horizon 300 s
                                     worst K         cost  failures  median ms   worst ms
ours, 16 growing stages               0.0000      0.09284         0      1.250      2.000
ours, 16, no bias, no margin          0.0000      0.08633         0      1.030      1.649
do-mpc 5                              0.0000      0.08716         0    500.000    400.000
16 growing stages: 400 times faster than do-mpc in the median, 200 in the worst case

start 63 degC, 6 steps of 5 s, horizon 300 s
ours, 16 growing stages               0.0100      0.93775         0      2.500      5.000
do-mpc 5                              0.0000      0.99992         0    500.000   1500.000
"""
SHARING = """tall: pitch 0.0 degrees, load at (0, 0, 0)
  equal        model    900 s (FR_calf), truth    800   1000 s =  +0.0  +0.0 %; knees 1.00 N·m, grip 0.10; 0.01 s
  share        model   1200 s (FR_calf), truth   1000   1250 s = +25.0 +25.0 %; knees 0.90 N·m, grip 0.20; 0.10 s
"""


def test_rows_are_what_was_printed() -> None:
    peers = {row.peer: row.ratio for row in fits(FITS)}
    assert peers["scipy trf, finite differences"] == pytest.approx(30.0)
    assert peers["scipy trf, our derivatives"] == pytest.approx(2.0)
    assert peers["IPOPT, simultaneous, exact Hessian"] == pytest.approx(10.0)
    (row,) = diagnosis(DIAGNOSIS)
    assert (row.ours, row.theirs, row.ratio) == ("4 s", "160 s", 40.0)
    assert [row.ratio for row in fmus(FMUS.format(peer="200"))] == [100.0, 10.0]
    assert [row.ratio for row in fmus(FMUS.format(peer="not measured"))] == [None, None]
    assert [row.ratio for row in traded(TRADE)] == [100.0, 10.0]
    assert controller(MPC)[0].ours == "1.25 ms"
    assert [row.ratio for row in controller(MPC)] == [400.0, 200.0, 200.0, 300.0]
    (row,) = shared(SHARING)
    assert (row.ours, row.theirs, row.ratio) == ("1125 s", "900 s", 1.25)


@pytest.mark.parametrize("read", [fits, diagnosis, traded])
def test_what_was_not_printed_is_an_error(read: object) -> None:
    assert callable(read)
    with pytest.raises(RuntimeError, match="nothing like"):
        read("all went well")


def test_a_missing_peer_is_said_to_be_missing() -> None:
    absent = Benchmark("Thermal MPC", ("-c", "print(1)"), controller, needs="no_such_package")
    rows, said = measure(absent, quick=True)
    assert not rows
    assert "| Thermal MPC | – | – | not measured: no_such_package is not installed | – |" in page(
        [(absent, rows, said)], quick=True, seconds=60.0
    )


def test_a_benchmark_that_fails_is_an_error() -> None:
    with pytest.raises(RuntimeError, match="Fits: no luck"):
        measure(Benchmark("Fits", ("-c", "import sys; sys.exit('no luck')"), fits), quick=True)


def test_the_page_says_how_it_was_made() -> None:
    text = page([(BENCHMARKS[-1], [Row("a", "1 s", "b", "2 s", 2.0)], "said")], quick=True, seconds=600.0)
    assert "`python -m tests.benchmarks.page --quick` in 10 min" in text
    assert "Python 3." in text
    assert "casadi" in text
    assert "| a | 1 s | b | 2 s | 2 |" in text


def test_the_page_in_the_project_has_each_benchmark() -> None:
    text = PAGE.read_text(encoding="utf-8")
    assert all(f"## {benchmark.name}" in text or f"| {benchmark.name} | – |" in text for benchmark in BENCHMARKS)
