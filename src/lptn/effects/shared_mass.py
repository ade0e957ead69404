"""Several joints sit on a common part that has no node in the model: the trunk."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import GroupEffect, Signature, Symbol, Values
from lptn.effects.excitation import LOAD_STEPS


class SharedMass(GroupEffect):
    r"""One hidden mass that exchanges heat with several nodes, and with their surroundings.

    .. math:: Q_i = g \, (T_s - T_i), \qquad
              t_s \dot T_s = \frac{1}{n} \sum_{i=1}^n T_i - T_s - \lambda \, (T_s - T_E)

    With the time constant :math:`t_s = C_s / (n g)` as the shape, the conductance enters as an amplitude. The
    mass's own conductance to the surroundings is :math:`\lambda n g`.

    Source: definition; the virtual quadruped's trunk has 2600 J/K, 1.6 K/W to each hip, 1.4 K/W to the air.
    """

    key = "shared_mass"
    title = "a hidden mass shared by several nodes"
    common = True
    prior_odds = 0.3
    """Each motor has a second mass of its own, its housing; a part that several hang on mostly has a node already."""
    parameters = (
        Parameter(
            "conductance",
            0.3,
            "W/K",
            (0.0, LARGEST),
            off=0.0,
            relative_to="conductance",
            title="from each node to the mass",
        ),
        Parameter(
            "time_constant", 1200.0, "s", (10.0, LARGEST), title="its time constant", grid=(200.0, 800.0, 3200.0)
        ),
        Parameter("leak", 0.5, "1", (0.0, 20.0), title="its loss, as a share of the exchange", fixed=True),
    )
    signature = Signature(
        looks_like="like nodes warm each other with a delay of many minutes, however far apart they sit",
        separate_by="load one joint of the group for 40 min; do the resting ones warm, all alike and late?",
        confused_with=("second_mass", "conduction"),
    )
    excitation = LOAD_STEPS
    source = "definition"

    def heat(self, temperature: Symbol, state: Symbol, p: Values) -> Symbol:
        return p.conductance * (state - temperature)

    def rate(self, mean: Symbol, state: Symbol, surroundings: Symbol, p: Values) -> Symbol:
        return (mean - state - p.leak * (state - surroundings)) / p.time_constant
