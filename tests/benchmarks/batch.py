"""How many robots a second one step of the exported functions takes, beside what else steps a model.

Run it with ``python -m tests.benchmarks.batch``, with the extras `jax` and `torch`; what is missing is left out. On a
GPU the rows of JAX and PyTorch are of that, if their packages for it are installed.
"""

from __future__ import annotations

import argparse
import ctypes
import tempfile
import time
from collections.abc import Callable
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.basics.c_library import shared_library
from lptn.batch import export, functions
from lptn.fmu import export as export_fmu
from lptn.model.file import read_model_file
from lptn.model.model import Model
from lptn.robots.presets import preset_text
from tests.benchmarks.fmu_cost import in_c as fmu_in_c
from tests.benchmarks.page import machine, versions

PRESETS = {13: ("quadruped", None), 26: ("quadruped", "windings")}
ROBOTS = (1, 64, 4096, 65536)
DT = 0.02  # s, a usual step of a policy
SCAN = 20  # steps of JAX in one call, as an environment unrolls them; of many robots one, so that calls stay short
MANY = 4096
Way = Callable[[Model, FloatArray, FloatArray], Callable[[], object]]
"""Of a model, inputs and parameters, shape (robots, …): a call that takes one step of all robots, or of several."""


def scanned(robots: int) -> int:
    """Steps of JAX in one call."""
    return SCAN if robots <= MANY else 1


def jax(model: Model, inputs: FloatArray, params: FloatArray) -> Callable[[], object]:
    """`jit` of a scan."""
    jax_: Any = import_module("jax")
    heat = functions(model, "jax")
    u, p = (jax_.numpy.asarray(array, "float32") for array in (inputs, params))

    def steps(state: Any, u: Any, p: Any) -> Any:
        def one(state: Any, _: Any) -> Any:
            return heat.step(state, u, p, DT), None

        return jax_.lax.scan(one, state, None, length=scanned(len(p)))[0]

    kept, compiled = [heat.initial(p, 25.0)], jax_.jit(steps)

    def call() -> None:
        kept[0] = jax_.block_until_ready(compiled(kept[0], u, p))

    return call


def torch(model: Model, inputs: FloatArray, params: FloatArray) -> Callable[[], object]:
    """`torch.compile` of a step."""
    torch_: Any = import_module("torch")
    heat = functions(model, "torch")
    device = "cuda" if torch_.cuda.is_available() else "cpu"
    u, p = (torch_.tensor(array, dtype=torch_.float32, device=device) for array in (inputs, params))
    step = torch_.compile(lambda state, u, p: heat.step(state, u, p, DT), dynamic=False)
    kept = [heat.initial(p, 25.0)]

    def call() -> None:
        kept[0] = step(kept[0], u, p)
        if device == "cuda":
            torch_.cuda.synchronize()

    return call


def numpy(model: Model, inputs: FloatArray, params: FloatArray) -> Callable[[], object]:
    """As it is."""
    heat = functions(model)
    u, p = inputs.astype(np.float32), params.astype(np.float32)
    kept = [heat.initial(p, 25.0)]

    def call() -> None:
        kept[0] = heat.step(kept[0], u, p, DT)

    return call


def c(model: Model, inputs: FloatArray, params: FloatArray) -> Callable[[], object]:
    """A loop over robots in C, one thread."""
    with tempfile.TemporaryDirectory() as folder:
        export(model, Path(folder) / "heat.c", "c")
        text = (Path(folder) / "heat.c").read_text()
    text += """
void heat_steps(long robots, double *x, double *rest, const double *u, const double *p, double dt) {
    for (long k = 0; k < robots; k++)
        heat_step(x + k * heat_n_states, rest + k * heat_n_states, u + k * heat_n_inputs, p + k * heat_n_parameters,
                  dt);
}
"""
    library = ctypes.CDLL(str(shared_library({"heat.c": text}, "heat.c", ("-O2",))))
    state = np.full((2, len(params), len(model.states)), 25.0)
    state[1] = 0.0
    arrays = [ctypes.c_void_p(array.ctypes.data) for array in (state[0], state[1], inputs, params)]

    def call(kept: object = (state, inputs, params)) -> None:  # what the pointers lead to
        library.heat_steps(ctypes.c_long(len(params)), *arrays, ctypes.c_double(DT))

    return call


def environment(model: Model, inputs: FloatArray, params: FloatArray) -> Callable[[], object]:
    """The robots of the Gymnasium environments, stepped by CasADi's interpreter."""
    from lptn.applications.gym.torque import Robots

    robots = Robots(model, len(params), DT, inputs.max(axis=0))
    robots.values = np.ascontiguousarray(params.T)
    u = np.ascontiguousarray(inputs.T)
    return lambda: robots.advance(u)


def loop(model: Model, inputs: FloatArray, params: FloatArray) -> Callable[[], object]:
    """CasADi's step called for each robot."""
    step = model.step()
    x = [np.full(len(model.states), 25.0) for _ in params]

    def call() -> None:
        for k, (u, p) in enumerate(zip(inputs, params, strict=True)):
            x[k] = step(x[k], u, p, DT).full().ravel()

    return call


