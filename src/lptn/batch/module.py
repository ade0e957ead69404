"""A model as a module of its own: its operations, between functions that are the same for every model."""

from __future__ import annotations

import hashlib
import json
import re
import sys
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from importlib.resources import files
from pathlib import Path
from types import ModuleType
from typing import Any, Literal, NamedTuple, get_args

import casadi as ca
import jinja2
import numpy as np

from lptn.basics.errors import InputError
from lptn.basics.files import write_whole
from lptn.basics.places import in_listed_order
from lptn.logs.columns import HEATS, column_unit
from lptn.model.model import Model
from lptn.planners.values import Each, checked_by_place
from lptn.simulate.dynamics import longest_step
from lptn.simulate.kernel import Operations, UnknownOperationError

from .assignments import PYTHON, C, assignments, held
from .motors import AIR, errors, motors

Target = Literal["jax", "torch", "numpy", "c", "mujoco"]

_WIDTH, _SHORT = 120, 80  # columns of the written file, and of what stands on one line with its name
_HOT = 100.0  # degC, where rates of a robot's network are near their fastest
_LARGE = 10.0  # m/s, rad/s, N*m: inputs at which they are
_OTHER_NAMES = {
    "torch": {"fabs": "abs"},
    "numpy": {"fabs": "abs", "pow": "power", **{f"a{name}": f"arc{name}" for name in ("sin", "cos", "tan", "tan2")},
              **{f"a{name}h": f"arc{name}h" for name in ("sin", "cos", "tan")}},
}  # fmt: skip
"""What array libraries call C's functions, where they call them otherwise; JAX follows NumPy."""
_ERF = {"torch": "xp.erf", "jax": "jax.scipy.special.erf", "numpy": "xp.vectorize(erf, otypes=[float])"}


def export(model: Model, output: str | Path, to: Target = "jax", *, limits: Each | None = None) -> None:
    """Write a model as a module of pure functions, which needs neither this package nor CasADi.

    For arrays the module has `initial`, `step`, `outputs` and `randomized`, whose leading axes are robots; in C
    `initial`, `step` and `outputs` of one robot. Its docstring says names and units. For MuJoCo the file has an
    actuator a joint, one node each, and says what that costs.

    Args:
        model: at the values to write, with the standard errors that `randomized` draws from.
        output: the file to write.
        to: the array library, `"c"`, or `"mujoco"`.
        limits: degC by node or pattern, or one for all; margins and torque scale are about these.

    Raises:
        InputError: an unknown target or place, an operation that has no equivalent there, limits or no motors for
            MuJoCo, or a file that can't be written.
    """
    path = Path(output)
    prefix = re.sub(r"\W", "_", path.stem, flags=re.ASCII)
    prefix = prefix if prefix[:1].isalpha() else f"heat_{prefix}"
    write_whole(path, _text(model, to, limits, prefix))


def functions(model: Model, to: Target = "numpy", *, limits: Each | None = None) -> ModuleType:
    """The module that `export` writes for an array library, at once and without a file.

    Args:
        model: at the values to write.
        to: `"jax"`, `"torch"` or `"numpy"`.
        limits: degC by node or pattern, or one for all.

    Returns:
        A module with `initial`, `step`, `outputs` and `randomized`, and with what its docstring names.

    Raises:
        InputError: an unknown target or place, or the array library is not installed.

    Example:
        >>> import lptn, lptn.batch
        >>> heat = lptn.batch.functions(lptn.load_model("examples/tclab/two_heaters.toml").model, limits=60.0)
        >>> import numpy as np
        >>> params = np.asarray(heat.VALUES)
        >>> state = heat.initial(params, ambient=np.full(1000, 23.0))  # of a thousand boards
        >>> heat.step(state, np.array([23.0, 2.0, 0.0]), params, dt=10.0).temperature.shape
        (1000, 2)
    """
    if to in ("c", "mujoco"):
        raise InputError("lptn.batch", "to", f"'{to}'", "jax, torch or numpy; `export` writes the others")
    text = _text(model, to, limits, "heat")
    name = f"heat_{hashlib.sha256(text.encode()).hexdigest()[:16]}"
    if name in sys.modules:
        return sys.modules[name]
    module = sys.modules[name] = ModuleType(name)  # where `torch.compile` and `pickle` look for what is in it
    try:
        exec(compile(text, f"<{module.__name__}>", "exec"), module.__dict__)
    except ModuleNotFoundError as error:
        del sys.modules[name]
        raise InputError("lptn.batch", to, "not installed", f"pip install 'lptn[{to}]'") from error
    return module


