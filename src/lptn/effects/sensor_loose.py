"""The sensor has come loose: it reads late, and between its part and what is around."""

from lptn.basics.parameters import Parameter
from lptn.effects.base import Conditions, NetworkPlaces, Place, Signature, Symbol
from lptn.effects.excitation import LOAD_STEPS
from lptn.effects.sensor_lag import SensorLag


class SensorLoose(SensorLag):
    r"""A bead that touches its part badly, and gives heat to what is around.

    .. math:: y = T_p + f (T_b - T_p), \qquad \dot T_b = \bigl(T_p + a \, (T_E - T_p) - T_b\bigr) / t_b

    With the conductances :math:`G_p` to the part and :math:`G_E` to what is around and the heat capacity :math:`C_b`
    the share of what is around is :math:`a = G_E / (G_p + G_E)`, and the time constant
    :math:`t_b = C_b / (G_p + G_E)`. Where the part is linked to a prescribed temperature, :math:`T_E` is that one;
    inside a machine, as of a winding in its housing, it is the mean of what the part is linked to, by conductance. The
    fraction *f* is 0 when off and 1 for a sensor that is loose. A run begins with the bead as warm as its part, unless
    its start is fitted; that is forgotten within :math:`t_b`.

    Source: heat balance of a bead; [Chen2017, sec. 3.1.1] (thermocouples on the housing).
    """

    key = "sensor_loose"
    title = "loose sensor"
    prior_odds = 0.5
    """Glue and clips mostly hold: a sensor that is slow, but warm through, is the usual thing."""
    single_defect = True
    common = False
    parameters = (
        SensorLag.parameters[0],
        Parameter("exposure", 0.3, "1", (0.0, 1.0), title="share of what is around"),
        *SensorLag.parameters[1:],
    )
    signature = Signature(
        looks_like="one reading comes late and rises by too little, in proportion, at every load",
        separate_by="press the sensor on, or put some foam over it, at a steady load: does the reading rise?",
        confused_with=("loss_scale", "sensor_lag", "surface_scale"),
    )
    excitation = LOAD_STEPS
    source = "heat balance of a bead"

    @classmethod
    def places(cls, at: str, layout: NetworkPlaces) -> list[Place]:
        return super().places(at, layout) if layout.prescribed else []

    @classmethod
    def places_in_words(cls, layout: NetworkPlaces) -> str:
        return super().places_in_words(layout) if layout.prescribed else "a model with a prescribed temperature"

    def state_rate(self, here: Conditions) -> Symbol:
        felt = here.at_sensor + here.p.exposure * (here.around - here.at_sensor)
        return self.rate(felt, here.state, here.p)
