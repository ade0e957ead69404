"""A refit with one effect more finds the optimum, whatever the fit before it did without that effect."""

from __future__ import annotations

from dataclasses import replace

import pytest

from lptn.basics.parameters import LARGEST, Parameter
from lptn.diagnose.answers import HOPELESS, Step, _with_all_that_is_given
from lptn.diagnose.plausibility import FACTOR
from lptn.diagnose.probability import is_implausible
from lptn.diagnose.refits import continued, kept_beside, refit
from lptn.effects.constant_heat import ConstantHeat
from lptn.effects.sensor_lag import SensorLag
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
    beginning = f"resistance.ambient~{NODES[0]}: these data don't tell whether heat passes there; "
    assert any(warning.startswith(beginning) for warning in base.uncertainty.warnings), base.uncertainty.warnings
    assert base.standard_errors[f"resistance.ambient~{NODES[0]}"] == float("inf")

    done = finished(continued(base, base.model.network.with_effects([EffectDeclaration(ConstantHeat(), NODES[0])])))
    assert done.rmse == pytest.approx(NOISE, rel=0.05)
    values = {parameter.name: parameter.value for parameter in done.model.parameters}
    assert values[f"resistance.ambient~{NODES[0]}"] == pytest.approx(4.0, rel=0.02)
    assert values[f"constant_heat.power.{NODES[0]}"] == pytest.approx(3.0, rel=0.02)


@pytest.mark.parametrize(("true", "least", "right"), [(5.0, 7.0, False), (20.0, 20.0, True)])
def test_what_the_given_model_tells_stays_beside_an_effect(*, true: float, least: float, right: bool) -> None:
    """A lag of four minutes that takes the place of a joint's capacity, 67 and 92 J/K by the given fit.

    With a third of that it explains nothing where 5 J/K are true, and four fifths where 20 J/K are: then it is an
    answer, and all fits that go on from there keep the capacity.
    """
    lag = (Parameter("fraction", 1.0, "1", fixed=True), Parameter("time_constant", 240.0, "s", fixed=True))
    added, name = EffectDeclaration(SensorLag(), NODES[0], lag), f"capacity.{NODES[0]}"
    truth = Model(robot(added).network.with_values({name: true}))
    data = split_data([make_run(truth, seed, str(seed), 600) for seed in (1, 2)])
    given = robot().network
    joints = [replace(node, capacity=_at_least(node.capacity, least)) for node in given.nodes]
    base = fit_segments(Model(replace(given, nodes=tuple(joints))), data.fit)
    (before,) = (parameter.value for parameter in base.model.parameters if parameter.name == name)
    free = Step(refit(base, added), added)
    assert free.fit.vanished == {name: 0}
    assert is_implausible(free.fit, [added], base)
    assert kept_beside(free.fit, base) == {name: (before / FACTOR, 1000.0)}
    step = _with_all_that_is_given(base, free, base.cost / HOPELESS)
    assert (step is free) != right
    for fit in (step.fit, finished(step.fit), refit(step.fit, EffectDeclaration(ConstantHeat(), NODES[1]))):
        (after,) = (parameter.value for parameter in fit.model.parameters if parameter.name == name)
        assert after == pytest.approx(before / FACTOR if right else least, rel=1e-3)
    said = f"{name}: would go to its bound beside the added effects, {least:g} J/K, and is kept at "
    assert (f"{said}{before / FACTOR:.3g} J/K" in step.fit.uncertainty.warnings) == right
    assert is_implausible(step.fit, [added], base) != right


def _at_least(capacity: Parameter | None, least: float) -> Parameter | None:
    return None if capacity is None else replace(capacity, bounds=(least, capacity.bounds[1]))
