"""What surrounds the nodes follows the measured ambient late: walls, covers, a body that warms through."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import BoundaryEffect, Signature, Symbol, Values
from lptn.effects.excitation import surroundings_change


class AmbientLag(BoundaryEffect):
    r"""A prescribed temperature of which a share acts late.

    .. math:: T_E' = T_E + f \, (T_l - T_E), \qquad \dot T_l = (T_E - T_l) / t_l

    Source: first-order lag; walls radiate at a temperature that follows the air's within half an hour or more.
    """

    key = "ambient_lag"
    title = "surroundings lagging behind the ambient"
    measurement_error = True
    prior_odds = 0.5
    """Walls out of balance with the air take a change of weather or of room, which few logs hold."""
    has_state = True
    parameters = (
        Parameter("fraction", 0.7, "1", (0.0, 1.0), off=0.0, title="share that is late"),
        Parameter("time_constant", 900.0, "s", (10.0, LARGEST), title="time constant", grid=(300.0, 900.0, 2700.0)),
    )
    signature = Signature(
        looks_like="after each change of the ambient all nodes are predicted to follow too soon",
        separate_by="carry the robot, unpowered, from a cool room into a warm one and log for an hour",
        confused_with=("ambient_offset", "shared_mass"),
    )
    excitation = surroundings_change()
    source = "first-order lag"

    def error(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        return p.fraction * (state - temperature)

    def rate(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        return (temperature - state) / p.time_constant
