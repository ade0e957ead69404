"""The winding is a mass apart: its loss reaches the node late."""

from collections.abc import Sequence

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import Conditions, InertialEffect, Signature, Symbol, Values
from lptn.effects.excitation import LOAD_STEPS

_RESISTANCE = 1.0  # K/W; scale of the state's excess


class WindingMass(InertialEffect):
    r"""A winding without a sensor, which stores its loss and passes it on to the node through its insulation.

    .. math:: Q = f \, (q - Q_{copper}), \qquad t_w \dot q = Q_{copper} - q

    With the winding's capacitance and its resistance to the node, :math:`t_w = R_w C_w`. The fraction *f* is 0 when
    off and 1 for a winding all of whose loss takes this way; the state is :math:`T + q \cdot 1\,\mathrm{K/W}`. What
    the winding stores as the node warms is counted to the node.

    Source: definition, of the network of winding and housing as in [Chen2017, sec. 3.1.2], with the heat in the winding
    and the sensor on the housing.
    """

    key = "winding_mass"
    title = "a winding as a mass of its own"
    common = True
    site = "node"
    heat_of = "copper_loss"
    parameters = (
        Parameter("fraction", 1.0, "1", (0.0, 1.0), off=0.0, on=1.0, title="share that takes this way"),
        Parameter("time_constant", 30.0, "s", (0.5, LARGEST), title="time constant", grid=(10.0, 30.0, 90.0)),
    )
    signature = Signature(
        looks_like="the reading turns late after each change of load, most where the stator has no paste",
        separate_by="warm the node from outside, by its neighbours or the room: a sensor's lag delays that, too",
        confused_with=("sensor_lag", "hot_spot", "second_mass"),
    )
    excitation = LOAD_STEPS
    source = "definition, of the two-node network as in [Chen2017, sec. 3.1.2]"

    def heat_into_ends(self, here: Conditions) -> Sequence[Symbol]:
        passed_on = self.excess(here) / _RESISTANCE
        return [here.p.fraction * (passed_on - here.heat_of(self.heat_of))]

    def excess_rate(self, excess: Symbol, heat: Symbol, p: Values) -> Symbol:
        return (_RESISTANCE * heat - excess) / p.time_constant