def _text(model: Model, to: Target, limits: Each | None, prefix: str) -> str:
    """The module's text; `prefix` stands before the names in C."""
    if to not in get_args(Target):
        raise InputError("lptn.batch", "to", f"'{to}'", f"one of {', '.join(get_args(Target))}")
    bounds = {} if limits is None else checked_by_place(limits, model.places, "limits")
    if to == "mujoco":
        return _motors_text(model, bounds)
    language, template = (C, "heat.c.j2") if to == "c" else (PYTHON, "arrays.py.j2")
    try:
        bodies = _bodies(model, language)
    except UnknownOperationError as error:
        raise InputError(model.network.origin, "effects", str(error), f"operations that {to} has, too") from error
    limited = list(bounds)
    joints = _heated_by(model)
    parameters = [(parameter, model.standard_errors.get(parameter.name, 0.0)) for parameter in model.parameters]
    values = {
        "title": f"Heat of {model.network.name}.",
        "origin": Path(model.network.origin).name,
        "to": to,
        "prefix": prefix,
        "library": {"jax": "JAX", "torch": "PyTorch", "numpy": "NumPy"}.get(to, "C"),
        "names": {
            "states": model.states,
            "nodes": model.nodes,
            "inputs": model.inputs,
            "parameters": [parameter.name for parameter in model.parameters],
            "limited": limited,
            "joints": list(joints),
        },
        "units": {
            "inputs": [column_unit(column) for column in model.inputs],
            "parameters": [
                f"{value.value:.6g}{value.declared.unit_behind}" + (f" ± {error:.2g}" if error else "")
                for value, error in parameters
            ],
            "limited": [f"{bound:g}" for bound in bounds.values()],
        },
        "values": model.values.tolist(),
        "errors": [error for _, error in parameters],
        "lower": [parameter.declared.bounds[0] for parameter in model.parameters],
        "upper": [parameter.declared.bounds[1] for parameter in model.parameters],
        "positive": [parameter.logarithmic for parameter in model.parameters],
        "bounds": list(bounds.values()),
        "places": [model.places.index(place) for place in limited],
        "of_joints": [
            tuple(k for k, place in enumerate(limited) if _node_of(model, place) in nodes) for nodes in joints.values()
        ],
        "longest": _longest_step(model),
        "functions": _functions_of(to, bodies),
        **bodies,
    }
    return _environment().get_template(template).render(values)


def _motors_text(model: Model, bounds: Mapping[str, float]) -> str:
    """Actuators of MuJoCo, and how far their temperatures are from the network's."""
    if bounds:
        raise InputError("lptn.batch", "limits", "some", "none: MuJoCo's motors have no limit of their temperature")
    found = motors(model)
    values = {
        "title": model.network.name,
        "origin": Path(model.network.origin).name,
        "motors": list(zip(found, *errors(found, model, functions(model)), strict=True)),
        "air": AIR,
    }
    return _environment().get_template("motors.xml.j2").render(values)


class _Body(NamedTuple):
    """A function of the module: names of its arguments' elements by argument, and what it calculates of them."""

    arguments: dict[str, list[str]]
    lines: list[tuple[str, str]]
    results: list[str]

    @property
    def texts(self) -> list[str]:
        return [*(text for _, text in self.lines), *self.results]

    @property
    def needs_zero(self) -> bool:
        return any(re.search(r"\bzero\b", text) for text in self.texts)


def _bodies(model: Model, language: Mapping[str, str]) -> dict[str, _Body]:
    """What the module calculates: held values, rates from states and these, readings, and the states at rest."""
    x, u, p, rates, readings = model.symbols
    none, ambient = ca.SX(0, 1), ca.SX.sym("ambient")
    of_rates, of_readings, of_start = (
        Operations(ca.Function("f", arguments, [ca.densify(result)]))
        for arguments, result in (
            ([x, u, p], rates),
            ([x, none, p], readings),
            ([ambient, none, p], _at_rest(model, ambient, p)),
        )
    )
    element = "{}[{}]" if language is C else "{}{}"

    def body(operations: Operations, wanted: Iterable[int], **arguments: Iterable[int]) -> _Body:
        names = {value: element.format(name, k) for name, values in arguments.items() for k, value in enumerate(values)}
        made = assignments(operations, [int(value) for value in wanted], names, language)
        return _Body({name: [names[value] for value in values] for name, values in arguments.items()}, *made)

    def of(operations: Operations, letter: str) -> range:
        first = "xup".index(letter)
        return range(sum(operations.sizes[:first]), sum(operations.sizes[: first + 1]))

    fixed = held(of_rates)
    return {
        "held": body(of_rates, fixed, u=of(of_rates, "u"), p=of(of_rates, "p")),
        "rates": body(of_rates, of_rates.results, x=of(of_rates, "x"), held=fixed),
        "readings": body(of_readings, of_readings.results, x=of(of_readings, "x"), p=of(of_readings, "p")),
        "start": body(of_start, of_start.results, x=of(of_start, "x"), p=of(of_start, "p")),
    }


