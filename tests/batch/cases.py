"""Models of every kind at random points, with what CasADi says of them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import casadi as ca
import numpy as np

from lptn.basics.arrays import FloatArray
from lptn.effects import catalogue
from lptn.model.file import read_model_file
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration
from tests.builders import base_network, random_inputs, random_value, with_every_effect

ROOT = Path(__file__).parents[2]
_EXAMPLES = ("bldc_stators", "heated_block", "pmsm", "tclab", "u8_thesis", "ur3")  # folders with model files
FILES = sorted(
    str(path.relative_to(ROOT))
    for folder in (ROOT / "src/lptn/robots", *(ROOT / "examples" / name for name in _EXAMPLES))
    for path in folder.glob("*.toml")
)
EVERY = "every effect at once"
CASES = [*catalogue(), EVERY, *FILES]
ROBOTS = 5


@cache
def model_of(case: str) -> Model:
    """The model of an effect, of all effects, or of a file."""
    if case == EVERY:
        return Model(with_every_effect())
    if case in FILES:
        return Model(read_model_file(ROOT / case).network)
    kind = catalogue()[case]
    declared = EffectDeclaration(kind(), "*", tuple(parameter.switched_on for parameter in kind.parameters))
    return Model(base_network(kind).with_effects([declared]))


class Points:
    """Robots of a model at random points.

    Attributes:
        x, u, p: states, inputs and parameters, shape (robots, …) each.
        seconds: of a step.
    """

    def __init__(self, model: Model, seconds: float, robots: int = ROBOTS, seed: int = 0) -> None:
        rng = np.random.default_rng(seed)
        self.model, self.seconds = model, seconds
        self.x = rng.uniform(0.0, 90.0, (robots, len(model.states)))
        inputs = [list(random_inputs(model, rng).values()) for _ in range(robots)]
        self.u = np.array(inputs, dtype=float).reshape(robots, -1)
        self.p = np.array([[self._near(k, rng) for k in range(len(model.parameters))] for _ in range(robots)])

    def _near(self, k: int, rng: np.random.Generator) -> float:
        """A value that keeps the network about as fast as it is: the step must stay one that RK4 can take."""
        parameter = self.model.parameters[k]
        if not parameter.free:
            return parameter.value
        if parameter.declared.bounds[0] > 0:
            return float(np.clip(parameter.value * rng.uniform(0.8, 1.25), *parameter.declared.bounds))
        return random_value(parameter, rng)

    def step(self) -> FloatArray:
        """States after a step, shape (robots, states)."""
        step = self.model.step()
        points = zip(self.x, self.u, self.p, strict=True)
        return np.array([step(*point, self.seconds).full().ravel() for point in points])

    def readings(self) -> FloatArray:
        """Shape (robots, nodes)."""
        return np.array([self.model.output(x, p).full().ravel() for x, p in zip(self.x, self.p, strict=True)])

    def gradients(self, weights: FloatArray) -> list[FloatArray]:
        """Of the weighted sum of the states after a step, by x, u and p, shape (robots, …) each."""
        x, u, p, _, _ = self.model.symbols
        step = self.model.step()(x, u, p, self.seconds)
        reverse = ca.jtimes(step, ca.vertcat(x, u, p), ca.DM(weights), True)
        gradient = ca.Function("gradient", [x, u, p], [ca.densify(reverse)])
        rows = np.array([gradient(*point).full().ravel() for point in zip(self.x, self.u, self.p, strict=True)])
        ends = np.cumsum([x.numel(), u.numel()])
        return np.split(rows, ends, axis=1)
