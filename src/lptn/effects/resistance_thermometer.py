"""The temperature is worked out from a resistance, and the resistance at the reference is a little another one."""

from lptn.basics.parameters import Parameter
from lptn.effects.base import SensorEffect, Signature, Symbol, Values
from lptn.effects.excitation import REST_OR_LEVELS


class ResistanceThermometer(SensorEffect):
    r"""A winding as its own thermometer, its cold resistance off by a share g.

    .. math:: y = T_0 + \frac{1}{\alpha} \left( \frac{R(T)}{R_0} - 1 \right)
              = T + g \left( T - T_0 + \frac{1}{\alpha} \right), \qquad R(T) = (1 + g) R_0 (1 + \alpha (T - T_0))

    Cables and contacts within the measured voltage count as g: 1 % are 2.6 K for copper, and a little more when hot. It
    is declared by whoever measures so, and not searched for: it is nearly collinear with a sensor's offset.

    Source: definition; [QuadrupedLPTN, eq. 6], [Chen2017, eq. 2.5] solved for the temperature.
    """

    key = "resistance_thermometer"
    title = "a winding as its own thermometer"
    parameters = (
        Parameter("change", 0.02, "1", (-0.5, 0.5), title="true over assumed cold resistance, less 1"),
        Parameter("alpha", 0.0039, "1/K", (1e-4, 0.02), title="temperature coefficient", fixed=True),
        Parameter("reference", 25.0, "degC", (-50.0, 200.0), title="reference temperature", fixed=True),
    )
    signature = Signature(
        looks_like="a rested motor reads off ambient, 2.6 K for each per cent of resistance, a hot one a little more",
        separate_by="a plain cool-down to a known ambient: what is left is the error of the cold resistance",
        confused_with=("sensor_offset",),
    )
    excitation = REST_OR_LEVELS
    source = "[QuadrupedLPTN, eq. 6]"

    def error(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        return p.change * (temperature - p.reference + 1 / p.alpha)
