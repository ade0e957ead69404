"""The sun shines on a surface."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import NodeEffect, Signature, Symbol, Values
from lptn.effects.excitation import INPUTS_VARY


class Solar(NodeEffect):
    r"""Heat in proportion to the logged irradiance.

    .. math:: Q = A \, G

    The area is the one that the sun sees, times the surface's absorptivity. The irradiance *G* is logged at the
    place (`irradiance.<place>`) or once for all (`irradiance.global`).

    Source: definition; the sun gives up to some 1000 W/m².
    """

    key = "solar"
    title = "heat of the sun"
    options = {"input": ("irradiance", "global_irradiance")}  # noqa: RUF012
    parameters = (
        Parameter(
            "area",
            0.005,
            "m^2",
            (0.0, LARGEST),
            off=0.0,
            relative_to="conductance",
            title="absorptivity times lit area",
        ),
    )
    signature = Signature(
        looks_like="predicted too cold while the sun shines, powered or not",
        separate_by="leave the robot unpowered for an hour in the sun, then for an hour in the shade",
        confused_with=("constant_heat", "ambient_offset"),
    )
    excitation = INPUTS_VARY
    source = "definition"

    def heat(self, temperature: Symbol, inputs: Values, p: Values) -> Symbol:
        return p.area * (inputs.irradiance if self.chosen["input"] == "irradiance" else inputs.global_irradiance)
