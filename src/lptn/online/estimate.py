"""What an estimator tells: temperatures and their uncertainty; and the algebra behind it."""

from __future__ import annotations

from dataclasses import dataclass

from lptn.arrays import FloatArray


@dataclass(frozen=True)
class Estimate:
    """What is known after an update; arrays have one entry for each node, in the order of `nodes`.

    Args:
        nodes: names of the nodes.
        temperatures: of the nodes [degC].
        deviations: their standard deviations [K].
        innovations: reading minus prediction [K], NaN where nothing was read.
        spreads: standard deviations expected of the innovations, rounding included [K].
        parameters: learnt parameters in their units, by name, each with its standard deviation.
    """

    nodes: tuple[str, ...]
    temperatures: FloatArray
    deviations: FloatArray
    innovations: FloatArray
    spreads: FloatArray
    parameters: dict[str, tuple[float, float]]

    def temperature(self, node: str) -> tuple[float, float]:
        """Temperature of a node [degC] and its standard deviation [K].

        Raises:
            ValueError: the model has no such node.
        """
        row = self.nodes.index(node)
        return float(self.temperatures[row]), float(self.deviations[row])


@dataclass(frozen=True)
class Correction:
    """The linear algebra of one correction, for whoever follows a fault through the filter.

    Args:
        transition: derivative of the state by that after the correction before, shape (z, z).
        by_state: derivative of the seen readings, shape (seen, z).
        gain: shape (z, seen).
        covariance: of the seen innovations [K²], shape (seen, seen).
        innovation: shape (seen,) [K].
    """

    transition: FloatArray
    by_state: FloatArray
    gain: FloatArray
    covariance: FloatArray
    innovation: FloatArray