def _at_rest(model: Model, ambient: ca.SX, p: ca.SX) -> ca.SX:
    """The states in equilibrium with air of one temperature, and with what the model prescribes itself."""
    prescribed = {name: p[source] for name, source in model.network.prescribed.items() if isinstance(source, int)}
    return ca.vertcat(*(sum(prescribed.get(place, ambient) for place in rests) / len(rests) for rests in model.rests))


def _heated_by(model: Model) -> dict[str, set[str]]:
    """The nodes that the torque or current of each joint heats, and the joint itself."""
    heated: dict[str, set[str]] = {}
    for instance in model.network.effect_instances:
        if any(feature.startswith(HEATS) for feature in instance.effect.needed()):
            heated.setdefault(instance.driven_by, {instance.driven_by}).add(instance.ends[0])
    return {joint: heated[joint] for joint in in_listed_order(heated, model.network.order)}


def _node_of(model: Model, place: str) -> str:
    return model.nodes[model.owners[model.places.index(place)]]


def _longest_step(model: Model) -> float:
    """The longest Runge-Kutta step [s] of a hot robot, at rest and moving fast."""
    hot = np.full(len(model.states), _HOT)
    air = np.array([column.startswith("temperature.") for column in model.inputs], dtype=bool)
    points = (np.where(air, _HOT, size) for size in (0.0, _LARGE))
    return float(f"{min(longest_step(model, hot, point, model.values) for point in points):.3g}")


def _functions_of(to: Target, bodies: Mapping[str, _Body]) -> dict[str, str]:
    """What the operations call, and what that is in the array library."""
    texts = "\n".join(text for body in bodies.values() for text in body.texts)
    called = sorted(set(re.findall(r"\b([a-z]\w*)\(", texts)))
    names = _OTHER_NAMES.get(to, _OTHER_NAMES["numpy"])
    return {name: _ERF.get(to, "") if name == "erf" else f"xp.{names.get(name, name)}" for name in called}


# --- text -------------------------------------------------------------------------------------------------------------


@cache
def _environment() -> jinja2.Environment:
    environment = jinja2.Environment(
        loader=jinja2.FunctionLoader(
            lambda name: files("lptn.batch").joinpath("templates", name).read_text(encoding="utf-8")
        ),
        autoescape=False,  # no page: Python and C
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
        keep_trailing_newline=True,
    )
    environment.filters |= {"dashed": _dashed, "listed": _listed, "plain": _plain, "quoted": _quoted}
    return environment


def _listed(values: Sequence[Any], brackets: str = "()", indent: str = "") -> str:
    """Values as a tuple, a list or an array of C, on lines as long as a screen is wide."""
    lines = [""]
    for item in (value if isinstance(value, str) else repr(value) for value in values):
        if len(indent) + len(lines[-1]) + len(item) + len("    ,") > _WIDTH:
            lines.append("")
        lines[-1] += f" {item}," if lines[-1] else f"{item},"
    if len(lines) == 1 and len(lines[0]) < _SHORT:
        return brackets[0] + lines[0] + brackets[1]
    return "\n".join([brackets[0], *(f"{indent}    {line}" for line in lines), indent + brackets[1]])


def _plain(text: str) -> str:
    """A text that ends neither a docstring nor a comment."""
    return text.replace("\\", "/").replace('"', "'").replace("*/", "* /")


def _dashed(text: str) -> str:
    """A text that does not end a comment of XML."""
    return text.replace("--", "–")


def _quoted(names: Iterable[str]) -> list[str]:
    return [json.dumps(name, ensure_ascii=False) for name in names]
