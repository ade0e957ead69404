"""The sensor sits where the heat arises, so that it reads more than the mass around it."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import ExcessEffect, Signature, Symbol, Values
from lptn.effects.excitation import LOAD_STEPS

_RESISTANCE = 1.0  # K/W; scale of the state's excess


class HotSpot(ExcessEffect):
    r"""The reading leads the node's mean temperature by a share of the copper loss.

    .. math:: y = T + r \, q, \qquad t_h \dot q = Q_{copper} - q

    The small mass at the sensor follows the loss within seconds, or half a minute; the state is
    :math:`T + q \cdot 1\,\mathrm{K/W}`.

    Source: definition; hot spot of a winding ([IEC60034-11] allows for it), here at the sensor.
    """

    key = "hot_spot"
    title = "sensor at a hot spot"
    common = True
    moves_sensor = True
    heat_of = "copper_loss"
    parameters = (
        Parameter(
            "resistance",
            0.1,
            "K/W",
            (0.0, LARGEST),
            off=0.0,
            relative_to="resistance",
            title="from the hot spot to the mass",
        ),
        Parameter("time_constant", 5.0, "s", (1.0, LARGEST), title="its time constant", grid=(5.0, 30.0)),
    )
    signature = Signature(
        looks_like="the reading jumps up within seconds of a load, and down when it ends, by the same amount",
        separate_by="short strong bursts of load, 1 min on and 3 min off, logged once a second",
        confused_with=("second_mass", "sensor_position", "contact_scale"),
    )
    excitation = LOAD_STEPS
    source = "definition"

    def error(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        return p.resistance * (state - temperature) / _RESISTANCE

    def excess_rate(self, excess: Symbol, heat: Symbol, p: Values) -> Symbol:
        return (_RESISTANCE * heat - excess) / p.time_constant
