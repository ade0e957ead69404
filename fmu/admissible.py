"""The predictive limiter inside an FMU: admissible torques as outputs, with exact derivatives.

The one file of this room that needs the planners.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property
from importlib.resources import files
from math import inf, isinf
from typing import Any

import casadi as ca

from lptn.basics.errors import InputError
from lptn.model.model import Model
from lptn.planners import Limiter

from .variables import ZERO_CELSIUS, structured_name


class Admissible:
    """The limiter over a component's states, inputs and parameters.

    Args:
        model: the component's model.
        limits: degC by node; where it runs they are replaced by the component's parameters.
        current_limits: of the joints [A], by name or pattern or one of all; none where nothing is said.
        columns: the component's inputs, the model's first.
        model_inputs: the model's inputs from the component's.
        parameter_offsets: what each of the component's parameters exceeds the model's by: 273.15 for temperatures,
            else 0.

    Raises:
        InputError: an unknown joint, a model without torques or currents or with both, or heat of one joint that
            depends on what another gives.
    """

    def __init__(
        self,
        model: Model,
        limits: Mapping[str, float],
        current_limits: Mapping[str, float] | float | None,
        columns: Sequence[str],
        model_inputs: ca.Function,
        parameter_offsets: Sequence[float],
    ) -> None:
        most = inf if current_limits is None else current_limits
        self.limiter = Limiter(model, limits, current_limits=most)
        self.columns, self.model_inputs, self.parameter_offsets = columns, model_inputs, parameter_offsets
        self._loads = _loads(self.limiter)

    @cached_property
    def outputs(self) -> list[tuple[str, str, str]]:
        """Name, unit and description of each output, in order."""
        request, unit = self.limiter.heating.request, self.limiter.heating.unit
        outputs = []
        for joint in self.limiter.joints:
            for seconds in self.limiter.horizons:
                horizon = "continuous" if isinf(seconds) else f"{seconds:g}s"
                name = structured_name(joint, f"admissible_{request}_{horizon}")
                time = "for ever" if isinf(seconds) else f"for {seconds:g} s"
                text = f"Largest RMS {request} of {joint} {time} within all limits, the other joints as they are"
                outputs.append((name, unit, text))
        return outputs

    def functions(self, parameters: int) -> list[ca.Function]:
        """The limiter, its forward and its reverse derivative, as the C core calls them.

        Args:
            parameters: number of the component's parameters.
        """
        x = ca.MX.sym("x", len(self.limiter.model.states))
        u, p = ca.MX.sym("u", self.model_inputs.size1_in(0)), ca.MX.sym("p", parameters)
        values = self._values(x, u, p)
        arguments, sizes = ca.vertcat(x, u, p), (x.numel(), u.numel(), p.numel())
        seeds = [ca.MX.sym("d", size) for size in sizes]
        weights = ca.MX.sym("a", values.numel())
        gradient = ca.densify(ca.jtimes(values, arguments, weights, True))
        split = [0, sizes[0], sizes[0] + sizes[1], sum(sizes)]
        forward = ca.densify(ca.jtimes(values, arguments, ca.vertcat(*seeds)))
        return [
            ca.Function("lptn_admissible", [x, u, p], [values]),
            ca.Function("lptn_admissible_forward", [x, u, p, *seeds], [forward]),
            ca.Function("lptn_admissible_reverse", [x, u, p, weights], ca.vertsplit(gradient, split)),
        ]

    def _values(self, x: Any, u: Any, p: Any) -> Any:
        limiter, own = self.limiter, len(self.parameter_offsets)
        inputs = dict(zip(limiter.model.inputs, ca.vertsplit(self.model_inputs(u)), strict=True))
        raw = dict(zip(self.columns, ca.vertsplit(u), strict=True))
        load = [inputs[column] for column in self._loads]
        heat = limiter.heating
        limits = p[own : own + len(limiter.model.places)] - ZERO_CELSIUS  # they stand behind the model's parameters
        warm, parameters = x - ZERO_CELSIUS, p[:own] - ca.DM(list(self.parameter_offsets))
        per_unit = ca.Function("torque", [heat.x, heat.p], [heat.torque])(warm, parameters)
        conditions = []
        least = 1e-6  # N*m; a speed is not told from less
        for column in limiter.conditions:
            value = inputs.get(column)
            if value is None:
                # Of a joint's power its speed: the power that is connected, if one is, goes with the load beside it.
                place = column.partition(".")[2]
                joint, power = limiter.joints.index(place), raw[f"mechanical_power.{place}"]
                torque = ca.fmax(ca.fabs(load[joint] * per_unit[joint]), least)
                value = ca.if_else(power < 0, raw[column], power / torque)
            conditions.append(value)
        arguments = (warm, ca.vertcat(*load), ca.vertcat(ca.MX(0, 1), *conditions), parameters, limits)
        return ca.densify(limiter.function(*arguments, limiter.most))

    def c_code(self, parameters: int, other_outputs: int) -> str:
        """The limiter as C behind that of the component, whose functions of outputs it completes.

        Args:
            parameters: number of the component's parameters.
            other_outputs: number of its other calculated outputs.
        """
        generator = ca.CodeGenerator("lptn_limiter.c", {"with_header": False, "cpp": False, "casadi_int": "int"})
        functions = self.functions(parameters)
        for function in functions:
            generator.add(function)
        sizes = {"PLAIN": other_outputs, "ADMISSIBLE": len(self.outputs)}
        for size in ("arg", "res", "iw", "w"):
            sizes[f"LIMITER_{size.upper()}"] = max(1, *(getattr(function, f"sz_{size}")() for function in functions))
        head = "".join(f"#define {name} {value}\n" for name, value in sizes.items())
        wrapper = (files("lptn.fmu") / "c" / "admissible.c").read_text(encoding="utf-8")
        # Both texts stand in one unit, and CasADi would give their helpers the same names.
        code = str(generator.dump()).replace("casadi_", "limiter_").replace("CASADI_PREFIX", "LIMITER_PREFIX")
        return f"{code}\n{head}{wrapper}"


def _loads(limiter: Limiter) -> list[str]:
    """For each joint the model's input that is its load.

    Raises:
        InputError: a joint has none of the limiter's kind.
    """
    model, request = limiter.model, limiter.heating.request
    columns = []
    for joint in limiter.joints:
        own = [column for column in (f"{request}.{joint}", f"{request}_abs.{joint}") if column in model.inputs]
        if not own:
            mixed = f"joints driven by torque and by current, no {request}.{joint}"
            raise InputError(model.network.origin, "admissible", mixed, "all joints driven by the same")
        columns.append(own[0])
    return columns