WAYS: dict[str, tuple[Way, str, int]] = {
    "JAX": (jax, "jax", 65536),
    "PyTorch, compiled": (torch, "torch", 65536),
    "C, one thread": (c, "", 65536),
    "NumPy": (numpy, "", 65536),
    "NumPy environment": (environment, "gymnasium", 4096),  # its map of CasADi takes minutes to make for more
    "loop of Python": (loop, "", 4096),
}
"""By name: the way, the package that it needs, and for how many robots it is tried."""


def rate(call: Callable[[], object], robots: int, seconds: float) -> float:
    """Robots a second, from the fastest of the calls that fit into some seconds: other work slows the rest."""
    for _ in range(2):  # JAX compiles anew where a first result is of another type than the start
        call()
    best, end = np.inf, time.perf_counter() + seconds
    while time.perf_counter() < end:
        start = time.perf_counter()
        call()
        best = min(best, time.perf_counter() - start)
    return robots / best


def mjx(robots: int) -> float:
    """Steps a second of MuJoCo's MJX: quadrupeds of twelve joints on the ground, one iteration of the solver a step."""
    mujoco, mjx_, jax_ = (import_module(name) for name in ("mujoco", "mujoco.mjx", "jax"))
    legs, drives = "", ""
    for number, (x, y) in enumerate(((0.2, 0.1), (0.2, -0.1), (-0.2, 0.1), (-0.2, -0.1))):
        legs += (
            f'<body pos="{x} {y} 0"><joint name="hip{number}" axis="1 0 0"/>{_LIMB.format("0 .05 0", 0.6)}'
            f'<body pos="0 .05 0"><joint name="thigh{number}" axis="0 1 0"/>{_LIMB.format("0 0 -.2", 1.0)}'
            f'<body pos="0 0 -.2"><joint name="calf{number}" axis="0 1 0"/>{_LIMB.format("0 0 -.2", 0.2)}'
            '<geom size=".02" pos="0 0 -.2" mass=".05"/></body></body></body>'
        )
        drives += "".join(f'<position joint="{joint}{number}" kp="40"/>' for joint in ("hip", "thigh", "calf"))
    model = mujoco.MjModel.from_xml_string(_SCENE.format(legs=legs, drives=drives))
    on_device = mjx_.put_model(model)
    start = jax_.numpy.tile(jax_.numpy.asarray(model.qpos0), (robots, 1))
    kept = [jax_.vmap(lambda place: mjx_.make_data(on_device).replace(qpos=place))(start)]
    step = jax_.jit(jax_.vmap(lambda data: mjx_.step(on_device, data)))

    def call() -> None:
        kept[0] = jax_.block_until_ready(step(kept[0]))

    return rate(call, robots, 5.0)


_LIMB = '<geom type="capsule" fromto="0 0 0 {}" size=".02" mass="{}" contype="0" conaffinity="0"/>'
_SCENE = """<mujoco><option timestep="0.004" iterations="1" ls_iterations="4"><flag eulerdamp="disable"/></option>
<worldbody><geom type="plane" size="5 5 .1"/><body pos="0 0 .45"><freejoint/>
<geom type="box" size=".25 .1 .05" mass="6" contype="0" conaffinity="0"/>{legs}</body></worldbody>
<actuator>{drives}</actuator></mujoco>"""


def fmu(model: Model) -> float:
    """Steps a second of one FMU called from C."""
    with tempfile.TemporaryDirectory() as folder:
        written = export_fmu(model, Path(folder) / "robot.fmu")
        return 1e6 / fmu_in_c(written.path, Path(folder) / "c", written.component)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=2.0, help="for each number")
    parser.add_argument("--robots", type=int, nargs="+", default=ROBOTS)
    parser.add_argument("--ways", nargs="+", choices=WAYS, default=list(WAYS))
    chosen = parser.parse_args()
    print(f"{machine()}; {versions()}\n")
    print(f"| nodes | | {' | '.join(f'{robots:,} robots' for robots in chosen.robots)} |")
    print("| --- " * (len(chosen.robots) + 2) + "|")
    for nodes, (preset, variant) in PRESETS.items():
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "model.toml"
            path.write_text(preset_text(preset, variant))
            model = Model(read_model_file(path).network)
        rng = np.random.default_rng(0)
        for name in chosen.ways:
            way, package, most = WAYS[name]
            if package and find_spec(package) is None:
                continue
            cells = []
            for robots in chosen.robots:
                if robots > most:
                    cells.append("")
                    continue
                inputs = rng.uniform(0.0, 3.0, (robots, len(model.inputs)))
                call = way(model, inputs, np.tile(model.values, (robots, 1)))
                steps = scanned(robots) if name == "JAX" else 1
                cells.append(f"{steps * rate(call, robots, chosen.seconds):.2g}")
            print(f"| {nodes} | {name} | {' | '.join(cells)} |", flush=True)
        print(f"| {nodes} | FMU, from C | {fmu(model):.2g} |{' |' * (len(chosen.robots) - 1)}", flush=True)
    if find_spec("mujoco") is not None and find_spec("mujoco.mjx") is not None and find_spec("jax") is not None:
        cells = [f"{mjx(robots):.2g}" if robots == MANY else "" for robots in chosen.robots]
        print(f"| | MJX's own step of a quadruped | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
