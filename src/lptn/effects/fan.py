"""A fan whose speed is logged drives air past a surface."""

from lptn.basics.parameters import Parameter
from lptn.effects.base import LinkEffect, Signature, Symbol, Values
from lptn.effects.excitation import INPUTS_VARY


class Fan(LinkEffect):
    r"""Conductance to the surroundings rising with the fan's speed.

    .. math:: \frac{1}{R'} = \frac{1 + \gamma \, s}{R}

    The speed *s* is what the log holds: a duty from 0 to 1 at a place (`fan.<place>`), or of one fan for all
    (`speed.fan`). A fan that is not logged shows as `surface_scale` of a run.

    Source: [Chen2017, table 4.2] (U8 with and without a fan); linear in the speed as [QuadrupedLPTN, eq. 3].
    """

    key = "fan"
    title = "air of a logged fan"
    options = {"input": ("fan", "fan_speed")}  # noqa: RUF012
    parameters = (Parameter("gamma", 1.0, "1", (0.0, 100.0), off=0.0, title="gain at full speed"),)
    signature = Signature(
        looks_like="predicted too hot whenever the fan runs",
        separate_by="hold one load for 30 min without the fan, then for 30 min with it",
        confused_with=("forced_convection", "surface_scale"),
    )
    excitation = INPUTS_VARY
    source = "[Chen2017, table 4.2]"

    def conductance_factor(self, temperature: Symbol, surroundings: Symbol, inputs: Values, p: Values) -> Symbol:
        return 1 + p.gamma * abs(inputs.fan if self.chosen["input"] == "fan" else inputs.fan_speed)
