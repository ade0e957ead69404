"""A hot surface radiates to its surroundings."""

from lptn.basics.parameters import LARGEST, Parameter
from lptn.effects.base import LinkEffect, Signature, Symbol, Values
from lptn.effects.excitation import hot

STEFAN_BOLTZMANN = 5.670374419e-8  # W/(m² K⁴)
ZERO_CELSIUS = 273.15  # K


class Radiation(LinkEffect):
    r"""Grey-body exchange with the surroundings.

    .. math:: Q = \sigma \, \varepsilon A \, (T_E^4 - T^4) \quad \text{in kelvin}

    Source: Stefan-Boltzmann law ([IncroperaDeWitt]); size of a joint's area as in `lptn.virtual`.
    """

    key = "radiation"
    title = "radiation to the surroundings"
    common = True
    alike = True
    parameters = (
        Parameter("area", 0.01, "m^2", (0.0, LARGEST), off=0.0, relative_to="link", title="emissivity times area"),
    )
    signature = Signature(
        looks_like="predicted too hot at the hottest; the more so at a warm ambient",
        separate_by="the same heating and cool-down at 8 and at 33 degC ambient",
        confused_with=("natural_convection",),
    )
    excitation = hot()
    source = "Stefan-Boltzmann law ([IncroperaDeWitt])"

    def extra_heat(self, temperature: Symbol, surroundings: Symbol, p: Values) -> Symbol:
        return STEFAN_BOLTZMANN * p.area * ((surroundings + ZERO_CELSIUS) ** 4 - (temperature + ZERO_CELSIUS) ** 4)
