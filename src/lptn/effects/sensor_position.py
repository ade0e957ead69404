"""The sensor sits between two parts and reads a mix of their temperatures."""

from lptn.basics.parameters import Parameter
from lptn.effects.base import PairSensorEffect, Signature, Symbol, Values
from lptn.effects.excitation import nodes_apart


class SensorPosition(PairSensorEffect):
    r"""The sensor of one node reads partly that of a node which it touches.

    .. math:: y_a = T_a + f \, (T_b - T_a)

    The place `"a~b"` is the sensor of *a*; `"b~a"` is that of *b*.

    Source: definition; [Chen2017, sec. 3.1.1] (thermocouples on a housing, meant for the winding).
    """

    key = "sensor_position"
    title = "sensor between two parts"
    moves_sensor = True
    parameters = (Parameter("fraction", 0.2, "1", (0.0, 1.0), off=0.0, title="share of the other temperature"),)
    signature = Signature(
        looks_like="one reading follows a neighbour at once, without the delay that a mass would give",
        separate_by="a step of load on the neighbour alone: does the reading rise in the first seconds?",
        confused_with=("conduction", "hot_spot", "contact_scale"),
    )
    excitation = nodes_apart()
    source = "definition"

    def error(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        return p.fraction * (state - temperature)
