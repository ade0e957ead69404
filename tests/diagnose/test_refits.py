"""A refit with one effect more finds the optimum, whatever the fit before it did without that effect."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lptn.basics.parameters import LARGEST, Parameter
from lptn.diagnose.refits import continued
from lptn.effects.constant_heat import ConstantHeat
from lptn.identify.data import split_data
from lptn.identify.fitting import finished
from lptn.identify.validation import fit_segments
from lptn.model.model import Model
from lptn.model.network import EffectDeclaration, LinkDeclaration
from tests.report.two_joints import NODES, NOISE, make_run, robot

RESISTANCE = Parameter("resistance", 4.0, "K/W", (1e-9, LARGEST), typical=5.0)


def _joined(*extra: EffectDeclaration) -> Model:
    """Two joints in air that warm each other."""
    to_air = tuple(LinkDeclaration((name, "ambient"), RESISTANCE) for name in NODES)
    between = LinkDeclaration(NODES, replace(RESISTANCE, value=1.5))
    return Model(replace(robot(*extra).network, links=(*to_air, between)))


def test_a_link_that_a_fit_took_away_comes_back_with_the_heat_that_was_missing() -> None:
    """Without the heat the joint is too warm for any way out to the air; along its logarithm no slope leads back."""
    heat = Parameter("power", 3.0, "W", (0.0, LARGEST), off=0.0)
    truth = _joined(EffectDeclaration(ConstantHeat(), NODES[0], (heat,)))
    data = split_data([make_run(truth, seed, str(seed), 600) for seed in (1, 2)])
    base = fit_segments(_joined(), data.fit)
    values = {parameter.name: parameter.value for parameter in base.model.parameters}
    assert values[f"resistance.ambient~{NODES[0]}"] > 1e6
    beginning = f"resistance.ambient~{NODES[0]}: these data don't show any heat flow there; "
    assert any(warning.startswith(beginning) for warning in base.uncertainty.warnings), base.uncertainty.warnings
    assert base.standard_errors[f"resistance.ambient~{NODES[0]}"] == float("inf")

    done = finished(continued(base, base.model.network.with_effects([EffectDeclaration(ConstantHeat(), NODES[0])])))
    assert done.rmse == pytest.approx(NOISE, rel=0.05)
    values = {parameter.name: parameter.value for parameter in done.model.parameters}
    assert values[f"resistance.ambient~{NODES[0]}"] == pytest.approx(4.0, rel=0.02)
    assert values[f"constant_heat.power.{NODES[0]}"] == pytest.approx(3.0, rel=0.02)
